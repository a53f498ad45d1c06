//! From the B-rep description and the non-design bodies to one checked solid.

use std::time::Instant;

use grassfire_occt::{BooleanResult, BrepDescription, OcctError, Operation, Origin, Shape};

use super::bores::{self, Bore};
use super::inspect::{self, NonDesignResult};
use super::non_design::NonDesignBody;
use super::reference::{self, Probe};
use super::{CadError, CadOptions, array, patches, shells, split};
use crate::Vec3;
use crate::monitor::Monitor;
use crate::spline::{Brep, BrepFace};

/// Where a face of the part comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaceSource {
    /// The fitted body.
    Organic,
    /// A face of non-design body `.0`.
    Body(u32),
    /// The wall of bore `.1` of non-design body `.0`.
    Bore(u32, u32),
}

/// The finished part with everything that was checked on it.
#[derive(Debug)]
pub struct CadSolid {
    /// The shape: one solid, or a compound of several.
    pub shape: Shape,
    /// All checks passed. When false, `messages` tell why, and the shape may be the bodies side by side.
    pub valid: bool,
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
const VOLUME_EPS: f64 = 1e-8;
/// Limit for identities between volumes.
const IDENTITY: f64 = 1e-6;
/// Largest tolerance accepted in a part, mm.
const MAX_TOLERANCE: f64 = 1e-2;
/// Chord of the triangulation that is compared with the reference, mm, and its facet angle, radians.
const CHECK_MESH: [f64; 2] = [0.01, 0.2];
/// Largest accepted share of a body's region that is missing or too much in that triangulation.
const REGION_TOLERANCE: f64 = 0.01;

/// Builds the part.
///
/// 1. Sort the shells into solids and cavities; build the solids directly; check them (BRepCheck, closed, volume equal to
///    the exact integral to 1e-6, tolerance).
/// 2. Fuse all non-design bodies with their bores filled, then cut the bores: organic material never stays in a bore.
/// 3. Check the union: no warnings, BRepCheck, closed, number of solids, inclusion-exclusion to 1e-6, and the volume,
///    the common part, the removed part and each body's region against ray integrals that use no boolean.
/// 4. When a check fails: faces near the non-design bodies cut into single polynomials, then also a larger fuzzy value, a
///    small shift of the fitted body, one body at a time; at last the bodies side by side with `valid = false`.
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
    monitor.step(STAGE, "building faces", 0.0)?;
    let body = Body::new(brep)?;
    let mut messages: Vec<String> = body.problems.clone();
    let sound = messages.is_empty();
    if !sound || bodies.is_empty() {
        let sources = vec![FaceSource::Organic; brep.faces.len()];
        let shape = if bodies.is_empty() {
            single(body.shape)?
        } else {
            side_by_side(&body.shape, bodies)?
        };
        let context = inspect::Context {
            bodies,
            options,
            probes: &[],
            reference: brep.volume,
        };
        let sources = if bodies.is_empty() {
            sources
        } else {
            inspect::separate_sources(&sources, bodies)?
        };
        return inspect::report(shape, sources, messages, sound, &context, monitor);
    }
    let bodies_holes = free_bores(bodies)?;
    let tools: Vec<Option<Shape>> = bodies_holes
        .iter()
        .map(|bores| tool(bores))
        .collect::<Result<_, _>>()?;
    let probes = reference::probes(brep, bodies, &tools, options.rays, monitor)?;
    let reference = brep.volume
        + probes
            .iter()
            .map(|p| p.part_volume - p.organic_volume)
            .sum::<f64>();
    let inputs = Inputs {
        bosses: disjoint(bodies.iter().map(|b| &b.boss), options)?,
        tools: disjoint(tools.iter().flatten(), options)?,
    };
    let context = inspect::Context {
        bodies,
        options,
        probes: &probes,
        reference,
    };

