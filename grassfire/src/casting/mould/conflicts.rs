//! Panels of a skeleton that shadow each other along the draw direction, and edits that part them.

use std::collections::BTreeMap;

use crate::Vec3;
use crate::edit::{Edit, Region, Rotation, cells_of};
use crate::mesh::Bvh;
use crate::skeleton::{EdgeTable, Skeleton, UnionFind};

/// Quads whose normal is nearer than this to the draw direction lie across it, degrees.
const ACROSS: f64 = 45.0;
/// Two panels are in conflict when this share of the smaller one lies over the other.
const SHADOWED: f64 = 0.25;
/// Places on a quad that are looked from; none on a diagonal, so that no ray meets an edge of aligned quads.
const PLACES: [[f64; 2]; 4] = [[0.3, 0.2], [0.8, 0.3], [0.7, 0.8], [0.2, 0.7]];

/// Two panels with a room between them that only a core makes.
#[derive(Debug, Clone, PartialEq)]
pub struct Conflict {
    /// Places on the lesser and on the greater panel, mm.
    pub places: [Vec3; 2],
    /// Area of the lesser that lies over the greater, across the draw direction, mm2.
    pub shadowed: f64,
    /// Takes the lesser away.
    pub remove: Edit,
    /// Turns both by 90 degrees about their long axes, towards each other, so that they stand along the draw direction.
    pub turn: [Edit; 2],
}

/// A part of a sheet that lies across the draw direction.
#[derive(Debug, Clone, PartialEq)]
struct Panel {
    quads: Vec<usize>,
    area: f64,
    /// Area times radius, mm3.
    size: f64,
    centre: Vec3,
}

/// The conflicts of a skeleton along the unit vector `draw`, those with the largest shadow first; no panel is in two.
///
/// 1. Panels: quads with a normal within 45 degrees of the draw direction that hang together over edges with two quads.
/// 2. From four places on each of their quads the next quad above and below along the draw direction is looked for. When it
///    belongs to another panel, with a room wider than `least` mm between the walls, a quarter of the quad lies over that.
/// 3. Pairs with more than a quarter of the smaller panel in the other's shadow are in conflict; the greedy choice by
///    shadowed area takes each panel once.
pub fn conflicts(skeleton: &Skeleton, draw: &Vec3, least: f64) -> Vec<Conflict> {
    let (panels, of) = panels(skeleton, draw);
    let mut pairs: Vec<(f64, usize, usize)> = shadows(skeleton, &of, draw, least)
        .into_iter()
        .map(|((lesser, greater), area)| (area, lesser, greater))
        .collect();
    pairs.retain(|&(area, lesser, greater)| {
        let (own, other) = (&panels[lesser], &panels[greater]);
        // Seen from the lesser one; of equal ones from the first.
        let order = own.size.total_cmp(&other.size).then(lesser.cmp(&greater));
        order.is_lt() && area > SHADOWED * own.area
    });
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut taken = vec![false; panels.len()];
    let mut out = Vec::new();
    for (shadowed, lesser, greater) in pairs {
        if taken[lesser] || taken[greater] {
            continue;
        }
        (taken[lesser], taken[greater]) = (true, true);
        let both = [&panels[lesser], &panels[greater]];
        let places = both.map(|panel| place_on(skeleton, panel));
        let way = (both[1].centre - both[0].centre).dot(draw).signum();
        out.push(Conflict {
            places,
            shadowed,
            remove: Edit {
                within: Some(Region::Panel(places[0].into())),
                delete: true,
                ..Edit::default()
            },
            turn: [
                turned(skeleton, both[0], places[0], &(draw * way)),
                turned(skeleton, both[1], places[1], &(draw * -way)),
            ],
        });
    }
    out
}

/// The panels, and the panel of every quad.
fn panels(skeleton: &Skeleton, draw: &Vec3) -> (Vec<Panel>, Vec<Option<usize>>) {
    let normals: Vec<Vec3> = skeleton
        .quads
        .iter()
        .map(|q| half_normal(skeleton, q))
        .collect();
    let limit = ACROSS.to_radians().cos();
    let across = |q: u32| {
        let n = &normals[q as usize];
        n.dot(draw).abs() > limit * n.norm()
    };
    let mut sets = UnionFind::new(normals.len());
    for (_, faces) in EdgeTable::of_quads(&skeleton.quads).iter() {
        if let [a, b] = faces
            && across(*a)
            && across(*b)
        {
            sets.join(*a, *b);
        }
    }
    let mut panels: Vec<Panel> = Vec::new();
    let mut of = vec![None; normals.len()];
    for q in (0..normals.len()).filter(|&q| across(q as u32)) {
        let root = sets.find(q as u32) as usize;
        let number = of[root].unwrap_or(panels.len());
        if number == panels.len() {
            panels.push(Panel {
                quads: Vec::new(),
                area: 0.0,
                size: 0.0,
                centre: Vec3::zeros(),
            });
        }
        of[q] = Some(number);
        let quad = &skeleton.quads[q];
        let radius = quad
            .iter()
            .map(|&v| skeleton.radii[v as usize])
            .sum::<f64>()
            / 4.0;
        let area = normals[q].dot(draw).abs();
        let panel = &mut panels[number];
        panel.quads.push(q);
        panel.area += area;
        panel.size += area * radius;
        panel.centre += on_quad(skeleton, quad, [0.5; 2]) * area;
    }
    for panel in &mut panels {
        panel.centre /= panel.area;
    }
    (panels, of)
}

