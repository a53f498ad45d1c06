//! Tubes of 4-gons along the beams.

use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::complex::Complex;
use super::regions::{Draft, Foot};
use super::{RuleCounts, ThickenError, perpendicular, unit};
use crate::Vec3;
use crate::monitor::Monitor;

/// Steps 5 and 6 of [`super::thicken`].
pub(super) fn add_beams(
    complex: &Complex,
    draft: &mut Draft,
    rules: &mut RuleCounts,
    monitor: &Monitor,
) -> Result<(), ThickenError> {
    for chain in chains(complex, draft) {
        monitor.check()?;
        if chain.first() == chain.last() && draft.feet[chain[0] as usize] == Foot::Chain {
            add_loop(complex, &chain, draft);
            rules.loops += 1;
            continue;
        }
        let last = chain.len() - 1;
        let start = section(complex, chain[0], chain[1], draft, rules)?;
        let end = section(complex, chain[last], chain[last - 1], draft, rules)?;
        add_tube(complex, &chain, start, end, draft);
    }
    Ok(())
}

/// Maximal paths of beams whose inner vertices are plain, then the closed loops (first vertex
/// repeated at the end).
fn chains(complex: &Complex, draft: &Draft) -> Vec<Vec<u32>> {
    let plain = |v: u32| draft.feet[v as usize] == Foot::Chain;
    let follow = |mut path: Vec<u32>, stop: Option<u32>| {
        loop {
            let (here, from) = (path[path.len() - 1], path[path.len() - 2]);
            if !plain(here) || Some(here) == stop {
                return path;
            }
            let next = complex.beam_neighbours[here as usize]
                .iter()
                .find(|&&w| w != from);
            path.extend(next);
        }
    };
    let mut done = BTreeSet::new();
    let mut visited = vec![false; complex.points.len()];
    let mut list = Vec::new();
    for a in (0..complex.points.len() as u32).filter(|&a| !plain(a)) {
        for &b in &complex.beam_neighbours[a as usize] {
            if done.contains(&(a, b)) {
                continue;
            }
            let path = follow(vec![a, b], None);
            done.insert((a, b));
            done.insert((path[path.len() - 1], path[path.len() - 2]));
            path.iter().for_each(|&v| visited[v as usize] = true);
            list.push(path);
        }
    }
    for a in (0..complex.points.len() as u32).filter(|&a| plain(a)) {
        if !visited[a as usize] {
            let path = follow(vec![a, complex.beam_neighbours[a as usize][0]], Some(a));
            path.iter().for_each(|&v| visited[v as usize] = true);
            list.push(path);
        }
    }
    list
}

/// The section at `v` for the beam to `w`, in the order of the quad that it replaces.
fn section(
    complex: &Complex,
    v: u32,
    w: u32,
    draft: &mut Draft,
    rules: &mut RuleCounts,
) -> Result<[u32; 4], ThickenError> {
    let (at, radius) = (complex.at(v), complex.radii[v as usize]);
    let direction = unit(complex.at(w) - at);
    if let Some(&ready) = draft.sections.get(&(v, w)) {
        return Ok(ready);
    }
    if draft.feet[v as usize] == Foot::Plug {
        rules.plug_feet += 1;
        return plug(v, &at, &direction, draft).ok_or(ThickenError::BadVertex {
            point: complex.source[v as usize],
            place: at,
            what: "no quad is left for a beam",
        });
    }
    rules.tips += 1;
    let across = perpendicular(&direction);
    let up = direction.cross(&across);
    let centre = at - 0.55 * radius * direction;
    let ids = [across, up, -across, -up].map(|d| draft.point(centre + 0.9 * radius * d, v));
    let [a, b, c, d] = ids;
    draft.quad([d, c, b, a]);
    Ok(ids)
}

/// Takes the quad at `v` that looks most along `direction` out of the body.
fn plug(v: u32, at: &Vec3, direction: &Vec3, draft: &mut Draft) -> Option<[u32; 4]> {
    let mut best: Option<(f64, u32)> = None;
    for &p in &draft.vertex_points[v as usize] {
        for &id in &draft.point_quads[p as usize] {
            let Some(quad) = draft.quads[id as usize] else {
                continue;
            };
            let [a, b, c, d] = quad.map(|i| draft.points[i as usize]);
            let normal = unit((c - a).cross(&(d - b)));
            let toward = unit((a + b + c + d) / 4.0 - at);
            let score = toward.dot(direction) + 0.5 * normal.dot(direction);
            if best.is_none_or(|(s, i)| score > s || (score == s && id < i)) {
                best = Some((score, id));
            }
        }
    }
    draft.quads[best?.1 as usize].take()
}

/// Unit tangents of a path; of a closed one (`looped`) the first equals the last.
fn tangents(complex: &Complex, path: &[u32], looped: bool) -> Vec<Vec3> {
    let steps: Vec<Vec3> = path
        .windows(2)
        .map(|w| unit(complex.at(w[1]) - complex.at(w[0])))
        .collect();
    let count = steps.len();
    let mean = |a: &Vec3, b: &Vec3| {
        (a + b)
            .try_normalize(1e-6)
            .unwrap_or_else(|| perpendicular(a))
    };
    (0..=count)
        .map(|k| match k {
            0 if looped => mean(&steps[count - 1], &steps[0]),
            0 => steps[0],
            k if k == count && looped => mean(&steps[count - 1], &steps[0]),
            k if k == count => steps[count - 1],
            k => mean(&steps[k - 1], &steps[k]),
        })
        .collect()
}