    let mut split_body = None;
    for attempt in ATTEMPTS {
        monitor.step(STAGE, attempt.text, 0.3)?;
        let body = match (&mut split_body, attempt.split) {
            (_, false) => &body,
            (Some(split), true) => split,
            (none, true) => none.insert(Body::new(&split::split(
                brep,
                &near(brep, bodies, &tools)?,
            ))?),
        };
        let outcome = attempt.run(body, &inputs, &context, monitor);
        monitor.check()?;
        match outcome {
            Ok(united) => {
                if !messages.is_empty() {
                    messages.push(format!("passed: {}", attempt.text));
                }
                monitor.step(STAGE, "inspecting", 0.8)?;
                let sources = inspect::sources(&united.mesh_shape, &united.kinds, &context)?;
                return inspect::report(united.shape, sources, messages, true, &context, monitor);
            }
            Err(reason) => messages.push(format!("{} failed: {reason}", attempt.text)),
        }
    }
    messages.push("no union passed its checks; the fitted body and the non-design bodies are written side by side".into());
    let sources = inspect::separate_sources(&vec![FaceSource::Organic; brep.faces.len()], bodies)?;
    inspect::report(
        side_by_side(&body.shape, bodies)?,
        sources,
        messages,
        false,
        &context,
        monitor,
    )
}

/// The fitted body as solids.
struct Body {
    shape: Shape,
    solids: u32,
    volume: f64,
    problems: Vec<String>,
}

impl Body {
    fn new(brep: &Brep) -> Result<Self, CadError> {
        patches::check(brep).map_err(|text| CadError::BadBrep { text })?;
        let solids = shells::classify(brep)?;
        let shape = Shape::from_brep(&describe(brep, &solids))?;
        let volume = shape.volume(VOLUME_EPS)?;
        let mut problems = Vec::new();
        if let Some(text) = shape.faults()? {
            problems.push(format!("the fitted body is not valid: {text}"));
        }
        let counts = shape.counts()?;
        if counts.bad_edges > 0 {
            problems.push(format!(
                "{} edges of the fitted body have not exactly two faces",
                counts.bad_edges
            ));
        }
        let difference = (volume - brep.volume).abs() / brep.volume.abs();
        if difference.is_nan() || difference > IDENTITY {
            problems.push(format!(
                "the fitted body has {volume:.6} mm3, its patches {:.6} mm3",
                brep.volume
            ));
        }
        Ok(Self {
            shape,
            solids: solids.len() as u32,
            volume,
            problems,
        })
    }
}

fn describe(brep: &Brep, solids: &[Vec<usize>]) -> BrepDescription {
    let flat = |points: &[Vec3]| points.iter().flat_map(|p| array(*p)).collect::<Vec<f64>>();
    BrepDescription {
        vertices: flat(&brep.vertices),
        edges: brep
            .edges
            .iter()
            .flat_map(|e| [e.vertices[0], e.vertices[1], e.spans])
            .collect(),
        edge_control: brep.edges.iter().flat_map(|e| flat(&e.control)).collect(),
        faces: brep
            .faces
            .iter()
            .flat_map(|f| [f.spans[0], f.spans[1], f.uses.len() as u32])
            .collect(),
        face_control: brep.faces.iter().flat_map(|f| flat(&f.control)).collect(),
        uses: brep
            .faces
            .iter()
            .flat_map(|f| &f.uses)
            .flat_map(|u| [u.edge, u32::from(u.reversed)])
            .collect(),
        use_uv: brep
            .faces
            .iter()
            .flat_map(|f| &f.uses)
            .flat_map(|u| [u.start[0], u.start[1], u.end[0], u.end[1]])
            .collect(),
        solids: solids
            .iter()
            .map(|s| s.iter().map(|&k| brep.shells[k].clone()).collect())
            .collect(),
    }
}

/// A compound of one solid is that solid.
fn single(shape: Shape) -> Result<Shape, OcctError> {
    let mut solids = shape.solids()?;
    Ok(if solids.len() == 1 {
        solids.swap_remove(0)
    } else {
        shape
    })
}

fn side_by_side(body: &Shape, bodies: &[NonDesignBody]) -> Result<Shape, OcctError> {
    Shape::compound(std::iter::once(body).chain(bodies.iter().map(|b| &b.solid)))
}

/// The bores of each body, kept free only as far as no other non-design body is in the way.
fn free_bores(bodies: &[NonDesignBody]) -> Result<Vec<Vec<Bore>>, OcctError> {
    let solids: Vec<&Shape> = bodies.iter().map(|b| &b.solid).collect();
    let free = |bore: &Bore| {
        let mut bore = bore.clone();
        let factor = bore.extension[0].max(bore.extension[1]) / bore.radius;
        bores::extend(&mut bore, factor, &solids)?;
        Ok(bore)
    };
    bodies
        .iter()
        .map(|b| b.bores.iter().map(free).collect())
        .collect()
}

