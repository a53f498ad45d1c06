//! The ready-made views of every stage. All lengths in mm.

use std::collections::BTreeMap;

use super::{
    Camera, ColourMap, Colours, Legend, PictureSize, RenderError, Rgb, Scene, SceneMesh, Shading,
    render,
};
use crate::Vec3;
use crate::medial::MedialMesh;
use crate::mesh::TriMesh;
use crate::report::Picture;
use crate::skeleton::Skeleton;
use crate::spline::ControlMesh;

const STEEL: Rgb = [176, 190, 208];
const SAND: Rgb = [226, 186, 120];
const EDGE: Rgb = [70, 78, 92];
const RIM: Rgb = [20, 20, 24];
const SEAM: Rgb = [214, 30, 160];
const BEAM: Rgb = [214, 48, 39];

/// One camera and one size for all pictures of a part.
#[derive(Debug, Clone, Copy)]
pub struct Studio {
    /// Where all pictures are taken from.
    pub camera: Camera,
    /// Size of all pictures.
    pub size: PictureSize,
}

impl Studio {
    /// Chooses the camera for a part by its points.
    pub fn new(points: &[Vec3], size: PictureSize) -> Self {
        Self {
            camera: Camera::fit(points),
            size,
        }
    }

    fn shoot(&self, scene: &Scene, title: &str, caption: &str) -> Result<Picture, RenderError> {
        let png = render(scene, &self.camera, self.size)?;
        Ok(Picture {
            title: title.to_owned(),
            caption: caption.to_owned(),
            png,
        })
    }

    /// The remeshed proposal.
    pub fn proposal(&self, mesh: &TriMesh) -> Result<Picture, RenderError> {
        let scene = Scene {
            meshes: vec![smooth(mesh)],
            ..Scene::default()
        };
        self.shoot(
            &scene,
            "Proposal",
            "The cleaned, closed proposal after the voxel remesh.",
        )
    }

    /// Wall thickness: `feature_size` has one value in mm a point, the distance to the medial axis, which is half the
    /// wall.
    pub fn thickness(&self, mesh: &TriMesh, feature_size: &[f64]) -> Result<Picture, RenderError> {
        let walls: Vec<f64> = feature_size.iter().map(|r| 2.0 * r).collect();
        let legend = Legend::spanning("wall thickness, mm", &walls, ColourMap::Viridis);
        let scene = measured(smooth(mesh), &walls, legend);
        self.shoot(
            &scene,
            "Wall thickness",
            "Twice the distance from the surface to the medial axis.",
        )
    }

    /// The medial axis: sheets coloured by radius, curves red.
    pub fn medial(&self, medial: &MedialMesh) -> Result<Picture, RenderError> {
        let legend = Legend::spanning("radius, mm", &medial.radii, ColourMap::Viridis);
        let mesh = SceneMesh::triangles(&medial.points, &medial.triangles, STEEL);
        let mut scene = measured(mesh, &medial.radii, legend);
        scene.add_edges(&medial.points, &medial.edges, BEAM, 2.5);
        self.shoot(
            &scene,
            "Medial axis",
            "Sheets coloured by the radius of the inscribed sphere; curves red.",
        )
    }

    /// The quad skeleton: rims black, seams magenta, beams red, quads coloured by radius.
    pub fn skeleton(&self, skeleton: &Skeleton) -> Result<Picture, RenderError> {
        let legend = Legend::spanning("radius, mm", &skeleton.radii, ColourMap::Viridis);
        let mesh = SceneMesh::quads(&skeleton.points, &skeleton.quads, STEEL);
        let mut scene = measured(mesh, &skeleton.radii, legend);
        for (edge, uses) in quad_edges(&skeleton.quads) {
            let (colour, width) = match uses {
                1 => (RIM, 2.5),
                2 => (EDGE, 1.2),
                _ => (SEAM, 3.5),
            };
            scene.add_edges(&skeleton.points, &[edge], colour, width);
        }
        scene.add_edges(&skeleton.points, &skeleton.beams, BEAM, 4.0);
        let caption = "Quads coloured by radius; rims black, seams magenta, beams red.";
        self.shoot(&scene, "Quad skeleton", caption)
    }

