//! Why a skeleton cannot be fed as asked.

use crate::Vec3;
use crate::monitor::Cancelled;

/// Why a skeleton cannot be fed as asked.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FeedError {
    /// An option is out of its range.
    #[error("feed.{name} is {value}, allowed is {allowed}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// Nothing to feed.
    #[error("the skeleton has no points")]
    Empty,
    /// No feeder was given.
    #[error("no feeder is given")]
    NoFeeder,
    /// A feeder stands away from the part.
    #[error("feeder {feeder} at ({:.1}, {:.1}, {:.1}) is {distance:.1} mm from the part's surface, {limit:.1} mm are allowed", place.x, place.y, place.z)]
    Outside {
        /// Number of the feeder.
        feeder: usize,
        /// Its place, mm.
        place: Vec3,
        /// Distance to the nearest sphere of the skeleton, mm.
        distance: f64,
        /// Largest distance allowed, mm.
        limit: f64,
    },
    /// A piece of the skeleton holds no feeder.
    #[error("no feeder reaches {points} of {all} skeleton points, the first at ({:.1}, {:.1}, {:.1}): that piece is not connected to one", place.x, place.y, place.z)]
    Unreachable {
        /// Points that no feeder reaches.
        points: usize,
        /// All points.
        all: usize,
        /// One of them, mm.
        place: Vec3,
    },
    /// Rules contradict each other around a cycle.
    #[error("the rules contradict each other: around {} points from ({:.1}, {:.1}, {:.1}) by ({:.1}, {:.1}, {:.1}) every radius would have to be {gain:.3} mm larger than itself", places.len(), places[0].x, places[0].y, places[0].z, places[places.len() / 2].x, places[places.len() / 2].y, places[places.len() / 2].z)]
    Contradiction {
        /// Points of the cycle in order, mm; not empty.
        places: Vec<Vec3>,
        /// Growth around the cycle, mm.
        gain: f64,
    },
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl FeedError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        let text = match self {
            Self::Option { name: "growth", .. } => {
                "growth is a slope unless feed.growth_as is area or diameter, and must stay below feed.transition"
            }
            Self::Option { .. } => "`grassfire schema` lists all options",
            Self::Empty => "the proposal vanished under the skeleton thresholds: use a finer grid",
            Self::NoFeeder => "give one with --feeder x,y,z, or set feed.mode=direction",
            Self::Outside { .. } => {
                "place the feeder on the part, in its coordinates, or raise feed.feeder_radius"
            }
            Self::Unreachable { .. } => "place one more feeder on that piece",
            Self::Contradiction { .. } => {
                "draft asks for thicker walls towards the parting plane, feeding towards the feeder: move the feeder or feed.parting, or lower feed.draft"
            }
            Self::Cancelled(_) => return None,
        };
        Some(text.to_owned())
    }
}
