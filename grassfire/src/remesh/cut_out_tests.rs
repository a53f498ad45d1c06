//! Eyes on a bar, cut out.

use super::super::{Capsule, extract};
use super::*;
use crate::mesh::Solid;

const EYES: [f64; 2] = [-30.0, 30.0];
const WALL: f64 = 8.0;
const BORE: f64 = 4.0;
const HEIGHT: f64 = 4.0;

/// Two eyes, whose walls stand out by `burr`, on a bar as high as `height` to each side.
fn proposal(burr: f64, height: f64) -> Remeshed {
    let mut field = VoxelGrid::filled(Vec3::new(-45.0, -14.0, -10.0), 0.8, [114, 36, 26], 0f32);
    for v in 0..field.values.len() {
        let [i, j, k] = field.ijk(v);
        let p = field.centre(i, j, k);
        let eye = EYES.map(|x| {
            let radial = (p - Vec3::new(x, 0.0, p.z)).norm();
            (WALL + burr - radial)
                .min(radial - BORE)
                .min(HEIGHT - p.z.abs())
        });
        let bar = (26.0 - p.x.abs())
            .min(3.0 - p.y.abs())
            .min(height - p.z.abs());
        let outside = EYES.map(|x| (p - Vec3::new(x, 0.0, p.z)).norm() - BORE);
        let bar = bar.min(outside[0]).min(outside[1]);
        field.values[v] = eye[0].max(eye[1]).max(bar) as f32;
    }
    let set = VoxelSet::positive(field.dims, &field.values);
    let surface = extract::surface(&field, &set, true).mesh;
    Remeshed {
        solid: Solid::try_from(surface).expect("a solid"),
        field,
        genus_before: 2,
        genus_after: 2,
        changes: Vec::new(),
        distance_max: 0.0,
        source: None,
        grain: 0.8,
        default_voxel: 0.8,
    }
}

/// The eyes as bodies.
fn bosses() -> Bosses {
    const N: u32 = 64;
    let mut out = Bosses::default();
    for (body, x) in EYES.into_iter().enumerate() {
        let first = out.surface.points.len() as u32;
        for z in [-HEIGHT, HEIGHT] {
            out.surface.points.push(Vec3::new(x, 0.0, z));
            for k in 0..N {
                let (s, c) = (std::f64::consts::TAU * f64::from(k) / f64::from(N)).sin_cos();
                out.surface
                    .points
                    .push(Vec3::new(x + WALL * c, WALL * s, z));
            }
        }
        let (low, high) = (first, first + N + 1);
        for k in 0..N {
            let (a, b) = (1 + k, 1 + (k + 1) % N);
            out.surface.triangles.extend([
                [low, low + b, low + a],
                [high, high + a, high + b],
                [low + a, low + b, high + b],
                [low + a, high + b, high + a],
            ]);
        }
        out.surface
            .tags
            .resize(out.surface.triangles.len(), body as u32);
        let (a, b) = (Vec3::new(x, 0.0, -9.0), Vec3::new(x, 0.0, 9.0));
        out.free.push(Capsule { a, b, radius: BORE });
    }
    out
}

fn cut(proposal: &Remeshed) -> DesignPart {
    cut_with(proposal, None)
}

fn cut_with(proposal: &Remeshed, wedge: Option<f64>) -> DesignPart {
    let options = CutOutOptions {
        wedge,
        ..CutOutOptions::default()
    };
    cut_out(proposal, &bosses(), &options, &Monitor::default())
        .expect("no error")
        .expect("something left")
}

/// Extent of the material at `y = 0`, height `z`.
fn reach(field: &VoxelGrid<f32>, z: f64) -> f64 {
    let inside = |x: &f64| field.sample(&Vec3::new(*x, 0.0, z)) > 0.0;
    (0..450)
        .map(|k| 0.1 * f64::from(k))
        .filter(inside)
        .fold(0.0, f64::max)
}

