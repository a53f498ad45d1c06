//! Pictures of a part with the places of what the foundry's sheet finds.

use super::conditions::VIEWS;
use super::{Camera, PictureSize, RenderError, Scene, SceneLabel, SceneMesh, render};
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::report::Picture;

const PART: [u8; 3] = [176, 190, 208];

/// Pictures of a part from two opposite sides with the numbers of the findings at their places; none without findings.
///
/// # Errors
/// [`RenderError`] when a picture could not be made.
pub fn findings(
    mesh: &TriMesh,
    places: &[Vec3],
    size: PictureSize,
) -> Result<Vec<Picture>, RenderError> {
    if places.is_empty() {
        return Ok(Vec::new());
    }
    let labels = places.iter().zip(1..).map(|(place, number)| SceneLabel {
        place: *place,
        text: format!("{number}"),
    });
    let scene = Scene {
        meshes: vec![SceneMesh::triangles(&mesh.points, &mesh.triangles, PART)],
        labels: labels.collect(),
        ..Scene::default()
    };
    let shoot = |&(azimuth, elevation, from): &(f64, f64, &str)| {
        let camera = Camera::looking(&mesh.points, azimuth, elevation);
        Ok(Picture {
            title: format!("Findings of the foundry's sheet, {from}"),
            caption: "Numbers as in the table; also of places behind the part.".to_owned(),
            png: render(&scene, &camera, size)?,
        })
    };
    VIEWS.iter().map(shoot).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::cuboid;

    #[test]
    fn findings_are_marked_in_both_pictures() {
        let mesh = cuboid(Vec3::zeros(), Vec3::new(40.0, 30.0, 20.0));
        let size = PictureSize {
            width: 160,
            height: 120,
        };
        assert!(findings(&mesh, &[], size).unwrap().is_empty());
        let one = findings(&mesh, &[Vec3::new(10.0, 10.0, 10.0)], size).unwrap();
        let other = findings(&mesh, &[Vec3::new(30.0, 10.0, 10.0)], size).unwrap();
        assert_eq!(one.len(), 2);
        assert!((0..2).all(|i| one[i].png != other[i].png));
    }
}
