//! Valences that the thickened body will have at a skeleton vertex, and what they cost in faces.
//!
//! Offsets of a vertex are the regions into which its quads and beams cut a small sphere (see `thicken`). A body vertex
//! with four edges is regular. Any other is the corner of as many faces as it has edges, so its valence is its cost:
//! with `S` the sum of the irregular valences, the body has `3 S / 4 - C` faces and a small `C`.
//! (Eppstein et al. 2008, <https://doi.org/10.1111/j.1467-8659.2008.01288.x>)

use super::complex::Class;
use super::quad_mesh::{MOST_QUADS, QuadMesh, spokes};

/// Quads at a vertex joined over sides with exactly two quads.
#[derive(Debug, Clone, Copy, Default)]
struct Fan {
    quads: i64,
    /// Sides at its ends that are rims and seams.
    rims: usize,
    seams: usize,
}

/// The quads around a vertex.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Star {
    fans: [Fan; MOST_QUADS],
    count: usize,
    pub rims: usize,
    pub seams: usize,
    beams: usize,
}

/// The star of `v`; `None` with too many quads.
pub(crate) fn star(m: &QuadMesh, v: u32) -> Option<Star> {
    let around = &m.around[v as usize];
    let n = around.len();
    if n > MOST_QUADS {
        return None;
    }
    let mut ends = [(0u32, 0usize); 2 * MOST_QUADS];
    for (i, &q) in around.iter().enumerate() {
        let [a, b] = spokes(&m.quad(q)?, v)?;
        ends[2 * i] = (a, i);
        ends[2 * i + 1] = (b, i);
    }
    let ends = &mut ends[..2 * n];
    ends.sort_unstable();
    let mut fan_of: [usize; MOST_QUADS] = std::array::from_fn(|i| i);
    for run in ends.chunk_by(|a, b| a.0 == b.0).filter(|r| r.len() == 2) {
        let (from, to) = (fan_of[run[0].1], fan_of[run[1].1]);
        for f in &mut fan_of[..n] {
            if *f == from {
                *f = to;
            }
        }
    }
    let mut out = Star {
        fans: [Fan::default(); MOST_QUADS],
        count: 0,
        rims: 0,
        seams: 0,
        beams: m.beams[v as usize].len(),
    };
    for &f in &fan_of[..n] {
        out.fans[f].quads += 1;
    }
    for run in ends.chunk_by(|a, b| a.0 == b.0) {
        match run.len() {
            1 => {
                out.rims += 1;
                out.fans[fan_of[run[0].1]].rims += 1;
            }
            2 => {}
            _ => {
                out.seams += 1;
                for end in run {
                    out.fans[fan_of[end.1]].seams += 1;
                }
            }
        }
    }
    for f in 0..n {
        if out.fans[f].quads > 0 {
            out.fans[out.count] = out.fans[f];
            out.count += 1;
        }
    }
    Some(out)
}

impl Star {
    /// How many fans there are: local changes must keep it.
    pub fn fans(&self) -> usize {
        self.count
    }

    /// Does the star fit the class, with enough quads for valid geometry?
    pub fn valid(&self, class: Class) -> bool {
        match class {
            Class::Interior => {
                self.count == 1 && self.rims + self.seams == 0 && self.fans[0].quads >= 3
            }
            Class::Rim => self.count == 1 && self.rims == 2 && self.seams == 0,
            _ => true,
        }
    }

    /// What the body's vertices here cost: nothing when all are regular. Irregular ones inside a sheet cost `inner` more.
    pub fn cost(&self, inner: f64) -> f64 {
        let k = |i: usize| self.fans[i].quads;
        let closed = |f: &Fan| f.rims + f.seams == 0;
        let fans = &self.fans[..self.count];
        match (self.count, self.rims, self.seams, self.beams) {
            (0, ..) => 0.0,
            (1, 0, 0, 0) if k(0) != 4 => inner + 2.0 * price(k(0)),
            // Inside a sheet; a beam stands on one side.
            (1, 0, 0, beams) => price(k(0) + beams as i64) + price(k(0)),
            (1, 2, 0, 0) => 2.0 * price(k(0) + 2),
            // Beam feet on rims, bow-ties: one ring of gaps around two axis points.
            (_, _, 0, beams) if !fans.iter().any(closed) => {
                2.0 * price(fans.iter().map(|f| f.quads + 2).sum::<i64>() + 2 * beams as i64)
            }
            // Three sheets along a seam, and where all three end.
            (3, 0, 2, 0) => price(k(0) + k(1)) + price(k(1) + k(2)) + price(k(2) + k(0)),
            (3, 3, 1, 0) => {
                price(k(0) + k(1) + 2) + price(k(1) + k(2) + 2) + price(k(2) + k(0) + 2)
            }
            // A sheet ends inside another one.
            (2, 1, 1, 0) => {
                let (plate, rib) = if fans[0].rims == 0 { (0, 1) } else { (1, 0) };
                price(k(plate)) + price(k(plate) + 2 * k(rib) + 1)
            }
            _ => fans.iter().map(|f| price(f.quads + 2)).sum(),
        }
    }
}

/// Cost of one body vertex: its valence, and more for those far from four, which fold easily.
fn price(valence: i64) -> f64 {
    let off = (valence - 4).abs() as f64;
    match valence {
        4 => 0.0,
        ..=2 => 30.0,
        _ => valence as f64 + 0.5 * off * (off - 1.0),
    }
}
