//! Recognition of non-design surfaces on real parts.

mod cad_common;

use std::error::Error;
use std::path::Path;

use cad_common::corpus;
use grassfire::Vec3;
use grassfire::io::{Input, ReadOptions, read_input};
use grassfire::mesh::{RepairOptions, TriMesh, repair};
use grassfire::monitor::Monitor;
use grassfire::non_design::{RecogniseOptions, Recognised, recognise};
use grassfire::remesh::{RemeshOptions, iso_surface};
use grassfire::voxel::VoxelGrid;

type Result<T = ()> = std::result::Result<T, Box<dyn Error>>;

fn mesh(path: &Path) -> Result<TriMesh> {
    let monitor = Monitor::default();
    match read_input(path, &ReadOptions::default(), &monitor)? {
        Input::Mesh { mesh, .. } => Ok(repair(mesh, &RepairOptions::default(), &monitor)?.mesh),
        _ => Err("no mesh".into()),
    }
}

/// The six rings of the GE bracket: middle, axis and bore radius as published.
const RINGS: [([f64; 3], [f64; 3], f64); 6] = [
    ([-21.36, -60.33, 44.72], [-0.0303, 0.9995, 0.0], 9.55675),
    ([-20.49, -88.98, 44.72], [-0.0303, 0.9995, 0.0], 9.55675),
    ([0.0, 0.0, 3.92], [0.0, 0.0, 1.0], 5.334),
    ([0.0, -148.13, 3.92], [0.0, 0.0, 1.0], 5.1562),
    ([38.09, -146.97, 3.92], [0.0, 0.0, 1.0], 5.1562),
    ([52.05, 1.58, 3.92], [0.0, 0.0, 1.0], 5.1562),
];

/// Radius of the wall that the part really has around a ring's axis: designers drilled their own (5.16 to 5.25 mm).
///
/// Median distance from the axis of the vertices of all triangles there that face the axis. No fit, no RANSAC.
fn drilled(part: &TriMesh, (middle, axis, radius): ([f64; 3], [f64; 3], f64)) -> f64 {
    let (middle, axis) = (Vec3::from(middle), Vec3::from(axis).normalize());
    let away = |p: Vec3| (p - middle) - axis * (p - middle).dot(&axis);
    let mut found = Vec::new();
    for t in 0..part.triangles.len() {
        let [a, b, c] = part.corners(t);
        let centre = (a + b + c) / 3.0;
        let normal = (b - a).cross(&(c - a)).normalize();
        let along = (centre - middle).dot(&axis).abs();
        let from = away(centre);
        if along < 3.0
            && (from.norm() - radius).abs() < 0.5
            && normal.dot(&from.normalize()) < -0.99
        {
            found.extend([a, b, c].map(|p| away(p).norm()));
        }
    }
    found.sort_by(f64::total_cmp);
    found[found.len() / 2]
}

fn find(part: &TriMesh) -> Result<Recognised> {
    Ok(recognise(
        part,
        &RecogniseOptions::default(),
        &Monitor::default(),
    )?)
}

#[test]
fn a_band_of_a_hollow_ball_is_no_bore() -> Result {
    let (voxel, thickness) = (0.844, 3.375);
    for radius in [8.0, 8.15, 8.3, 8.45, 8.6] {
        let mut density = VoxelGrid::filled(Vec3::repeat(-11.2), voxel, [28; 3], 0.0_f32);
        for at in 0..density.values.len() {
            let [i, j, k] = density.ijk(at);
            let off = (density.centre(i, j, k).norm() - radius).abs();
            density.values[at] = (0.5 + (0.5 * thickness - off) / voxel) as f32;
        }
        let (options, monitor) = (RemeshOptions::default(), Monitor::default());
        let found = find(&iso_surface(&density, 0.5, &options, &monitor)?)?;
        assert!(found.bosses.is_empty(), "{radius}: {:?}", found.bosses);
    }
    Ok(())
}

#[test]
fn bolt_bosses_and_lugs_of_the_brackets_are_found() -> Result {
    let Some(corpus) = corpus() else {
        println!("skipped: no corpus");
        return Ok(());
    };
    for name in ["simjeb_055", "simjeb_398", "simjeb_576", "simjeb_623"] {
        let part = mesh(&corpus.join("dev").join(format!("{name}.obj")))?;
        let found = find(&part)?;
        for boss in &found.bosses {
            println!(
                "{name}: radius {:.4}, outer {:.3}, extent {:.3} to {:.3}, residual {:.4}",
                boss.radius, boss.outer_radius, boss.extent[0], boss.extent[1], boss.residual
            );
        }
        for ring in RINGS {
            let truth = drilled(&part, ring);
            let (middle, axis) = (Vec3::from(ring.0), Vec3::from(ring.1).normalize());
            let boss = found.bosses.iter().find(|boss| {
                let from = middle - boss.origin;
                let along = from.dot(&boss.direction);
                (from - boss.direction * along).norm() < 0.1
                    && along > boss.extent[0] - 1.0
                    && along < boss.extent[1] + 1.0
            });
            let boss = boss.ok_or_else(|| {
                format!(
                    "{name}: nothing at {:?}; rejected: {:?}",
                    ring.0, found.rejected
                )
            })?;
            assert!(
                (boss.radius - truth).abs() < 0.05,
                "{name}: {} for {truth}",
                boss.radius
            );
            let angle = boss.direction.cross(&axis).norm().asin().to_degrees();
            assert!(
                angle < 0.2,
                "{name}: axis {angle} degrees off at {:?}",
                ring.0
            );
            assert!(boss.outer_radius > boss.radius + 0.3);
        }
    }
    Ok(())
}

#[cfg(feature = "occt")]
mod design_space {
    use super::*;
    use grassfire::cad::read_design_space;
    use grassfire::non_design::{DomainOptions, FaceCoverage, coverage};

    const INCH: f64 = 25.4;

    fn match_faces(shift: Vec3, tolerance: f64) -> Result<Option<Vec<FaceCoverage>>> {
        let Some(corpus) = corpus() else {
            println!("skipped: no corpus");
            return Ok(None);
        };
        let mut part = mesh(&corpus.join("dev/featuretype.stl"))?;
        part.points.iter_mut().for_each(|p| *p = *p * INCH + shift);
        let space = read_design_space(&corpus.join("dev/featuretype.step"), 0.02)?;
        let options = DomainOptions::default();
        Ok(Some(coverage(
            &space.faces,
            &part,
            tolerance,
            &options,
            &Monitor::default(),
        )?))
    }

    #[test]
    fn a_machined_part_follows_its_own_cad_faces() -> Result {
        let Some(faces) = match_faces(Vec3::zeros(), 0.5)? else {
            return Ok(());
        };
        let area = |kept: bool| -> f64 {
            faces
                .iter()
                .filter(|f| f.non_design || !kept)
                .map(|f| f.area)
                .sum()
        };
        let share = area(true) / area(false);
        println!(
            "{} faces, {:.2} % of the area recognised",
            faces.len(),
            100.0 * share
        );
        assert_eq!(faces.len(), 96);
        assert!(share > 0.95, "{share}");
        Ok(())
    }

    /// Moved across all its planes, also the sloping ones: along a plane it would still follow that.
    #[test]
    fn a_part_that_was_moved_follows_no_face() -> Result {
        let Some(faces) = match_faces(Vec3::new(0.5, 0.9, 1.4), 0.1)? else {
            return Ok(());
        };
        let wrong: Vec<_> = faces.iter().filter(|f| f.non_design).collect();
        assert!(wrong.is_empty(), "{wrong:?}");
        Ok(())
    }
}
