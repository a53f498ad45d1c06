//! The mould: undercuts, parting, draft, walls, the best draw direction, and repair.

mod apart;
mod choose;
mod conflicts;
mod cores;
pub mod dexels;
pub mod directions;
pub mod draft;
mod gaps;
mod inner_edges;
mod junctions;
mod remaining;
pub mod repair;
mod rooms;
pub mod rules;
mod sheet;
mod taper;
#[cfg(test)]
mod tests;
pub mod undercuts;
mod walls;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use choose::choose;
pub use conflicts::{Conflict, conflicts};
pub use dexels::{Dexels, Lattice, dexels, dexels_on};
pub use directions::{Direction, best_direction};
pub use draft::DraftClass;
pub use inner_edges::{InnerEdge, InnerEdges, inner_edges};
pub use junctions::{Junction, JunctionKind, junctions};
pub use remaining::remaining;
pub use repair::{Repair, RepairOptions, Repaired, repair};
pub use rooms::{Room, rooms};
pub use rules::{Alloy, Limit, Process, Rules};
pub use undercuts::{Undercut, parting, undercuts};
pub use walls::{Inscribed, Wall, Walls, inscribed, transitions, walls, with_walls};

use crate::Vec3;
use crate::mesh::TriMesh;
use crate::monitor::{Cancelled, Monitor};
use crate::remesh::RemeshError;

/// Name of this stage in progress and warnings.
pub(crate) const STAGE: &str = "mould";

/// Options of [`mould`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MouldOptions {
    /// Draw direction; without it the best is looked for.
    pub draw: Option<[f64; 3]>,
    /// Lines along the longer side of the part.
    pub lines: usize,
    /// Directions tried when the best is looked for.
    pub directions: usize,
    /// Undercuts below this are the lattice's, mm3; without it the volume of one voxel layer of the lattice's pitch.
    pub least_undercut: Option<f64>,
    /// Places at which walls are measured.
    pub wall_samples: usize,
    /// Share of the surface that may have less draft or a thinner wall: a smooth surface turns through zero draft at its
    /// parting line, and walls end somewhere.
    pub exempt: f64,
    /// What is done about undercuts; the part without them is written as repaired.stl.
    pub repair: Repair,
    /// For the repair `keep`: what filling a volume costs against removing one.
    pub fill_cost: f64,
    /// Draft that the repair adds, degrees; without it the least that the rules allow, where undercuts are repaired.
    pub repair_draft: Option<f64>,
    /// A place in each undercut that a core makes, mm: a repair leaves it open.
    pub cores: Vec<[f64; 3]>,
    /// A place in each undercut whose lesser side, below or above it along the draw direction, is taken away, mm.
    pub removals: Vec<[f64; 3]>,
    /// For the repair `best`: what one more core costs, as the volume of metal that costs as much, mm3; without it a tenth of the
    /// proposal's volume.
    pub core_price: Option<f64>,
    /// For the repair `best`: most variants that are made. All combinations are where that is enough, else the undercuts are
    /// settled one after another, the largest first.
    pub tries: usize,
    /// Gaps narrower than this go solid in a repair, and once more when sections have grown towards feeders, mm: sand between walls
    /// that are too near each other burns on or breaks off. 0 keeps all.
    pub min_gap: f64,
    /// Voxel of the repair, mm; without it the pitch of the lines.
    pub cell: Option<f64>,
    /// Limits of the foundry.
    pub rules: Rules,
}

impl Default for MouldOptions {
    fn default() -> Self {
        Self {
            draw: None,
            lines: 256,
            directions: 300,
            least_undercut: None,
            wall_samples: 20_000,
            exempt: 0.01,
            repair: Repair::Off,
            fill_cost: 0.5,
            repair_draft: None,
            cores: Vec::new(),
            removals: Vec::new(),
            core_price: None,
            tries: 12,
            min_gap: 0.0,
            cell: None,
            rules: Rules::default(),
        }
    }
}

impl MouldOptions {
    /// A repair is asked for.
    pub fn repairs(&self) -> bool {
        self.repair != Repair::Off
            || self.added_draft() > 0.0
            || self.min_gap > 0.0
            || !self.removals.is_empty()
    }

    /// Draft that a repair adds, degrees.
    pub fn added_draft(&self) -> f64 {
        let usual = match self.repair {
            Repair::Off => 0.0,
            _ => self.rules.draft().value,
        };
        self.repair_draft.unwrap_or(usual)
    }

    /// The unit vector of the draw direction, where the part is repaired along it and gets draft.
    pub fn leans(&self) -> Option<Vec3> {
        let draw = self.draw.filter(|_| self.added_draft() > 0.0)?;
        Some(Vec3::from(draw).normalize())
    }

