//! STEP and triangles of the finished part.

use std::path::Path;

use grassfire_occt::{OcctError, StepTexts};

use super::build::{CadSolid, FaceSource};
use super::{CadError, StepOptions};
use crate::mesh::TriMesh;

/// Angle between neighbouring facets, radians.
const FACET: f64 = 0.35;

/// Writes the part as STEP AP242 in mm, faces named by where they come from.
///
/// The file appears under its name only when it is complete: it is written beside it and then renamed. Equal parts give
/// equal files but for the time stamp.
///
/// # Errors
/// [`CadError::Write`].
pub fn write_step(solid: &CadSolid, path: &Path, options: &StepOptions) -> Result<(), CadError> {
    let fail = |text: String| CadError::Write {
        path: path.display().to_string(),
        text,
    };
    let folder = path
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".part-").suffix(".step");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // As any new file: less what the umask forbids.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let file = builder
        .tempfile_in(folder)
        .map_err(|e| fail(e.to_string()))?
        .into_temp_path();
    let names = solid
        .non_design
        .iter()
        .map(|n| n.name.as_str())
        .collect::<Vec<_>>();
    let texts = StepTexts {
        product: options.product.clone(),
        author: options.author.clone(),
        organization: options.organization.clone(),
        system: format!("grassfire {}", env!("CARGO_PKG_VERSION")),
        description: if solid.valid {
            "solid reconstructed by grassfire".into()
        } else {
            "NOT VALID: see the report of grassfire".into()
        },
        time_stamp: options.time_stamp.clone(),
        solids: solid_names(solid, &options.product),
        faces: solid
            .sources
            .iter()
            .map(|s| face_name(*s, &names))
            .collect(),
    };
    solid
        .shape
        .write_step(&file, &texts)
        .map_err(|OcctError(text)| fail(text))?;
    file.persist(path).map_err(|e| fail(e.to_string()))
}

fn solid_names(solid: &CadSolid, product: &str) -> Vec<String> {
    match solid.bodies {
        1 => vec![product.to_owned()],
        n => (1..=n).map(|i| format!("{product} {i}")).collect(),
    }
}

fn face_name(source: FaceSource, names: &[&str]) -> String {
    let body = |i: u32| names.get(i as usize).copied().unwrap_or("non-design");
    match source {
        FaceSource::Organic => "organic".into(),
        FaceSource::Body(i) => body(i).into(),
        FaceSource::Bore(i, k) => format!("{} bore {}", body(i), k + 1),
    }
}

/// Chords that are tried when the kernel cannot triangulate a face with the first, as multiples of it.
const CHORDS: [f64; 5] = [1.0, 0.6, 0.3, 1.5, 2.5];

/// Triangles within `chord` mm of the part, watertight. Tags: 0 for the fitted body, 1 + index for a non-design body.
///
/// Where the kernel cannot triangulate a face with that chord, finer ones are tried, then ones up to 2.5 times as coarse.
///
/// # Errors
/// [`CadError::Kernel`] when a face cannot be triangulated with any of them.
pub fn tessellate(solid: &CadSolid, chord: f64) -> Result<TriMesh, CadError> {
    // Of a copy: triangles that an earlier try has left stay otherwise.
    let of = |factor: &f64| {
        let copy = solid.shape.translated([0.0; 3])?;
        copy.tessellate(chord * factor, FACET)
    };
    let mut mesh = of(&CHORDS[0]);
    for factor in &CHORDS[1..] {
        if mesh.is_ok() {
            break;
        }
        mesh = of(factor).or(mesh);
    }
    let mesh = mesh?;
    let tag = |f: &u32| match solid.sources.get(*f as usize) {
        Some(FaceSource::Body(i) | FaceSource::Bore(i, _)) => i + 1,
        _ => 0,
    };
    Ok(TriMesh {
        points: mesh.points.iter().map(|p| (*p).into()).collect(),
        tags: mesh.faces.iter().map(tag).collect(),
        triangles: mesh.triangles,
    })
}