/// Normal of a quad, as long as its area.
fn half_normal(skeleton: &Skeleton, q: &[u32; 4]) -> Vec3 {
    let p = q.map(|v| skeleton.points[v as usize]);
    (p[2] - p[0]).cross(&(p[3] - p[1])) / 2.0
}

/// A place on a quad.
fn on_quad(skeleton: &Skeleton, q: &[u32; 4], [s, t]: [f64; 2]) -> Vec3 {
    let p = q.map(|v| skeleton.points[v as usize]);
    (p[0] * (1.0 - s) + p[1] * s) * (1.0 - t) + (p[3] * (1.0 - s) + p[2] * s) * t
}

/// Area of one panel in the shadow of another, by their numbers.
fn shadows(
    skeleton: &Skeleton,
    of: &[Option<usize>],
    draw: &Vec3,
    least: f64,
) -> BTreeMap<(usize, usize), f64> {
    let radius = |q: &[u32; 4]| q.iter().map(|&v| skeleton.radii[v as usize]).sum::<f64>() / 4.0;
    let cells = Bvh::new(&cells_of(&Skeleton {
        beams: Vec::new(),
        ..skeleton.clone()
    }));
    let mut out = BTreeMap::new();
    for (q, quad) in skeleton.quads.iter().enumerate() {
        let Some(own) = of[q] else { continue };
        let share = half_normal(skeleton, quad).dot(draw).abs() / PLACES.len() as f64;
        for place in PLACES {
            let from = on_quad(skeleton, quad, place);
            for way in [*draw, -draw] {
                let start = radius(quad);
                let Some((distance, hit)) = cells.first_hit(&from, &way, start, f64::INFINITY)
                else {
                    continue;
                };
                // Two triangles a quad, in their order.
                let other = hit as usize / 2;
                let room = distance - start - radius(&skeleton.quads[other]);
                if let Some(other) = of[other].filter(|&other| other != own && room > least) {
                    *out.entry((own, other)).or_insert(0.0) += share;
                }
            }
        }
    }
    out
}

/// The middle of the quad that is nearest to the panel's centre.
fn place_on(skeleton: &Skeleton, panel: &Panel) -> Vec3 {
    let middles = panel
        .quads
        .iter()
        .map(|&q| on_quad(skeleton, &skeleton.quads[q], [0.5; 2]));
    let away = |p: &Vec3| (p - panel.centre).norm();
    let nearest = middles.min_by(|a, b| away(a).total_cmp(&away(b)));
    rounded(&nearest.unwrap_or(panel.centre), 1e3)
}

/// Edits are read and copied by people: a micrometre is enough.
fn rounded(v: &Vec3, parts: f64) -> Vec3 {
    v.map(|x| (x * parts).round() / parts)
}

/// Turns a panel by 90 degrees about its long axis, and moves it by half its width along `way`: it stands then, and its outer end is
/// where the panel was. The side on which it hangs on other quads becomes that end.
fn turned(skeleton: &Skeleton, panel: &Panel, place: Vec3, way: &Vec3) -> Edit {
    let axis = long_axis(skeleton, panel, way);
    let across = way.cross(&axis);
    let offset = |p: &Vec3| (p - panel.centre).dot(&across);
    let corners = panel.quads.iter().flat_map(|&q| skeleton.quads[q]);
    let offsets = corners.map(|v| offset(&skeleton.points[v as usize]));
    let (low, high) = offsets.fold((0.0_f64, 0.0_f64), |(low, high), x| {
        (low.min(x), high.max(x))
    });
    // Turning takes `across` to `way`, turning back to its opposite, which is where the other quads shall be.
    let sense = if hanging(skeleton, panel, &offset) > 0.0 {
        -1.0
    } else {
        1.0
    };
    // A turn and a move are a turn about another centre.
    let half = (high - low) / 4.0;
    let centre = panel.centre + way * half - across * (sense * half);
    Edit {
        within: Some(Region::Panel(place.into())),
        rotate: Some(Rotation {
            centre: rounded(&centre, 1e3).into(),
            axis: rounded(&axis, 1e6).into(),
            degrees: 90.0 * sense,
        }),
        ..Edit::default()
    }
}

