//! Why an edit was refused, with its place.

use crate::Vec3;
use crate::skeleton::SkeletonError;

/// One edit of a list was refused; nothing of the list is applied.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("edits[{edit}] {why}")]
pub struct EditListError {
    /// Its number in the list.
    pub edit: usize,
    /// Why.
    #[source]
    pub why: Refusal,
}

/// Why an edit cannot be done.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum Refusal {
    #[error("has {found} of {KINDS}; exactly one is wanted, or smooth alone")]
    Kind { found: usize },
    #[error("has {key} {value}, {wanted} is wanted")]
    Value {
        key: &'static str,
        value: f64,
        wanted: &'static str,
    },
    #[error(
        "holds no {what} of the skeleton; the nearest lies {distance:.1} mm away at {}",
        at(nearest)
    )]
    Nothing {
        what: &'static str,
        nearest: Vec3,
        distance: f64,
    },
    #[error(
        "holds {points} points, the first at {}, but no whole quad or beam",
        at(place)
    )]
    NoCell { points: usize, place: Vec3 },
    #[error(
        "leaves a radius of {radius:.3} mm at {}, at least {least:.3} mm is wanted",
        at(place)
    )]
    TooThin {
        radius: f64,
        least: f64,
        place: Vec3,
    },
    #[error(
        "cuts the skeleton: a piece of {points} points at {} hangs on nothing then",
        at(place)
    )]
    Cut { points: usize, place: Vec3 },
    #[error("flattens a {what} at {} to {share:.4} of its size", at(place))]
    Flat {
        what: &'static str,
        place: Vec3,
        share: f64,
    },
    #[error(
        "moves a point to {}, {distance:.0} mm away from a part of {size:.0} mm",
        at(place)
    )]
    Far {
        place: Vec3,
        distance: f64,
        size: f64,
    },
    #[error(
        "joins no points: the nearest two, at {}, are {distance:.2} mm apart",
        at(place)
    )]
    Apart { distance: f64, place: Vec3 },
    #[error("folds a quad at {}: it would lose a corner", at(place))]
    Folds { place: Vec3 },
    #[error("holds something at {} that hangs on nothing already", at(place))]
    Loose { place: Vec3 },
    #[error("joins what meets already at {}", at(place))]
    Meets { place: Vec3 },
    #[error("joins a rim of {from} edges and one of {to} at {}", at(place))]
    Uneven { from: usize, to: usize, place: Vec3 },
    #[error(
        "fills nothing: the sheets, {distance:.1} mm apart at {}, do not face each other",
        at(place)
    )]
    Beside { distance: f64, place: Vec3 },
    #[error("has within, but {key} names its places itself")]
    Within { key: &'static str },
    #[error("leaves a skeleton that is none: {0}")]
    Invalid(#[from] SkeletonError),
}

/// The kinds of edits, as messages list them.
const KINDS: &str = "set, scale, add, move, rotate, stretch, snap, delete, duplicate, subdivide, weld, merge, split, bridge, strut and fill";

fn at(p: &Vec3) -> String {
    format!("({:.1}, {:.1}, {:.1}) mm", p.x, p.y, p.z)
}

impl EditListError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        let text = match self.why {
            Refusal::Kind { .. } => "for example edits=[{\"scale\": 1.25}]",
            Refusal::Value { .. } => return None,
            Refusal::Nothing { .. } | Refusal::NoCell { .. } => {
                "make its region larger, or take it out of the list"
            }
            Refusal::TooThin { .. } => {
                "walls thinner than the voxels vanish: a smaller remesh.voxel allows thinner ones"
            }
            Refusal::Cut { .. } => "\"cut\": true allows it",
            Refusal::Flat { .. } => {
                "choose less points, another plane or another factor, or delete the place instead"
            }
            Refusal::Far { .. } => "lengths are mm",
            Refusal::Apart { .. } => "a larger tolerance joins more",
            Refusal::Folds { .. } => "a smaller tolerance joins less; whole quads can be deleted",
            Refusal::Loose { .. } => "take it out of the list",
            Refusal::Meets { .. } => "name places on two different members",
            Refusal::Uneven { .. } => "subdivide a quad at the one with less edges first",
            Refusal::Beside { .. } => "name two sheets with a room between them, or move one",
            Refusal::Within { .. } => "leave within out",
            Refusal::Invalid(_) => return None,
        };
        Some(text.to_owned())
    }
}
