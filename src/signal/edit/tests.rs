use super::super::design::{DesignOptions, design};
use super::super::distance;
use super::super::fit::{FitOptions, fit};
use super::*;
use faer::Mat;
use proptest::prelude::*;

use super::super::psi::Representation;

/// Frames of a motion that comes round.
fn fitted(n: usize, k: usize) -> Representation {
    let z = Mat::from_fn(12, n, |a, i| {
        let t = i as f64 * 0.4;
        (t + a as f64).sin() + 0.3 * (0.5 * t * (1.0 + a as f64 * 0.1)).cos()
    });
    let options = FitOptions::new(k, n / 2, 5);
    fit(z.as_ref(), &options).unwrap().representation
}

fn frames_of(r: &Representation, time: &TimeSignal) -> Vec<Vec<u64>> {
    let r = Representation {
        time: time.clone(),
        ..r.clone()
    };
    let times: Vec<f64> = (1..=time.frame_count()).map(|i| i as f64).collect();
    let frames = r.evaluate(&times);
    let bits = |frame: &[f64]| frame.iter().map(|x| x.to_bits()).collect();
    frames.chunks(r.dimension()).map(bits).collect()
}

/// Frames that are said to be kept are the same bits, whole frames and not poses only.
#[track_caller]
fn assert_kept(r: &Representation, edited: &Edited) -> usize {
    let (before, after) = (frames_of(r, &r.time), frames_of(r, &edited.time));
    assert_eq!(after.len(), edited.sources.len());
    for (i, frame) in after.iter().enumerate() {
        if edited.kept[i] {
            assert!(*frame == before[edited.sources[i].unwrap()], "frame {i}");
        }
    }
    assert!(edited.time.parameters.windows(2).all(|w| w[0] <= w[1]));
    assert!(edited.time.spline.check().is_ok());
    edited.kept.iter().filter(|&&kept| kept).count()
}

/// Frames outside the support of the basis functions that an edit touches: those farther than this many spans of knots from it.
fn far(time: &TimeSignal, from: f64, to: f64) -> Vec<usize> {
    let basis = Basis {
        knots: &time.spline.knots,
    };
    let (a, b) = (basis.span(from), basis.span(to));
    (0..time.frame_count())
        .filter(|&i| {
            let s = basis.span(time.parameters[i]);
            s + 3 <= a || s >= b + 3
        })
        .collect()
}

#[test]
fn a_moved_control_point_changes_only_where_its_basis_function_is() {
    let r = fitted(40, 30);
    for control in [0, 1, 13, 28, 29] {
        let target = Target::By([0.3, -0.1]);
        let edited = edit(&r.time, &[Edit::Move { control, target }]).unwrap();
        assert_kept(&r, &edited);
        let u = |i: usize| r.time.spline.knots[i.clamp(1, 32) - 1];
        // B_j lives on [T_j, T_(j+4)].
        for (i, &t) in r.time.parameters.iter().enumerate() {
            let outside = t < u(control) || t >= u(control + 4);
            assert!(!outside || edited.kept[i] || t == u(32), "{control} {i}");
        }
        assert!(edited.kept.iter().any(|k| !k));
    }
}

#[test]
fn a_loop_adds_frames_and_control_points_and_leaves_the_rest() {
    let r = fitted(99, 82);
    let leave = r.time.evaluate(40.5);
    let through = vec![
        [leave[0] + 2.0, leave[1] + 1.0],
        [leave[0] + 1.0, leave[1] + 3.0],
        [leave[0] - 1.0, leave[1] + 1.0],
    ];
    let edits = [Edit::Loop {
        after: 39,
        through: through.clone(),
        frames: Some(19),
        control: Some(15),
    }];
    let edited = edit(&r.time, &edits).unwrap();
    // Figure 5: (k, n) = (82, 99) and then (97, 118).
    assert_eq!(edited.time.spline.control.len(), 97);
    assert_eq!(edited.time.frame_count(), 118);
    let cut = 0.5 * (r.time.parameters[39] + r.time.parameters[40]);
    let kept = assert_kept(&r, &edited);
    for i in far(&r.time, cut, cut) {
        assert!(edited.kept[if i <= 39 { i } else { i + 19 }], "frame {i}");
    }
    assert!(kept >= 88, "{kept}");
    // The curve comes near the points asked for, and frames step evenly.
    let curve: Vec<Point> = (0..=4000)
        .map(|q| edited.time.evaluate(1.0 + q as f64 * 117.0 / 4000.0))
        .collect();
    for p in through {
        let nearest = curve
            .iter()
            .map(|&c| distance(c, p))
            .fold(f64::INFINITY, f64::min);
        assert!(nearest < 0.1, "{nearest}");
    }
    let steps: Vec<f64> = (40..58)
        .map(|i| {
            distance(
                edited.time.evaluate(i as f64 + 1.0),
                edited.time.evaluate(i as f64 + 2.0),
            )
        })
        .collect();
    let (least, most) = steps
        .iter()
        .fold((f64::INFINITY, 0.0f64), |(a, b), &s| (a.min(s), b.max(s)));
    assert!(most < 2.0 * least, "{steps:?}");
}

