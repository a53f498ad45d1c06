//! Short necks between sheets, which stay sheets.

use rayon::prelude::*;

use super::burn::{Alive, FaceSpheres, distance};
use super::complex::Complex;
use super::curves::Incidence;

/// Faces within this many radii of a neck's curve belong to it.
const REACH: f32 = 1.2;

/// A curve that joins two places of sheets.
struct Neck {
    /// Its places and their radii.
    spheres: Vec<([f32; 3], f32)>,
    lo: [f32; 3],
    hi: [f32; 3],
}

impl Neck {
    fn new(complex: &Complex, chain: &[u32]) -> Self {
        let sphere = |&v: &u32| (complex.centres[v as usize], complex.radii[v as usize]);
        let spheres: Vec<_> = chain.iter().map(sphere).collect();
        let (mut lo, mut hi) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for (centre, radius) in &spheres {
            for k in 0..3 {
                lo[k] = lo[k].min(centre[k] - REACH * radius);
                hi[k] = hi[k].max(centre[k] + REACH * radius);
            }
        }
        Self { spheres, lo, hi }
    }

    /// Length over mean radius. A path along Voronoi edges zigzags: the length is that of the widest way from end to end over
    /// one place of it.
    fn slenderness(&self) -> f32 {
        let (Some(first), Some(last)) = (self.spheres.first(), self.spheres.last()) else {
            return 0.0;
        };
        let detour = |s: &([f32; 3], f32)| distance(&first.0, &s.0) + distance(&s.0, &last.0);
        let length = self.spheres.iter().map(detour).fold(0.0, f32::max);
        let radius = self.spheres.iter().map(|s| s.1).sum::<f32>() / self.spheres.len() as f32;
        length / radius
    }

    fn holds(&self, p: &[f32; 3]) -> bool {
        (0..3).all(|k| self.lo[k] <= p[k] && p[k] <= self.hi[k])
            && self
                .spheres
                .iter()
                .any(|(centre, radius)| distance(centre, p) <= REACH * radius)
    }
}

/// Marks the faces at curves between sheets that are shorter than `most` times their radius; whether there are new ones.
pub(super) fn add_necks(
    complex: &Complex,
    spheres: &FaceSpheres,
    alive: &Alive,
    most: f64,
    marked: &mut [bool],
) -> bool {
    let necks: Vec<Neck> = curves_between_sheets(complex, alive)
        .iter()
        .map(|chain| Neck::new(complex, chain))
        .filter(|neck| f64::from(neck.slenderness()) < most)
        .collect();
    if necks.is_empty() {
        return false;
    }
    let added: Vec<u32> = (0..complex.faces() as u32)
        .into_par_iter()
        .filter(|&f| {
            let centre = &spheres.centres[f as usize];
            !marked[f as usize] && necks.iter().any(|neck| neck.holds(centre))
        })
        .collect();
    added.iter().for_each(|&f| marked[f as usize] = true);
    !added.is_empty()
}

/// Vertices of every curve from a sheet to a sheet that nothing but dangling curves branches off.
fn curves_between_sheets(complex: &Complex, alive: &Alive) -> Vec<Vec<u32>> {
    let mut is_curve = vec![false; complex.edges.len()];
    let mut on_sheet = vec![false; complex.radii.len()];
    for e in (0..complex.edges.len()).filter(|&e| alive.edges[e]) {
        is_curve[e] = alive.faces_at(complex, e as u32).next().is_none();
        if !is_curve[e] {
            complex.edges[e]
                .iter()
                .for_each(|&v| on_sheet[v as usize] = true);
        }
    }
    drop_dangling(complex, &mut is_curve, &on_sheet);
    let at = Incidence::of(complex, &is_curve);
    let mut chains = Vec::new();
    for start in (0..on_sheet.len() as u32).filter(|&v| on_sheet[v as usize]) {
        for &first in at.edges(start) {
            let (mut chain, mut edge) = (vec![start], first);
            let ended = loop {
                let [a, b] = complex.edges[edge as usize];
                let v = if chain.last() == Some(&a) { b } else { a };
                chain.push(v);
                if on_sheet[v as usize] {
                    break true;
                }
                match at.edges(v) {
                    &[p, q] => edge = if p == edge { q } else { p },
                    _ => break false,
                }
            };
            // Each curve is met from both of its ends.
            if ended && chain.last() > chain.first() {
                chains.push(chain);
            }
        }
    }
    chains
}

/// Takes dangling curves out of the set.
fn drop_dangling(complex: &Complex, is_curve: &mut [bool], on_sheet: &[bool]) {
    let at = Incidence::of(complex, is_curve);
    let mut degree: Vec<usize> = (0..on_sheet.len() as u32)
        .map(|v| at.edges(v).len())
        .collect();
    let dangles = |v: u32, degree: &[usize]| degree[v as usize] == 1 && !on_sheet[v as usize];
    let tips = (0..on_sheet.len() as u32).filter(|&v| dangles(v, &degree));
    let mut tips: Vec<u32> = tips.collect();
    while let Some(tip) = tips.pop() {
        let edge = at.edges(tip).iter().find(|&&e| is_curve[e as usize]);
        let Some(&edge) = edge else { continue };
        is_curve[edge as usize] = false;
        let [a, b] = complex.edges[edge as usize];
        let inner = if a == tip { b } else { a };
        degree[inner as usize] -= 1;
        if dangles(inner, &degree) {
            tips.push(inner);
        }
    }
}
