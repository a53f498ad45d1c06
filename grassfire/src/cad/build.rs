//! From the B-rep description and the non-design bodies to one checked solid.

use grassfire_occt::Shape;

use super::beside::{disjoint, free_bores, near, side_by_side, tool};
use super::body::{Body, Built, single};
use super::bores::Bore;
use super::inspect::{self, NonDesignResult};
use super::non_design::NonDesignBody;
use super::reference::{self, Probe};
use super::unite::{ATTEMPTS, Booleans, Inputs, Kernel, United, booleans, kernel, shift};
use super::{CadError, CadOptions, split};
use crate::Vec3;
use crate::monitor::Monitor;
use crate::spline::{Brep, Crowded};

/// Where a face of the part comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaceSource {
    /// The fitted body.
    Organic,
    /// A face of non-design body `.0`.
    Body(u32),
    /// The wall of bore `.1` of non-design body `.0`.
    Bore(u32, u32),
    /// Cut plane at flat face `.0` of the proposal.
    Flat(u32),
    /// A fillet between the fitted body and a non-design body.
    Fillet,
}

/// The finished part with everything that was checked on it.
#[derive(Debug)]
pub struct CadSolid {
    /// The shape: one solid, or a compound of several.
    pub shape: Shape,
    /// All checks passed. When false, `messages` tell why, and the shape may be the bodies side by side.
    pub valid: bool,
    /// The fitted body as it was united.
    pub organic: Shape,
    /// Number of solids.
    pub bodies: usize,
    /// Number of faces.
    pub faces: usize,
    /// Volume, mm3.
    pub volume: f64,
    /// Surface area, mm2.
    pub area: f64,
    /// Sum of the genus of all shells.
    pub genus: i64,
    /// Largest angle between normals across edges of the fitted body, degrees.
    pub g1_max: f64,
    /// Length of the shortest edge, mm.
    pub shortest_edge: f64,
    /// Largest tolerance in the shape, mm.
    pub max_tolerance: f64,
    /// Relative difference between the volume and the independent volume.
    pub volume_check: f64,
    /// One entry a non-design body.
    pub non_design: Vec<NonDesignResult>,
    /// Source of each face.
    pub sources: Vec<FaceSource>,
    /// What was tried and what failed, in plain words.
    pub messages: Vec<String>,
}

const STAGE: &str = "cad";
/// Accuracy of volumes; the kernel's own default is 1e-4 wrong on merged faces.
pub(super) const VOLUME_EPS: f64 = 1e-8;
/// Limit for identities between volumes.
pub(super) const IDENTITY: f64 = 1e-6;

/// The fitted body's solids, with the non-design bodies put to them but nothing checked yet.
pub struct Joined {
    body: Built,
    bores: Vec<Vec<Bore>>,
    tools: Vec<Option<Shape>>,
    /// None without non-design bodies.
    union: Option<Union>,
}

struct Union {
    bosses: Option<Shape>,
    tools: Option<Shape>,
    /// What the first of all attempts gave.
    first: Result<Booleans, String>,
}

/// Builds the fitted body and unites it with the non-design bodies, without a check: the first steps of [`build`].
///
/// # Errors
/// As for [`build`].
pub fn join(
    brep: &Brep,
    bodies: &[NonDesignBody],
    options: &CadOptions,
    monitor: &Monitor,
) -> Result<Joined, CadError> {
    join_with(&kernel, brep, bodies, options, monitor)
}

/// [`join`] with booleans by `kernel`.
pub(super) fn join_with(
    kernel: &Kernel<'_>,
    brep: &Brep,
    bodies: &[NonDesignBody],
    options: &CadOptions,
    monitor: &Monitor,
) -> Result<Joined, CadError> {
    monitor.step(STAGE, "building faces", 0.0)?;
    let body = Built::new(brep)?;
    let bores = free_bores(bodies)?;
    let tools: Vec<Option<Shape>> = bores
        .iter()
        .map(|bores| tool(bores))
        .collect::<Result<_, _>>()?;
    let union = if bodies.is_empty() {
        None
    } else {
        let bosses = disjoint(bodies.iter().map(|b| &b.boss), options)?;
        let cutters = disjoint(tools.iter().flatten(), options)?;
        monitor.step(STAGE, ATTEMPTS[0].text, 0.1)?;
        let inputs = Inputs {
            bosses: bosses.as_ref(),
            tools: cutters.as_ref(),
            kernel,
        };
        let first = booleans(&body.shape, &inputs, options.fuzzy, false, options, monitor);
        monitor.check()?;
        Some(Union {
            bosses,
            tools: cutters,
            first,
        })
    };
    Ok(Joined {
        body,
        bores,
        tools,
        union,
    })
}

