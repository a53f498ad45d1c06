//! Collapse of short edges and pruning of spurs on the fine complex.

use super::complex::{Class, Complex};
use crate::monitor::{Cancelled, Monitor};

/// Contracts edges shorter than `length`, shortest first, keeping rims on rims, seams on seams and beams on beams.
/// `unit` is the lattice length of the complex: below 0.05 of it an edge counts as zero.
pub(crate) fn collapse_short(
    c: &mut Complex,
    length: f64,
    unit: f64,
    rounds: usize,
    monitor: &Monitor,
) -> Result<(), Cancelled> {
    for _ in 0..rounds {
        monitor.check()?;
        let mut edges: Vec<(f64, [u32; 2])> = c
            .edges()
            .into_iter()
            .map(|e| (c.length(e[0], e[1]), e))
            .filter(|x| x.0 <= length)
            .collect();
        edges.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut collapsed = 0;
        for (l, [a, b]) in edges {
            if c.used(a) && c.used(b) && c.connected(a, b) && try_collapse(c, a, b, l, length, unit)
            {
                collapsed += 1;
            }
        }
        c.compact();
        if collapsed == 0 {
            break;
        }
    }
    Ok(())
}

fn try_collapse(c: &mut Complex, a: u32, b: u32, l: f64, length: f64, unit: f64) -> bool {
    let (ka, kb) = (c.class(a), c.class(b));
    let (a, b, ka) = if ka > kb { (b, a, kb) } else { (a, b, ka) };
    let (faces, beam) = (c.face_count(a, b), c.is_beam(a, b));
    // Sheets that a beam joins must not come to touch in a point.
    let sheets = |v: u32| !c.vertex_triangles[v as usize].is_empty();
    if beam && sheets(a) && sheets(b) {
        return false;
    }
    let allowed = match ka {
        Class::Interior => true,
        Class::Rim => faces == 1,
        Class::Seam => faces >= 3,
        Class::Beam => beam,
        Class::Corner => faces != 2 || beam,
    };
    if l > 0.3 * length && !allowed {
        return false;
    }
    let fits =
        l < 0.05 * unit || !c.would_flip(a, b, &c.points[b as usize], 0.3, 1e-2 * unit * unit);
    if fits && c.link_condition(a, b) {
        c.collapse(a, b);
        return true;
    }
    false
}

/// Up to where a dangling beam is a spur.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SpurLimits {
    /// Its ball sticks out of the root's ball by less than this, mm.
    pub absolute: f64,
    /// The same over the radius of the root's ball.
    pub relative: f64,
    /// The same for one that is slight: what tapers off beside a body that was cut out comes and goes with the voxel.
    pub relative_slight: f64,
    /// It is slight when it has less material outside of the root's ball than this many balls of the root's radius.
    pub balls: f64,
}

/// A dangling chain of beams, tip first.
struct Spur {
    protrusion: f64,
    /// Material outside of the root's ball, mm3.
    volume: f64,
    path: Vec<u32>,
}

impl Spur {
    fn within(&self, limits: &SpurLimits, root: f64) -> bool {
        let ball = 4.0 / 3.0 * std::f64::consts::PI * root.powi(3);
        let slight = self.volume < limits.balls * ball;
        self.protrusion < limits.absolute.max(limits.relative * root)
            || slight && self.protrusion < limits.relative_slight * root
    }
}

/// Removes dangling beams within `limits`, again and again until none is left. A component never vanishes: a chain with
/// two free ends stays. Returns how many spurs went.
pub(crate) fn prune_spurs(c: &mut Complex, limits: &SpurLimits) -> usize {
    let mut removed = 0;
    loop {
        let mut spurs: Vec<Spur> = (0..c.points.len() as u32)
            .filter(|&v| is_tip(c, v))
            .filter_map(|tip| spur_from(c, tip))
            .filter(|s| {
                let root = s.path[s.path.len() - 1];
                s.within(limits, c.radii[root as usize])
            })
            .collect();
        if spurs.is_empty() {
            return removed;
        }
        spurs.sort_by(|a, b| {
            a.protrusion
                .total_cmp(&b.protrusion)
                .then(a.path.cmp(&b.path))
        });
        let mut roots = vec![false; c.points.len()];
        for spur in spurs {
            // One spur a root and round: the rest may have become a plain chain.
            let root = spur.path[spur.path.len() - 1] as usize;
            if std::mem::replace(&mut roots[root], true) {
                continue;
            }
            removed += 1;
            for pair in spur.path.windows(2) {
                for x in c.vertex_beams[pair[0] as usize].clone() {
                    if c.beams[x as usize].contains(&pair[1]) {
                        c.remove_beam(x);
                    }
                }
            }
        }
    }
}

