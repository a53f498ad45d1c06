//! Junctions of walls: their kind, and the inscribed ball beside the walls.

use std::f64::consts::TAU;

use rayon::prelude::*;
use serde::Serialize;

use super::apart::apart;
use super::walls::Inscribed;
use crate::Vec3;
use crate::mesh::{TangentBall, TangentBalls};

/// How walls meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum JunctionKind {
    /// Two walls at an angle of 60 to 150 degrees.
    #[default]
    L,
    /// Two walls at a sharper angle.
    V,
    /// A wall on a wall that goes through.
    T,
    /// Three walls of which none goes through.
    Y,
    /// Four walls or more.
    X,
}

/// Junctions of one kind.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Junction {
    /// The kind.
    pub kind: JunctionKind,
    /// Places that were found, about one a diameter of the ball along the junction.
    pub places: usize,
    /// Diameter of the inscribed ball over the thickness of the thickest of the walls that meet: the largest found.
    pub ratio: f64,
    /// Where, mm.
    pub place: Vec3,
    /// Thickness of that wall, mm.
    pub wall: f64,
}

/// Balls nearer than this many radii to a larger one stand for the same place.
const APART: f64 = 1.0;
/// Two touches are two when they are seen from the centre at more than this (cosine of 40 degrees).
const TWO: f64 = 0.766;
/// Touches at most.
const TOUCHES: usize = 6;
/// A ball leans on what is no farther than this many radii.
const LEANS: f64 = 1.02;
/// A third wall touches the ball, or nearly: within this many radii.
const NEARLY: f64 = 1.3;
/// Directions in a wall, steps to each in radii, and the growth of the ball that makes it worth to go there.
const DIRECTIONS: usize = 12;
const STEP: f64 = 0.5;
const GROWTH: f64 = 1.04;
/// Steps uphill at most.
const STEPS: usize = 100;
/// Walls are looked for this many radii from the centre.
const RING: f64 = 2.5;
/// Rays around the centre.
const RAYS: usize = 120;
/// A ball that is not larger than the wall by this factor lies in no junction.
const LEAST: f64 = 1.03;
/// Walls seen under a larger angle than this are no walls but bulk, rays.
const WIDEST: usize = 34;

/// Junctions of each kind in a part, by its inscribed balls.
///
/// 1. The largest ball stands for its surroundings, then the next outside them, and so on.
/// 2. Where a ball is larger half a radius farther along its wall, it goes there and on uphill, until what it touches holds it: sharp inner
///    edges touch balls whose centres no point of the surface has beneath it.
/// 3. Three places where it touches give the plane across the junction. Rays in this plane that run farther than 2.5 radii are in
///    walls; neighbouring ones are in the same.
/// 4. Thickness of a wall: the chord across it there. Kind: number of walls and angles between them.
///
/// In equal walls T without fillets have a ratio of 1.25, X of 1.41, L of 1.17; with fillets they have more.
pub fn junctions(balls: &TangentBalls, inscribed: &[Inscribed]) -> Vec<Junction> {
    let starts = largest(inscribed.iter().map(|i| i.ball).collect());
    let ends: Vec<TangentBall> = starts.par_iter().map(|ball| uphill(balls, ball)).collect();
    let found: Vec<Junction> = largest(ends)
        .par_iter()
        .filter_map(|ball| junction(balls, ball.centre, ball.radius))
        .collect();
    let mut out: Vec<Junction> = Vec::new();
    for one in found {
        match out.iter_mut().find(|o| o.kind == one.kind) {
            Some(same) => {
                let places = same.places + 1;
                if one.ratio > same.ratio {
                    *same = one;
                }
                same.places = places;
            }
            None => out.push(one),
        }
    }
    out.sort_by_key(|j| j.kind);
    out
}

/// The largest ball, the largest outside it, and so on.
fn largest(mut balls: Vec<TangentBall>) -> Vec<TangentBall> {
    balls.sort_by(|a, b| b.radius.total_cmp(&a.radius));
    let near =
        |k: &TangentBall, one: &TangentBall| (k.centre - one.centre).norm() < APART * k.radius;
    apart(balls, usize::MAX, near)
}

/// Directions from a centre to where its ball touches, the nearest first; those within `leans` times its distance.
fn touches(balls: &TangentBalls, centre: &Vec3, leans: f64) -> Vec<Vec3> {
    let mut out: Vec<Vec3> = Vec::new();
    let mut reach = f64::INFINITY;
    while out.len() < TOUCHES {
        let elsewhere = |_: u32, q: &Vec3| {
            let u = (q - centre).normalize();
            out.iter().all(|o| o.dot(&u) < TWO)
        };
        let Some(near) = balls.bvh.nearest_where(centre, reach, elsewhere) else {
            break;
        };
        if out.is_empty() {
            reach = leans * near.distance;
        }
        let Some(direction) = (near.point - centre).try_normalize(0.0) else {
            break;
        };
        out.push(direction);
    }
    out
}