fn tool(bores: &[Bore]) -> Result<Option<Shape>, OcctError> {
    let tools: Vec<Shape> = bores.iter().map(Bore::tool).collect::<Result<_, _>>()?;
    if tools.is_empty() {
        Ok(None)
    } else {
        Shape::compound(&tools).map(Some)
    }
}

/// One compound of solids that do not overlap: those whose boxes meet are fused first, so that volumes add up.
fn disjoint<'a>(
    shapes: impl Iterator<Item = &'a Shape>,
    options: &CadOptions,
) -> Result<Option<Shape>, OcctError> {
    let mut groups: Vec<(Shape, [[f64; 3]; 2])> = Vec::new();
    for shape in shapes {
        for solid in shape.solids()? {
            let mut merged = solid;
            let mut bounds = merged.bounds()?;
            while let Some(k) = groups.iter().position(|(_, other)| {
                (0..3).all(|d| other[0][d] <= bounds[1][d] && bounds[0][d] <= other[1][d])
            }) {
                let (other, _) = groups.remove(k);
                merged = other
                    .boolean(Operation::Fuse, &merged, options.fuzzy, false, &|| false)?
                    .shape;
                bounds = merged.bounds()?;
            }
            groups.push((merged, bounds));
        }
    }
    if groups.is_empty() {
        Ok(None)
    } else {
        Shape::compound(groups.iter().map(|(s, _)| s)).map(Some)
    }
}

struct Inputs {
    bosses: Option<Shape>,
    tools: Option<Shape>,
}

/// What a face of a boolean's result is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Organic,
    Boss,
    Bore,
}

pub(crate) struct United {
    /// The part.
    shape: Shape,
    /// The same shape carrying a fine triangulation.
    mesh_shape: Shape,
    kinds: Vec<Kind>,
}

/// One way to make the union.
#[derive(Debug, Clone, Copy)]
struct Attempt {
    text: &'static str,
    /// Faces near the non-design bodies are single polynomials.
    split: bool,
    larger_fuzzy: bool,
    shift: bool,
    one_by_one: bool,
}

const PLAIN: Attempt = Attempt {
    text: "union of all bodies",
    split: false,
    larger_fuzzy: false,
    shift: false,
    one_by_one: false,
};
const SPLIT: Attempt = Attempt {
    text: "union with smaller faces near the non-design bodies",
    split: true,
    ..PLAIN
};
const ATTEMPTS: [Attempt; 5] = [
    PLAIN,
    SPLIT,
    Attempt {
        text: "union with smaller faces and a larger fuzzy value",
        larger_fuzzy: true,
        ..SPLIT
    },
    Attempt {
        text: "union with smaller faces after a small shift of the fitted body",
        shift: true,
        ..SPLIT
    },
    Attempt {
        text: "union with smaller faces, one body at a time",
        one_by_one: true,
        ..SPLIT
    },
];

impl Attempt {
    fn run(
        self,
        body: &Body,
        inputs: &Inputs,
        context: &inspect::Context,
        monitor: &Monitor,
    ) -> Result<United, String> {
        let options = context.options;
        let fuzzy = if self.larger_fuzzy {
            options.fuzzy_retry
        } else {
            options.fuzzy
        };
        if let Some(problem) = body.problems.first() {
            return Err(problem.clone());
        }
        if !self.shift {
            return unite(body, inputs, fuzzy, self.one_by_one, context, monitor);
        }
        let by = Vec3::new(0.6, 0.48, 0.64) * options.shift;
        let shape = body.shape.translated(array(by)).map_err(|e| e.0)?;
        unite(
            &Body {
                shape,
                problems: Vec::new(),
                ..*body
            },
            inputs,
            fuzzy,
            self.one_by_one,
            context,
            monitor,
        )
    }
}

/// Faces whose control points come near a non-design body or its tools.
fn near(
    brep: &Brep,
    bodies: &[NonDesignBody],
    tools: &[Option<Shape>],
) -> Result<Vec<bool>, OcctError> {
    let margin = Vec3::repeat(0.5);
    let shapes = bodies.iter().map(|b| &b.boss).chain(tools.iter().flatten());
    let boxes: Vec<(Vec3, Vec3)> = shapes
        .map(|s| {
            s.bounds()
                .map(|[lo, hi]| (Vec3::from(lo) - margin, Vec3::from(hi) + margin))
        })
        .collect::<Result<_, _>>()?;
    let meets = |face: &BrepFace| {
        let first = face.control[0];
        let (lo, hi) = face
            .control
            .iter()
            .fold((first, first), |(lo, hi), p| (lo.inf(p), hi.sup(p)));
        boxes
            .iter()
            .any(|(a, b)| (0..3).all(|d| a[d] <= hi[d] && lo[d] <= b[d]))
    };
    Ok(brep.faces.iter().map(meets).collect())
}