#[test]
fn repeated_frames_are_the_frames_again() {
    let r = fitted(60, 50);
    let edits = [Edit::Repeat {
        frames: 10..=40,
        times: 2,
        join: 3,
    }];
    let edited = edit(&r.time, &edits).unwrap();
    assert_eq!(edited.time.frame_count(), 60 + 2 * 31 + 3 * 3);
    assert_kept(&r, &edited);
    let times_kept = |i: usize| {
        (0..edited.kept.len())
            .filter(|&j| edited.sources[j] == Some(i) && edited.kept[j])
            .count()
    };
    for i in 17..34 {
        assert_eq!(times_kept(i), 3, "frame {i}");
    }
    for i in (0..4).chain(48..60) {
        assert_eq!(times_kept(i), 1, "frame {i}");
    }
}

#[test]
fn deleted_frames_are_gone_and_the_ends_are_cut_exactly() {
    let r = fitted(60, 50);
    let delete = |frames| edit(&r.time, &[Edit::Delete { frames, join: 0 }]).unwrap();
    let middle = delete(20..=29);
    assert_eq!(middle.time.frame_count(), 50);
    assert!(
        middle
            .sources
            .iter()
            .flatten()
            .all(|i| !(20..=29).contains(i))
    );
    assert!(assert_kept(&r, &middle) >= 38);
    for (edited, first) in [(delete(0..=9), 10), (delete(50..=59), 0)] {
        assert_eq!(edited.time.frame_count(), 50);
        assert!(assert_kept(&r, &edited) >= 44);
        for i in 0..=490 {
            let t = 1.0 + i as f64 / 10.0;
            let (a, b) = (edited.time.evaluate(t), r.time.evaluate(t + first as f64));
            // Between frames rho differs beside a new end.
            if t.fract() == 0.0 || (3.0..48.0).contains(&t) {
                assert!(distance(a, b) < 1e-12, "{t}: {a:?} {b:?}");
            }
        }
    }
}

#[test]
fn all_of_it_backwards_and_back_again_is_the_signal() {
    let r = fitted(30, 24);
    let all = Edit::Reverse {
        frames: 0..=29,
        join: 0,
    };
    let once = edit(&r.time, std::slice::from_ref(&all)).unwrap();
    let twice = edit(&r.time, &[all.clone(), all]).unwrap();
    for i in 0..30 {
        let (a, b) = (
            r.time.evaluate(i as f64 + 1.0),
            once.time.evaluate(30.0 - i as f64),
        );
        assert!(distance(a, b) < 1e-12);
    }
    assert_eq!(twice.kept, vec![true; 30]);
    let part = edit(
        &r.time,
        &[Edit::Reverse {
            frames: 8..=21,
            join: 2,
        }],
    )
    .unwrap();
    assert_eq!(part.time.frame_count(), 34);
    assert_kept(&r, &part);
    let (a, b) = (
        r.time.evaluate(16.0),
        part.time
            .evaluate(part.sources.iter().position(|&s| s == Some(15)).unwrap() as f64 + 1.0),
    );
    assert!(distance(a, b) < 1e-9);
    for frames in [0..=14, 15..=29] {
        let edited = edit(&r.time, &[Edit::Reverse { frames, join: 0 }]).unwrap();
        assert_eq!(edited.time.frame_count(), 30);
        assert_kept(&r, &edited);
    }
}

#[test]
fn refining_leaves_the_curve() {
    let r = fitted(40, 20);
    let edited = edit(&r.time, &[Edit::Refine { frames: 10..=20 }]).unwrap();
    assert_eq!(edited.time.spline.control.len(), 31);
    for i in 0..=390 {
        let t = 1.0 + i as f64 / 10.0;
        assert!(distance(edited.time.evaluate(t), r.time.evaluate(t)) < 1e-13);
    }
}

#[test]
fn edits_that_cannot_be_made_are_named() {
    let r = fitted(10, 8);
    let problem = |e: Edit| edit(&r.time, &[Edit::Refine { frames: 2..=3 }, e]).unwrap_err();
    let target = Target::To([f64::NAN, 0.0]);
    for (bad, words) in [
        (
            Edit::Move {
                control: 10,
                target: Target::By([0.0; 2]),
            },
            "control point 11; expected 1 to 10",
        ),
        (Edit::Move { control: 1, target }, "not finite"),
        (
            Edit::Delete {
                frames: 0..=8,
                join: 0,
            },
            "at least 2 of 10",
        ),
        (
            Edit::Delete {
                frames: 8..=10,
                join: 0,
            },
            "frames 9..11; expected a range within 1..10",
        ),
        (
            Edit::Repeat {
                frames: 3..=5,
                times: 0,
                join: 0,
            },
            "`times` is 0",
        ),
        (
            Edit::Repeat {
                frames: 3..=5,
                times: usize::MAX,
                join: 0,
            },
            "more than",
        ),
        (
            Edit::Reverse {
                frames: std::ops::RangeInclusive::new(5, 4),
                join: 0,
            },
            "frames 6..5",
        ),
        (
            Edit::Loop {
                after: 9,
                through: vec![[0.0; 2]],
                frames: None,
                control: None,
            },
            "after frame 10; expected 1 to 9",
        ),
        (
            Edit::Loop {
                after: 3,
                through: vec![],
                frames: None,
                control: None,
            },
            "at least 1 point",
        ),
        (
            Edit::Loop {
                after: 3,
                through: vec![[9.0; 2]],
                frames: Some(0),
                control: None,
            },
            "`frames` is 0",
        ),
    ] {
        let found = problem(bad).to_string();
        assert!(found.contains(words) && found.contains("edit 2"), "{found}");
    }
}