impl Joined {
    /// Edges of the union that are shorter than `least` mm, the shortest first; `None` when there is no union.
    ///
    /// # Errors
    /// [`CadError::Kernel`].
    pub fn short_edges(&self, least: f64) -> Result<Option<Vec<Crowded>>, CadError> {
        let Some(Ok(first)) = self.union.as_ref().map(|union| &union.first) else {
            return Ok(None);
        };
        let edges = first.shape.edges()?;
        let short = edges.iter().filter(|edge| edge.length < least);
        let mut crowded: Vec<Crowded> = short
            .map(|edge| Crowded {
                place: edge.middle.into(),
                length: edge.length,
            })
            .collect();
        crowded.sort_by(|a, b| a.length.total_cmp(&b.length));
        Ok(Some(crowded))
    }
}

/// Builds the part.
///
/// 1. Sort the shells into solids and cavities; build the solids directly; check them (BRepCheck, closed, volume equal to
///    the exact integral to 1e-6, tolerance).
/// 2. Fuse all non-design bodies with their bores filled, then cut the bores: organic material never stays in a bore.
/// 3. Check the union: no warnings, BRepCheck, closed, number of solids, inclusion-exclusion to 1e-6, and the volume,
///    the common part, the removed part and each body's region against ray integrals that use no boolean.
/// 4. When a check fails or a non-design body is not kept exactly: a larger fuzzy value; faces near the non-design bodies
///    cut into single polynomials, also with the larger fuzzy value, then after a small shift of the fitted body, then one
///    body at a time; at last the bodies side by side with `valid = false`.
///
/// # Errors
/// [`CadError::BadBrep`], [`CadError::MisplacedShell`], [`CadError::Kernel`] when the body itself cannot be built, and
/// [`CadError::Cancelled`]. A part that fails its checks is no error but has `valid == false`.
pub fn build(
    brep: &Brep,
    bodies: &[NonDesignBody],
    options: &CadOptions,
    monitor: &Monitor,
) -> Result<CadSolid, CadError> {
    let joined = join(brep, bodies, options, monitor)?;
    finish(joined, brep, bodies, options, monitor)
}

/// The rest of [`build`], from step 3 on, with what [`join`] gave for the same arguments.
///
/// # Errors
/// As for [`build`].
pub fn finish(
    joined: Joined,
    brep: &Brep,
    bodies: &[NonDesignBody],
    options: &CadOptions,
    monitor: &Monitor,
) -> Result<CadSolid, CadError> {
    finish_with(&kernel, joined, brep, bodies, options, monitor)
}

/// [`finish`] with booleans by `kernel`.
pub(super) fn finish_with(
    kernel: &Kernel<'_>,
    joined: Joined,
    brep: &Brep,
    bodies: &[NonDesignBody],
    options: &CadOptions,
    monitor: &Monitor,
) -> Result<CadSolid, CadError> {
    let Joined {
        body,
        bores,
        tools,
        union,
    } = joined;
    let body = body.checked(brep)?;
    let Some(union) = union.filter(|_| body.problems.is_empty()) else {
        return without_union(body, brep, bodies, options, monitor);
    };
    let mut messages = Vec::new();
    let still = Expected::new(brep, bodies, &tools, options, monitor)?;
    let inputs = Inputs {
        bosses: union.bosses.as_ref(),
        tools: union.tools.as_ref(),
        kernel,
    };
    let mut first = Some(union.first);
    let mut split_body = None;
    let mut best: Option<CadSolid> = None;
    for attempt in ATTEMPTS {
        monitor.step(STAGE, attempt.text, 0.3)?;
        let shifted;
        let context = if attempt.shift {
            let moved = moved(brep, shift(options));
            shifted = Expected::new(&moved, bodies, &tools, options, monitor)?;
            shifted.context(bodies, options)
        } else {
            still.context(bodies, options)
        };
        let body = match (&mut split_body, attempt.split) {
            (_, false) => &body,
            (Some(split), true) => split,
            (none, true) => {
                let split = split::split(brep, &near(brep, bodies, &tools)?);
                none.insert(Built::new(&split)?.checked(&split)?)
            }
        };
        let outcome = match first.take() {
            Some(first) => first.and_then(|made| made.checked(body, &context)),
            None => attempt.run(body, &inputs, &context, monitor),
        };
        monitor.check()?;
        match outcome {
            Ok(united) => {
                let mut solid = inspected(united, &bores, &context, monitor)?;
                if !messages.is_empty() {
                    solid
                        .messages
                        .insert(0, format!("passed: {}", attempt.text));
                }
                let kept = solid.non_design.iter().all(|body| body.kept);
                if best.as_ref().is_none_or(|b| badness(&solid) < badness(b)) {
                    best = Some(solid);
                }
                if kept {
                    break;
                }
                messages.push(format!(
                    "{}: a non-design body is not kept exactly",
                    attempt.text
                ));
            }
            Err(reason) => messages.push(format!("{} failed: {reason}", attempt.text)),
        }
    }
    if let Some(mut solid) = best {
        solid.messages.splice(0..0, messages);
        return Ok(solid);
    }
    messages.push("no union passed its checks; the fitted body and the non-design bodies are written side by side".into());
    let sources = inspect::separate_sources(&vec![FaceSource::Organic; brep.faces.len()], bodies)?;
    let made = inspect::Made {
        shape: side_by_side(&body.shape, bodies)?,
        organic: body.shape.share()?,
        sources,
        checked: None,
    };
    inspect::report(
        made,
        messages,
        false,
        &still.context(bodies, options),
        monitor,
    )
}