/// The ball that a ball becomes when it moves to where it can grow.
fn uphill(balls: &TangentBalls, ball: &TangentBall) -> TangentBall {
    let room = |c: &Vec3| {
        balls
            .bvh
            .nearest(c, f64::INFINITY)
            .map_or(0.0, |n| n.distance)
    };
    let toward = (ball.touch - ball.centre).normalize();
    let across = toward.cross(&Vec3::ith(toward.iamin(), 1.0)).normalize();
    let other = toward.cross(&across);
    let shifted = |k: usize| {
        let angle = TAU * k as f64 / DIRECTIONS as f64;
        ball.centre + STEP * ball.radius * (angle.cos() * across + angle.sin() * other)
    };
    let (mut centre, mut radius) = (ball.centre, ball.radius);
    let best = (0..DIRECTIONS)
        .map(|k| (shifted(k), room(&shifted(k))))
        .max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((place, larger)) = best.filter(|b| b.1 > GROWTH * radius) {
        (centre, radius) = (place, larger);
    }
    let mut step = STEP * radius;
    for _ in 0..STEPS {
        if step < 1e-3 * ball.radius {
            break;
        }
        let held = touches(balls, &centre, LEANS);
        let away = -nearest_of_hull(&held);
        let Some(away) = away.try_normalize(0.02) else {
            break;
        };
        let next = centre + step * away;
        let larger = room(&next);
        // A ball that has left its place is another one's.
        if larger > radius && (next - ball.centre).norm() < 2.0 * ball.radius {
            (centre, radius) = (next, larger);
        } else {
            step /= 2.0;
        }
    }
    TangentBall {
        centre,
        radius,
        ..*ball
    }
}

/// The point of the convex hull of unit vectors that is nearest to zero (Gilbert's steps, to a hundredth).
fn nearest_of_hull(points: &[Vec3]) -> Vec3 {
    let mut at = points.first().copied().unwrap_or_default();
    for _ in 0..60 {
        let Some(far) = points
            .iter()
            .min_by(|a, b| a.dot(&at).total_cmp(&b.dot(&at)))
        else {
            break;
        };
        let way = far - at;
        if way.dot(&at) > -1e-6 {
            break;
        }
        at += (-at.dot(&way) / way.norm_squared()).clamp(0.0, 1.0) * way;
    }
    at
}

/// The junction that a ball lies in; none in a single wall, at its end and in bulk.
fn junction(balls: &TangentBalls, centre: Vec3, radius: f64) -> Option<Junction> {
    let touch = touches(balls, &centre, NEARLY);
    let &[first, second, third, ..] = touch.as_slice() else {
        return None;
    };
    let axis = (second - first)
        .cross(&(third - first))
        .try_normalize(1e-9)?;
    let walls = walls_around(balls, &centre, radius, &axis)?;
    let kind = kind(&walls)?;
    let thickest = walls.iter().map(|w| w.1).fold(0.0, f64::max);
    let ratio = 2.0 * radius / thickest;
    (ratio > LEAST).then_some(Junction {
        kind,
        places: 1,
        ratio,
        place: centre,
        wall: thickest,
    })
}

/// Walls that are met on the way around a centre: angle (radians) and thickness; none in bulk.
fn walls_around(
    balls: &TangentBalls,
    centre: &Vec3,
    radius: f64,
    axis: &Vec3,
) -> Option<Vec<(f64, f64)>> {
    let across = axis.cross(&Vec3::ith(axis.iamin(), 1.0)).normalize();
    let other = axis.cross(&across);
    let along = |angle: f64| angle.cos() * across + angle.sin() * other;
    let ring = RING * radius;
    let angle = |ray: usize| TAU * ray as f64 / RAYS as f64;
    let deep = |ray: usize| {
        balls
            .bvh
            .first_hit(centre, &along(angle(ray)), 0.0, ring)
            .is_none()
    };
    let deep: Vec<bool> = (0..RAYS).map(deep).collect();
    let start = deep.iter().position(|d| !d)?;
    let mut out = Vec::new();
    let mut ray = start;
    while ray < start + RAYS {
        let run = (ray..start + RAYS).take_while(|r| deep[r % RAYS]).count();
        if run > WIDEST {
            return None;
        }
        if run > 0 {
            let middle = TAU * (ray as f64 + (run - 1) as f64 / 2.0) / RAYS as f64;
            let side = axis.cross(&along(middle));
            let thickness = |way: f64| {
                let place = centre + way * along(middle);
                let half = |s: Vec3| balls.bvh.first_hit(&place, &s, 0.0, 2.0 * ring);
                Some(half(side)?.0 + half(-side)?.0)
            };
            // What gets much thicker on the way is the tip of a corner.
            let [far, near] = [thickness(ring)?, thickness(0.8 * ring)?];
            if near < 2.0 * far {
                out.push((middle, far));
            }
        }
        ray += run.max(1);
    }
    Some(out)
}

/// The kind of junction of walls at these angles.
fn kind(walls: &[(f64, f64)]) -> Option<JunctionKind> {
    let between = |a: f64, b: f64| {
        let d = (a - b).rem_euclid(TAU);
        d.min(TAU - d).to_degrees()
    };
    let widest = (0..walls.len())
        .flat_map(|i| (0..i).map(move |j| (i, j)))
        .map(|(i, j)| between(walls[i].0, walls[j].0))
        .fold(0.0, f64::max);
    match walls.len() {
        2 if widest > 150.0 => None,
        2 if widest < 60.0 => Some(JunctionKind::V),
        2 => Some(JunctionKind::L),
        3 if widest > 150.0 => Some(JunctionKind::T),
        3 => Some(JunctionKind::Y),
        4.. => Some(JunctionKind::X),
        _ => None,
    }
}
