//! The fitted body as solids of the kernel, made directly from its B-rep.

use grassfire_occt::{BrepDescription, OcctError, Shape};

use super::build::{IDENTITY, VOLUME_EPS};
use super::{CadError, array, patches, shells};
use crate::Vec3;
use crate::spline::Brep;

/// The fitted body's solids, not checked.
pub(super) struct Built {
    pub(super) shape: Shape,
    solids: u32,
}

/// The fitted body as solids.
pub(super) struct Body {
    pub(super) shape: Shape,
    pub(super) solids: u32,
    pub(super) volume: f64,
    /// What each face adds to the volume, mm3; empty when the shape was moved since.
    pub(super) face_volumes: Vec<f64>,
    pub(super) problems: Vec<String>,
}

impl Built {
    pub(super) fn new(brep: &Brep) -> Result<Self, CadError> {
        patches::check(brep).map_err(|text| CadError::BadBrep { text })?;
        let solids = shells::classify(brep)?;
        Ok(Self {
            shape: Shape::from_brep(&describe(brep, &solids))?,
            solids: solids.len() as u32,
        })
    }

    /// What the kernel, the edges' faces and the volume say of it.
    pub(super) fn checked(self, brep: &Brep) -> Result<Body, CadError> {
        let Self { shape, solids } = self;
        let face_volumes = shape.face_volumes(VOLUME_EPS, None)?;
        let volume = face_volumes.iter().sum::<f64>();
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
        Ok(Body {
            shape,
            solids,
            volume,
            face_volumes,
            problems,
        })
    }
}

impl Body {
    /// Volume of a shape made from this body by booleans, mm3: faces that they left alone keep what they add.
    pub(super) fn volume_of(&self, shape: &Shape) -> Result<f64, OcctError> {
        let known = Some((&self.shape, self.face_volumes.as_slice()));
        Ok(shape.face_volumes(VOLUME_EPS, known)?.iter().sum())
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
pub(super) fn single(shape: Shape) -> Result<Shape, OcctError> {
    let mut solids = shape.solids()?;
    Ok(if solids.len() == 1 {
        solids.swap_remove(0)
    } else {
        shape
    })
}
