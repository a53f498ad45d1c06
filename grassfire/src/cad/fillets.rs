//! Fillets where members meet non-design bodies.

use grassfire_occt::{Edge, FilletResult, OcctError, Shape};

use super::build::{CadSolid, FaceSource, VOLUME_EPS};
use super::inspect;
use super::non_design::NonDesignBody;
use super::unite::MAX_TOLERANCE;
use super::{CadError, CadOptions};
use crate::Vec3;
use crate::monitor::Monitor;

/// An inner edge that was to get a fillet.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Fillet {
    /// Middle of its longest edge, mm.
    pub place: Vec3,
    /// Length, mm.
    pub length: f64,
    /// Radius that was wanted, mm.
    pub wanted: f64,
    /// Radius that it has, mm; none where no fillet passed.
    pub radius: Option<f64>,
    /// Why it has none or a smaller one.
    pub reason: Option<String>,
}

/// Edges where the faces differ by less than this need no fillet, radians.
const FLAT: f64 = 0.26;
/// Radii that are tried, shares of the wanted one.
const SHARES: [f64; 5] = [1.0, 0.7, 0.5, 0.35, 0.2];
/// A fillet adds this many times what its edges and angles say, at least and at most.
const ADDS: [f64; 2] = [0.1, 3.0];
/// What the bridge says of a fillet that takes too much time.
const TOO_LONG: &str = "too long";
/// What is said when all fillets together are worse than each.
const TOGETHER: &str = "it does not go together with the others";

/// Gives the inner edges between fitted body and non-design bodies fillets, and tells of each.
///
/// 1. Edges that run on smoothly get one together; `radius_at` gives the radius for a place (mm).
/// 2. Each is made by the kernel alone, with smaller radii (down to a fifth) where it does not pass: the solid must be closed, pass BRepCheck, keep
///    tolerance, bodies and tunnels, and gain what the edges' lengths and angles say (a tenth to three times).
/// 3. Those that passed are made together; where these do not pass, one after another.
/// 4. The part is inspected anew; when a non-design body is not kept any more, the whole part stays as it was.
///
/// The kernel gives up on many edges that end in corners: these stay sharp, with the reason. It has `fillet_seconds` for each fillet.
///
/// # Errors
/// [`CadError::Kernel`], [`CadError::Cancelled`].
pub fn round_edges(
    solid: CadSolid,
    radius_at: &dyn Fn(&Vec3) -> f64,
    bodies: &[NonDesignBody],
    options: &CadOptions,
    monitor: &Monitor,
) -> Result<(CadSolid, Vec<Fillet>), CadError> {
    let mut fillets = Vec::new();
    if !solid.valid {
        return Ok((solid, fillets));
    }
    let sharp = Sharp::new(&solid, options, monitor)?;
    let contours = sharp.contours()?;
    let mut passed: Vec<(&[u32], f64)> = Vec::new();
    let mut made = None;
    for (k, contour) in contours.iter().enumerate() {
        monitor.step("cad", "fillets", k as f64 / contours.len() as f64)?;
        let mut fillet = sharp.described(contour);
        fillet.wanted = radius_at(&fillet.place);
        if let Some((radius, alone)) = sharp.largest(contour, &mut fillet)? {
            passed.push((contour, radius));
            made = Some(alone);
        }
        fillets.push(fillet);
    }
    // One alone is there already.
    if passed.len() > 1 {
        made = sharp.together(&passed, &mut fillets)?;
    }
    let Some((made, volume)) = made else {
        return Ok((solid, fillets));
    };
    let sources = sources(&solid, &made, bodies, options)?;
    let rounded = inspect::again(&solid, made.shape, sources, volume, bodies, options)?;
    if let Some(body) = rounded.non_design.iter().find(|body| !body.kept) {
        for fillet in &mut fillets {
            fillet.radius = None;
            fillet.reason = Some(format!("{} would not be kept exactly", body.name));
        }
        return Ok((solid, fillets));
    }
    Ok((rounded, fillets))
}

/// Whether an edge is a sharp inner one between the fitted body and a non-design body.
fn sharp_between(edge: &Edge, sources: &[FaceSource]) -> bool {
    let source = |f: u32| sources.get(f as usize);
    let sides = edge.faces.map(|[a, b]| [source(a), source(b)]);
    let between = matches!(
        sides,
        Some(
            [Some(FaceSource::Organic), Some(FaceSource::Body(_))]
                | [Some(FaceSource::Body(_)), Some(FaceSource::Organic)]
        )
    );
    between && edge.concave && edge.angle.is_some_and(|angle| angle > FLAT)
}

/// Samples of a face that tell whether it still lies on its body.
const SAMPLES: usize = 8;

/// Where the faces come from. The kernel names some fillets as what is left of the face that they join: those lie on no body.
fn sources(
    solid: &CadSolid,
    made: &FilletResult,
    bodies: &[NonDesignBody],
    options: &CadOptions,
) -> Result<Vec<FaceSource>, OcctError> {
    let source = |(face, origin): (usize, &Option<u32>)| {
        let from = origin.and_then(|f| solid.sources.get(f as usize).copied());
        let Some(FaceSource::Body(body)) = from else {
            return Ok(from.unwrap_or(FaceSource::Fillet));
        };
        let points = made.shape.face_samples(&[face as u32], SAMPLES)?;
        let away = bodies[body as usize].solid.distances(&points)?;
        let off = away.into_iter().fold(0.0, f64::max) > options.distance_tolerance;
        Ok(if off {
            FaceSource::Fillet
        } else {
            FaceSource::Body(body)
        })
    };
    made.origins.iter().enumerate().map(source).collect()
}

/// A part with fillets, and its volume, mm3.
type Made = (FilletResult, f64);

