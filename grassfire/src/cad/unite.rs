//! The union of fitted body and non-design bodies: ways to make it, and the checks that it must pass.

use std::time::Instant;

use grassfire_occt::{BooleanResult, OcctError, Operation, Origin, Shape};
use rayon::prelude::*;

use super::body::{Body, single};
use super::build::{IDENTITY, VOLUME_EPS};
use super::reference::{self, Probe};
use super::{CadOptions, array, inspect};
use crate::Vec3;
use crate::monitor::Monitor;

/// Largest tolerance accepted in a part, mm.
pub(super) const MAX_TOLERANCE: f64 = 1e-2;
/// Chord (mm) and facet angle (radians) of the triangulation that is compared with the reference, on faces of bosses and bores.
const CHECK_MESH: [f64; 2] = [0.01, 0.2];
/// The same on the fitted body's faces: these only touch the regions that are compared, along edges of the others.
const COARSE_MESH: [f64; 2] = [0.05, 0.35];
/// Largest accepted share of a body's region that is missing or too much in that triangulation.
const REGION_TOLERANCE: f64 = 0.01;

/// Makes one boolean; what the gate is there to distrust. Takes what [`Shape::boolean`] takes.
pub(super) type Kernel<'a> = dyn Fn(
        &Shape,
        Operation,
        &Shape,
        f64,
        &(dyn Fn() -> bool + Sync),
    ) -> Result<BooleanResult, OcctError>
    + 'a;

/// The kernel's own boolean, with the common part.
pub(super) fn kernel(
    object: &Shape,
    operation: Operation,
    tool: &Shape,
    fuzzy: f64,
    interrupt: &(dyn Fn() -> bool + Sync),
) -> Result<BooleanResult, OcctError> {
    object.boolean(operation, tool, fuzzy, true, interrupt)
}

/// What is added and what is cut, and by what.
pub(super) struct Inputs<'a> {
    pub(super) bosses: Option<&'a Shape>,
    pub(super) tools: Option<&'a Shape>,
    pub(super) kernel: &'a Kernel<'a>,
}

/// What a face of a boolean's result is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Organic,
    Boss,
    Bore,
}

/// A union that passed its checks.
pub(super) struct United {
    /// The part.
    pub(super) shape: Shape,
    /// The fitted body that went into it.
    pub(super) organic: Shape,
    /// The same shape carrying a fine triangulation.
    pub(super) mesh_shape: Shape,
    /// What each face is.
    pub(super) kinds: Vec<Kind>,
    /// Volume, mm3.
    pub(super) volume: f64,
}

/// One way to make the union.
#[derive(Debug, Clone, Copy)]
pub(super) struct Attempt {
    pub(super) text: &'static str,
    /// Faces near the non-design bodies are single polynomials.
    pub(super) split: bool,
    larger_fuzzy: bool,
    /// The fitted body is moved by [`shift`].
    pub(super) shift: bool,
    one_by_one: bool,
}

/// The small move of the fitted body, along no axis, mm.
pub(super) fn shift(options: &CadOptions) -> Vec3 {
    Vec3::new(0.6, 0.48, 0.64) * options.shift
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
/// The ways to make the union, in the order in which they are tried.
pub(super) const ATTEMPTS: [Attempt; 6] = [
    PLAIN,
    Attempt {
        text: "union with a larger fuzzy value",
        larger_fuzzy: true,
        ..PLAIN
    },
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
    pub(super) fn run(
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
        let unite = |body: &Body| {
            let made = booleans(
                &body.shape,
                inputs,
                fuzzy,
                self.one_by_one,
                options,
                monitor,
            )?;
            made.checked(body, context)
        };
        if !self.shift {
            return unite(body);
        }
        let shape = body
            .shape
            .translated(array(shift(options)))
            .map_err(|e| e.0)?;
        unite(&Body {
            shape,
            face_volumes: Vec::new(),
            problems: Vec::new(),
            ..*body
        })
    }
}

/// Running result of the booleans.
struct Progress<'a> {
    kernel: &'a Kernel<'a>,
    shape: Shape,
    kinds: Vec<Kind>,
    commons: Vec<Shape>,
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
        } = (self.kernel)(&self.shape, operation, tool, self.fuzzy, self.interrupt)
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
            self.commons.push(common);
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

/// What the booleans of an attempt gave, not yet checked.
pub(super) struct Booleans {
    pub(super) shape: Shape,
    kinds: Vec<Kind>,
    /// What is common with the bosses, and with the tools.
    commons: [Vec<Shape>; 2],
    bosses: Option<Shape>,
}