    /// The thickened body: control mesh with its quad edges.
    pub fn body(&self, body: &ControlMesh) -> Result<Picture, RenderError> {
        let mesh = SceneMesh {
            shading: Shading::Flat,
            ..SceneMesh::quads(&body.points, &body.quads, STEEL)
        };
        let mut scene = Scene {
            meshes: vec![mesh],
            ..Scene::default()
        };
        let edges: Vec<[u32; 2]> = quad_edges(&body.quads).into_keys().collect();
        scene.add_edges(&body.points, &edges, EDGE, 1.2);
        self.shoot(
            &scene,
            "Body",
            "Control mesh of the thickened and fitted body.",
        )
    }

    /// The final solid with its face borders. `mesh.tags` holds the face of every triangle; faces in `non_design` are
    /// drawn in another colour.
    pub fn solid(&self, mesh: &TriMesh, non_design: &[u32]) -> Result<Picture, RenderError> {
        let given: std::collections::BTreeSet<u32> = non_design.iter().copied().collect();
        let colour = |t: usize| {
            if mesh.tags.get(t).is_some_and(|f| given.contains(f)) {
                SAND
            } else {
                STEEL
            }
        };
        let colours = Colours::Triangles((0..mesh.triangles.len()).map(colour).collect());
        let mut scene = Scene {
            meshes: vec![SceneMesh {
                colours,
                ..smooth(mesh)
            }],
            ..Scene::default()
        };
        scene.add_edges(&mesh.points, &face_borders(mesh), EDGE, 1.2);
        let caption = match non_design.is_empty() {
            true => "The CAD solid with the borders of its faces.",
            false => {
                "The CAD solid with the borders of its faces; non-design bodies sand-coloured."
            }
        };
        self.shoot(&scene, "Solid", caption)
    }

    /// Size of the displacement under a load case, one value in mm a point.
    pub fn displacement(
        &self,
        mesh: &TriMesh,
        values: &[f64],
        case: &str,
    ) -> Result<Picture, RenderError> {
        let legend = Legend::spanning("displacement, mm", values, ColourMap::Viridis);
        let scene = measured(smooth(mesh), values, legend);
        let caption = format!("Size of the displacement under the loads of {case:?}.");
        self.shoot(&scene, "Displacement", &caption)
    }

    /// Von Mises stress at the surface, one value in MPa a point; the scale ends at the 99 % value.
    pub fn stress(&self, mesh: &TriMesh, values: &[f64]) -> Result<Picture, RenderError> {
        let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let most = sorted.get(sorted.len() * 99 / 100).copied().unwrap_or(1.0);
        let legend = Legend::spanning("von Mises, MPa", &[0.0, most], ColourMap::Viridis);
        let scene = measured(smooth(mesh), values, legend);
        let caption = "Von Mises stress in the voxels that the surface cuts, largest over the load cases: a view of where it is high, rough in size.";
        self.shoot(&scene, "Stress", caption)
    }

    /// Signed distance from the solid to the proposal, one value in voxels a point; the scale is -1..1 voxel. NaN, where
    /// the proposal is not the reference, is grey.
    pub fn error(&self, mesh: &TriMesh, voxels: &[f64]) -> Result<Picture, RenderError> {
        let legend = Legend::symmetric("distance, voxels", 1.0);
        let scene = measured(smooth(mesh), voxels, legend);
        let caption = if voxels.iter().any(|d| d.is_nan()) {
            "Distance from the solid to the proposal: red outside it, blue inside it; grey near non-design bodies."
        } else {
            "Distance from the solid to the proposal: red outside it, blue inside it."
        };
        self.shoot(&scene, "Deviation", caption)
    }
}

/// A mesh coloured by one value a point.
fn measured(mesh: SceneMesh, values: &[f64], legend: Legend) -> Scene {
    let colours = values.iter().map(|value| legend.colour(*value)).collect();
    Scene {
        meshes: vec![SceneMesh {
            colours: Colours::Points(colours),
            ..mesh
        }],
        legend: Some(legend),
        ..Scene::default()
    }
}