/// Running result of the booleans.
struct Progress<'a> {
    shape: Shape,
    kinds: Vec<Kind>,
    common: f64,
    fuzzy: f64,
    interrupt: &'a (dyn Fn() -> bool + Sync),
}

impl Progress<'_> {
    fn apply(&mut self, operation: Operation, tool: &Shape) -> Result<(), String> {
        let kind = if operation == Operation::Cut {
            Kind::Bore
        } else {
            Kind::Boss
        };
        let BooleanResult {
            shape,
            common,
            warnings,
            origins,
        } = self
            .shape
            .boolean(operation, tool, self.fuzzy, true, self.interrupt)
            .map_err(|e| e.0)?;
        if let Some(first) = warnings.first() {
            return Err(format!(
                "the kernel warned: {first} ({} lines)",
                warnings.len()
            ));
        }
        if let Some(common) = common
            && common.counts().map_err(|e| e.0)?.solids > 0
        {
            self.common += common.volume(VOLUME_EPS).map_err(|e| e.0)?;
        }
        let from = |origin: &Origin| match origin {
            Origin::Object(face) => self.kinds.get(*face as usize).copied().unwrap_or(kind),
            _ => kind,
        };
        self.kinds = origins.iter().map(from).collect();
        self.shape = shape;
        Ok(())
    }
}

fn unite(
    body: &Body,
    inputs: &Inputs,
    fuzzy: f64,
    one_by_one: bool,
    context: &inspect::Context,
    monitor: &Monitor,
) -> Result<United, String> {
    let text = |e: OcctError| e.0;
    let start = Instant::now();
    let limit = context.options.boolean_seconds;
    let interrupt = move || monitor.check().is_err() || start.elapsed().as_secs_f64() > limit;
    let faces = body.shape.counts().map_err(text)?.faces as usize;
    let mut at = Progress {
        shape: body.shape.share().map_err(text)?,
        kinds: vec![Kind::Organic; faces],
        common: 0.0,
        fuzzy,
        interrupt: &interrupt,
    };
    let mut commons = [0.0; 2];
    let mut bosses = 0.0;
    for (k, (operation, tools)) in [
        (Operation::Fuse, &inputs.bosses),
        (Operation::Cut, &inputs.tools),
    ]
    .into_iter()
    .enumerate()
    {
        let Some(tools) = tools else { continue };
        if operation == Operation::Fuse {
            bosses = tools.volume(VOLUME_EPS).map_err(text)?;
        }
        at.common = 0.0;
        if one_by_one {
            tools
                .solids()
                .map_err(text)?
                .iter()
                .try_for_each(|tool| at.apply(operation, tool))?;
        } else {
            at.apply(operation, tools)?;
        }
        commons[k] = at.common;
    }
    let expected = body.volume + bosses - commons[0] - commons[1];
    let shape = single(at.shape).map_err(text)?;
    let volume = gates(&shape, body.solids, expected, context)?;
    volumes(volume, commons, context)?;
    let mesh_shape = shape.translated([0.0; 3]).map_err(text)?;
    regions(&mesh_shape, context)?;
    Ok(United {
        shape,
        mesh_shape,
        kinds: at.kinds,
    })
}

/// What the kernel can check by itself.
fn gates(
    shape: &Shape,
    organic_solids: u32,
    expected: f64,
    context: &inspect::Context,
) -> Result<f64, String> {
    let text = |e: OcctError| e.0;
    if let Some(fault) = shape.faults().map_err(text)? {
        return Err(format!("the union is not valid: {fault}"));
    }
    let counts = shape.counts().map_err(text)?;
    if counts.bad_edges > 0 {
        return Err(format!(
            "{} edges of the union have not exactly two faces",
            counts.bad_edges
        ));
    }
    let loose = context
        .probes
        .iter()
        .filter(|p| p.overlap <= 1e-6 * p.region)
        .count() as u32;
    if counts.solids == 0 || counts.solids > organic_solids + loose {
        return Err(format!(
            "the union has {} solids; at most {} wanted",
            counts.solids,
            organic_solids + loose
        ));
    }
    let tolerance = shape.max_tolerance().map_err(text)?;
    if tolerance > MAX_TOLERANCE {
        return Err(format!(
            "the union's tolerance is {tolerance:.1e} mm; at most {MAX_TOLERANCE:.0e} wanted"
        ));
    }
    let volume = shape.volume(VOLUME_EPS).map_err(text)?;
    if ((volume - expected) / expected).abs() > IDENTITY {
        return Err(format!(
            "inclusion-exclusion gives {expected:.6} mm3, the union has {volume:.6} mm3"
        ));
    }
    Ok(volume)
}

