//! Faces of a STEP file as places for supports and loads.

use std::fmt;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::CaseError;
use crate::Vec3;
use crate::io::IoError;
use crate::mesh::TriMesh;

/// How far a face may be from what is asked for: its area by a share, its middle by a share of the root of the area, its
/// normal by a length.
const SAME: f64 = 0.05;

/// What a face looks like. Numbers of faces change whenever CAD writes a file anew; this does not.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FaceLike {
    /// Area, mm2.
    pub area: f64,
    /// Its centre of area, mm; for a bore that is a point of the axis.
    pub middle: [f64; 3],
    /// Mean outward normal; zero all around a bore.
    pub normal: [f64; 3],
}

/// As it stands in a project file.
impl fmt::Display for FaceLike {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        // No "-0.0000".
        let rounded = |v: f64| (1e4 * v).round() / 1e4 + 0.0;
        let vector = |v: [f64; 3]| {
            let [x, y, z] = v.map(rounded);
            format!("[{x:.4}, {y:.4}, {z:.4}]")
        };
        let (middle, normal) = (vector(self.middle), vector(self.normal));
        write!(
            f,
            "{{ area = {:.4}, middle = {middle}, normal = {normal} }}",
            self.area
        )
    }
}

/// A face of a STEP file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StepFace {
    /// Kind of surface.
    pub surface: &'static str,
    /// What it looks like.
    pub like: FaceLike,
    /// Its name; may be empty.
    pub name: String,
    /// Its colour, such as `#ff8000`.
    pub colour: Option<String>,
}

/// What is asked for: faces that look like one of some, and all of a name or a colour.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wanted<'a> {
    pub like: &'a [FaceLike],
    pub name: Option<&'a str>,
    pub colour: Option<&'a str>,
}

/// Colours as texts are six digits after a `#`.
pub(super) fn is_colour(text: &str) -> bool {
    let digits = text.strip_prefix('#');
    digits.is_some_and(|d| d.len() == 6 && d.chars().all(|c| c.is_ascii_hexdigit()))
}

/// The triangles of a STEP file, tagged with their faces, and the faces, in the order of the file.
///
/// # Errors
/// [`CaseError::Cad`]; [`CaseError::NoKernel`] in a program without one.
#[cfg(feature = "occt")]
pub fn step_faces(path: &Path) -> Result<(TriMesh, Vec<StepFace>), CaseError> {
    let (mesh, texts) = crate::cad::read_faces(path)?;
    let mut sums = vec![(0.0, Vec3::zeros(), Vec3::zeros()); texts.len()];
    for (t, &face) in mesh.tags.iter().enumerate() {
        let [a, b, c] = mesh.corners(t);
        let area = (b - a).cross(&(c - a)) / 2.0;
        if let Some((sum, middle, normal)) = sums.get_mut(face as usize) {
            *sum += area.norm();
            *middle += (a + b + c) / 3.0 * area.norm();
            *normal += area;
        }
    }
    let faces = texts
        .into_iter()
        .zip(sums)
        .map(|(text, (area, middle, normal))| {
            let area_or_one = if area > 0.0 { area } else { 1.0 };
            StepFace {
                surface: text.surface,
                like: FaceLike {
                    area,
                    middle: (middle / area_or_one).into(),
                    normal: (normal / area_or_one).into(),
                },
                name: text.name,
                colour: text
                    .colour
                    .map(|[r, g, b]| format!("#{r:02x}{g:02x}{b:02x}")),
            }
        });
    let faces = faces.collect();
    Ok((mesh, faces))
}

/// Needs the feature `occt`.
///
/// # Errors
/// [`CaseError::NoKernel`].
#[cfg(not(feature = "occt"))]
pub fn step_faces(path: &Path) -> Result<(TriMesh, Vec<StepFace>), CaseError> {
    Err(CaseError::NoKernel {
        key: "step_face".to_owned(),
        path: path.display().to_string(),
    })
}