fn smooth(mesh: &TriMesh) -> SceneMesh {
    SceneMesh::triangles(&mesh.points, &mesh.triangles, STEEL)
}

/// Edges of quads with the number of quads that use them.
fn quad_edges(quads: &[[u32; 4]]) -> BTreeMap<[u32; 2], usize> {
    let mut edges = BTreeMap::new();
    for quad in quads {
        for k in 0..4 {
            let (a, b) = (quad[k], quad[(k + 1) % 4]);
            *edges.entry([a.min(b), a.max(b)]).or_insert(0) += 1;
        }
    }
    edges
}

/// Edges between triangles with different tags, and edges with one triangle.
fn face_borders(mesh: &TriMesh) -> Vec<[u32; 2]> {
    let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(mesh.triangles.len() * 3);
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let tag = mesh.tags.get(t).copied().unwrap_or(0);
        for k in 0..3 {
            let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
            edges.push(([a.min(b), a.max(b)], tag));
        }
    }
    edges.sort_unstable();
    let same_edge = edges.chunk_by(|a, b| a.0 == b.0);
    same_edge
        .filter(|uses| uses.len() == 1 || uses[0].1 != uses[uses.len() - 1].1)
        .map(|uses| uses[0].0)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> TriMesh {
        let points = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
            .map(|[x, y]| Vec3::new(x, y, 0.0))
            .to_vec();
        TriMesh {
            points,
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            tags: vec![0, 1],
        }
    }

    #[test]
    fn borders_lie_between_tags_and_at_open_edges() {
        let mut mesh = square();
        assert_eq!(face_borders(&mesh).len(), 5);
        mesh.tags = vec![3, 3];
        assert_eq!(face_borders(&mesh).len(), 4);
    }

    #[test]
    fn every_view_gives_a_png() {
        let mesh = square();
        let size = PictureSize {
            width: 64,
            height: 48,
        };
        let studio = Studio::new(&mesh.points, size);
        let (points, radii) = (mesh.points.clone(), vec![1.0; 4]);
        let medial = MedialMesh {
            points: points.clone(),
            radii: radii.clone(),
            edges: vec![[0, 1]],
            triangles: vec![[0, 1, 2]],
        };
        let skeleton = Skeleton {
            points: points.clone(),
            radii,
            quads: vec![[0, 1, 2, 3]],
            beams: vec![[0, 2]],
        };
        let body = ControlMesh {
            points,
            quads: vec![[0, 1, 2, 3]],
        };
        let pictures = [
            studio.proposal(&mesh),
            studio.thickness(&mesh, &[1.0, 2.0, f64::NAN]),
            studio.medial(&medial),
            studio.skeleton(&skeleton),
            studio.body(&body),
            studio.solid(&mesh, &[1]),
            studio.error(&mesh, &[-2.0, 0.0, 0.1, 9.0]),
        ];
        for picture in pictures {
            assert!(picture.expect("renders").png.starts_with(b"\x89PNG"));
        }
    }

    #[test]
    fn bad_indices_and_empty_meshes_are_left_out() {
        let mesh = TriMesh {
            points: vec![Vec3::repeat(f64::NAN)],
            triangles: vec![[0, 0, 0], [7, 8, 9]],
            tags: vec![],
        };
        let studio = Studio::new(
            &mesh.points,
            PictureSize {
                width: 32,
                height: 32,
            },
        );
        assert!(studio.proposal(&mesh).is_ok());
        assert!(studio.proposal(&TriMesh::default()).is_ok());
        let too_big = Studio {
            size: PictureSize {
                width: 99_999,
                height: 1,
            },
            ..studio
        };
        assert!(too_big.proposal(&mesh).is_err());
    }

    #[test]
    fn threads_do_not_change_the_picture() {
        let mesh = square();
        let studio = Studio::new(
            &mesh.points,
            PictureSize {
                width: 200,
                height: 150,
            },
        );
        let shoot = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("pool");
            pool.install(|| studio.proposal(&mesh))
                .expect("renders")
                .png
        };
        assert_eq!(shoot(1), shoot(2));
    }
}
