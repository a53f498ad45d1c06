//! Pictures of a project's voxels with what holds and loads them.

use super::{
    Camera, Colours, PictureSize, RenderError, Rgb, Scene, SceneLine, SceneMesh, SceneSphere,
    Shading, render,
};
use crate::Vec3;
use crate::report::Picture;
use crate::topopt::{FROZEN, Problem};

const SPACE: Rgb = [222, 226, 232];
const BODY: Rgb = [132, 148, 170];
const FIXED: Rgb = [38, 92, 200];
const SPRING: Rgb = [30, 150, 90];
const LOAD: Rgb = [214, 48, 39];
const WEIGHT: Rgb = [120, 80, 40];
/// Nodes that are drawn of every kind, at most.
const MOST: usize = 3000;
/// Radius of a node over the edge of a voxel.
const NODE: f64 = 0.28;
/// Length of an arrow and of its tip over the diagonal of the space.
const ARROW: f64 = 0.18;
const TIP: f64 = 0.03;
/// Directions that the pictures are taken from, degrees: azimuth, elevation.
pub(super) const VIEWS: [(f64, f64, &str); 2] = [
    (-60.0, 30.0, "from above"),
    (120.0, -30.0, "from the other side, below"),
];

/// Pictures of a problem from two opposite sides: the far walls of the space, the non-design bodies, fixed nodes blue, nodes on
/// springs green, loaded nodes red, an arrow for the sum of the forces of every case, brown ones for gravity.
///
/// # Errors
/// [`RenderError`] when a picture could not be made.
pub fn conditions(problem: &Problem, size: PictureSize) -> Result<Vec<Picture>, RenderError> {
    let marks = marks(problem);
    let shoot = |&(azimuth, elevation, from): &(f64, f64, &str)| {
        let corners = [[0; 3], problem.dims].map(|n| problem.node(n));
        let box_points: Vec<Vec3> = (0..8)
            .map(|i| Vec3::from_fn(|d, _| corners[i >> d & 1][d]))
            .collect();
        let camera = Camera::looking(&box_points, azimuth, elevation);
        let scene = Scene {
            meshes: vec![
                faces(
                    problem,
                    SPACE,
                    |v| problem.is_active(v),
                    Some(camera.toward),
                ),
                faces(problem, BODY, |v| problem.labels[v] == FROZEN, None),
            ],
            ..marks.clone()
        };
        Ok(Picture {
            title: format!("Supports and loads, {from}"),
            caption: "Far walls of the space, non-design bodies grey; fixed nodes blue, nodes on springs green, loaded nodes red. Arrows: the sum of the forces of every case; gravity brown.".to_owned(),
            png: render(&scene, &camera, size)?,
        })
    };
    VIEWS.iter().map(shoot).collect()
}

/// Nodes and arrows.
fn marks(problem: &Problem) -> Scene {
    let mut scene = Scene::default();
    let mut add = |nodes: Vec<[usize; 3]>, colour: Rgb, size: f64| {
        let step = nodes.len().div_ceil(MOST).max(1);
        let ball = |node: &[usize; 3]| SceneSphere {
            centre: problem.node(*node),
            radius: size * NODE * problem.h,
            colour,
        };
        scene.spheres.extend(nodes.iter().step_by(step).map(ball));
    };
    let mut fixed: Vec<[usize; 3]> = problem.fixed.iter().map(|(node, _)| *node).collect();
    fixed.dedup();
    add(fixed, FIXED, 1.0);
    add(
        problem.springs.iter().map(|(node, _)| *node).collect(),
        SPRING,
        1.1,
    );
    let loaded = problem.cases.iter().flat_map(|case| &case.forces);
    add(loaded.map(|(node, _)| *node).collect(), LOAD, 1.2);
    let diagonal = problem.h * Vec3::from(problem.dims.map(|n| n as f64)).norm();
    for case in &problem.cases {
        let forces = case
            .forces
            .iter()
            .map(|(node, f)| (problem.node(*node), Vec3::from(*f)));
        let size: f64 = forces.clone().map(|(_, f)| f.norm()).sum();
        let sum: Vec3 = forces.clone().map(|(_, f)| f).sum();
        // A moment alone has no sum.
        if sum.norm() > 1e-6 * size {
            let middle = forces.map(|(p, f)| p * f.norm()).sum::<Vec3>() / size;
            scene
                .lines
                .extend(arrow(middle, sum.normalize(), diagonal, LOAD));
        }
        let weight = Vec3::from(case.body_force);
        if weight != Vec3::zeros() {
            let middle = (problem.node([0; 3]) + problem.node(problem.dims)) / 2.0;
            scene
                .lines
                .extend(arrow(middle, weight.normalize(), diagonal, WEIGHT));
        }
    }
    scene
}

