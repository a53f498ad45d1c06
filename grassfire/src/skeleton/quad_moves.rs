//! Local changes of a quad mesh: edge rotation, diagonal collapse, its inverse, and the shortening of a rim.

use super::complex::Class;
use super::quad_mesh::{Change, MOST_QUADS, QuadMesh, spokes};
use crate::Vec3;

/// Turns the side of two quads inside their hexagon, one way or the other.
pub(crate) fn rotate(m: &QuadMesh, i: u32, k: usize, turn: bool) -> Option<Change> {
    let a = m.quad(i)?;
    let (p, q, c, d) = (a[k], a[(k + 1) % 4], a[(k + 2) % 4], a[(k + 3) % 4]);
    let j = neighbour(m, i, p, q)?;
    let mut b = m.quad(j)?;
    let mut at = b.iter().position(|&v| v == q)?;
    if b[(at + 1) % 4] != p {
        b.reverse();
        at = b.iter().position(|&v| v == q)?;
    }
    let (s, t) = (b[(at + 2) % 4], b[(at + 3) % 4]);
    let hexagon = [p, s, t, q, c, d];
    if (0..6).any(|x| hexagon[x + 1..].contains(&hexagon[x])) {
        return None;
    }
    let (g, h, quads) = if turn {
        (d, t, [[d, p, s, t], [d, t, q, c]])
    } else {
        (s, c, [[s, c, d, p], [s, t, q, c]])
    };
    (!m.linked(g, h)).then(|| Change {
        remove: vec![i, j],
        add: quads.to_vec(),
        sheet: m.sheet[i as usize],
        ..Change::default()
    })
}

/// The other quad on side `pq` of quad `i`, when there are two.
fn neighbour(m: &QuadMesh, i: u32, p: u32, q: u32) -> Option<u32> {
    let mut on = m.on_edge(p, q);
    let pair = [on.next()?, on.next()?];
    match (pair, on.next()) {
        ([a, b], None) if a == i => Some(b),
        ([a, b], None) if b == i => Some(a),
        _ => None,
    }
}

/// Removes quad `i` by drawing its corner `k`, inside a sheet, into the opposite one.
pub(crate) fn collapse(m: &QuadMesh, i: u32, k: usize) -> Option<Change> {
    let q = m.quad(i)?;
    let (from, into, x, y) = (q[k], q[(k + 2) % 4], q[(k + 1) % 4], q[(k + 3) % 4]);
    if m.class[from as usize] != Class::Interior || !merges(m, from, into, [x, y]) {
        return None;
    }
    let place = if m.class[into as usize] == Class::Interior {
        vec![(
            into,
            (m.points[from as usize] + m.points[into as usize]) / 2.0,
        )]
    } else {
        Vec::new()
    };
    Some(Change {
        place,
        ..renamed(m, i, from, into)?
    })
}

/// No neighbour in common but `shared`, and no side between the two.
fn merges(m: &QuadMesh, a: u32, b: u32, shared: [u32; 2]) -> bool {
    let ends = m.spoke_ends(b);
    !m.linked(a, b)
        && m.spoke_ends(a)
            .iter()
            .all(|v| shared.contains(v) || !ends.contains(v) && !m.beams[b as usize].contains(v))
}

/// All quads at `from` but `gone`, with `into` in its place.
fn renamed(m: &QuadMesh, gone: u32, from: u32, into: u32) -> Option<Change> {
    let mut change = Change {
        remove: m.around[from as usize].clone(),
        sheet: m.sheet[gone as usize],
        ..Change::default()
    };
    for &i in &m.around[from as usize] {
        if i != gone {
            change
                .add
                .push(m.quad(i)?.map(|v| if v == from { into } else { v }));
        }
    }
    Some(change)
}

