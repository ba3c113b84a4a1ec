//! The embedded sequences, `@name`: made at run time, so that tests, benchmarks and first steps need no data.
//!
//! Every sequence is deterministic to the bit on one machine (one thread, no clock, no chance) and takes well under a second in a release
//! build. Lengths are in metres in spirit: y is up, x is forward or along, z completes a right-handed frame. Frames are 0-based here and
//! 1-based on the command line. Each name has a `-small` variant of a few hundred vertices for tests. Most are motions; `@face`,
//! `@gallop-poses` and `@trot-poses` are collections of poses, whose frames do not follow each other in time. `@roam` goes on for ever:
//! `@roam:5000` are its first 5,000 frames, which [`stream_embedded`] makes one by one.

pub mod animals;
pub mod bar;
pub mod book;
pub mod character;
pub mod face;
pub mod flag;
pub mod gallop;
pub mod jelly;
pub mod klein;
pub mod ring;
pub mod roam;
pub mod roll;
pub mod trot;

mod biped;
mod body;
#[cfg(test)]
mod checks;
mod cloth;
mod grid;
mod horse;
mod hound;
mod implicit;
mod motion;
mod quadruped;
mod ride;
mod skin;
mod soft_body;
mod surface_nets;

use std::path::Path;
use std::sync::Arc;

use nalgebra::Vector3;
use thiserror::Error;

use self::animals::Animal;
use self::motion::Motion;
use super::format::stream::FrameStream;
use super::{Sequence, SequenceError};
use crate::mesh::{Connectivity, ConnectivityError};

/// One embedded sequence: its name, its size and what it is good for.
#[derive(Clone, Debug)]
pub struct Entry {
    /// The name with its `@`, as [`embedded`] takes it.
    pub name: &'static str,
    /// What moves and how, in one line.
    pub summary: &'static str,
    /// Number of frames n.
    pub frames: usize,
    /// Number of vertices V.
    pub vertices: usize,
    /// Number of triangles F.
    pub faces: usize,
    /// What it is good for, in one line.
    pub good_for: &'static str,
    build: fn() -> Result<Sequence, SyntheticError>,
    /// The motion, where it has no end.
    endless: Option<fn() -> Result<Motion, SyntheticError>>,
}

/// A named place of a body and the vertex nearest to it at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Marker {
    /// What it marks: `withers`, `left_knee`, ...; the left side is -z.
    pub name: &'static str,
    /// The vertex, 0-based.
    pub vertex: u32,
}