/// The part of `u` across the unit vector `tangent`, or any direction across.
fn across(u: &Vec3, tangent: &Vec3) -> Vec3 {
    (u - tangent * u.dot(tangent))
        .try_normalize(1e-6)
        .unwrap_or_else(|| perpendicular(tangent))
}

/// First frame directions transported along the path without twist (double reflection is not needed
/// at this step length; projection is exact for the piecewise straight axis).
fn transport(first: Vec3, tangents: &[Vec3]) -> Vec<Vec3> {
    let mut frames = vec![across(&first, &tangents[0])];
    for (k, tangent) in tangents.iter().enumerate().skip(1) {
        frames.push(across(&frames[k - 1], tangent));
    }
    frames
}

/// Four points of vertex `v` around `at`, counter-clockwise about `tangent`, the first turned by `turn` from `u`.
fn ring_points(
    complex: &Complex,
    (v, at): (u32, Vec3),
    u: &Vec3,
    tangent: &Vec3,
    turn: f64,
    draft: &mut Draft,
) -> [u32; 4] {
    let radius = complex.radii[v as usize];
    let w = tangent.cross(u);
    [0.0, 1.0, 2.0, 3.0].map(|quarter| {
        let angle = turn + quarter * FRAC_PI_2;
        draft.point(at + radius * (u * angle.cos() + w * angle.sin()), v)
    })
}

fn stitch(from: &[u32; 4], to: &[u32; 4], draft: &mut Draft) {
    for j in 0..4 {
        draft.quad([from[j], from[(j + 1) % 4], to[(j + 1) % 4], to[j]]);
    }
}

fn add_tube(complex: &Complex, path: &[u32], start: [u32; 4], end: [u32; 4], draft: &mut Draft) {
    let last = path.len() - 1;
    let tangents = tangents(complex, path, false);
    let [a, b, c, d] = end;
    let end = [d, c, b, a];
    let centre = |s: &[u32; 4], draft: &Draft| {
        s.map(|i| draft.points[i as usize]).iter().sum::<Vec3>() / 4.0
    };
    let first = draft.points[start[0] as usize] - centre(&start, draft);
    let frames = transport(first, &tangents);
    // Which corner of the last section follows the first corner of the first one with least twist.
    let (u, w) = (frames[last], tangents[last].cross(&frames[last]));
    let middle = centre(&end, draft);
    let angles = end.map(|i| {
        let d = draft.points[i as usize] - middle;
        d.dot(&w).atan2(d.dot(&u))
    });
    let twist = |shift: usize| {
        let turns = (0..4).map(|j| angles[(j + shift) % 4] - j as f64 * FRAC_PI_2);
        let (x, y) = turns.fold((0.0, 0.0), |(x, y), t| (x + t.cos(), y + t.sin()));
        f64::atan2(y, x)
    };
    let shift = (0..4)
        .min_by(|&a, &b| twist(a).abs().total_cmp(&twist(b).abs()))
        .unwrap_or(0);
    let turn = twist(shift);
    let places = places(complex, path, start.iter().any(|p| end.contains(p)));
    let mut before = start;
    for (i, &(k, at)) in places.iter().enumerate() {
        let part = turn * (i + 1) as f64 / (places.len() + 1) as f64;
        let here = ring_points(
            complex,
            (path[k], at),
            &frames[k],
            &tangents[k],
            part,
            draft,
        );
        stitch(&before, &here, draft);
        before = here;
    }
    stitch(&before, &[0, 1, 2, 3].map(|j| end[(j + shift) % 4]), draft);
}

/// Where a tube along `path` has its sections: index into the path and centre. With a single section between two
/// feet that share a point (`touching`), two edges of the tube could coincide: it gets two.
fn places(complex: &Complex, path: &[u32], touching: bool) -> Vec<(usize, Vec3)> {
    let at = |k: usize| complex.at(path[k]);
    if touching && path.len() == 3 {
        return [0, 2].map(|k| (1, at(1) + 0.25 * (at(k) - at(1)))).to_vec();
    }
    (1..path.len() - 1).map(|k| (k, at(k))).collect()
}

fn add_loop(complex: &Complex, path: &[u32], draft: &mut Draft) {
    let last = path.len() - 1;
    let tangents = tangents(complex, path, true);
    let frames = transport(perpendicular(&tangents[0]), &tangents);
    let (u, w) = (frames[last], tangents[last].cross(&frames[last]));
    let angle = frames[0].dot(&w).atan2(frames[0].dot(&u));
    let shift = (angle / FRAC_PI_2).round();
    let turn = angle - shift * FRAC_PI_2;
    debug_assert!(turn.abs() <= PI / 4.0 + 1e-9 && angle.abs() <= TAU);
    let at = |k: usize| (path[k], complex.at(path[k]));
    let first = ring_points(complex, at(0), &frames[0], &tangents[0], 0.0, draft);
    let mut before = first;
    for k in 1..last {
        let part = turn * k as f64 / last as f64;
        let here = ring_points(complex, at(k), &frames[k], &tangents[k], part, draft);
        stitch(&before, &here, draft);
        before = here;
    }
    let shift = shift.rem_euclid(4.0) as usize;
    stitch(
        &before,
        &[0, 1, 2, 3].map(|j| first[(j + 4 - shift) % 4]),
        draft,
    );
}
