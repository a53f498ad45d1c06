//! One radius that changes moves the surface around its point and leaves the rest alone.

mod thicken_support;

use grassfire::Vec3;
use grassfire::edit::{apply_radii, cells_of, grow};
use grassfire::fit::{FitOptions, fit};
use grassfire::mesh::{Bvh, TriMesh};
use grassfire::monitor::Monitor;
use grassfire::remesh::{RemeshOptions, iso_surface};
use grassfire::skeleton::Skeleton;
use grassfire::spline::ControlMesh;
use grassfire::spline::catmull_clark::limit_mesh;
use grassfire::thicken::{ThickenOptions, ThickenedBody, thicken};
use grassfire::voxel::VoxelGrid;
use thicken_support::{Builder, v, x, y, z};

/// Half of the walls' thickness, mm.
const RADIUS: f64 = 2.0;
/// Edge of a skeleton quad, mm.
const QUAD: f64 = 5.0;
/// Change of the radius.
const FACTOR: f64 = 1.2;

/// A plate with a rib on it, and its distance field on voxels of 1 mm.
fn rib_on_a_plate() -> (Skeleton, VoxelGrid<f32>) {
    let mut b = Builder::new(RADIUS);
    b.sheet(Vec3::zeros(), [x(60.0), y(40.0)], [12, 8]);
    b.sheet(v(30.0, 0.0, 0.0), [y(40.0), z(30.0)], [8, 6]);
    let distance = |p: &Vec3| {
        let plate = v(p.x.clamp(0.0, 60.0), p.y.clamp(0.0, 40.0), 0.0);
        let rib = v(30.0, p.y.clamp(0.0, 40.0), p.z.clamp(0.0, 30.0));
        RADIUS - (p - plate).norm().min((p - rib).norm())
    };
    let mut field = VoxelGrid::filled(v(-7.0, -7.0, -7.0), 1.0, [75, 55, 45], 0.0_f32);
    for i in 0..field.values.len() {
        let [a, b, c] = field.ijk(i);
        field.values[i] = distance(&field.centre(a, b, c)) as f32;
    }
    (b.skeleton, field)
}

/// The skeleton point nearest to a place.
fn nearest(skeleton: &Skeleton, place: Vec3) -> usize {
    let distance = |i: &usize| (skeleton.points[*i] - place).norm();
    (0..skeleton.points.len())
        .min_by(|i, j| distance(i).total_cmp(&distance(j)))
        .expect("points")
}

/// Largest distance of the limit surface before to that after within two quads of `place`, and beyond them. That points slide
/// along the surface does not count: its shape stays.
fn moves(before: &ControlMesh, after: &ControlMesh, place: Vec3) -> [f64; 2] {
    let [from, to] = [before, after].map(|mesh| limit_mesh(mesh, 2).expect("limit").0);
    let after = Bvh::new(&to);
    let mut largest = [0.0_f64; 2];
    for p in &from.points {
        // The diagonals of two quads, and what the wall's surface lies off its middle.
        let near = (p - place).norm() <= 2.0 * QUAD * 2.0_f64.sqrt() + FACTOR * RADIUS;
        let nearest = after.nearest(p, f64::INFINITY).expect("a surface");
        let side = usize::from(!near);
        largest[side] = largest[side].max(nearest.distance);
    }
    largest
}

fn surface_of(field: &VoxelGrid<f32>) -> TriMesh {
    iso_surface(field, 0.0, &RemeshOptions::default(), &Monitor::default()).expect("a surface")
}

/// Fits a body as it is, so that its control points can be compared with those of another fit.
fn fitted(body: &ThickenedBody, skeleton: &Skeleton, field: &VoxelGrid<f32>) -> ControlMesh {
    let options = FitOptions {
        refinements: 0,
        ..FitOptions::default()
    };
    fit(body, skeleton, field, &options, &Monitor::default())
        .expect("fits")
        .mesh
}

#[test]
fn one_radius_moves_the_surface_within_two_quads() {
    let (skeleton, field) = rib_on_a_plate();
    let body = thicken(&skeleton, &ThickenOptions::default(), &Monitor::default()).expect("body");
    let before = fitted(&body, &skeleton, &field);
    let surface = surface_of(&field);
    for place in [
        v(15.0, 20.0, 0.0),
        v(30.0, 20.0, 15.0),
        v(30.0, 20.0, 0.0),
        v(0.0, 0.0, 0.0),
    ] {
        let point = nearest(&skeleton, place);
        let mut edited = skeleton.clone();
        edited.radii[point] *= FACTOR;
        let grown = RADIUS * (FACTOR - 1.0);

        // The fitted body with its offsets scaled: nothing else moves at all.
        let scaled = apply_radii(&before, &body, &skeleton, &edited.radii).expect("its own");
        let [near, far] = moves(&before, &scaled, place);
        assert!(
            near > 0.3 * grown && near < 1.5 * grown,
            "{place:?}: {near}"
        );
        assert!(far < 1e-9, "{place:?}: {far}");

        // Fitted again to the grown proposal: what is left of it further away is below what a voxel resolves.
        let mut growth = vec![0.0; skeleton.points.len()];
        growth[point] = grown;
        let target = grow(&field, &surface, &cells_of(&skeleton), &growth);
        let mesh = apply_radii(&body.mesh, &body, &skeleton, &edited.radii).expect("its own");
        let again = ThickenedBody {
            mesh,
            ..body.clone()
        };
        let [near, far] = moves(&before, &fitted(&again, &edited, &target), place);
        assert!(
            near > 0.3 * grown && near < 1.5 * grown,
            "{place:?}: {near}"
        );
        assert!(far < 0.1 * grown, "{place:?}: {far}");
    }
}
