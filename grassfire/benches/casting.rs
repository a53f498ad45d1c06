//! Cost of feeding, feeder placement, solidification and the draw search, and how it grows.
//!
//! Run with `cargo bench --bench casting`; `-- small` leaves out the grid of 5 million cells. Prints seconds and, where the
//! size grows, the cost relative to the smallest. With `-- part.obj ...` it prints how far the best draw direction of each part
//! lies from the best of 20,626 directions, which are a degree apart, and from the best a quarter of a degree apart around the best of these.

use std::path::Path;
use std::time::Instant;

use rayon::prelude::*;

use grassfire::Vec3;
use grassfire::casting::feed::{FeedOptions, feed, place_feeders};
use grassfire::casting::mould::dexels::axes;
use grassfire::casting::mould::directions::{FINER, allowed, best_of, judge, spiral};
use grassfire::casting::mould::{Direction, best_direction};
use grassfire::casting::solidify::{SolidifyOptions, solidify};
use grassfire::io::{Input, ReadOptions, read_input};
use grassfire::mesh::TriMesh;
use grassfire::monitor::Monitor;
use grassfire::skeleton::Skeleton;

fn main() {
    let given = std::env::args().skip(1);
    let parts: Vec<String> = given.filter(|a| a.contains('.')).collect();
    if !parts.is_empty() {
        parts.iter().for_each(|part| draw_beside_all(part));
        return;
    }
    let small = std::env::args().any(|arg| arg == "small");
    feeding();
    placement();
    draw_search();
    freezing(if small { &[40, 60, 80] } else { &[40, 80, 160] });
}

/// A wavy sheet of n x n quads with uneven radii.
fn sheet(n: u32) -> Skeleton {
    let mut skeleton = Skeleton::default();
    for j in 0..=n {
        for i in 0..=n {
            let (x, y) = (f64::from(i), f64::from(j));
            skeleton
                .points
                .push(Vec3::new(x, y, 2.0 * (x / 7.0).sin()) * 4.0);
            skeleton.radii.push(4.0 + (1.7 * x).sin() * (2.3 * y).cos());
        }
    }
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i;
            skeleton.quads.push([a, a + 1, a + n + 2, a + n + 1]);
        }
    }
    skeleton
}

fn fed_at(skeleton: &Skeleton) -> FeedOptions {
    FeedOptions {
        feeders: vec![skeleton.points[skeleton.points.len() / 2].into()],
        ..FeedOptions::default()
    }
}

fn feeding() {
    println!("feeding: points, ms, cost a point relative to the first");
    let mut first = None;
    for n in [49, 99, 199, 399] {
        let skeleton = sheet(n);
        let options = fed_at(&skeleton);
        let clock = Instant::now();
        feed(&skeleton, &[], &options, &Monitor::default()).expect("it feeds");
        let ms = 1e3 * clock.elapsed().as_secs_f64();
        let each = ms / skeleton.points.len() as f64;
        let base = *first.get_or_insert(each);
        println!(
            "{:>8} {ms:>9.2} {:>6.2}",
            skeleton.points.len(),
            each / base
        );
    }
}

fn placement() {
    let skeleton = sheet(40);
    let all: Vec<u32> = (0..1000).collect();
    println!(
        "placement on {} points, 1000 candidates: feeders, s",
        skeleton.points.len()
    );
    for count in [1, 2, 3] {
        let clock = Instant::now();
        let options = FeedOptions::default();
        place_feeders(&skeleton, &[], &all, count, &options, &Monitor::default())
            .expect("it feeds");
        println!("{count:>8} {:>9.2}", clock.elapsed().as_secs_f64());
    }
}

/// A bracket of boxes with a pocket, each box with `n` x `n` squares a side.
fn bracket() -> TriMesh {
    let mut mesh = TriMesh::default();
    for [x0, y0, z0, x1, y1, z1] in [
        [0.0, 0.0, 0.0, 120.0, 60.0, 10.0],
        [0.0, 0.0, 0.0, 10.0, 60.0, 50.0],
        [110.0, 0.0, 0.0, 120.0, 60.0, 50.0],
        [0.0, 0.0, 40.0, 50.0, 60.0, 50.0],
    ] {
        let corner = |i: usize| {
            let pick = |bit: usize, low: f64, high: f64| if i >> bit & 1 == 1 { high } else { low };
            Vec3::new(pick(0, x0, x1), pick(1, y0, y1), pick(2, z0, z1))
        };
        let faces = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        for face in faces {
            let [a, b, c, d] = face.map(corner);
            let n = 40_u32;
            let at = |i: u32, j: u32| {
                let (s, t) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                a * (1.0 - s) * (1.0 - t) + b * s * (1.0 - t) + c * s * t + d * (1.0 - s) * t
            };
            let points = (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j)));
            let quads = (0..n).flat_map(|j| (0..n).map(move |i| j * (n + 1) + i));
            let triangles = quads.flat_map(|v| [[v, v + 1, v + n + 2], [v, v + n + 2, v + n + 1]]);
            mesh.append(
                points.map(|(i, j)| at(i, j)).collect::<Vec<_>>(),
                triangles.collect::<Vec<_>>(),
            );
        }
    }
    mesh
}

fn draw_search() {
    let mesh = bracket();
    let clock = Instant::now();
    let best = best_direction(&mesh, 300, 128, 1.0, &Monitor::default()).expect("not cancelled");
    println!(
        "draw search, {} triangles, 300 directions, 128 lines: {:.2} s, undercut {:.0} mm3",
        mesh.triangles.len(),
        clock.elapsed().as_secs_f64(),
        best.undercut
    );
}

