//! Triangles: closed, close to the surface, converging volume.

use std::collections::BTreeMap;

use grassfire::mesh::Solid;
use grassfire::spline::{TessellateOptions, Tessellation, area, evaluate, tessellate, volume};

use crate::patches::build;
use crate::shapes;

fn uniform(n: u32) -> TessellateOptions {
    TessellateOptions {
        divisions: Some(n),
        ..TessellateOptions::default()
    }
}

#[test]
fn shapes_give_closed_solids_of_the_same_topology() {
    for (name, mesh) in shapes::all() {
        let patches = build(&mesh);
        for options in [
            uniform(1),
            uniform(2),
            uniform(5),
            TessellateOptions::default(),
            TessellateOptions {
                chord: 0.002,
                ..TessellateOptions::default()
            },
        ] {
            let result = tessellate(&mesh, &patches, &options).expect("a valid mesh");
            assert_eq!(result.mesh.tags.len(), result.mesh.triangles.len());
            assert_eq!(result.samples.len(), result.mesh.points.len());
            let solid = Solid::try_from(result.mesh).expect(name);
            assert_eq!(solid.euler(), shapes::euler(&mesh), "{name} {options:?}");
        }
    }
}

#[test]
fn volume_and_area_converge_with_the_square_of_the_divisions() {
    let mut mesh = shapes::bracket();
    shapes::jitter(&mut mesh, 0.1, 4);
    let patches = build(&mesh);
    let exact = [volume(&patches), area(&patches)];
    let error = |n: u32| {
        let mesh = tessellate(&mesh, &patches, &uniform(n))
            .expect("a valid mesh")
            .mesh;
        [
            (mesh.volume() - exact[0]).abs(),
            (mesh.area() - exact[1]).abs(),
        ]
    };
    let (coarse, fine) = (error(16), error(32));
    for k in 0..2 {
        let slope = (coarse[k] / fine[k]).log2();
        assert!(
            (slope - 2.0).abs() < 0.1,
            "slope {slope} of {}",
            ["volume", "area"][k]
        );
    }
    // Two grids extrapolate to the exact value.
    let rich = |n: u32| {
        tessellate(&mesh, &patches, &uniform(n))
            .expect("a valid mesh")
            .mesh
            .volume()
    };
    let limit = (4.0 * rich(32) - rich(16)) / 3.0;
    assert!(
        (limit / exact[0] - 1.0).abs() < 1e-5,
        "{limit} {}",
        exact[0]
    );
}

/// Largest distance between the middles of triangle sides and the surface point halfway in parameters, normal part only.
fn sagitta(patches: &[grassfire::spline::Patch], result: &Tessellation) -> f64 {
    let mut worst = 0.0f64;
    for (t, corners) in result.mesh.triangles.iter().enumerate() {
        let quad = result.owner(t);
        let patch = &patches[quad as usize];
        // Border points may be numbered in the neighbour: find the parameters in this patch by the position.
        let known: Vec<_> = corners
            .iter()
            .filter(|v| result.samples[**v as usize].quad == quad)
            .collect();
        if known.len() < 3 {
            continue;
        }
        for k in 0..3 {
            let (a, b) = (*known[k] as usize, *known[(k + 1) % 3] as usize);
            let middle = (result.mesh.points[a] + result.mesh.points[b]) / 2.0;
            let [u, v] = [0, 1]
                .map(|i| (result.samples[a].parameters[i] + result.samples[b].parameters[i]) / 2.0);
            let point = evaluate(patch, u, v);
            worst = worst.max((point.position - middle).dot(&point.normal).abs());
        }
    }
    worst
}

#[test]
fn chord_is_kept() {
    for (name, mesh) in shapes::all() {
        let patches = build(&mesh);
        for chord in [0.05, 0.01, 0.002] {
            let options = TessellateOptions {
                chord,
                ..TessellateOptions::default()
            };
            let result = tessellate(&mesh, &patches, &options).expect("a valid mesh");
            let found = sagitta(&patches, &result);
            assert!(found <= 1.1 * chord, "{name}: {found} for {chord}");
        }
    }
}

#[test]
fn triangles_are_limited() {
    let mesh = shapes::block(3);
    let options = TessellateOptions {
        chord: 0.0,
        max_triangles: 10_000,
        ..TessellateOptions::default()
    };
    let result = tessellate(&mesh, &build(&mesh), &options).expect("a valid mesh");
    assert!(result.limited && result.mesh.triangles.len() <= 10_000);
}

#[test]
fn samples_name_their_points() {
    let mut mesh = shapes::frame();
    shapes::jitter(&mut mesh, 0.1, 8);
    let patches = build(&mesh);
    let result = tessellate(&mesh, &patches, &TessellateOptions::default()).expect("a valid mesh");
    let mut owners = BTreeMap::new();
    for (sample, point) in result.samples.iter().zip(&result.mesh.points) {
        let [u, v] = sample.parameters;
        assert_eq!(
            evaluate(&patches[sample.quad as usize], u, v).position,
            *point
        );
        *owners.entry(sample.quad).or_insert(0) += 1;
    }
    assert_eq!(owners.len(), mesh.quads.len());
}

#[test]
fn real_bodies_give_closed_solids() {
    for (name, mesh) in shapes::bodies() {
        let patches = build(&mesh);
        let result =
            tessellate(&mesh, &patches, &TessellateOptions::default()).expect("a valid mesh");
        let found = sagitta(&patches, &result);
        assert!(found <= 0.025, "{name}: {found}");
        let (triangles, exact) = (result.mesh.triangles.len(), volume(&patches));
        let solid = Solid::try_from(result.mesh).expect("a closed surface");
        assert_eq!(solid.euler(), shapes::euler(&mesh), "{name}");
        assert!(
            (solid.volume() / exact - 1.0).abs() < 2e-3,
            "{name}: {} {exact}",
            solid.volume()
        );
        println!(
            "{name}: {triangles} triangles, volume {} of {exact}, sagitta {found}",
            solid.volume()
        );
    }
}