/// An arrow that begins at a point.
fn arrow(from: Vec3, along: Vec3, diagonal: f64, colour: Rgb) -> Vec<SceneLine> {
    let to = from + ARROW * diagonal * along;
    let across = along.cross(&Vec3::ith(along.iamin(), 1.0)).normalize();
    let other = along.cross(&across);
    let line = |from: Vec3| SceneLine {
        from,
        to,
        colour,
        width: 4.0,
    };
    let barbs = [across, -across, other, -other];
    let barbs = barbs.map(|side| line(to + TIP * diagonal * (0.5 * side - along)));
    std::iter::once(line(from)).chain(barbs).collect()
}

/// Faces of voxels towards others; with `toward` only those that face away from it.
fn faces(
    problem: &Problem,
    colour: Rgb,
    inside: impl Fn(usize) -> bool,
    toward: Option<Vec3>,
) -> SceneMesh {
    let mut quads = Vec::new();
    let mut points = Vec::new();
    for v in (0..problem.labels.len()).filter(|&v| inside(v)) {
        let at = problem.at(v);
        for (axis, up) in (0..6).map(|i| (i / 2, i % 2)) {
            let mut next = at;
            let neighbour = match up {
                0 => at[axis].checked_sub(1),
                _ => Some(at[axis] + 1).filter(|&i| i < problem.dims[axis]),
            };
            let open = neighbour.is_none_or(|i| {
                next[axis] = i;
                !inside(problem.index(next))
            });
            let mut normal = Vec3::zeros();
            normal[axis] = if up == 1 { 1.0 } else { -1.0 };
            if !open || toward.is_some_and(|t| t.dot(&normal) >= 0.0) {
                continue;
            }
            let first = points.len() as u32;
            for (i, j) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
                let mut node = at;
                node[axis] += up;
                node[(axis + 1) % 3] += i;
                node[(axis + 2) % 3] += j;
                points.push(problem.node(node));
            }
            quads.push([first, first + 1, first + 2, first + 3]);
        }
    }
    let mut out = SceneMesh::quads(&points, &quads, colour);
    out.colours = Colours::Uniform(colour);
    out.shading = Shading::Flat;
    out
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;

    use super::*;
    use crate::topopt::{DESIGN, LoadCase};

    #[test]
    fn supports_springs_and_loads_are_seen() {
        let mut problem = Problem {
            h: 1.0,
            dims: [8, 4, 4],
            labels: vec![DESIGN; 128],
            ..Problem::default()
        };
        let size = PictureSize {
            width: 160,
            height: 120,
        };
        let shoot = |problem: &Problem| {
            let pictures = conditions(problem, size).unwrap();
            assert_eq!(pictures.len(), 2);
            pictures.into_iter().map(|p| p.png).collect::<Vec<_>>()
        };
        let mut before = shoot(&problem);
        let mut changed = |problem: &Problem| {
            let after = shoot(problem);
            let differ = before[0] != after[0] || before[1] != after[1];
            before = after;
            differ
        };
        problem.fixed.push(([0, 2, 2], 1));
        assert!(changed(&problem));
        problem.springs.push(([0, 0, 4], Matrix3::identity()));
        assert!(changed(&problem));
        problem.labels[127] = FROZEN;
        assert!(changed(&problem));
        problem.cases.push(LoadCase {
            forces: vec![([8, 2, 2], [0.0, 0.0, -5.0])],
            ..LoadCase::default()
        });
        assert!(changed(&problem));
        problem.cases[0].body_force = [0.0, 0.0, -1.0];
        assert!(changed(&problem));
    }
}