/// Directions a degree apart on a half-space: 2 pi / (pi / 180)^2.
const ALL: usize = 20_626;

/// So many of the best of all are judged on the search's finest lattice: what the lines above cannot tell apart.
const CLOSE: usize = 300;

/// Around how many of these, no two of which lie within [`DISC`], directions of a finer grid are judged, too.
const HEADS: usize = 12;
/// Radius of the finer grid and its step, degrees.
const DISC: f64 = 3.0;
const STEP: f64 = 0.25;

/// Directions [`STEP`] apart within [`DISC`] of one.
fn disc(draw: &Vec3) -> Vec<Vec3> {
    let [u, v, w] = axes(draw);
    let (count, step) = ((DISC / STEP) as i32, STEP.to_radians().tan());
    let all = (-count..=count).flat_map(|i| (-count..=count).map(move |j| (i, j)));
    let within = all.filter(|(i, j)| i * i + j * j <= count * count);
    within
        .map(|(i, j)| (w + step * (f64::from(i) * u + f64::from(j) * v)).normalize())
        .collect()
}

/// Degrees between two lines.
fn angle(a: &Vec3, b: &Vec3) -> f64 {
    a.dot(b).abs().min(1.0).acos().to_degrees()
}

/// The search of `grassfire mould` beside all directions, by the same order on the same lines.
///
/// 1. The best of all directions a degree apart, on the search's finest lattice.
/// 2. Of those that count as equal to it, with twice the usual allowance because a degree beside a low is above it, the best that lie
///    [`DISC`] apart: all directions of a finer grid around each.
fn draw_beside_all(part: &str) {
    let read = read_input(
        Path::new(part),
        &ReadOptions::default(),
        &Monitor::default(),
    );
    let Ok(Input::Mesh { mesh, .. }) = read else {
        println!("{part}: not a mesh");
        return;
    };
    let (lines, draft) = (128, 1.0);
    let clock = Instant::now();
    let found = best_direction(&mesh, 300, lines, draft, &Monitor::default()).expect("in time");
    let searched = clock.elapsed().as_secs_f64();
    let look = |draws: &[Vec3], lines: usize| -> Vec<Direction> {
        let seen = draws
            .par_iter()
            .map(|draw| judge(&mesh, draw, lines, draft));
        seen.collect()
    };
    let clock = Instant::now();
    let all = look(&spiral(ALL), lines);
    let close = best_of(&all, allowed(&all, &mesh, lines), CLOSE);
    let close: Vec<Vec3> = close.iter().map(|d| d.draw).collect();
    let mut seen = look(&close, FINER * lines);
    let equal = |seen: &[Direction]| allowed(seen, &mesh, FINER * lines);
    let best_beside = |seen: &[Direction]| {
        let mut both = seen.to_vec();
        both.push(found);
        let equal = equal(&both);
        (best_of(seen, equal, 1)[0], equal)
    };
    println!("{part}: search {searched:.1} s");
    tell("search", &found, &found, equal(&[found]));
    let (best, equal_now) = best_beside(&seen);
    println!("  all: {:.1} s", clock.elapsed().as_secs_f64());
    tell("all", &best, &found, equal_now);

    let least = seen
        .iter()
        .map(|d| d.undercut)
        .fold(f64::INFINITY, f64::min);
    let wide = 2.0 * equal(&seen) - least;
    let mut heads: Vec<Vec3> = Vec::new();
    let mut left_out = 0;
    for one in best_of(&seen, equal(&seen), seen.len()) {
        let apart = heads.iter().all(|head| angle(head, &one.draw) > DISC);
        if one.undercut <= wide && apart {
            if heads.len() < HEADS {
                heads.push(one.draw);
            } else {
                left_out += 1;
            }
        }
    }
    let clock = Instant::now();
    for head in &heads {
        seen.extend(look(&disc(head), FINER * lines));
    }
    let (best, equal_now) = best_beside(&seen);
    println!(
        "  finer around {}, {left_out} left out: {:.1} s",
        heads.len(),
        clock.elapsed().as_secs_f64()
    );
    tell("finer", &best, &found, equal_now);
    // The best of the neighbourhood of what was found.
    let near: Vec<Direction> = look(&disc(&found.draw), FINER * lines);
    let (best, equal_now) = best_beside(&near);
    tell("around the found one", &best, &found, equal_now);
}

/// A direction beside the one found.
fn tell(name: &str, direction: &Direction, found: &Direction, equal: f64) {
    let [x, y, z]: [f64; 3] = direction.draw.into();
    println!(
        "  {name}: ({x:.4}, {y:.4}, {z:.4}) undercut {:.0} mm3 (equal up to {equal:.0}) in {}, flatness {:.2} mm, little draft {:.1} %, {:.2} degrees apart, the found one is {:?} in the order",
        direction.undercut,
        direction.undercuts,
        direction.flatness,
        100.0 * direction.low_draft,
        angle(&found.draw, &direction.draw),
        found.compare(direction, equal)
    );
}

fn freezing(across: &[u32]) {
    let mesh = bracket();
    println!("solidification: cells, steps, s, ns a cell and step");
    for &n in across {
        let options = SolidifyOptions {
            cell: Some(120.0 / f64::from(n)),
            ..SolidifyOptions::default()
        };
        let clock = Instant::now();
        let found = solidify(&mesh, &options, &Monitor::default()).expect("it freezes");
        let seconds = clock.elapsed().as_secs_f64();
        let each = 1e9 * seconds / (found.cells * found.steps) as f64;
        println!(
            "{:>8} {:>5} {seconds:>8.1} {each:>7.1}",
            found.cells, found.steps
        );
    }
}
