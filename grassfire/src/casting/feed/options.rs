//! What is asked of feeding.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where metal comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FeedMode {
    /// From point feeders: sections grow along the shortest way on the skeleton to the nearest one.
    #[default]
    Point,
    /// From everywhere that lies farthest in one direction: sections grow along it.
    Direction,
}

/// What `feed.growth` counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GrowthKind {
    /// Radius a length: 0.03 is 3 mm on 100 mm.
    #[default]
    Slope,
    /// Heuvers' factor between the areas of touching circles, above 1.
    Area,
    /// Factor between their diameters, above 1.
    Diameter,
}

/// On what sections are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FeedOn {
    /// The quad skeleton: sheets and beams, junctions left out.
    #[default]
    Skeleton,
    /// The skeleton, and every inscribed ball of the medial axis, too, also those of junctions and of waves between the points of
    /// the skeleton: balls hardly shrink anywhere on the way then, for more metal.
    Medial,
}

/// What has to grow towards the feeder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// The radius of the inscribed circle.
    #[default]
    Radius,
    /// Volume over cooling area: a bar counts half of its radius, a ball a third.
    Modulus,
}

/// A chill: the skeleton there counts as thinner.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Chill {
    /// Middle, mm.
    pub place: [f64; 3],
    /// Skeleton points within this distance are chilled, mm.
    pub reach: f64,
    /// What their modulus is divided by; 1.5 to 2 in practice.
    pub factor: f64,
}

/// A bound on the radii near a place.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RadiusBound {
    /// Middle, mm.
    pub place: [f64; 3],
    /// Skeleton points within this distance are bound, mm.
    pub reach: f64,
    /// Smallest radius, mm; 0 for none.
    #[serde(default)]
    pub least: f64,
    /// Largest radius, mm; none when left out.
    #[serde(default)]
    pub most: Option<f64>,
}

/// Options of [`super::feed`]. Nothing is edited without feeders, unless `mode` is `direction`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FeedOptions {
    /// Where feeders stand, mm.
    pub feeders: Vec<[f64; 3]>,
    /// Radius of a feeder's foot, mm: skeleton points within it are fed at once. 0 takes the nearest only.
    pub feeder_radius: f64,
    /// Point feeders or a direction.
    pub mode: FeedMode,
    /// Direction in which sections grow, for the mode `direction`.
    pub direction: [f64; 3],
    /// How much sections grow towards the feeder; see `growth_as`. As a slope 0.03 is a good start for steel, 0.05 is
    /// strict.
    pub growth: f64,
    /// What `growth` counts.
    pub growth_as: GrowthKind,
    /// Skeleton or medial axis.
    pub on: FeedOn,
    /// Radius or modulus.
    pub measure: Measure,
    /// An edge feeds when it runs within this angle of the way to the feeder, degrees. 0 follows single paths and leaves
    /// seams where two ways meet; 90 thickens everything that lies nearer.
    pub cone: f64,
    /// Largest slope of the radius along the wall, so that no step arises; 0.2 is about 1 in 5.
    pub transition: f64,
    /// Smallest wall thickness, mm; 0 for none.
    pub min_wall: f64,
    /// Draft angle of sheets that stand along the draw direction, degrees; 0 for none.
    pub draft: f64,
    /// Draw direction for `draft`.
    pub draw: [f64; 3],
    /// Height of the parting plane along `draw`, mm.
    pub parting: f64,
    /// Spread the change above and below instead of only adding, at equal volume.
    pub neutral: bool,
    /// Bounds on radii.
    pub bounds: Vec<RadiusBound>,
    /// Chills.
    pub chills: Vec<Chill>,
    /// A feeder reaches this many times the mean wall thickness of its zone.
    pub feeding_distance: f64,
}

impl Default for FeedOptions {
    fn default() -> Self {
        Self {
            feeders: Vec::new(),
            feeder_radius: 0.0,
            mode: FeedMode::Point,
            direction: [0.0, 0.0, 1.0],
            growth: 0.03,
            growth_as: GrowthKind::Slope,
            on: FeedOn::Skeleton,
            measure: Measure::Radius,
            cone: 45.0,
            transition: 0.2,
            min_wall: 0.0,
            draft: 0.0,
            draw: [0.0, 0.0, 1.0],
            parting: 0.0,
            neutral: false,
            bounds: Vec::new(),
            chills: Vec::new(),
            feeding_distance: 4.5,
        }
    }
}

impl FeedOptions {
    /// Something is to be fed.
    pub fn active(&self) -> bool {
        !self.feeders.is_empty() || self.mode == FeedMode::Direction
    }

    /// The growth as a slope g of the radius: of circles that touch and grow by the factor q in diameter the centres are
    /// `r (1 + q)` apart, so `g = (q - 1) / (q + 1)`.
    pub fn slope(&self) -> f64 {
        let q = match self.growth_as {
            GrowthKind::Slope => return self.growth,
            GrowthKind::Area => self.growth.max(0.0).sqrt(),
            GrowthKind::Diameter => self.growth,
        };
        (q - 1.0) / (q + 1.0)
    }
}

/// Heuvers' area factor of a slope: `((1 + g) / (1 - g))^2`.
pub fn area_factor(slope: f64) -> f64 {
    ((1.0 + slope) / (1.0 - slope)).powi(2)
}
