//! From subpixels to pixels: outlines, ambient occlusion, averaging.

use rayon::prelude::*;

use super::Rgb;
use super::raster::{BACKGROUND, Fragment, Kind, SUPER};

/// A jump in depth above this share of the half diagonal gets an outline.
const OUTLINE_JUMP: f32 = 0.025;
const OUTLINE_DARKNESS: f32 = 0.42;

/// Outlines and ambient occlusion, then the average over the subpixels of every pixel.
pub(super) fn finish(
    fragments: &[Fragment],
    width: usize,
    height: usize,
    reach: f32,
    scale: f32,
) -> Vec<Rgb> {
    let columns = width * SUPER;
    let rows = height * SUPER;
    let depth = |x: i64, y: i64| {
        let inside = x >= 0 && y >= 0 && x < columns as i64 && y < rows as i64;
        if inside {
            fragments[y as usize * columns + x as usize].depth
        } else {
            f32::NEG_INFINITY
        }
    };
    let occlusion = occlusion(&depth, width, height, reach, scale);
    let pixel = |index: usize| {
        let (px, py) = (index % width, index / width);
        let subpixels =
            (0..SUPER * SUPER).map(|sub| (px * SUPER + sub % SUPER, py * SUPER + sub / SUPER));
        if subpixels
            .clone()
            .all(|(x, y)| fragments[y * columns + x].kind == Kind::Empty)
        {
            return BACKGROUND;
        }
        let open_sky = 1.0 - blurred(&occlusion, width, height, px, py);
        let mut sum = [0.0f32; 3];
        for (x, y) in subpixels {
            let fragment = &fragments[y * columns + x];
            let light = match fragment.kind {
                Kind::Empty | Kind::Line => 1.0,
                Kind::Surface if outlined(&depth, x as i64, y as i64, reach) => OUTLINE_DARKNESS,
                Kind::Surface => open_sky,
            };
            for (total, c) in sum.iter_mut().zip(fragment.colour) {
                *total += f32::from(c) * light;
            }
        }
        sum.map(|s| (s / (SUPER * SUPER) as f32).round() as u8)
    };
    (0..width * height)
        .into_par_iter()
        .with_min_len(width)
        .map(pixel)
        .collect()
}

/// Is the surface here the near side of a jump in depth? Second differences, so that slopes do not count.
fn outlined(depth: &impl Fn(i64, i64) -> f32, x: i64, y: i64, reach: f32) -> bool {
    let here = depth(x, y);
    [(1, 0), (0, 1)].into_iter().any(|(dx, dy)| {
        let (ahead, behind) = (depth(x + dx, y + dy), depth(x - dx, y - dy));
        let fall = (here - ahead).max(here - behind);
        let slope = (here - ahead).abs().min((here - behind).abs());
        fall - slope > OUTLINE_JUMP * reach || (fall == f32::INFINITY)
    })
}

/// How much of the sky each pixel cannot see, 0..=0.5, from the curvature of the depth buffer along pairs of
/// opposite samples: a plane, however tilted, gives zero.
fn occlusion(
    depth: &(impl Fn(i64, i64) -> f32 + Sync),
    width: usize,
    height: usize,
    reach: f32,
    scale: f32,
) -> Vec<f32> {
    let stars = sample_stars(reach, scale);
    let pixel = |index: usize| {
        let (px, py) = (index % width, index / width);
        let (x, y) = ((px * SUPER) as i64, (py * SUPER) as i64);
        let here = depth(x, y);
        if here == f32::NEG_INFINITY {
            return 0.0;
        }
        let star = &stars[(px % 4) * 4 + (py * 7 + px) % 4];
        let sum: f32 = star
            .iter()
            .map(|&(dx, dy, radius)| {
                let rise = |d: f32| (d - here).clamp(-radius, radius);
                let bend = rise(depth(x + dx, y + dy)) + rise(depth(x - dx, y - dy));
                (bend / (2.0 * radius) - 0.03).clamp(0.0, 1.0)
            })
            .sum();
        (1.3 * sum / star.len() as f32).min(0.5)
    };
    (0..width * height)
        .into_par_iter()
        .with_min_len(width)
        .map(pixel)
        .collect()
}

/// Sixteen turned stars of sample offsets (subpixels) with their radius in mm, one for each pixel of a 4 x 4 pattern
/// that the blur of the same size evens out.
fn sample_stars(reach: f32, scale: f32) -> Vec<Vec<(i64, i64, f32)>> {
    const DIRECTIONS: usize = 4;
    const RINGS: [f32; 3] = [0.012, 0.03, 0.07];
    let star = |turn: usize| {
        let offsets = RINGS.iter().flat_map(|ring| {
            (0..DIRECTIONS).map(move |n| {
                let angle =
                    std::f32::consts::PI * (n as f32 + turn as f32 / 16.0) / DIRECTIONS as f32;
                let (radius, pixels) = (ring * reach, ring * reach * scale);
                (
                    (angle.cos() * pixels).round() as i64,
                    (angle.sin() * pixels).round() as i64,
                    radius,
                )
            })
        });
        offsets.collect()
    };
    (0..16).map(star).collect()
}

fn blurred(values: &[f32], width: usize, height: usize, px: usize, py: usize) -> f32 {
    let columns = px.saturating_sub(2)..(px + 2).min(width);
    let rows = py.saturating_sub(2)..(py + 2).min(height);
    let count = (columns.len() * rows.len()).max(1);
    let sum: f32 = rows
        .flat_map(|y| columns.clone().map(move |x| values[y * width + x]))
        .sum();
    sum / count as f32
}