/// Mean of the offsets of the edges between the panel and other quads; 0 without any.
fn hanging(skeleton: &Skeleton, panel: &Panel, offset: &impl Fn(&Vec3) -> f64) -> f64 {
    let inside = |q: &u32| panel.quads.binary_search(&(*q as usize)).is_ok();
    let table = EdgeTable::of_quads(&skeleton.quads);
    let border = table
        .iter()
        .filter(|(_, faces)| faces.iter().any(inside) && !faces.iter().all(inside));
    let offsets: Vec<f64> = border
        .map(|(ends, _)| ends.map(|v| offset(&skeleton.points[v as usize])))
        .map(|[a, b]| (a + b) / 2.0)
        .collect();
    offsets.iter().sum::<f64>() / offsets.len().max(1) as f64
}

/// The unit vector across `way` along which the panel is longest (principal axis of its quads' middles by area).
fn long_axis(skeleton: &Skeleton, panel: &Panel, way: &Vec3) -> Vec3 {
    let first = crate::thicken::perpendicular(way);
    let second = way.cross(&first);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for &q in &panel.quads {
        let quad = &skeleton.quads[q];
        let area = half_normal(skeleton, quad).norm();
        for &v in quad {
            let p = skeleton.points[v as usize] - panel.centre;
            let (x, y) = (p.dot(&first), p.dot(&second));
            xx += area * x * x;
            xy += area * x * y;
            yy += area * y * y;
        }
    }
    let (sin, cos) = (0.5 * f64::atan2(2.0 * xy, xx - yy)).sin_cos();
    first * cos + second * sin
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edit::edit;

    /// A channel along y, 60 mm long and 30 mm high: a web in the plane x = 0, flanges of 20 mm above and of `lower` mm below.
    fn channel(lower: u32) -> Skeleton {
        let mut section: Vec<[f64; 2]> = (1..=lower / 10)
            .rev()
            .map(|x| [f64::from(10 * x), 0.0])
            .collect();
        section.extend([
            [0.0, 0.0],
            [0.0, 15.0],
            [0.0, 30.0],
            [10.0, 30.0],
            [20.0, 30.0],
        ]);
        let n = section.len() as u32;
        let mut out = Skeleton::default();
        for y in 0..7_u32 {
            let row = section
                .iter()
                .map(|[x, z]| Vec3::new(*x, f64::from(10 * y), *z));
            out.points.extend(row);
            if y > 0 {
                let a = n * (y - 1);
                out.quads
                    .extend((a..a + n - 1).map(|a| [a, a + 1, a + n + 1, a + n]));
            }
        }
        out.radii = vec![2.0; out.points.len()];
        out
    }

    fn run(skeleton: &Skeleton, edits: &[Edit]) -> Skeleton {
        let kept = vec![false; skeleton.points.len()];
        edit(skeleton, &kept, edits, 0.5)
            .expect("good edits")
            .skeleton
    }

    #[test]
    fn the_lesser_flange_of_a_channel_is_in_conflict() {
        let skeleton = channel(10);
        let found = conflicts(&skeleton, &Vec3::z(), 1.0);
        let [conflict] = &found[..] else {
            panic!("{found:?}");
        };
        assert_eq!((conflict.places[0].z, conflict.places[1].z), (0.0, 30.0));
        assert!((conflict.shadowed - 600.0).abs() < 1e-9);
        // Along x the web shadows nothing, and a wide web between the flanges leaves no room to core.
        assert!(conflicts(&skeleton, &Vec3::x(), 1.0).is_empty());
        assert!(conflicts(&skeleton, &Vec3::z(), 27.0).is_empty());
    }

    #[test]
    fn removing_or_turning_ends_the_conflict() {
        for lower in [10, 20] {
            let skeleton = channel(lower);
            let conflict = conflicts(&skeleton, &Vec3::z(), 1.0).remove(0);
            let removed = run(&skeleton, &[conflict.remove]);
            assert_eq!(
                removed.quads.len() as u32,
                skeleton.quads.len() as u32 - 6 * lower / 10
            );
            assert!(conflicts(&removed, &Vec3::z(), 1.0).is_empty());
            let turned = run(&skeleton, &conflict.turn);
            assert!(conflicts(&turned, &Vec3::z(), 1.0).is_empty());
            // The flanges stand, within the height that they had.
            let heights = turned.points.iter().map(|p| p.z);
            assert!(heights.clone().fold(f64::INFINITY, f64::min) > -1e-9);
            assert!(heights.fold(f64::NEG_INFINITY, f64::max) < 30.0 + 1e-9);
            let flat = turned.quads.iter().filter(|q| {
                let n = half_normal(&turned, q);
                n.z.abs() > 0.9 * n.norm()
            });
            assert_eq!(flat.count(), 0);
            assert_eq!(turned.radii, skeleton.radii);
        }
    }
}