/// The triangles of the faces of a STEP file that are asked for.
///
/// # Errors
/// As [`step_faces`]; [`CaseError::MissingFile`]; [`CaseError::NoFace`] names the nearest one.
pub(super) fn chosen(path: &Path, key: &str, wanted: Wanted) -> Result<TriMesh, CaseError> {
    if let Err(source) = std::fs::metadata(path) {
        let file = path.display().to_string();
        return Err(CaseError::MissingFile {
            key: key.to_owned(),
            path: file.clone(),
            source: Box::new(IoError::Open { file, source }),
        });
    }
    let (mut mesh, faces) = step_faces(path)?;
    let mut held = vec![false; faces.len()];
    for like in wanted.like {
        let measured = faces
            .iter()
            .enumerate()
            .map(|(i, f)| (i, unlike(&f.like, like)));
        let best = measured.min_by(|a, b| a.1.total_cmp(&b.1));
        match best {
            Some((i, off)) if off <= SAME => held[i] = true,
            best => {
                let nearest = best.map(|(i, _)| faces[i].like.to_string());
                return Err(CaseError::NoFace {
                    key: key.to_owned(),
                    path: path.display().to_string(),
                    wanted: like.to_string(),
                    there: nearest.unwrap_or_default(),
                });
            }
        }
    }
    for (held, face) in held.iter_mut().zip(&faces) {
        let same = |colour: &str| {
            face.colour
                .as_ref()
                .is_some_and(|c| c.eq_ignore_ascii_case(colour))
        };
        *held |=
            wanted.name.is_some_and(|name| name == face.name) || wanted.colour.is_some_and(same);
    }
    if !held.contains(&true) {
        let names: Vec<&str> = faces
            .iter()
            .map(|f| f.name.as_str())
            .filter(|n| !n.is_empty())
            .collect();
        return Err(CaseError::NoFace {
            key: key.to_owned(),
            path: path.display().to_string(),
            wanted: [wanted.name, wanted.colour]
                .into_iter()
                .flatten()
                .collect::<Vec<_>>()
                .join(" or "),
            there: if names.is_empty() {
                "none of its faces has a name".to_owned()
            } else {
                names.join(", ")
            },
        });
    }
    let tags = std::mem::take(&mut mesh.tags);
    let mut tags = tags.iter();
    mesh.triangles.retain(|_| {
        tags.next()
            .is_some_and(|&f| held.get(f as usize) == Some(&true))
    });
    Ok(mesh)
}

/// How little two faces are alike: 0 when they are the same.
fn unlike(a: &FaceLike, b: &FaceLike) -> f64 {
    let size = a.area.max(b.area).max(f64::MIN_POSITIVE);
    let apart = |a: [f64; 3], b: [f64; 3]| (Vec3::from(a) - Vec3::from(b)).norm();
    let area = (a.area - b.area).abs() / size;
    let middle = apart(a.middle, b.middle) / size.sqrt();
    area.max(middle).max(apart(a.normal, b.normal))
}

#[cfg(all(test, feature = "occt"))]
mod tests {
    use grassfire_occt::{Operation, Shape, StepTexts};

    use super::*;

    /// A block of 20 x 10 x 5 mm with a bore of 6 mm.
    fn block(folder: &Path) -> std::path::PathBuf {
        let block = Shape::cuboid([0.0; 3], [20.0, 10.0, 5.0]).unwrap();
        let pin = Shape::cylinder([8.0, 5.0, -1.0], [0.0, 0.0, 1.0], 3.0, 7.0).unwrap();
        let part = block
            .boolean(Operation::Cut, &pin, 1e-6, false, &|| false)
            .unwrap()
            .shape;
        let faces = part.faces().unwrap();
        let is_bore =
            |f: &grassfire_occt::Face| f.normal[2].abs() < 0.5 && f.area > 90.0 && f.area < 95.0;
        let path = folder.join("block.step");
        let texts = StepTexts {
            faces: faces
                .iter()
                .map(|f| {
                    if is_bore(f) {
                        "bore".into()
                    } else {
                        String::new()
                    }
                })
                .collect(),
            colors: faces
                .iter()
                .map(|f| {
                    if f.normal[2] > 0.5 {
                        [255, 128, 0]
                    } else {
                        [90, 90, 90]
                    }
                })
                .collect(),
            ..StepTexts::default()
        };
        part.write_step(&path, &texts).unwrap();
        path
    }

    #[test]
    fn faces_are_found_by_likeness_name_and_colour() {
        let folder = tempfile::tempdir().unwrap();
        let path = block(folder.path());
        let (_, faces) = step_faces(&path).unwrap();
        assert_eq!(faces.len(), 7);
        let area = |wanted: Wanted| chosen(&path, "select", wanted).map(|mesh| mesh.area());
        let none = Wanted {
            like: &[],
            name: None,
            colour: None,
        };
        let bore = std::f64::consts::TAU * 3.0 * 5.0;
        let named = area(Wanted {
            name: Some("bore"),
            ..none
        })
        .unwrap();
        assert!((named / bore - 1.0).abs() < 0.01, "{named}");
        let top = area(Wanted {
            colour: Some("#FF8000"),
            ..none
        })
        .unwrap();
        assert!(
            (top / (200.0 - 9.0 * std::f64::consts::PI) - 1.0).abs() < 0.01,
            "{top}"
        );
        // A little off, as after a change of the part.
        let left = FaceLike {
            area: 51.0,
            middle: [0.1, 5.0, 2.6],
            normal: [-1.0, 0.0, 0.0],
        };
        let found = area(Wanted {
            like: std::slice::from_ref(&left),
            ..none
        })
        .unwrap();
        assert!((found - 50.0).abs() < 1e-9);
        let gone = FaceLike { area: 70.0, ..left };
        let error = area(Wanted {
            like: &[gone],
            ..none
        })
        .unwrap_err();
        let text = error.to_string();
        assert!(text.contains("70.0") && text.contains("50.0"), "{text}");
        let error = area(Wanted {
            name: Some("boss"),
            ..none
        })
        .unwrap_err();
        assert!(error.to_string().contains("bore"), "{error}");
        assert!(error.hint().is_some_and(|h| h.contains("grassfire faces")));
    }
}