    /// The repair that is asked for, with the parting plane at a height along the draw direction and voxels of `cell`, mm.
    pub fn repair_options(&self, parting: f64, cell: f64) -> RepairOptions {
        RepairOptions {
            kind: self.repair,
            fill_cost: self.fill_cost,
            draft: self.added_draft(),
            parting,
            cell,
            cores: self.cores.iter().map(|p| Vec3::from(*p)).collect(),
            cores_may_close: false,
            bores: Vec::new(),
            walls: TriMesh::default(),
            removals: self.removals.iter().map(|p| Vec3::from(*p)).collect(),
            min_gap: self.min_gap,
        }
    }
}

/// A rule that is not met.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Finding {
    /// Name of the rule.
    pub rule: String,
    /// Where, mm.
    pub place: Vec3,
    /// What was measured.
    pub value: f64,
    /// What is allowed.
    pub limit: f64,
    /// Where the limit comes from.
    pub source: String,
}

/// How a part leaves its mould.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mould {
    /// Unit vector of the draw direction.
    pub draw: Vec3,
    /// What was found along it.
    pub direction: Direction,
    /// Undercuts that count, largest first.
    pub undercuts: Vec<Undercut>,
    /// Volume of all gaps, also of those that do not count, mm3.
    pub undercut_volume: f64,
    /// Range of the parting line across its plane, mm.
    pub parting_flatness: f64,
    /// Height of the parting plane along the draw direction, mm.
    pub parting: f64,
    /// Draft that all but the exempt share of the surface has, degrees.
    pub min_draft: f64,
    /// Areas by draft.
    pub draft: Vec<DraftClass>,
    /// Wall that all but the exempt share of places has, mm; none when no place has an opposite wall.
    pub min_wall: Option<f64>,
    /// Thick over thin walls: 95 % and 5 % of the places.
    pub wall_ratio: f64,
    /// Change of thickness over the way along the wall: what all but the exempt share of places have, at most.
    pub transition: f64,
    /// Inner edges with too small a fillet, gaps and holes that are too narrow.
    pub inner_edges: InnerEdges,
    /// Junctions of walls, one of each kind.
    pub junctions: Vec<Junction>,
    /// Rules that are not met.
    pub findings: Vec<Finding>,
    /// The part without undercuts, when asked for.
    pub repaired: Option<Repaired>,
}

/// Why a mould cannot be looked at.
#[derive(Debug, thiserror::Error)]
pub enum MouldError {
    /// An option is out of its range.
    #[error("mould.{name} is {value}, allowed is {allowed}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// Members are to be edited of a part whose skeleton is not known.
    #[error(
        "mould.repair turns or removes members of a skeleton, or tries that; a finished solid has none"
    )]
    NoSkeleton,
    /// Nothing there.
    #[error("the part has no surface")]
    Empty,
    /// A place is named where nothing is undercut.
    #[error("a place of mould.{list} is {distance:.1} mm from the nearest undercut of the part")]
    Place {
        /// The option that has the place.
        list: &'static str,
        /// Distance to the nearest undercut, mm.
        distance: f64,
    },
    /// The part could not be put on a grid for its repair.
    #[error("the part cannot be put on a grid of {cell} mm")]
    Grid {
        /// Edge of a voxel, mm.
        cell: f64,
        /// Why.
        source: RemeshError,
    },
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl MouldError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Option { .. } => Some("`grassfire schema` lists all options".to_owned()),
            Self::Place { .. } => {
                Some("the report of `grassfire mould` lists the undercuts with their places".into())
            }
            Self::NoSkeleton => {
                Some("`grassfire reconstruct` does that, or take mould.repair=fill".into())
            }
            Self::Grid { source, .. } => source.hint(),
            Self::Empty | Self::Cancelled(_) => None,
        }
    }
}

/// Angles by which the surface is sorted, degrees.
const CLASSES: [f64; 4] = [0.5, 1.0, 2.0, 3.0];