fn any_edit() -> impl Strategy<Value = Edit> {
    let range = (0usize..14, 0usize..14).prop_map(|(a, b)| a.min(b)..=a.max(b));
    prop_oneof![
        (0usize..14, -1.0f64..1.0).prop_map(|(control, x)| Edit::Move {
            control,
            target: Target::By([x, 0.1])
        }),
        (
            0usize..12,
            prop::collection::vec((-2.0f64..2.0, -2.0f64..2.0), 1..4),
            1usize..9,
            1usize..9
        )
            .prop_map(|(after, p, frames, control)| {
                let through = p.into_iter().map(|(x, y)| [x, y]).collect();
                Edit::Loop {
                    after,
                    through,
                    frames: Some(frames),
                    control: Some(control),
                }
            }),
        (range.clone(), 0usize..3).prop_map(|(frames, join)| Edit::Delete { frames, join }),
        (range.clone(), 1usize..3, 0usize..3).prop_map(|(frames, times, join)| Edit::Repeat {
            frames,
            times,
            join
        }),
        (range.clone(), 0usize..3).prop_map(|(frames, join)| Edit::Reverse { frames, join }),
        range.prop_map(|frames| Edit::Refine { frames }),
    ]
}

proptest! {
    /// Any edits in any order: a signal comes out, and frames that are said to be kept are kept.
    #[test]
    fn any_edits_give_a_signal(edits in prop::collection::vec(any_edit(), 1..5), k in 4usize..18) {
        let r = fitted(16, k);
        if let Ok(edited) = edit(&r.time, &edits) {
            assert_kept(&r, &edited);
            let n = edited.time.frame_count();
            let finite = |i: usize| edited.time.evaluate(1.0 + i as f64 * 0.5).iter().all(|x| x.is_finite());
            prop_assert!((0..2 * n).all(finite));
            let positions = edited.positions(&vec![[0.0; 2]; 16]);
            prop_assert_eq!(positions.len(), n);
        }
    }
}

/// Frames farther than this from the seams of an edit are the same bits whatever was edited before, and whether the signal was fitted or designed.
#[test]
fn edits_far_away_and_before_change_no_bit() {
    let circle = |i: usize| [(0.9 * i as f64).cos(), (0.7 * i as f64).sin()];
    let sketch: Vec<Point> = (0..25).map(circle).collect();
    let poses = Mat::from_fn(12, 5, |a, i| ((a + 1) as f64 * (i as f64 + 0.4)).sin());
    let designed = |closed| {
        let options = DesignOptions {
            frames: 120,
            closed,
            sites: None,
            dimension: None,
        };
        design(poses.as_ref(), &sketch[..5], &sketch, &options).unwrap()
    };
    for r in [fitted(120, 60), designed(false), designed(true)] {
        let through = vec![[0.31, 0.17], [0.2, -0.4]];
        let one = Edit::Loop {
            after: 3,
            through,
            frames: Some(7),
            control: Some(5),
        };
        let two = Edit::Delete {
            frames: 90..=91,
            join: 3,
        };
        let three = Edit::Reverse {
            frames: 60..=75,
            join: 1,
        };
        let edited = edit(&r.time, &[one, two, three]).unwrap();
        assert_kept(&r, &edited);
        for (i, source) in edited.sources.iter().enumerate() {
            // Seven frames are new before the later edits.
            let near = |frame: usize| source.is_some_and(|s| s.abs_diff(frame) <= 18);
            let seams = [3, 53, 68, 83].into_iter().any(near);
            assert!(seams || source.is_none() || edited.kept[i], "{source:?}");
        }
    }
}

#[test]
fn a_motion_that_stands_still_takes_loops_it_has_room_for() {
    let still = Mat::from_fn(6, 8, |a, _| a as f64);
    let r = fit(still.as_ref(), &FitOptions::new(4, 3, 2)).unwrap();
    let r = r.representation;
    let with = |x: f64| {
        let through = vec![[x, 0.0]];
        let edits = [Edit::Loop {
            after: 3,
            through,
            frames: Some(5),
            control: Some(3),
        }];
        edit(&r.time, &edits)
    };
    let edited = with(1.5).unwrap();
    assert!(
        edited
            .time
            .spline
            .control
            .iter()
            .flatten()
            .all(|x| x.is_finite())
    );
    for (x, words) in [
        (1e300, "farther than"),
        (1e-34, "too short"),
        (0.0, "sketch"),
    ] {
        let found = with(x).unwrap_err().to_string();
        assert!(found.contains(words), "{x}: {found}");
    }
}