/// A union that passed its checks, inspected; its bodies' bores with the length over which they were cut.
fn inspected(
    united: United,
    bores: &[Vec<Bore>],
    context: &inspect::Context,
    monitor: &Monitor,
) -> Result<CadSolid, CadError> {
    monitor.step(STAGE, "inspecting", 0.8)?;
    let made = inspect::Made {
        sources: inspect::sources(&united.mesh_shape, &united.kinds, context)?,
        shape: united.shape,
        organic: united.organic,
        checked: Some(united.volume),
    };
    let mut solid = inspect::report(made, Vec::new(), true, context, monitor)?;
    for (result, bores) in solid.non_design.iter_mut().zip(bores) {
        result.bores.clone_from(bores);
    }
    Ok(solid)
}

/// The fitted body alone, or beside the non-design bodies when it is not sound.
fn without_union(
    body: Body,
    brep: &Brep,
    bodies: &[NonDesignBody],
    options: &CadOptions,
    monitor: &Monitor,
) -> Result<CadSolid, CadError> {
    let sound = body.problems.is_empty();
    let sources = vec![FaceSource::Organic; brep.faces.len()];
    let organic = body.shape.share()?;
    let (shape, sources) = if bodies.is_empty() {
        (single(body.shape)?, sources)
    } else {
        (
            side_by_side(&body.shape, bodies)?,
            inspect::separate_sources(&sources, bodies)?,
        )
    };
    let context = inspect::Context {
        bodies,
        options,
        probes: &[],
        reference: brep.volume,
    };
    let made = inspect::Made {
        shape,
        organic,
        sources,
        checked: None,
    };
    inspect::report(made, body.problems, sound, &context, monitor)
}

/// Volumes that the union must have.
struct Expected {
    probes: Vec<Probe>,
    /// Of the whole part, mm3.
    reference: f64,
}

impl Expected {
    fn new(
        brep: &Brep,
        bodies: &[NonDesignBody],
        tools: &[Option<Shape>],
        options: &CadOptions,
        monitor: &Monitor,
    ) -> Result<Self, CadError> {
        let probes = reference::probes(brep, bodies, tools, options.rays, monitor)?;
        let change = |p: &Probe| p.part_volume - p.organic_volume;
        let reference = brep.volume + probes.iter().map(change).sum::<f64>();
        Ok(Self { probes, reference })
    }

    fn context<'a>(
        &'a self,
        bodies: &'a [NonDesignBody],
        options: &'a CadOptions,
    ) -> inspect::Context<'a> {
        inspect::Context {
            bodies,
            options,
            probes: &self.probes,
            reference: self.reference,
        }
    }
}

/// The fitted body moved by `by`.
fn moved(brep: &Brep, by: Vec3) -> Brep {
    let mut out = brep.clone();
    let edges = out.edges.iter_mut().flat_map(|e| &mut e.control);
    let faces = out.faces.iter_mut().flat_map(|f| &mut f.control);
    out.vertices
        .iter_mut()
        .chain(edges)
        .chain(faces)
        .for_each(|p| *p += by);
    out
}

/// How far a part is from keeping its non-design bodies: bodies not kept, then the largest distance, mm.
fn badness(solid: &CadSolid) -> (usize, f64) {
    let lost = solid.non_design.iter().filter(|body| !body.kept).count();
    let distance = solid.non_design.iter().map(|body| body.max_distance);
    (lost, distance.fold(0.0, f64::max))
}