fn is_tip(c: &Complex, v: u32) -> bool {
    c.vertex_beams[v as usize].len() == 1 && c.vertex_triangles[v as usize].is_empty()
}

fn spur_from(c: &Complex, tip: u32) -> Option<Spur> {
    let mut path = vec![tip];
    let mut length = 0.0;
    let mut last_beam = c.vertex_beams[tip as usize][0];
    loop {
        let at = path[path.len() - 1];
        let [p, q] = c.beams[last_beam as usize];
        let next = if p == at { q } else { p };
        length += c.length(at, next);
        path.push(next);
        if c.class(next) != Class::Beam {
            break;
        }
        let beams = &c.vertex_beams[next as usize];
        last_beam = if beams[0] == last_beam {
            beams[1]
        } else {
            beams[0]
        };
    }
    let root = path[path.len() - 1];
    if is_tip(c, root) {
        return None;
    }
    Some(Spur {
        protrusion: length + c.radii[tip as usize] - c.radii[root as usize],
        volume: outside(c, &path),
        path,
    })
}

/// Volume of the tubes along a path as far as they lie outside of the ball at its end.
fn outside(c: &Complex, path: &[u32]) -> f64 {
    let root = path[path.len() - 1] as usize;
    let tube = |pair: &[u32]| {
        let [a, b] = [pair[0] as usize, pair[1] as usize];
        let middle = (c.points[a] + c.points[b]) / 2.0;
        let radius = (c.radii[a] + c.radii[b]) / 2.0;
        let free = (middle - c.points[root]).norm() > c.radii[root];
        let length = if free {
            c.length(pair[0], pair[1])
        } else {
            0.0
        };
        std::f64::consts::PI * radius * radius * length
    };
    path.windows(2).map(tube).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;

    #[test]
    fn spurs_go_and_a_lone_chain_stays() {
        // A T of beams: the short leg is a spur, the long bar stays although both its ends are free.
        let x = |x: f64, y: f64| Vec3::new(x, y, 0.0);
        let points = vec![x(-10.0, 0.0), x(0.0, 0.0), x(10.0, 0.0), x(0.0, 1.0)];
        let none: [[u32; 3]; 0] = [];
        let mut c = Complex::new(points, vec![2.0; 4], &none, &[[0, 1], [1, 2], [1, 3]]);
        let limits = |absolute| SpurLimits {
            absolute,
            relative: 0.6,
            ..SpurLimits::default()
        };
        assert_eq!(prune_spurs(&mut c, &limits(1.0)), 1);
        assert_eq!(c.alive_beams().count(), 2);
        assert_eq!(prune_spurs(&mut c, &limits(1e9)), 0);
    }

    #[test]
    fn tapering_remnants_beside_a_body_came_and_went_with_the_voxel() {
        // Two spurs of eight radii on a bar: one tapers to a tenth of its radius, the other is as thick as the bar.
        let x = |x: f64, y: f64| Vec3::new(x, y, 0.0);
        let (mut points, mut radii) =
            (vec![x(-40.0, 0.0), x(0.0, 0.0), x(40.0, 0.0)], vec![2.0; 3]);
        let mut beams = vec![[0, 1], [1, 2]];
        for side in [1.0, -1.0] {
            for step in 1..=16u32 {
                let tip = points.len() as u32;
                beams.push([if step == 1 { 1 } else { tip - 1 }, tip]);
                points.push(x(0.0, side * f64::from(step)));
                let taper = if side > 0.0 {
                    1.0 - 0.9 * f64::from(step) / 16.0
                } else {
                    1.0
                };
                radii.push(2.0 * taper);
            }
        }
        let none: [[u32; 3]; 0] = [];
        let mut c = Complex::new(points, radii, &none, &beams);
        let limits = SpurLimits {
            absolute: 1.0,
            relative: 2.4,
            relative_slight: 8.0,
            balls: 3.0,
        };
        assert_eq!(prune_spurs(&mut c, &limits), 1);
        c.compact();
        assert!(c.points.iter().all(|p| p.y <= 0.0) && c.alive_beams().count() == 18);
    }

    #[test]
    fn short_edges_go_and_topology_stays() {
        let n = 40;
        let points = (0..n)
            .map(|i| Vec3::new((i / 2) as f64 * 0.2, (i % 2) as f64 * 0.2, 0.0))
            .collect();
        let triangles: Vec<[u32; 3]> = (0..n - 2)
            .map(|i| [i as u32, i as u32 + 1, i as u32 + 2])
            .collect();
        let mut c = Complex::new(points, vec![1.0; n], &triangles, &[]);
        let before = c.betti();
        collapse_short(&mut c, 1.0, 1.0, 5, &Monitor::default()).expect("not cancelled");
        assert_eq!(c.betti(), before);
        assert!(c.alive().count() + c.alive_beams().count() < 20);
    }
}
