//! What becomes of a part whose non-design bodies cannot be united with it.

use super::*;
use crate::Vec3;
use crate::cad::NonDesignOptions;
use crate::cad::from_mesh;
use crate::mesh::shapes::{CUBOID, cuboid, cuboid_corners};
use crate::pipeline::shape::surface;
use crate::spline::ControlMesh;

/// A round body about the origin, some 30 mm across, and a cuboid with its low corner at `x`.
fn body_and_cuboid(x: f64) -> Result<(Surface, Bodies), Box<dyn std::error::Error>> {
    let mesh = ControlMesh {
        points: cuboid_corners(Vec3::repeat(-20.0), Vec3::repeat(20.0)),
        quads: CUBOID.to_vec(),
    };
    let monitor = Monitor::default();
    let surface = surface(&mesh, 1.0, &ReconstructOptions::default(), &monitor)?;
    let low = Vec3::new(x, -4.0, -4.0);
    let cuboid = cuboid(low, low + Vec3::repeat(8.0));
    let options = NonDesignOptions::default();
    let solids = from_mesh("pad", "test", &cuboid, &options, &monitor)?;
    let mut bodies = Bodies::default();
    bodies.add(solids)?;
    Ok((surface, bodies))
}

fn unite(
    x: f64,
    recognised: bool,
) -> Result<(Part, Bodies, Vec<String>), Box<dyn std::error::Error>> {
    let (surface, mut bodies) = body_and_cuboid(x)?;
    bodies.recognised = recognised;
    let monitor = Monitor::default();
    let options = ReconstructOptions::default();
    let joined = join(&surface, &bodies, &options, &monitor)?;
    let union = Union {
        surface: &surface,
        intersections: 0,
        voxel: 1.0,
        options: &options,
        monitor: &monitor,
    };
    let part = union.part_or_without_recognised(joined, &mut bodies)?;
    let warnings = monitor.warnings().into_iter().map(|w| w.text).collect();
    Ok((part, bodies, warnings))
}

#[test]
fn recognised_body_that_fits_is_united() -> Result<(), Box<dyn std::error::Error>> {
    let (part, bodies, warnings) = unite(8.0, true)?;
    assert!(part.solid.valid && part.solid.bodies == 1, "{warnings:?}");
    assert!(part.non_design.len() == 1 && bodies.solids.len() == 1);
    Ok(())
}

#[test]
fn recognised_body_that_cannot_be_united_is_left_out() -> Result<(), Box<dyn std::error::Error>> {
    let (part, bodies, warnings) = unite(40.0, true)?;
    assert!(part.solid.valid && part.solid.bodies == 1, "{warnings:?}");
    assert!(part.non_design.is_empty() && part.non_design_max.is_none());
    assert!(bodies.solids.is_empty() && bodies.surface.triangles.is_empty());
    let told = |text: &String| text.contains("left out") && text.contains("does not overlap");
    assert!(warnings.iter().any(told), "{warnings:?}");
    Ok(())
}

#[test]
fn given_body_that_cannot_be_united_stays_and_the_part_is_not_valid()
-> Result<(), Box<dyn std::error::Error>> {
    let (part, bodies, warnings) = unite(40.0, false)?;
    assert!(!part.solid.valid && part.solid.bodies == 2);
    assert!(part.non_design.len() == 1 && bodies.solids.len() == 1);
    assert!(
        warnings.iter().any(|w| w.contains("does not overlap")),
        "{warnings:?}"
    );
    Ok(())
}