/// Looks at how a closed part leaves a two-part mould.
///
/// 1. The draw direction as given, or the best ([`best_direction`]).
/// 2. Undercuts, parting line, draft, walls.
/// 3. Fillets, gaps and holes ([`inner_edges()`]), steps of walls ([`transitions`]), junctions ([`junctions()`]).
/// 4. The foundry's rules; every finding has a place, a value, a limit and its source.
/// 5. The repair, when asked for.
///
/// Lengths in mm, angles in degrees. Does not depend on the number of threads.
///
/// # Errors
/// [`MouldError`].
pub fn mould(
    mesh: &TriMesh,
    options: &MouldOptions,
    monitor: &Monitor,
) -> Result<Mould, MouldError> {
    check(options)?;
    if mesh.triangles.is_empty() {
        return Err(MouldError::Empty);
    }
    monitor.step(STAGE, "draw direction", 0.0)?;
    let rules = &options.rules;
    let wanted = rules.draft().value;
    let draw = match options.draw {
        Some(draw) => Vec3::from(draw).normalize(),
        None => {
            best_direction(
                mesh,
                options.directions,
                128.min(options.lines),
                wanted,
                monitor,
            )?
            .draw
        }
    };
    monitor.step(STAGE, "undercuts", 0.5)?;
    let lattice = dexels(mesh, &draw, options.lines);
    let mut found = undercuts(&lattice);
    let undercut_volume: f64 = found.iter().map(|u| u.volume).sum();
    let least = options
        .least_undercut
        .unwrap_or(8.0 * lattice.pitch.powi(3));
    found.retain(|u| u.volume >= least);
    let (parting_flatness, parting) = parting(&lattice);
    monitor.step(STAGE, "walls", 0.7)?;
    let measured = walls(mesh, options.wall_samples);
    let pick = |share: f64| {
        let at = (share * measured.len() as f64) as usize;
        measured.get(at.min(measured.len().saturating_sub(1)))
    };
    let ratio = match (pick(0.95), pick(0.05)) {
        (Some(thick), Some(thin)) => thick.thickness / thin.thickness,
        _ => 1.0,
    };
    let (steps, inner_edges, junctions) =
        with_walls(mesh, options.wall_samples, |balls, inscribed, walls| {
            let [share, width] = [rules.rounding(), rules.hole()].map(|rule| rule.value);
            (
                transitions(walls),
                inner_edges(balls, inscribed, walls, share, width),
                junctions(balls, inscribed),
            )
        });
    let steep = steps.get((options.exempt * steps.len() as f64) as usize);
    let mut out = Mould {
        draw,
        direction: directions::judge(mesh, &draw, options.lines, wanted),
        undercuts: found,
        undercut_volume,
        parting_flatness,
        parting,
        min_draft: draft::least_draft(mesh, &draw, options.exempt),
        draft: draft::draft_classes(mesh, &draw, &CLASSES),
        min_wall: pick(options.exempt).map(|wall| wall.thickness),
        wall_ratio: ratio,
        transition: steep.map_or(0.0, |s| s.1),
        inner_edges,
        junctions,
        ..Mould::default()
    };
    let places = sheet::Places {
        thin: pick(options.exempt),
        thick: pick(0.95),
        steep: steep.map(|s| s.0),
    };
    out.findings = sheet::findings(&out, mesh, &places, rules);
    if options.repairs() {
        monitor.step(STAGE, "repair", 0.8)?;
        let cell = options.cell.unwrap_or(lattice.pitch);
        let repair_options = options.repair_options(parting, cell);
        out.repaired = Some(repair(mesh, &draw, &repair_options, monitor)?);
    }
    Ok(out)
}

/// Checks the options.
///
/// # Errors
/// [`MouldError::Option`].
pub fn check(options: &MouldOptions) -> Result<(), MouldError> {
    let range = |name, value: f64, lo: f64, hi: f64, allowed| {
        if value.is_finite() && value >= lo && value <= hi {
            Ok(())
        } else {
            Err(MouldError::Option {
                name,
                value,
                allowed,
            })
        }
    };
    if let Some(draw) = options.draw {
        let length = Vec3::from(draw).norm();
        range("draw", length, 1e-9, 1e9, "a vector that is not zero")?;
    }
    range("lines", options.lines as f64, 8.0, 4096.0, "8 to 4096")?;
    range(
        "directions",
        options.directions as f64,
        1.0,
        1e5,
        "1 to 100000",
    )?;
    range("exempt", options.exempt, 0.0, 0.5, "0 to 0.5")?;
    range("fill_cost", options.fill_cost, 0.0, 1e6, "0 or more")?;
    for (name, places) in [("cores", &options.cores), ("removals", &options.removals)] {
        for place in places.iter().flatten() {
            range(name, *place, -1e9, 1e9, "places in mm")?;
        }
    }
    let price = options.core_price.unwrap_or(0.0);
    range("core_price", price, 0.0, 1e12, "0 or more, mm3")?;
    range("tries", options.tries as f64, 1.0, 1000.0, "1 to 1000")?;
    range("min_gap", options.min_gap, 0.0, 1e6, "0 or more, mm")?;
    range("repair_draft", options.added_draft(), 0.0, 30.0, "0 to 30")?;
    range(
        "cell",
        options.cell.unwrap_or(1.0),
        1e-3,
        1e4,
        "0.001 to 10000",
    )?;
    range(
        "wall_samples",
        options.wall_samples as f64,
        0.0,
        1e7,
        "at most 10 million",
    )
}