/// Why there is no such embedded sequence.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SyntheticError {
    /// A name that is not in the catalogue.
    #[error("no embedded sequence is called {name:?}; choose one of {known}")]
    Unknown {
        /// The name asked for.
        name: String,
        /// Every name there is, separated by commas.
        known: String,
    },
    /// A length that cannot be given.
    #[error(
        "{name}: expected a number of frames from 1 to {MOST_FRAMES} behind the colon, and a motion without an end: one of {endless}"
    )]
    BadLength {
        /// The name asked for.
        name: String,
        /// Every name that takes a length, separated by commas.
        endless: String,
    },
    /// No frames were asked for.
    #[error("expected at least one frame to make, found none; ask for one or more")]
    NoFrames,
    /// A strip without a quad.
    #[error("a strip needs at least 1 x 1 quads, found {columns} x {rows}; give it more")]
    NoQuads { columns: usize, rows: usize },
    /// A strip rolled by a whole turn a column or more.
    #[error(
        "cannot roll a strip by {degrees} degrees: expected fewer than {limit} to either side, a whole turn a column"
    )]
    TooFar { degrees: f64, limit: f64 },
    /// A generator named a vertex that it did not make: a defect of this crate.
    #[error("an embedded sequence came out with bad faces, please report it: {0}")]
    Connectivity(#[from] ConnectivityError),
    /// A generator made frames that are no sequence: a defect of this crate.
    #[error("an embedded sequence came out with bad frames, please report it: {0}")]
    Sequence(#[from] SequenceError),
}

/// The longest that an endless motion is asked for.
pub const MOST_FRAMES: usize = 1_000_000;

/// Makes the embedded sequence of this name (with its `@`, as in [`catalogue`]). A name and `:N` are the first N frames of a motion that has no
/// end.
pub fn embedded(name: &str) -> Result<Sequence, SyntheticError> {
    match asked(name)? {
        Asked::Whole(entry) => (entry.build)(),
        Asked::Endless(motion, frames) => motion()?.sequence(frames),
    }
}

/// What [`embedded`] makes, to be made some frames at a time where the motion has no end.
pub fn stream_embedded(name: &str) -> Result<FrameStream, SyntheticError> {
    let path = Path::new(name);
    match asked(name)? {
        Asked::Whole(entry) => Ok(FrameStream::held(path, (entry.build)()?)),
        Asked::Endless(motion, frames) => motion()?.stream(path, frames),
    }
}

enum Asked {
    Whole(&'static Entry),
    Endless(fn() -> Result<Motion, SyntheticError>, usize),
}

fn asked(name: &str) -> Result<Asked, SyntheticError> {
    let Some((base, length)) = name.split_once(':') else {
        let entry = entry(name)?;
        return Ok(match entry.endless {
            Some(motion) => Asked::Endless(motion, entry.frames),
            None => Asked::Whole(entry),
        });
    };
    let length = length.parse().ok();
    let length = length.filter(|n| (1..=MOST_FRAMES).contains(n));
    match (entry(base)?.endless, length) {
        (Some(motion), Some(frames)) => Ok(Asked::Endless(motion, frames)),
        _ => Err(SyntheticError::BadLength {
            name: name.to_owned(),
            endless: names(|entry| entry.endless.is_some()),
        }),
    }
}

/// The markers of the embedded sequence of this name: the same names in the same order for all quadrupeds, none for the others.
pub fn markers(name: &str) -> Result<Vec<Marker>, SyntheticError> {
    Ok(match entry(name)?.name {
        "@gallop" | "@gallop-poses" | "@roam" => animals::markers(Animal::Horse),
        "@gallop-small" | "@gallop-poses-small" | "@roam-small" => {
            animals::markers(Animal::SmallHorse)
        }
        "@trot" | "@trot-poses" => animals::markers(Animal::Hound),
        "@trot-small" | "@trot-poses-small" => animals::markers(Animal::SmallHound),
        _ => Vec::new(),
    })
}

fn entry(name: &str) -> Result<&'static Entry, SyntheticError> {
    let found = CATALOGUE.iter().find(|entry| entry.name == name);
    found.ok_or_else(|| SyntheticError::Unknown {
        name: name.to_owned(),
        known: names(|_| true),
    })
}

/// All embedded sequences, the full size of each before its small variant.
pub fn catalogue() -> &'static [Entry] {
    CATALOGUE
}

fn names(of: impl Fn(&Entry) -> bool) -> String {
    let names = CATALOGUE.iter().filter(|entry| of(entry));
    names.map(|entry| entry.name).collect::<Vec<_>>().join(", ")
}

/// Stacks frames of points into a sequence over `faces`.
fn assemble(
    faces: Vec<[u32; 3]>,
    frames: &[Vec<Vector3<f64>>],
) -> Result<Sequence, SyntheticError> {
    let vertex_count = frames.first().map_or(0, Vec::len);
    let connectivity = Connectivity::new(vertex_count, faces)?;
    let positions = frames
        .iter()
        .flatten()
        .flat_map(|p| [p.x, p.y, p.z])
        .collect();
    Ok(Sequence::new(
        Arc::new(connectivity),
        frames.len(),
        positions,
    )?)
}