/// Volume, common part and removed part against the ray integrals.
fn volumes(volume: f64, commons: [f64; 2], context: &inspect::Context) -> Result<(), String> {
    let sum = |f: fn(&Probe) -> f64| context.probes.iter().map(f).sum::<f64>();
    let allowed = context.options.volume_tolerance * sum(|p| p.region);
    let rows = [
        ("the union", volume, context.reference),
        (
            "the common part of fitted body and bosses",
            commons[0],
            sum(|p| p.overlap),
        ),
        ("what the bores removed", commons[1], sum(|p| p.removed)),
    ];
    match rows
        .iter()
        .find(|(_, got, wanted)| (got - wanted).abs() > allowed)
    {
        Some((what, got, wanted)) => Err(format!(
            "{what} has {got:.3} mm3, independent rays give {wanted:.3} mm3; {allowed:.3} mm3 of difference allowed"
        )),
        None => Ok(()),
    }
}

/// Every body's surroundings in the part's triangulation, ray by ray.
fn regions(shape: &Shape, context: &inspect::Context) -> Result<(), String> {
    let mesh = reference::triangles(shape, CHECK_MESH[0], CHECK_MESH[1]).map_err(|e| e.0)?;
    for (probe, body) in context.probes.iter().zip(context.bodies) {
        let (missing, extra) = probe.compare(&mesh);
        if missing + extra > REGION_TOLERANCE * probe.region {
            return Err(format!(
                "around {} {missing:.3} mm3 are missing and {extra:.3} mm3 too much of {:.3} mm3",
                body.name, probe.region
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cad::{NonDesignOptions, from_mesh};
    use crate::mesh::TriMesh;

    /// A square tube about z as a mesh: outside 10 x 10 x 8 mm, inside 6 x 6.
    fn tube() -> TriMesh {
        let mut mesh = TriMesh::default();
        for corner in [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]] {
            for (half, z) in [(5.0, 0.0), (5.0, 8.0), (3.0, 8.0), (3.0, 0.0)] {
                mesh.points
                    .push(Vec3::new(corner[0] * half, corner[1] * half, z));
            }
        }
        for k in 0..4u32 {
            for j in 0..4 {
                let next = (k + 1) % 4;
                let (a, b, c, d) = (
                    4 * k + j,
                    4 * next + j,
                    4 * next + (j + 1) % 4,
                    4 * k + (j + 1) % 4,
                );
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        mesh
    }

    /// A solid that BRepCheck likes but from which a piece is missing, as silently wrong booleans make it.
    #[test]
    fn missing_piece_of_a_valid_solid_is_caught() -> Result<(), Box<dyn std::error::Error>> {
        let monitor = Monitor::default();
        let bodies = from_mesh(
            "tube",
            "test",
            &tube(),
            &NonDesignOptions::default(),
            &monitor,
        )?;
        let options = CadOptions::default();
        let probes = reference::probes(&Brep::default(), &bodies, &[None], options.rays, &monitor)?;
        assert!(
            (probes[0].part_volume - 512.0).abs() < 0.5,
            "{}",
            probes[0].part_volume
        );
        let context = inspect::Context {
            bodies: &bodies,
            options: &options,
            probes: &probes,
            reference: probes[0].part_volume,
        };
        let right = bodies[0].solid.share()?;
        assert_eq!(volumes(512.0, [0.0; 2], &context), Ok(()));
        assert_eq!(regions(&right, &context), Ok(()));
        let piece = Shape::cuboid([3.5, -2.0, 1.0], [9.0, 1.0, 3.0])?;
        let wrong = right
            .boolean(Operation::Cut, &piece, 1e-5, false, &|| false)?
            .shape;
        assert!(gates(&wrong, 1, 512.0 - 9.0, &context).is_ok());
        assert!(volumes(503.0, [0.0; 2], &context).is_err());
        assert!(regions(&wrong, &context).is_err_and(|e| e.contains("tube")));
        Ok(())
    }
}