/// The inverse of a collapse: the spokes `i` and `j` of the fan of quad `start` at `v` open into a quad, whose new
/// corner takes the quads between them.
pub(crate) fn open(m: &mut QuadMesh, v: u32, start: u32, [i, j]: [usize; 2]) -> Option<Change> {
    let (quads, ends, closed) = fan(m, v, start)?;
    let n = quads.len();
    if i.max(j) > n {
        return None;
    }
    let taken: Vec<u32> = if closed {
        (0..(j + n - i) % n).map(|x| quads[(i + x) % n]).collect()
    } else if i < j && j <= n {
        quads[i..j].to_vec()
    } else {
        return None;
    };
    let left = n - taken.len();
    let inside = m.class[v as usize] == Class::Interior;
    if taken.len() < 2 || inside && left < 2 || n + 2 > MOST_QUADS {
        return None;
    }
    let (s, t) = (ends[i % ends.len()], ends[if closed { j % n } else { j }]);
    let x = m.points[v as usize];
    let centre = |quads: &[u32]| -> Option<Vec3> {
        let sum = quads.iter().try_fold(Vec3::zeros(), |sum, &q| {
            let corners = m.quad(q)?;
            Some(sum + corners.iter().map(|&w| m.points[w as usize]).sum::<Vec3>() / 4.0)
        })?;
        Some(sum / quads.len() as f64)
    };
    let place = x + (centre(&taken)? - x) * 0.5;
    let mut change = Change {
        sheet: m.sheet[start as usize],
        remove: taken.clone(),
        ..Change::default()
    };
    let u = m.add_point(place, m.radii[v as usize], Class::Interior);
    for q in taken {
        change
            .add
            .push(m.quad(q)?.map(|w| if w == v { u } else { w }));
    }
    // The new quad runs against the taken ones over its sides at `u`.
    change.add.push([u, t, v, s]);
    if let Some(&first) = change.add.first()
        && !runs_against([u, t, v, s], first, u, s)
    {
        let last = change.add.len() - 1;
        change.add[last] = [u, s, v, t];
    }
    Some(change)
}

/// Do the two quads pass side `ab` in opposite senses?
fn runs_against(p: [u32; 4], q: [u32; 4], a: u32, b: u32) -> bool {
    let forward = |q: [u32; 4]| (0..4).any(|k| q[k] == a && q[(k + 1) % 4] == b);
    forward(p) != forward(q)
}

/// Quads of the fan of `start` around `v` in order, the far ends of the sides between them, and whether it closes.
/// An open fan has one side more than quads.
fn fan(m: &QuadMesh, v: u32, start: u32) -> Option<(Vec<u32>, Vec<u32>, bool)> {
    let walk = |first: u32, over: u32| -> Option<(Vec<u32>, Vec<u32>, bool)> {
        let (mut quads, mut ends) = (vec![first], Vec::new());
        let mut side = over;
        loop {
            ends.push(side);
            let at = quads[quads.len() - 1];
            let Some(next) = neighbour(m, at, v, side) else {
                return Some((quads, ends, false));
            };
            if next == first {
                return Some((quads, ends, true));
            }
            if quads.len() > MOST_QUADS {
                return None;
            }
            quads.push(next);
            let [a, b] = spokes(&m.quad(next)?, v)?;
            side = if a == side { b } else { a };
        }
    };
    let [a, b] = spokes(&m.quad(start)?, v)?;
    let (quads, mut ends, closed) = walk(start, b)?;
    if closed {
        // The side before the first quad comes first.
        ends.rotate_right(1);
        return Some((quads, ends, true));
    }
    let (last, outer) = (*quads.last()?, *ends.last()?);
    let [p, q] = spokes(&m.quad(last)?, v)?;
    let inner = if p == outer { q } else { p };
    // Back from the end: from one end of the fan to the other.
    let (quads, mut ends, _) = if quads.len() == 1 {
        walk(last, a)?
    } else {
        walk(last, inner)?
    };
    ends.insert(0, outer);
    Some((quads, ends, false))
}

/// Takes quad `i` with corner `k`, alone on its rim, out: its two rim sides fall together.
pub(crate) fn shorten_rim(m: &QuadMesh, i: u32, k: usize) -> Option<Change> {
    let q = m.quad(i)?;
    let (x, mut from, mut into, y) = (q[k], q[(k + 1) % 4], q[(k + 3) % 4], q[(k + 2) % 4]);
    let rim = |v: u32| m.class[v as usize] == Class::Rim;
    if !rim(x) || m.around[x as usize].len() != 1 {
        return None;
    }
    if !rim(from) {
        (from, into) = (into, from);
    }
    if !rim(from) || !merges(m, from, into, [x, y]) || m.rim_ends(from).contains(&into) {
        return None;
    }
    let place = if rim(into) {
        vec![(into, m.points[x as usize])]
    } else {
        Vec::new()
    };
    Some(Change {
        place,
        shortens_rim: true,
        ..renamed(m, i, from, into)?
    })
}