/// 0 before `from`, 1 after `to`, and 3u^2 - 2u^3 between.
fn smoothstep(from: f64, to: f64, at: f64) -> f64 {
    let u = ((at - from) / (to - from)).clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

const CATALOGUE: &[Entry] = &[
    Entry {
        name: "@bar",
        summary: "a box bar that bends by up to 150 degrees and twists by 300",
        frames: 60,
        vertices: 2050,
        faces: 4096,
        good_for: "deformation gradients, known in closed form at every point and frame",
        build: || bar::build(&bar::FULL),
        endless: None,
    },
    Entry {
        name: "@bar-small",
        summary: "@bar with fewer vertices and frames",
        frames: 30,
        vertices: 260,
        faces: 516,
        good_for: "tests of gradients",
        build: || bar::build(&bar::SMALL),
        endless: None,
    },
    Entry {
        name: "@roll",
        summary: "a flat strip rolled up by 20 degrees a frame, to 700 degrees",
        frames: 36,
        vertices: 1331,
        faces: 2400,
        good_for: "isometry and rotations beyond a half turn: every triangle keeps its shape",
        build: || roll::build(&roll::FULL, roll::FRAMES),
        endless: None,
    },
    Entry {
        name: "@roll-small",
        summary: "@roll with fewer vertices",
        frames: 36,
        vertices: 164,
        faces: 240,
        good_for: "tests of isometry and of unwrapped rotations",
        build: || roll::build(&roll::SMALL, roll::FRAMES),
        endless: None,
    },
    Entry {
        name: "@flag",
        summary: "a cloth on a pole in a periodic wind, simulated",
        frames: 100,
        vertices: 3003,
        faces: 5776,
        good_for: "the size of the flag of Cashman & Hormann 2012, Table 1: F = 5776, n = 100, 9F + 3 = 51987",
        build: || flag::build(&flag::FULL),
        endless: None,
    },
    Entry {
        name: "@flag-small",
        summary: "@flag with a coarser cloth and fewer frames",
        frames: 40,
        vertices: 153,
        faces: 256,
        good_for: "tests on an open surface with a nearly periodic motion",
        build: || flag::build(&flag::SMALL),
        endless: None,
    },
    Entry {
        name: "@gallop",
        summary: "a quadruped that gallops in place for two similar cycles of 12 frames",
        frames: 24,
        vertices: 4082,
        faces: 8160,
        good_for: "articulated motion as in Cashman & Hormann 2012, Figure 1; transfer, by its joint markers",
        build: || gallop::build(Animal::Horse),
        endless: None,
    },
    Entry {
        name: "@gallop-small",
        summary: "@gallop with a stouter animal of fewer vertices",
        frames: 24,
        vertices: 634,
        faces: 1264,
        good_for: "tests of articulated motion and of transfer between different connectivities",
        build: || gallop::build(Animal::SmallHorse),
        endless: None,
    },
    Entry {
        name: "@jelly",
        summary: "a soft animal lifted, swung, dropped, squashed and pulled by the head, simulated",
        frames: 120,
        vertices: 1502,
        faces: 3000,
        good_for: "large elastic deformation that never repeats, hard as the cow of Cashman & Hormann 2012, Figure 6",
        build: || jelly::build(&jelly::FULL),
        endless: None,
    },
    Entry {
        name: "@jelly-small",
        summary: "@jelly with fewer vertices, every third frame",
        frames: 40,
        vertices: 494,
        faces: 984,
        good_for: "tests of large elastic deformation",
        build: || jelly::build(&jelly::SMALL),
        endless: None,
    },
    Entry {
        name: "@book",
        summary: "an open book whose pages share one spine and turn over one after another",
        frames: 40,
        vertices: 3225,
        faces: 6144,
        good_for: "a non-manifold mesh: eight triangles at every edge of the spine",
        build: || book::build(&book::FULL),
        endless: None,
    },
    Entry {
        name: "@book-small",
        summary: "@book with fewer pages and vertices",
        frames: 40,
        vertices: 310,
        faces: 540,
        good_for: "tests on non-manifold edges",
        build: || book::build(&book::SMALL),
        endless: None,
    },
    Entry {
        name: "@klein",
        summary: "a Klein bottle in space whose section turns while it breathes",
        frames: 36,
        vertices: 3456,
        faces: 6912,
        good_for: "a closed surface with one side: no outward normal, no volume",
        build: || klein::build(&klein::FULL),
        endless: None,
    },
    Entry {
        name: "@klein-small",
        summary: "@klein with fewer vertices",
        frames: 36,
        vertices: 392,
        faces: 784,
        good_for: "tests on a surface that cannot be oriented",
        build: || klein::build(&klein::SMALL),
        endless: None,
    },
    Entry {
        name: "@character",
        summary: "a person who does jumping jacks, bows and twists, and marches in place",
        frames: 99,
        vertices: 3835,
        faces: 7666,
        good_for: "the size of Cashman & Hormann 2012, Figure 5 and Table 1: V = 3835, n = 99, d = 11505; large turns of limbs",
        build: || character::build(&character::FULL),
        endless: None,
    },
    Entry {
        name: "@character-small",
        summary: "@character with stouter limbs and fewer vertices, every third frame",
        frames: 33,
        vertices: 682,
        faces: 1360,
        good_for: "tests of large turns of limbs",
        build: || character::build(&character::SMALL),
        endless: None,
    },
    Entry {
        name: "@trot",
        summary: "a hound that trots in place for two similar cycles of 16 frames",
        frames: 32,
        vertices: 3726,
        faces: 7448,
        good_for: "transfer to or from @gallop, by the same joint markers on another connectivity",
        build: || trot::build(Animal::Hound),
        endless: None,
    },
    Entry {
        name: "@trot-small",
        summary: "@trot with a stouter animal of fewer vertices",
        frames: 32,
        vertices: 688,
        faces: 1372,
        good_for: "tests of transfer between different connectivities",
        build: || trot::build(Animal::SmallHound),
        endless: None,
    },
    Entry {
        name: "@roam",
        summary: "a quadruped in place that changes between gallop and trot and never repeats; @roam:5000 for 5,000 frames",
        frames: roam::FRAMES,
        vertices: 4082,
        faces: 8160,
        good_for: "sequences of any length: every frame is made by itself",
        build: || roam::motion(Animal::Horse)?.sequence(roam::FRAMES),
        endless: Some(|| roam::motion(Animal::Horse)),
    },
    Entry {
        name: "@roam-small",
        summary: "@roam with the animal of @gallop-small, fewer frames unless it says how many",
        frames: roam::SMALL_FRAMES,
        vertices: 634,
        faces: 1264,
        good_for: "tests of long sequences",
        build: || roam::motion(Animal::SmallHorse)?.sequence(roam::SMALL_FRAMES),
        endless: Some(|| roam::motion(Animal::SmallHorse)),
    },
    Entry {
        name: "@gallop-poses",
        summary: "the horse of @gallop at rest and in seven poses of its gallop",
        frames: 8,
        vertices: 4082,
        faces: 8160,
        good_for: "the source examples of a transfer with m = 7, as in Cashman & Hormann 2012, Figure 7",
        build: || animals::build_poses(Animal::Horse),
        endless: None,
    },
    Entry {
        name: "@gallop-poses-small",
        summary: "the horse of @gallop-small in the same poses",
        frames: 8,
        vertices: 634,
        faces: 1264,
        good_for: "tests of transfer by examples",
        build: || animals::build_poses(Animal::SmallHorse),
        endless: None,
    },
    Entry {
        name: "@trot-poses",
        summary: "the hound of @trot in the poses of @gallop-poses, one by one",
        frames: 8,
        vertices: 3726,
        faces: 7448,
        good_for: "the target examples of a transfer of @gallop",
        build: || animals::build_poses(Animal::Hound),
        endless: None,
    },
    Entry {
        name: "@trot-poses-small",
        summary: "the hound of @trot-small in the same poses",
        frames: 8,
        vertices: 688,
        faces: 1372,
        good_for: "tests of transfer by examples",
        build: || animals::build_poses(Animal::SmallHound),
        endless: None,
    },
    Entry {
        name: "@face",
        summary: "nine expressions of one face, the neutral one first",
        frames: 9,
        vertices: 3200,
        faces: 6144,
        good_for: "designing a sequence from poses, as in Cashman & Hormann 2012, Figure 8",
        build: || face::build(&face::FULL),
        endless: None,
    },
    Entry {
        name: "@face-small",
        summary: "@face with fewer vertices",
        frames: 9,
        vertices: 480,
        faces: 864,
        good_for: "tests of design from poses",
        build: || face::build(&face::SMALL),
        endless: None,
    },
    Entry {
        name: "@loop",
        summary: "a rubber ring round which a bulge and a wave run, one whole period",
        frames: 32,
        vertices: 2688,
        faces: 5376,
        good_for: "looping: the last frame leads into the first",
        build: || ring::build(&ring::FULL),
        endless: None,
    },
    Entry {
        name: "@loop-small",
        summary: "@loop with fewer vertices",
        frames: 32,
        vertices: 396,
        faces: 792,
        good_for: "tests of looping, and of a closed surface with a handle",
        build: || ring::build(&ring::SMALL),
        endless: None,
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_entry_has_the_size_that_it_states() {
        for entry in catalogue() {
            let sequence = embedded(entry.name).unwrap();
            let mesh = sequence.connectivity();
            assert_eq!(
                (entry.frames, entry.vertices, entry.faces),
                (
                    sequence.frame_count(),
                    mesh.vertex_count(),
                    mesh.faces().len()
                ),
                "{}",
                entry.name
            );
        }
    }

    #[test]
    fn two_calls_give_the_same_bits() {
        for entry in catalogue() {
            let (a, b) = (embedded(entry.name).unwrap(), embedded(entry.name).unwrap());
            assert_eq!(a.connectivity(), b.connectivity(), "{}", entry.name);
            let bits =
                |s: &Sequence| -> Vec<u64> { s.positions().iter().map(|x| x.to_bits()).collect() };
            assert!(bits(&a) == bits(&b), "{}", entry.name);
        }
    }

    /// A motion, and no collection of poses.
    fn is_film(entry: &Entry) -> bool {
        !entry.name.contains("-poses") && !entry.name.starts_with("@face")
    }

    #[test]
    fn no_two_consecutive_frames_are_far_apart_or_equal() {
        for entry in catalogue().iter().filter(|entry| is_film(entry)) {
            let sequence = embedded(entry.name).unwrap();
            // every third frame of a film is kept there
            let limit = match entry.name {
                "@jelly-small" => 0.35,
                "@character-small" => 0.5,
                _ => 0.17,
            };
            for i in 1..sequence.frame_count() {
                let step = checks::largest_step(&sequence, i) / checks::diagonal(sequence.frame(0));
                assert!(step < limit, "{} frame {i}: {step}", entry.name);
                assert!(step > 1e-6, "{} frame {i} repeats", entry.name);
            }
        }
    }

    #[test]
    fn small_variants_are_small() {
        for entry in catalogue().iter().filter(|e| e.name.ends_with("-small")) {
            assert!(entry.vertices <= 700, "{}", entry.name);
            let frames = if is_film(entry) { 24..=40 } else { 8..=9 };
            assert!(frames.contains(&entry.frames), "{}", entry.name);
            assert!(
                catalogue()
                    .iter()
                    .any(|e| format!("{}-small", e.name) == entry.name)
            );
        }
    }

    #[test]
    fn endless_motions_have_any_length_and_others_their_own() {
        let (short, long) = (embedded("@roam-small:7"), embedded("@roam-small"));
        let (short, long) = (short.unwrap(), long.unwrap());
        assert_eq!(short.frame_count(), 7);
        assert_eq!(short.positions(), &long.positions()[..7 * long.dimension()]);
        for name in [
            "@roam:0",
            "@roam:1000001",
            "@roam:",
            "@roam:three",
            "@roam:-3",
            "@gallop:48",
        ] {
            let refused = stream_embedded(name).err().unwrap();
            assert!(
                matches!(refused, SyntheticError::BadLength { .. }),
                "{name}"
            );
            assert_eq!(embedded(name).unwrap_err(), refused);
            assert!(refused.to_string().contains("one of @roam, @roam-small"));
        }
        let unknown = embedded("@rome:3").unwrap_err();
        assert!(matches!(unknown, SyntheticError::Unknown { .. }));
    }

    #[test]
    fn an_unknown_name_lists_all_names() {
        let message = embedded("flag").unwrap_err().to_string();
        assert_eq!(message, markers("flag").unwrap_err().to_string());
        assert!(message.contains("\"flag\""), "{message}");
        for entry in catalogue() {
            assert!(message.contains(entry.name), "{message}");
        }
    }
}
