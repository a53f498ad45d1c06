//! Files and triangles of the finished part.

use std::fs::File;
use std::path::{Path, PathBuf};

use grassfire_occt::{OcctError, Shape, StepTexts, Triangulation};

use super::build::{CadSolid, FaceSource, VOLUME_EPS};
use super::non_design::NonDesignBody;
use super::{CadError, StepOptions, names};
use crate::io::atomic_write;
use crate::mesh::TriMesh;

/// Angle between neighbouring facets, radians.
const FACET: f64 = 0.35;
/// Largest relative difference of volume between a part and its BREP file, which holds the same numbers.
const BREP_VOLUME: f64 = 1e-6;
/// The same for IGES, whose surfaces and trimming curves are translated.
const IGES_VOLUME: f64 = 1e-4;

/// Writes the part as STEP AP242 in mm.
///
/// 1. One solid is one product; several solids are an assembly of products, named by the body that they come from.
/// 2. Every face is named by where it comes from (`organic`, `boss 3: wall`, `boss 3: bore`) and coloured by body.
/// 3. The header holds author, organization and description; the accuracy is the part's largest tolerance.
///
/// The file appears under its name only when it is complete. Equal parts give equal files but for the time stamp.
///
/// # Errors
/// [`CadError::Write`], [`CadError::File`].
pub fn write_step(solid: &CadSolid, path: &Path, options: &StepOptions) -> Result<(), CadError> {
    let texts = texts(solid, options)?;
    by_kernel(path, "part.step", |file| {
        solid.shape.write_step(file, &texts)
    })
}

/// Writes the part in OpenCASCADE's own format and reads it again.
///
/// # Errors
/// [`CadError::Write`], also when the file does not give the part's solids and volume back; [`CadError::File`].
pub fn write_brep(solid: &CadSolid, path: &Path) -> Result<(), CadError> {
    by_kernel(path, "part.brep", |file| {
        solid.shape.write_brep(file)?;
        compare(solid, &Shape::read_brep(file)?, BREP_VOLUME)
    })
}

/// Writes the part as IGES 5.3 in mm (manifold solids, faces without names) and reads it again.
///
/// # Errors
/// As [`write_brep`].
pub fn write_iges(solid: &CadSolid, path: &Path, options: &StepOptions) -> Result<(), CadError> {
    let texts = StepTexts {
        time_stamp: iges_time(&options.time_stamp),
        ..texts(solid, options)?
    };
    by_kernel(path, "part.igs", |file| {
        solid.shape.write_iges(file, &texts)?;
        compare(solid, &Shape::read_iges(file)?, IGES_VOLUME)
    })
}

/// Name of the fitted body's file among the pieces.
pub const ORGANIC_PIECE: &str = "organic.step";

/// Name of a non-design body's file among the pieces; bodies count from 0.
pub fn piece_name(body: usize) -> String {
    format!("body-{:02}.step", body + 1)
}

/// Writes what the part was united from: the fitted body and every non-design body with its bores filled, one STEP file
/// each. Together with the bores of [`CadSolid::non_design`] they give the part again.
///
/// # Errors
/// [`CadError::Write`], [`CadError::File`].
pub fn write_pieces(
    solid: &CadSolid,
    bodies: &[NonDesignBody],
    folder: &Path,
    options: &StepOptions,
) -> Result<(), CadError> {
    std::fs::create_dir_all(folder).map_err(|e| CadError::Write {
        path: folder.display().to_string(),
        text: e.to_string(),
    })?;
    let write = |shape: &Shape, file: &str, name: &str| {
        let texts = StepTexts {
            product: name.to_owned(),
            solids: vec![name.to_owned()],
            description: "piece of a part reconstructed by grassfire; bores are filled".into(),
            ..header(options)
        };
        by_kernel(&folder.join(file), file, |path| {
            shape.write_step(path, &texts)
        })
    };
    write(&solid.organic, ORGANIC_PIECE, "organic body")?;
    bodies
        .iter()
        .enumerate()
        .try_for_each(|(i, body)| write(&body.boss, &piece_name(i), &body.name))
}

/// The kernel writes to a folder of its own; what it wrote goes to `path` whole or not at all.
pub(super) fn by_kernel(
    path: &Path,
    name: &str,
    write: impl FnOnce(&Path) -> Result<(), OcctError>,
) -> Result<(), CadError> {
    let fail = |text: String| CadError::Write {
        path: path.display().to_string(),
        text,
    };
    let folder = tempfile::tempdir().map_err(|e| fail(e.to_string()))?;
    let file: PathBuf = folder.path().join(name);
    write(&file).map_err(|OcctError(text)| fail(text))?;
    let mut from = File::open(&file).map_err(|e| fail(e.to_string()))?;
    Ok(atomic_write(path, |out| {
        std::io::copy(&mut from, out).map(|_| ())
    })?)
}