/// Puts the bosses to the body and cuts the tools. Volumes take longer than that: [`Booleans::checked`] takes them.
pub(super) fn booleans(
    body: &Shape,
    inputs: &Inputs,
    fuzzy: f64,
    one_by_one: bool,
    options: &CadOptions,
    monitor: &Monitor,
) -> Result<Booleans, String> {
    let text = |e: OcctError| e.0;
    let start = Instant::now();
    let limit = options.boolean_seconds;
    let interrupt = move || monitor.check().is_err() || start.elapsed().as_secs_f64() > limit;
    let faces = body.counts().map_err(text)?.faces as usize;
    let mut at = Progress {
        kernel: inputs.kernel,
        shape: body.share().map_err(text)?,
        kinds: vec![Kind::Organic; faces],
        commons: Vec::new(),
        fuzzy,
        interrupt: &interrupt,
    };
    let mut commons = [Vec::new(), Vec::new()];
    for (k, (operation, tools)) in [
        (Operation::Fuse, inputs.bosses),
        (Operation::Cut, inputs.tools),
    ]
    .into_iter()
    .enumerate()
    {
        let Some(tools) = tools else { continue };
        if one_by_one {
            tools
                .solids()
                .map_err(text)?
                .iter()
                .try_for_each(|tool| at.apply(operation, tool))?;
        } else {
            at.apply(operation, tools)?;
        }
        commons[k] = std::mem::take(&mut at.commons);
    }
    let bosses = inputs.bosses.map(Shape::share).transpose().map_err(text)?;
    Ok(Booleans {
        shape: single(at.shape).map_err(text)?,
        kinds: at.kinds,
        commons,
        bosses,
    })
}

impl Booleans {
    /// The union when it passes all checks.
    pub(super) fn checked(self, body: &Body, context: &inspect::Context) -> Result<United, String> {
        let text = |e: OcctError| e.0;
        let Self {
            shape,
            kinds,
            commons,
            bosses,
        } = self;
        let volume_of = |shape: &Shape| body.volume_of(shape).map_err(text);
        let sum = |shapes: &[Shape]| shapes.iter().map(volume_of).sum::<Result<f64, String>>();
        let commons = [sum(&commons[0])?, sum(&commons[1])?];
        let bosses = bosses.map_or(Ok(0.0), |b| b.volume(VOLUME_EPS).map_err(text))?;
        let expected = body.volume + bosses - commons[0] - commons[1];
        gates(&shape, body.solids, context)?;
        let volume = volume_of(&shape)?;
        volumes(volume, expected, commons, context)?;
        let mesh_shape = shape.translated([0.0; 3]).map_err(text)?;
        regions(&mesh_shape, &kinds, context)?;
        Ok(United {
            shape,
            organic: body.shape.share().map_err(text)?,
            mesh_shape,
            kinds,
            volume,
        })
    }
}

/// What the kernel can check by itself.
fn gates(shape: &Shape, organic_solids: u32, context: &inspect::Context) -> Result<(), String> {
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
    Ok(())
}

/// Volume against inclusion-exclusion; volume, common part and removed part against the ray integrals.
fn volumes(
    volume: f64,
    expected: f64,
    commons: [f64; 2],
    context: &inspect::Context,
) -> Result<(), String> {
    let difference = ((volume - expected) / expected).abs();
    if difference.is_nan() || difference > IDENTITY {
        return Err(format!(
            "inclusion-exclusion gives {expected:.6} mm3, the union has {volume:.6} mm3"
        ));
    }
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
fn regions(shape: &Shape, kinds: &[Kind], context: &inspect::Context) -> Result<(), String> {
    let fine: Vec<u32> = (0..kinds.len() as u32)
        .filter(|f| kinds[*f as usize] != Kind::Organic)
        .collect();
    let mesh = shape
        .tessellate_finer(COARSE_MESH, &fine, CHECK_MESH)
        .map_err(|e| e.0)?;
    let mesh = reference::corners(&mesh);
    let compared: Vec<(f64, f64)> = context
        .probes
        .par_iter()
        .map(|probe| probe.compare(&mesh))
        .collect();
    for ((probe, body), (missing, extra)) in context.probes.iter().zip(context.bodies).zip(compared)
    {
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
#[path = "unite_tests.rs"]
mod tests;
