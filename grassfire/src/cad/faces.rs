//! The faces of a STEP file, one by one.

use std::path::Path;

use grassfire_occt::{Shape, Surface, step_contents};

use super::CadError;
use crate::Vec3;
use crate::mesh::TriMesh;

/// Chord (mm) and angle of neighbouring facets (radians) of the triangles.
const CHORD: f64 = 0.02;
const FACET: f64 = 0.2;

/// What a STEP file says of a face.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct FaceText {
    /// Kind of surface.
    pub surface: &'static str,
    /// Its name; empty when it has none, or the file is an assembly.
    pub name: String,
    /// Its colour or that of its solid.
    pub colour: Option<[u8; 3]>,
}

/// The triangles of a STEP file, mm, tagged with the face that they are of, and what the file says of the faces.
///
/// # Errors
/// [`CadError::Unreadable`], [`CadError::Kernel`].
pub fn read_faces(path: &Path) -> Result<(TriMesh, Vec<FaceText>), CadError> {
    let unreadable = |text: String| CadError::Unreadable {
        path: path.display().to_string(),
        text,
    };
    let shape = Shape::read_step(path).map_err(|e| unreadable(e.0))?;
    let faces = shape.faces()?;
    let contents = step_contents(path).map_err(|e| unreadable(e.0))?;
    // Parts of an assembly are told once, however often they stand in it.
    let told = contents.faces.len() == faces.len();
    let text = |(i, face): (usize, &grassfire_occt::Face)| FaceText {
        surface: match face.surface {
            Surface::Plane => "plane",
            Surface::Cylinder { .. } => "cylinder",
            Surface::Cone { .. } => "cone",
            Surface::Sphere { .. } => "sphere",
            Surface::Torus { .. } => "torus",
            Surface::Free => "free",
        },
        name: if told {
            contents.faces[i].clone()
        } else {
            String::new()
        },
        colour: contents.colors.get(i).copied().flatten().filter(|_| told),
    };
    let texts = faces.iter().enumerate().map(text).collect();
    let triangles = shape.tessellate(CHORD, FACET)?;
    let mesh = TriMesh {
        points: triangles.points.into_iter().map(Vec3::from).collect(),
        triangles: triangles.triangles,
        tags: triangles.faces,
    };
    Ok((mesh, texts))
}