/// A part with sharp inner edges.
struct Sharp<'a> {
    solid: &'a CadSolid,
    edges: Vec<Edge>,
    seconds: f64,
    monitor: &'a Monitor,
}

impl<'a> Sharp<'a> {
    fn new(
        solid: &'a CadSolid,
        options: &CadOptions,
        monitor: &'a Monitor,
    ) -> Result<Self, OcctError> {
        Ok(Self {
            edges: solid.shape.edges()?,
            solid,
            seconds: options.fillet_seconds,
            monitor,
        })
    }

    /// The largest fillet that the kernel makes alone, with its radius.
    fn largest(
        &self,
        contour: &[u32],
        fillet: &mut Fillet,
    ) -> Result<Option<(f64, Made)>, CadError> {
        for share in SHARES {
            let radius = share * fillet.wanted;
            match self.rounded(&[(contour, radius)]) {
                Ok(made) => {
                    fillet.radius = Some(radius);
                    return Ok(Some((radius, made)));
                }
                Err(reason) => {
                    // What takes hours with one radius takes them with the next.
                    let hopeless = reason.contains(TOO_LONG);
                    fillet.reason = Some(reason);
                    if hopeless {
                        break;
                    }
                }
            }
            self.monitor.check()?;
        }
        Ok(None)
    }

    /// All fillets that passed alone; where these do not pass, as many as do, one after another.
    fn together(
        &self,
        passed: &[(&[u32], f64)],
        fillets: &mut [Fillet],
    ) -> Result<Option<Made>, CadError> {
        if let Ok(made) = self.rounded(passed) {
            return Ok(Some(made));
        }
        let mut made = None;
        let mut together = Vec::new();
        let alone = fillets.iter_mut().filter(|f| f.radius.is_some());
        for (fillet, one) in alone.zip(passed) {
            together.push(*one);
            match self.rounded(&together) {
                Ok(result) => made = Some(result),
                Err(_) => {
                    together.pop();
                    fillet.radius = None;
                    fillet.reason = Some(TOGETHER.to_owned());
                }
            }
            self.monitor.check()?;
        }
        Ok(made)
    }

    /// Sharp inner edges between fitted body and non-design bodies, those together that run on smoothly, longest first.
    fn contours(&self) -> Result<Vec<Vec<u32>>, OcctError> {
        let mut seen = vec![false; self.edges.len()];
        let mut out = Vec::new();
        for e in 0..self.edges.len() {
            if seen[e] || !sharp_between(&self.edges[e], &self.solid.sources) {
                continue;
            }
            let contour = self.solid.shape.fillet_contour(e as u32)?;
            contour.iter().for_each(|k| seen[*k as usize] = true);
            seen[e] = true;
            if !contour.is_empty() {
                out.push(contour);
            }
        }
        out.sort_by(|a, b| self.length(b).total_cmp(&self.length(a)));
        Ok(out)
    }

    fn length(&self, contour: &[u32]) -> f64 {
        contour.iter().map(|e| self.edges[*e as usize].length).sum()
    }

    fn described(&self, contour: &[u32]) -> Fillet {
        let edges = contour.iter().map(|e| &self.edges[*e as usize]);
        let longest = edges.max_by(|a, b| a.length.total_cmp(&b.length));
        Fillet {
            place: longest.map_or_else(Vec3::zeros, |e| e.middle.into()),
            length: self.length(contour),
            ..Fillet::default()
        }
    }

    /// What fillets of these radii add by the lengths and angles of their edges, mm3.
    fn expected(&self, contour: &[u32], radius: f64) -> f64 {
        let section = |e: &u32| {
            let edge = &self.edges[*e as usize];
            let half = edge.angle.unwrap_or(0.0) / 2.0;
            edge.length * radius * radius * (half.tan() - half)
        };
        contour.iter().map(section).sum()
    }

    /// The part with fillets, and its volume, when it passes all checks.
    fn rounded(&self, contours: &[(&[u32], f64)]) -> Result<Made, String> {
        let text = |e: OcctError| e.0;
        let starts: Vec<(u32, f64)> = contours.iter().map(|(c, r)| (c[0], *r)).collect();
        let stop = || self.monitor.check().is_err();
        let shape = &self.solid.shape;
        let seconds = self.seconds * contours.len() as f64;
        let made = shape.fillet(&starts, seconds, &stop).map_err(text)?;
        self.checked(&made.shape)?;
        let volume = made.shape.volume(VOLUME_EPS).map_err(text)?;
        let added = volume - self.solid.volume;
        let expected: f64 = contours.iter().map(|(c, r)| self.expected(c, *r)).sum();
        if added < ADDS[0] * expected || added > ADDS[1] * expected {
            return Err(format!(
                "it would add {added:.2} mm3, its length and angles say {expected:.2} mm3"
            ));
        }
        Ok((made, volume))
    }

    fn checked(&self, shape: &Shape) -> Result<(), String> {
        let text = |e: OcctError| e.0;
        if let Some(fault) = shape.faults().map_err(text)? {
            return Err(format!("BRepCheck: {fault}"));
        }
        let counts = shape.counts().map_err(text)?;
        let genus = inspect::genus(&counts);
        if counts.bad_edges > 0
            || counts.solids as usize != self.solid.bodies
            || genus != self.solid.genus
        {
            return Err(format!(
                "it gives {} bodies and {genus} tunnels instead of {} and {}, {} open edges",
                counts.solids, self.solid.bodies, self.solid.genus, counts.bad_edges
            ));
        }
        let tolerance = shape.max_tolerance().map_err(text)?;
        if tolerance > MAX_TOLERANCE {
            return Err(format!("its tolerance is {tolerance:.1e} mm"));
        }
        Ok(())
    }
}
