//! Everything that the report says about the finished part.

use grassfire_occt::{Counts, Edge, Face, OcctError, Shape};
use serde::Serialize;

use super::bores::{Bore, ON_WALL};
use super::build::{CadSolid, FaceSource, VOLUME_EPS};
use super::non_design::NonDesignBody;
use super::reference::Probe;
use super::unite::Kind;
use super::{CadError, CadOptions, array};
use crate::Vec3;
use crate::monitor::Monitor;

/// How a non-design body came out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NonDesignResult {
    /// Name of the body.
    pub name: String,
    /// File it came from.
    pub source: String,
    /// Faces of the part that lie on it.
    pub faces: usize,
    /// Share of its bore walls that are faces of the part; without bores, of all its faces.
    pub coverage: f64,
    /// Its material is all there, its faces are exact and its bores are open.
    pub kept: bool,
    /// Radii of its bores, mm.
    pub bore_radii: Vec<f64>,
    /// Its bores, with the length over which they were cut.
    pub bores: Vec<Bore>,
    /// Largest distance of its faces in the part to the input, mm.
    pub max_distance: f64,
}

/// A part to be inspected.
pub(crate) struct Made {
    pub(crate) shape: Shape,
    /// The fitted body in it.
    pub(crate) organic: Shape,
    /// Source of each face.
    pub(crate) sources: Vec<FaceSource>,
    /// Volume of a shape that BRepCheck has passed, mm3.
    pub(crate) checked: Option<f64>,
}

/// What the inspection compares with.
pub(crate) struct Context<'a> {
    pub(crate) bodies: &'a [NonDesignBody],
    pub(crate) options: &'a CadOptions,
    /// Empty when there was no union.
    pub(crate) probes: &'a [Probe],
    /// Volume that the part must have, mm3.
    pub(crate) reference: f64,
}

/// Points on each face that decide which body it belongs to.
const SAMPLES: usize = 8;

/// Finds for each face that is not organic the body, or the bore, whose surface it lies on.
pub(crate) fn sources(
    shape: &Shape,
    kinds: &[Kind],
    context: &Context,
) -> Result<Vec<FaceSource>, CadError> {
    let boxes: Vec<[[f64; 3]; 2]> = context
        .bodies
        .iter()
        .map(|b| b.solid.bounds())
        .collect::<Result<_, _>>()?;
    let mut out = Vec::with_capacity(kinds.len());
    for (face, kind) in kinds.iter().enumerate() {
        if *kind == Kind::Organic {
            out.push(FaceSource::Organic);
            continue;
        }
        let points: Vec<Vec3> = shape
            .face_samples(&[face as u32], SAMPLES)?
            .into_iter()
            .map(Vec3::from)
            .collect();
        out.push(source(&points, *kind, context.bodies, &boxes)?);
    }
    Ok(out)
}

fn source(
    points: &[Vec3],
    kind: Kind,
    bodies: &[NonDesignBody],
    boxes: &[[[f64; 3]; 2]],
) -> Result<FaceSource, OcctError> {
    let mut best = (f64::MAX, FaceSource::Body(0));
    if kind == Kind::Bore {
        best = wall(points, bodies);
        if best.0 <= ON_WALL {
            return Ok(best.1);
        }
        // The bottom of a blind hole, or the shoulder of a stepped one: cut by the end of a tool.
    }
    for (b, body) in bodies.iter().enumerate() {
        let outside = points
            .iter()
            .map(|p| box_distance(&boxes[b], *p))
            .fold(0.0, f64::max);
        if outside < best.0.min(1.0) {
            let flat: Vec<[f64; 3]> = points.iter().map(|p| array(*p)).collect();
            let away = body.solid.distances(&flat)?.into_iter().fold(0.0, f64::max);
            if away < best.0 {
                best = (away, FaceSource::Body(b as u32));
            }
        }
    }
    Ok(best.1)
}

/// The bore whose wall is nearest, and how far the farthest point is from it, mm.
fn wall(points: &[Vec3], bodies: &[NonDesignBody]) -> (f64, FaceSource) {
    let mut best = (f64::MAX, FaceSource::Body(0));
    for (b, body) in bodies.iter().enumerate() {
        for (k, bore) in body.bores.iter().enumerate() {
            // Of two coaxial bores of one radius the nearer one.
            let away = points
                .iter()
                .map(|p| bore.distance(*p) + 1e-9 * overshoot(bore, *p))
                .fold(0.0, f64::max);
            if away < best.0 {
                best = (away, FaceSource::Bore(b as u32, k as u32));
            }
        }
    }
    best
}

/// How far a point lies beyond the ends of a bore, mm.
fn overshoot(bore: &Bore, p: Vec3) -> f64 {
    let t = (p - bore.origin).dot(&bore.direction);
    (bore.extent[0] - t).max(t - bore.extent[1]).max(0.0)
}

