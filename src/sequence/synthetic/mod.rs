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
pub mod scraps;
pub mod trot;

mod biped;
mod body;
mod catalogue;
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
pub use self::catalogue::Entry;
use self::catalogue::{CATALOGUE, Make};
use super::format::stream::FrameStream;
use super::{Sequence, SequenceError};
use crate::mesh::{Connectivity, ConnectivityError};

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
        (Make::Whole(build), _) => build(),
        (Make::Endless(motion), frames) => motion()?.sequence(frames),
    }
}

/// What [`embedded`] makes, to be made some frames at a time where the motion has no end.
pub fn stream_embedded(name: &str) -> Result<FrameStream, SyntheticError> {
    let path = Path::new(name);
    match asked(name)? {
        (Make::Whole(build), _) => Ok(FrameStream::held(path, build()?)),
        (Make::Endless(motion), frames) => motion()?.stream(path, frames),
    }
}

/// How to make what a name asks for, and how many frames of it.
fn asked(name: &str) -> Result<(&'static Make, usize), SyntheticError> {
    let Some((base, length)) = name.split_once(':') else {
        let entry = entry(name)?;
        return Ok((&entry.make, entry.frames));
    };
    let length = length.parse().ok();
    let length = length.filter(|n| (1..=MOST_FRAMES).contains(n));
    match (&entry(base)?.make, length) {
        (make @ Make::Endless(_), Some(frames)) => Ok((make, frames)),
        _ => Err(SyntheticError::BadLength {
            name: name.to_owned(),
            endless: names(|entry| matches!(entry.make, Make::Endless(_))),
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