#[test]
fn eyes_go_and_the_bar_runs_on_into_their_walls() {
    let design = cut(&proposal(0.0, 2.0));
    assert_eq!((design.part.genus_after, design.part.solid.euler()), (0, 2));
    assert_eq!((design.united.b0, design.united.b1), (1, 2));
    assert_eq!(design.united, design.wanted);
    // The walls begin at x = 22 and end at 26.
    let end = reach(&design.part.field, 0.0);
    assert!((22.8..24.0).contains(&end), "{end}");
    // Half-way along the bar nothing has changed.
    let middle = design.part.field.sample(&Vec3::new(3.0, 0.0, 1.7));
    assert!((middle - 0.3).abs() < 0.05, "{middle}");
}

#[test]
fn walls_that_stand_out_leave_no_shells() {
    let design = cut(&proposal(0.7, 2.0));
    assert_eq!(design.united, design.wanted);
    let highest = design.part.solid.mesh().points.iter().map(|p| p.y.abs());
    assert!(highest.fold(0.0, f64::max) < 4.0);
}

#[test]
fn slices_beside_bodies_stayed_at_a_finer_voxel_than_the_default() {
    let mut proposal = proposal(1.6, 2.0);
    let highest = |proposal: &Remeshed| {
        let design = cut(proposal);
        let points = design.part.solid.mesh().points.iter();
        points.map(|p| p.y.abs()).fold(0.0, f64::max)
    };
    // They are 1.2 mm thick: more than one voxel of 0.8 mm, but less than a default one of 1.6 mm.
    assert!(highest(&proposal) > 8.0);
    proposal.grain = 1.6;
    // What is left runs on into the walls, which end at 8 mm.
    assert!(highest(&proposal) < 8.0);
}

#[test]
fn wedges_beside_bodies_were_cut_off_with_a_step() {
    // A bar higher than the eyes, which runs out over their end faces as wedges.
    let mut wedged = proposal(0.0, 2.0);
    // The thicknesses that decide are three and two voxels thick.
    wedged.grain = 1.6;
    for v in 0..wedged.field.values.len() {
        let [i, j, k] = wedged.field.ijk(v);
        let p = wedged.field.centre(i, j, k);
        let slope = 0.7 * (26.0 - p.x.abs());
        let wall = (HEIGHT + slope.min(3.5) - p.z.abs())
            .min(26.0 - p.x.abs())
            .min(3.0 - p.y.abs());
        let outside = EYES.map(|x| (p - Vec3::new(x, 0.0, p.z)).norm() - BORE);
        let wall = wall.min(outside[0]).min(outside[1]);
        wedged.field.values[v] = wedged.field.values[v].max(wall as f32);
    }
    let lost = [None, Some(0.3)].map(|wedge| {
        let design = cut_with(&wedged, wedge);
        assert_eq!(design.united, design.wanted);
        design.lost
    });
    assert!(lost[1] < 0.75 * lost[0] && lost[0] > 0.0, "{lost:?}");
    // Shells of the eyes' walls still go.
    let design = cut_with(&proposal(0.7, 2.0), Some(0.3));
    let highest = design.part.solid.mesh().points.iter().map(|p| p.y.abs());
    assert!(highest.fold(0.0, f64::max) < 4.0);
}

#[test]
fn under_open_end_faces_the_bar_dives() {
    let design = cut(&proposal(0.0, HEIGHT));
    assert_eq!(design.united, design.wanted);
    assert!(reach(&design.part.field, 2.5) > 22.5);
    assert!(reach(&design.part.field, 3.5) < 22.4);
}

#[test]
fn lengths_that_make_no_sense_are_refused() {
    for value in [1000.0, -1.0, f64::NAN] {
        let options = CutOutOptions {
            run_on: value,
            ..CutOutOptions::default()
        };
        let part = cut_out(
            &proposal(0.0, 2.0),
            &bosses(),
            &options,
            &Monitor::default(),
        );
        assert!(matches!(
            part,
            Err(RemeshError::BadCutOut { name: "run_on", .. })
        ));
    }
}

#[test]
fn without_bodies_there_is_nothing_to_cut_out() {
    let (options, monitor) = (CutOutOptions::default(), Monitor::default());
    let part = cut_out(&proposal(0.0, 2.0), &Bosses::default(), &options, &monitor);
    assert!(part.expect("no error").is_none());
}