fn box_distance(bounds: &[[f64; 3]; 2], p: Vec3) -> f64 {
    (0..3)
        .map(|d| (bounds[0][d] - p[d]).max(p[d] - bounds[1][d]).max(0.0))
        .fold(0.0, f64::max)
}

/// Sources when the bodies lie side by side in a compound: their faces follow each other.
pub(crate) fn separate_sources(
    organic: &[FaceSource],
    bodies: &[NonDesignBody],
) -> Result<Vec<FaceSource>, OcctError> {
    let mut out = organic.to_vec();
    for (b, body) in bodies.iter().enumerate() {
        let source = |face: &Face| match bore_of(body, face) {
            Some(k) => FaceSource::Bore(b as u32, k as u32),
            None => FaceSource::Body(b as u32),
        };
        out.extend(body.solid.faces()?.iter().map(source));
    }
    Ok(out)
}

/// The bore of a body whose wall a face of it is.
fn bore_of(body: &NonDesignBody, face: &Face) -> Option<usize> {
    body.bores.iter().position(|bore| bore.is_wall(face))
}

/// Measures the part and decides whether it is valid.
pub(crate) fn report(
    made: Made,
    mut messages: Vec<String>,
    mut valid: bool,
    context: &Context,
    monitor: &Monitor,
) -> Result<CadSolid, CadError> {
    let Made {
        shape,
        organic,
        sources,
        checked,
    } = made;
    let volume = match checked {
        Some(volume) => volume,
        None => {
            if let Some(text) = shape.faults()? {
                valid = false;
                messages.push(format!("BRepCheck: {text}"));
            }
            shape.volume(VOLUME_EPS)?
        }
    };
    let (mut solid, faces) = measured(shape, organic, sources, volume)?;
    monitor.check()?;
    let open = if context.probes.is_empty() {
        Vec::new()
    } else {
        bores_open(&solid.shape, context.bodies)?
    };
    for (b, body) in context.bodies.iter().enumerate() {
        let result = if context.probes.is_empty() {
            separate(body)
        } else {
            united(&solid, &faces, b, open[b], context)?
        };
        if !result.kept {
            valid = false;
            messages.push(format!(
                "{}: not kept exactly (faces at most {:.1e} mm away, {:.1} % of its bore walls there, see the bores)",
                result.name,
                result.max_distance,
                100.0 * result.coverage
            ));
        }
        solid.non_design.push(result);
    }
    for (probe, body) in context.probes.iter().zip(context.bodies) {
        if probe.overlap <= 1e-6 * probe.region {
            valid = false;
            messages.push(format!("{} does not overlap the fitted body", body.name));
        }
    }
    Ok(CadSolid {
        valid,
        volume_check: (volume - context.reference).abs() / context.reference.abs(),
        messages,
        ..solid
    })
}

/// What is counted and measured on a shape of `volume` mm3 alone, and its faces. Checks, messages and bodies are left open.
fn measured(
    shape: Shape,
    organic: Shape,
    sources: Vec<FaceSource>,
    volume: f64,
) -> Result<(CadSolid, Vec<Face>), OcctError> {
    let (edges, faces, counts) = (shape.edges()?, shape.faces()?, shape.counts()?);
    let solid = CadSolid {
        valid: false,
        organic,
        bodies: counts.solids as usize,
        faces: counts.faces as usize,
        volume,
        area: faces.iter().map(|face| face.area).sum(),
        genus: genus(&counts),
        g1_max: kink(&edges, &sources),
        shortest_edge: shortest(&edges).unwrap_or(0.0),
        max_tolerance: shape.max_tolerance()?,
        volume_check: f64::NAN,
        non_design: Vec::new(),
        sources,
        messages: Vec::new(),
        shape,
    };
    Ok((solid, faces))
}

/// Measures a part anew after cuts of which each was checked: `shape` of `volume` mm3 with one source a face.
pub(crate) fn again(
    before: &CadSolid,
    shape: Shape,
    sources: Vec<FaceSource>,
    volume: f64,
    bodies: &[NonDesignBody],
    options: &CadOptions,
) -> Result<CadSolid, CadError> {
    let context = Context {
        bodies,
        options,
        probes: &[],
        reference: volume,
    };
    let (mut solid, faces) = measured(shape, before.organic.share()?, sources, volume)?;
    let open = bores_open(&solid.shape, bodies)?;
    for (b, old) in before.non_design.iter().enumerate() {
        let mut result = united(&solid, &faces, b, open[b], &context)?;
        result.bores.clone_from(&old.bores);
        solid.non_design.push(result);
    }
    Ok(CadSolid {
        valid: before.valid,
        volume_check: before.volume_check,
        messages: before.messages.clone(),
        ..solid
    })
}

