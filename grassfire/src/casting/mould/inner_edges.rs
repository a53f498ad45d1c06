//! Fillets of inner edges, and gaps and holes, by balls in the sand.

use rayon::prelude::*;

use super::apart::apart;
use super::walls::{Inscribed, Walls};
use crate::Vec3;
use crate::mesh::{TangentBall, TangentBalls};

/// A place where two walls face or meet each other.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct InnerEdge {
    /// Where, mm.
    pub place: Vec3,
    /// Radius of the fillet, or width of the gap, mm.
    pub value: f64,
    /// Mean thickness of the two walls, mm.
    pub wall: f64,
}

/// What balls in the sand find.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct InnerEdges {
    /// Fillets with a radius below the wanted one, the smallest for their walls first, each some way from the next.
    pub fillets: Vec<InnerEdge>,
    /// Share of the surface that lies beside these inner edges: there the ball outside is smaller than the fillet should be.
    pub short: f64,
    /// Gaps and holes narrower than the wanted width, the narrowest first, each some way from the next.
    pub gaps: Vec<InnerEdge>,
}

/// Walls face each other when their normals differ by more than this (cosine of 135 degrees).
const FACING: f64 = -0.707;
/// Balls move on towards the edge this many times.
const MOVES: usize = 16;
/// Most places of a kind that are listed.
const LISTED: usize = 5;

enum Found {
    Fillet(InnerEdge),
    Gap(InnerEdge),
}

/// Fillets smaller than `share` times the sum of the two walls' thickness, and gaps or holes narrower than `width` (mm).
///
/// 1. At every sample of the surface the largest ball outside ([`TangentBalls`]), no larger than what is looked for.
/// 2. Where the other wall stands opposite, it is in a gap or a hole.
/// 3. Elsewhere it lies in an inner edge. From half-way between its two touches it starts again until it shrinks no more: in a fillet it ends with
///    the fillet's radius, in a sharp edge with none.
/// 4. Thickness of walls: [`Walls`].
pub fn inner_edges(
    balls: &TangentBalls,
    inscribed: &[Inscribed],
    walls: &Walls,
    share: f64,
    width: f64,
) -> InnerEdges {
    let thickest = inscribed.iter().map(|i| i.ball.radius).fold(0.0, f64::max);
    let found: Vec<Found> = inscribed
        .par_iter()
        .filter_map(|sample| {
            let most = (2.0 * share * (sample.ball.radius + thickest)).max(width / 2.0);
            let ball = balls.at(&sample.place, sample.triangle, false, most)?;
            look(balls, walls, sample, &ball, share, width)
        })
        .collect();
    let (mut fillets, mut gaps) = (Vec::new(), Vec::new());
    for found in found {
        match found {
            Found::Fillet(edge) => fillets.push(edge),
            Found::Gap(edge) => gaps.push(edge),
        }
    }
    let short = fillets.len() as f64 / inscribed.len().max(1) as f64;
    let ratio = |edge: &InnerEdge| edge.value / edge.wall;
    fillets.sort_by(|a, b| ratio(a).total_cmp(&ratio(b)));
    gaps.sort_by(|a, b| a.value.total_cmp(&b.value));
    // Two walls from those before.
    let near = |a: &InnerEdge, b: &InnerEdge| (a.place - b.place).norm() < 2.0 * (a.wall + b.wall);
    InnerEdges {
        fillets: apart(fillets, LISTED, near),
        short,
        gaps: apart(gaps, LISTED, near),
    }
}

/// What is wrong at a ball outside.
fn look(
    balls: &TangentBalls,
    walls: &Walls,
    sample: &Inscribed,
    ball: &TangentBall,
    share: f64,
    width: f64,
) -> Option<Found> {
    let normal = balls.normals[sample.triangle as usize];
    let (from, to) = (1e-3 * ball.radius, 2.2 * ball.radius);
    let across = balls.bvh.first_hit(&sample.place, &normal, from, to);
    let wall = |p: &Vec3, triangle| walls.thickness(p, &balls.normal_at(p, triangle));
    let own = wall(&sample.place, sample.triangle).unwrap_or(2.0 * sample.ball.radius);
    if let Some((gap, other)) = across
        && balls.normals[other as usize].dot(&normal) < FACING
    {
        return (gap < width).then(|| {
            Found::Gap(InnerEdge {
                place: sample.place + gap / 2.0 * normal,
                value: gap,
                wall: own,
            })
        });
    }
    let other = wall(&ball.touch, ball.triangle).unwrap_or(own);
    let wanted = share * (own + other);
    if ball.radius >= wanted {
        return None;
    }
    let (place, value) = settle(balls, sample.place, ball);
    Some(Found::Fillet(InnerEdge {
        place,
        value,
        wall: (own + other) / 2.0,
    }))
}

/// Where a ball ends that moves into its inner edge, and its radius.
fn settle(balls: &TangentBalls, from: Vec3, ball: &TangentBall) -> (Vec3, f64) {
    let (mut p, mut now) = (from, *ball);
    for _ in 0..MOVES {
        let Some(near) = balls.bvh.nearest(&((p + now.touch) / 2.0), f64::INFINITY) else {
            break;
        };
        let next = balls.at(&near.point, near.triangle, false, ball.radius);
        let Some(next) = next.filter(|next| next.radius < 0.98 * now.radius) else {
            break;
        };
        (p, now) = (near.point, next);
    }
    let radius = if now.radius < 0.01 * ball.radius {
        0.0
    } else {
        now.radius
    };
    ((p + now.touch) / 2.0, radius)
}