/// An error when a file does not give the part's solids and volume back.
fn compare(solid: &CadSolid, back: &Shape, limit: f64) -> Result<(), OcctError> {
    let solids = back.counts()?.solids as usize;
    if solids != solid.bodies {
        return Err(OcctError(format!(
            "read again, the file has {solids} solids instead of {}",
            solid.bodies
        )));
    }
    let volume = back.volume(VOLUME_EPS)?;
    let off = (volume / solid.volume - 1.0).abs();
    if off.is_nan() || off > limit {
        return Err(OcctError(format!(
            "read again, the file has {volume:.6} mm3 instead of {:.6} mm3",
            solid.volume
        )));
    }
    Ok(())
}

pub(super) fn texts(solid: &CadSolid, options: &StepOptions) -> Result<StepTexts, CadError> {
    let product = options.product();
    let (faces, colors) = names::faces(solid)?;
    let state = if solid.valid {
        "solid reconstructed by grassfire"
    } else {
        "NOT VALID: see the report of grassfire"
    };
    let description = match options.description.trim() {
        "" => state.to_owned(),
        own if solid.valid => own.to_owned(),
        own => format!("{own} ({state})"),
    };
    Ok(StepTexts {
        solids: names::solids(solid, product)?,
        product: product.to_owned(),
        description,
        faces,
        colors,
        ..header(options)
    })
}

/// What all files of a run have in common.
fn header(options: &StepOptions) -> StepTexts {
    StepTexts {
        author: options.author.clone(),
        organization: options.organization.clone(),
        system: format!("grassfire {}", env!("CARGO_PKG_VERSION")),
        time_stamp: options.time_stamp.clone(),
        ..StepTexts::default()
    }
}

/// `2026-01-31T12:00:00` as IGES has it: `20260131.120000`. Anything else is no time: now.
fn iges_time(iso: &str) -> String {
    let digits: String = iso.chars().filter(char::is_ascii_digit).take(14).collect();
    match digits.split_at_checked(8) {
        Some((day, time)) if time.len() == 6 => format!("{day}.{time}"),
        _ => String::new(),
    }
}

/// Chords that are tried when the kernel cannot triangulate a face with the first, as multiples of it.
const CHORDS: [f64; 5] = [1.0, 0.6, 0.3, 1.5, 2.5];

/// Triangles within `chord` mm of a shape.
///
/// Where the kernel cannot triangulate a face with that chord, finer ones are tried, then ones up to 2.5 times as coarse.
fn triangles(shape: &Shape, chord: f64) -> Result<Triangulation, OcctError> {
    // Of a copy: triangles that an earlier try has left stay otherwise.
    let of = |factor: &f64| {
        let copy = shape.translated([0.0; 3])?;
        copy.tessellate(chord * factor, FACET)
    };
    let mut mesh = of(&CHORDS[0]);
    for factor in &CHORDS[1..] {
        if mesh.is_ok() {
            break;
        }
        mesh = of(factor).or(mesh);
    }
    mesh
}

/// Triangles within `chord` mm of the part, watertight; up to 2.5 times as coarse where the kernel needs that. Tags: 0 for
/// the fitted body, 1 + index for a non-design body.
///
/// # Errors
/// [`CadError::Kernel`] when a face cannot be triangulated with any of them.
pub fn tessellate(solid: &CadSolid, chord: f64) -> Result<TriMesh, CadError> {
    let mesh = triangles(&solid.shape, chord)?;
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

/// As [`tessellate`], each solid with its name and without tags.
///
/// # Errors
/// [`CadError::Kernel`] when a face cannot be triangulated.
pub fn tessellate_solids(
    solid: &CadSolid,
    chord: f64,
    options: &StepOptions,
) -> Result<Vec<(String, TriMesh)>, CadError> {
    let names = names::solids(solid, options.product())?;
    let mut out = Vec::with_capacity(names.len());
    for (name, part) in names.into_iter().zip(solid.shape.solids()?) {
        let mesh = triangles(&part, chord)?;
        out.push((
            name,
            TriMesh {
                points: mesh.points.iter().map(|p| (*p).into()).collect(),
                tags: Vec::new(),
                triangles: mesh.triangles,
            },
        ));
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::iges_time;

    #[test]
    fn time_stamps_of_iges() {
        assert_eq!(iges_time("2026-01-31T12:34:56"), "20260131.123456");
        assert_eq!(iges_time("2026-01-31T12:34:56+01:00"), "20260131.123456");
        assert_eq!(iges_time("yesterday"), "");
        assert_eq!(iges_time(""), "");
    }
}