/// Sum of the genus of all shells.
pub(super) fn genus(counts: &Counts) -> i64 {
    let euler = i64::from(counts.vertices) - i64::from(counts.edges) + 2 * i64::from(counts.faces)
        - i64::from(counts.wires);
    i64::from(counts.shells) - euler / 2
}

/// Largest angle between the normals of two faces of the fitted body at their common edge, degrees.
fn kink(edges: &[Edge], sources: &[FaceSource]) -> f64 {
    let smooth = |f: u32| sources.get(f as usize) == Some(&FaceSource::Organic);
    let angle = |edge: &Edge| match (edge.faces, edge.angle) {
        (Some([a, b]), Some(angle)) if smooth(a) && smooth(b) => angle.to_degrees(),
        _ => 0.0,
    };
    edges.iter().map(angle).fold(0.0, f64::max)
}

/// Length of the shortest edge, mm.
pub(super) fn shortest(edges: &[Edge]) -> Option<f64> {
    edges.iter().map(|edge| edge.length).reduce(f64::min)
}

/// A body that lies beside the part.
fn separate(body: &NonDesignBody) -> NonDesignResult {
    NonDesignResult {
        name: body.name.clone(),
        source: body.source.clone(),
        faces: 0,
        coverage: 0.0,
        kept: false,
        bore_radii: body.bores.iter().map(|b| b.radius).collect(),
        bores: body.bores.clone(),
        max_distance: 0.0,
    }
}

/// How body `b` came out in a solid of these faces.
fn united(
    solid: &CadSolid,
    faces: &[Face],
    b: usize,
    open: bool,
    context: &Context,
) -> Result<NonDesignResult, CadError> {
    let body = &context.bodies[b];
    let shape = &solid.shape;
    let (mut own, mut walls) = (Vec::new(), Vec::new());
    for (f, source) in solid.sources.iter().enumerate() {
        match *source {
            FaceSource::Body(i) if i as usize == b => own.push(f as u32),
            FaceSource::Bore(i, k) if i as usize == b => walls.push((f as u32, k as usize)),
            _ => {}
        }
    }
    let mut max_distance = body
        .solid
        .distances(&shape.face_samples(&own, SAMPLES)?)?
        .into_iter()
        .fold(0.0, f64::max);
    for &(face, k) in &walls {
        for p in shape.face_samples(&[face], SAMPLES)? {
            max_distance = max_distance.max(body.bores[k].distance(p.into()));
        }
    }
    let area =
        |list: &mut dyn Iterator<Item = u32>| list.map(|f| faces[f as usize].area).sum::<f64>();
    let (have, wanted) = if body.bores.is_empty() {
        (area(&mut own.iter().copied()), body.solid.area(1e-6)?)
    } else {
        (area(&mut walls.iter().map(|w| w.0)), wall_area(body)?)
    };
    let coverage = (have / wanted).min(1.0);
    let exact = max_distance <= context.options.distance_tolerance;
    Ok(NonDesignResult {
        name: body.name.clone(),
        source: body.source.clone(),
        faces: own.len() + walls.len(),
        coverage,
        kept: open && exact && (body.bores.is_empty() || coverage > 0.999),
        bore_radii: body.bores.iter().map(|b| b.radius).collect(),
        bores: body.bores.clone(),
        max_distance,
    })
}

/// Area of the walls of a body's bores in the input.
fn wall_area(body: &NonDesignBody) -> Result<f64, OcctError> {
    let faces = body.solid.faces()?;
    let walls = faces.iter().filter(|f| bore_of(body, f).is_some());
    Ok(walls.map(|f| f.area).sum())
}

/// Tells for each body whether no line along its bores, on the axis or near the wall, meets the part.
fn bores_open(shape: &Shape, bodies: &[NonDesignBody]) -> Result<Vec<bool>, OcctError> {
    let (mut lines, mut middles) = (Vec::new(), Vec::new());
    let (mut body_of_line, mut body_of_middle) = (Vec::new(), Vec::new());
    for (b, body) in bodies.iter().enumerate() {
        for bore in &body.bores {
            let range = bore.free_range();
            lines.extend(bore.lines(range));
            body_of_line.resize(lines.len(), b);
            middles.push(array(
                bore.origin + bore.direction * ((range[0] + range[1]) / 2.0),
            ));
            body_of_middle.push(b);
        }
    }
    let mut open = vec![true; bodies.len()];
    // One call each: the kernel prepares every face of the part anew at every call.
    for (hits, b) in shape.line_hits(&lines)?.iter().zip(body_of_line) {
        open[b] &= hits.is_empty();
    }
    for (inside, b) in shape.contains(&middles)?.into_iter().zip(body_of_middle) {
        open[b] &= !inside;
    }
    Ok(open)
}
