//! The rasteriser: depth buffer and shading.
//!
//! The picture is cut into bands of rows that are drawn in parallel; within a band everything is drawn in the order
//! of the scene, so the result does not depend on the number of threads.

use rayon::prelude::*;

use super::finish::finish;
use super::scene::{Colours, SceneLine, SceneMesh, SceneSphere};
use super::{Camera, Rgb, Scene};
use crate::Vec3;

/// Subpixels along each side of a pixel.
pub(super) const SUPER: usize = 2;
/// Rows (of subpixels) in a band.
const BAND: usize = 64;
/// The part fills this share of the width; the rest is left for the colour scale.
const FILL: [f64; 2] = [0.84, 0.92];
/// The middle of the part, as a share of the width.
const MIDDLE: f64 = 0.45;
/// Lines win against surfaces up to this share of the part's half diagonal in front of them.
const LINE_BIAS: f64 = 0.006;
pub(super) const BACKGROUND: Rgb = [252, 252, 253];

/// One subpixel; `kind` tells which passes touch it.
#[derive(Clone, Copy)]
pub(super) struct Fragment {
    pub colour: Rgb,
    pub kind: Kind,
    pub depth: f32,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Empty,
    Surface,
    Line,
}

struct Corner {
    /// Subpixels right and down, depth in mm toward the viewer.
    at: [f32; 3],
    normal: [f32; 3],
    colour: [f32; 3],
}

struct Disc {
    at: [f32; 3],
    /// Radius in subpixels and in mm.
    radius: [f32; 2],
    colour: Rgb,
}

struct Stroke {
    from: [f32; 3],
    to: [f32; 3],
    half_width: f32,
    colour: Rgb,
}

/// Everything in subpixels.
struct Screen {
    triangles: Vec<[Corner; 3]>,
    discs: Vec<Disc>,
    strokes: Vec<Stroke>,
    line_bias: f32,
}

/// Draws `scene` into `width * height` pixels.
pub(super) fn draw(scene: &Scene, camera: &Camera, width: usize, height: usize) -> Vec<Rgb> {
    let (columns, rows) = (width * SUPER, height * SUPER);
    let view = View::new(camera, columns, rows);
    let screen = Screen {
        triangles: scene
            .meshes
            .iter()
            .flat_map(|mesh| view.mesh(mesh))
            .collect(),
        discs: scene.spheres.iter().filter_map(|s| view.disc(s)).collect(),
        strokes: scene.lines.iter().filter_map(|l| view.stroke(l)).collect(),
        line_bias: (LINE_BIAS * camera.reach) as f32,
    };
    let mut fragments = vec![
        Fragment {
            colour: BACKGROUND,
            kind: Kind::Empty,
            depth: f32::NEG_INFINITY
        };
        columns * rows
    ];
    let bins = bin(&screen, rows);
    fragments
        .par_chunks_mut(BAND * columns)
        .zip(&bins)
        .enumerate()
        .for_each(|(band, (pixels, bin))| {
            let mut target = Band {
                pixels,
                columns,
                first_row: band * BAND,
            };
            bin.triangles
                .iter()
                .for_each(|&t| target.triangle(&screen.triangles[t as usize]));
            bin.discs
                .iter()
                .for_each(|&d| target.disc(&screen.discs[d as usize]));
            bin.strokes
                .iter()
                .for_each(|&s| target.stroke(&screen.strokes[s as usize], screen.line_bias));
        });
    finish(
        &fragments,
        width,
        height,
        camera.reach as f32,
        view.scale as f32,
    )
}

/// The pixel of a place.
pub(super) fn pixel(p: &Vec3, camera: &Camera, width: usize, height: usize) -> [f64; 2] {
    let [x, y, _] = View::new(camera, width, height).point(p);
    [x.into(), y.into()]
}

/// Maps millimetres to subpixels.
struct View<'a> {
    camera: &'a Camera,
    scale: f64,
    middle: [f64; 2],
}

impl<'a> View<'a> {
    fn new(camera: &'a Camera, columns: usize, rows: usize) -> Self {
        let across = FILL[0] * columns as f64 / (2.0 * camera.half[0]);
        let down = FILL[1] * rows as f64 / (2.0 * camera.half[1]);
        let middle = [MIDDLE * columns as f64, 0.5 * rows as f64];
        Self {
            camera,
            scale: across.min(down),
            middle,
        }
    }

    fn point(&self, p: &Vec3) -> [f32; 3] {
        let q = self.camera.project(p);
        let x = self.middle[0] + self.scale * q.x;
        let y = self.middle[1] - self.scale * q.y;
        [x as f32, y as f32, q.z as f32]
    }

    fn direction(&self, n: &Vec3) -> [f32; 3] {
        [
            self.camera.right.dot(n) as f32,
            self.camera.up.dot(n) as f32,
            self.camera.toward.dot(n) as f32,
        ]
    }

    fn mesh(&self, mesh: &SceneMesh) -> Vec<[Corner; 3]> {
        let sound = |t: &[u32; 3]| {
            t.iter().all(|&v| {
                mesh.points
                    .get(v as usize)
                    .is_some_and(|p| p.iter().all(|x| x.is_finite()))
            })
        };
        let kept: Vec<usize> = (0..mesh.triangles.len())
            .filter(|&t| sound(&mesh.triangles[t]))
            .collect();
        let triangles: Vec<[u32; 3]> = kept.iter().map(|&t| mesh.triangles[t]).collect();
        let normals = super::scene::corner_normals(&mesh.points, &triangles, mesh.shading);
        let colour = |t: usize, v: u32| {
            let rgb = match &mesh.colours {
                Colours::Uniform(rgb) => Some(*rgb),
                Colours::Points(list) => list.get(v as usize).copied(),
                Colours::Triangles(list) => list.get(t).copied(),
            };
            rgb.unwrap_or([150; 3]).map(f32::from)
        };
        (0..triangles.len())
            .into_par_iter()
            .map(|n| {
                std::array::from_fn(|k| {
                    let v = triangles[n][k];
                    Corner {
                        at: self.point(&mesh.points[v as usize]),
                        normal: self.direction(&normals[n][k]),
                        colour: colour(kept[n], v),
                    }
                })
            })
            .collect()
    }

    fn disc(&self, sphere: &SceneSphere) -> Option<Disc> {
        let sound = sphere.centre.iter().all(|x| x.is_finite()) && sphere.radius.is_finite();
        let radius = [(sphere.radius * self.scale) as f32, sphere.radius as f32];
        sound.then(|| Disc {
            at: self.point(&sphere.centre),
            radius,
            colour: sphere.colour,
        })
    }

    fn stroke(&self, line: &SceneLine) -> Option<Stroke> {
        let sound = line
            .from
            .iter()
            .chain(line.to.iter())
            .all(|x| x.is_finite())
            && line.width.is_finite();
        let half_width = (line.width * SUPER as f64 / 2.0).clamp(0.5, 64.0) as f32;
        sound.then(|| Stroke {
            from: self.point(&line.from),
            to: self.point(&line.to),
            half_width,
            colour: line.colour,
        })
    }
}

/// What touches one band.
#[derive(Default, Clone)]
struct Bin {
    triangles: Vec<u32>,
    discs: Vec<u32>,
    strokes: Vec<u32>,
}

fn bin(screen: &Screen, rows: usize) -> Vec<Bin> {
    let mut bins = vec![Bin::default(); rows.div_ceil(BAND)];
    let last = bins.len() - 1;
    let span = |low: f32, high: f32| {
        let band = |y: f32| ((y / BAND as f32).floor().max(0.0) as usize).min(last);
        let visible = high >= 0.0 && low <= rows as f32;
        if visible {
            band(low)..band(high) + 1
        } else {
            0..0
        }
    };
    for (n, t) in screen.triangles.iter().enumerate() {
        let ys = t.each_ref().map(|c| c.at[1]);
        let range = span(ys[0].min(ys[1]).min(ys[2]), ys[0].max(ys[1]).max(ys[2]));
        bins[range]
            .iter_mut()
            .for_each(|b| b.triangles.push(n as u32));
    }
    for (n, d) in screen.discs.iter().enumerate() {
        let range = span(d.at[1] - d.radius[0], d.at[1] + d.radius[0]);
        bins[range].iter_mut().for_each(|b| b.discs.push(n as u32));
    }
    for (n, s) in screen.strokes.iter().enumerate() {
        let range = span(
            s.from[1].min(s.to[1]) - s.half_width,
            s.from[1].max(s.to[1]) + s.half_width,
        );
        bins[range]
            .iter_mut()
            .for_each(|b| b.strokes.push(n as u32));
    }
    bins
}

/// The rows of one band.
struct Band<'a> {
    pixels: &'a mut [Fragment],
    columns: usize,
    first_row: usize,
}

impl Band<'_> {
    /// Subpixel columns and rows of this band whose centres lie in the box; rows count from the top of the picture.
    fn clip(
        &self,
        low: [f32; 2],
        high: [f32; 2],
    ) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let rows = self.pixels.len() / self.columns;
        let from = |x: f32| (x - 0.5).ceil().max(0.0) as usize;
        let to = |x: f32| ((x - 0.5).floor() + 1.0).max(0.0) as usize;
        let x = from(low[0])..to(high[0]).min(self.columns);
        let y = from(low[1]).max(self.first_row)..to(high[1]).min(self.first_row + rows);
        (x, y)
    }

    fn at(&mut self, x: usize, y: usize) -> &mut Fragment {
        &mut self.pixels[(y - self.first_row) * self.columns + x]
    }

    fn triangle(&mut self, t: &[Corner; 3]) {
        let [a, b, c] = t.each_ref().map(|corner| corner.at);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area.abs() < 1e-9 {
            return;
        }
        let low = [a[0].min(b[0]).min(c[0]), a[1].min(b[1]).min(c[1])];
        let high = [a[0].max(b[0]).max(c[0]), a[1].max(b[1]).max(c[1])];
        let (columns, rows) = self.clip(low, high);
        for y in rows {
            let py = y as f32 + 0.5;
            for x in columns.clone() {
                let px = x as f32 + 0.5;
                let u = ((b[0] - px) * (c[1] - py) - (b[1] - py) * (c[0] - px)) / area;
                let v = ((c[0] - px) * (a[1] - py) - (c[1] - py) * (a[0] - px)) / area;
                let w = [u, v, 1.0 - u - v];
                if w.iter().any(|w| *w < -1e-5) {
                    continue;
                }
                let depth = w[0] * a[2] + w[1] * b[2] + w[2] * c[2];
                let fragment = self.at(x, y);
                if depth > fragment.depth {
                    let mix = |f: fn(&Corner) -> &[f32; 3]| -> [f32; 3] {
                        std::array::from_fn(|k| (0..3).map(|n| w[n] * f(&t[n])[k]).sum())
                    };
                    let colour = shade(mix(|corner| &corner.colour), mix(|corner| &corner.normal));
                    *fragment = Fragment {
                        colour,
                        kind: Kind::Surface,
                        depth,
                    };
                }
            }
        }
    }

    fn disc(&mut self, d: &Disc) {
        let [cx, cy, cz] = d.at;
        let [pixels, mm] = d.radius;
        let (columns, rows) = self.clip([cx - pixels, cy - pixels], [cx + pixels, cy + pixels]);
        for y in rows {
            for x in columns.clone() {
                let (dx, dy) = (
                    (x as f32 + 0.5 - cx) / pixels,
                    (cy - y as f32 - 0.5) / pixels,
                );
                let square = dx * dx + dy * dy;
                if square > 1.0 {
                    continue;
                }
                let dz = (1.0 - square).sqrt();
                let depth = cz + dz * mm;
                let fragment = self.at(x, y);
                if depth > fragment.depth {
                    let colour = shade(d.colour.map(f32::from), [dx, dy, dz]);
                    *fragment = Fragment {
                        colour,
                        kind: Kind::Surface,
                        depth,
                    };
                }
            }
        }
    }

    fn stroke(&mut self, s: &Stroke, bias: f32) {
        let (a, b, r) = (s.from, s.to, s.half_width);
        let low = [a[0].min(b[0]) - r, a[1].min(b[1]) - r];
        let high = [a[0].max(b[0]) + r, a[1].max(b[1]) + r];
        let (columns, rows) = self.clip(low, high);
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = (dx * dx + dy * dy).max(1e-12);
        for y in rows {
            for x in columns.clone() {
                let (px, py) = (x as f32 + 0.5 - a[0], y as f32 + 0.5 - a[1]);
                let t = ((px * dx + py * dy) / length).clamp(0.0, 1.0);
                let (ex, ey) = (px - t * dx, py - t * dy);
                let depth = a[2] + t * (b[2] - a[2]);
                let fragment = self.at(x, y);
                if ex * ex + ey * ey <= r * r && depth + bias > fragment.depth {
                    let depth = depth.max(fragment.depth);
                    *fragment = Fragment {
                        colour: s.colour,
                        kind: Kind::Line,
                        depth,
                    };
                }
            }
        }
    }
}

/// Two lights and an ambient one, fixed to the camera; the side facing the viewer is lit.
fn shade(colour: [f32; 3], normal: [f32; 3]) -> Rgb {
    const KEY: [f32; 3] = [-0.38, 0.58, 0.72];
    const FILL_LIGHT: [f32; 3] = [0.84, -0.10, 0.53];
    let length = normal.iter().map(|n| n * n).sum::<f32>().sqrt().max(1e-12);
    let sign = if normal[2] < 0.0 { -1.0 } else { 1.0 } / length;
    let dot = |light: [f32; 3]| {
        (0..3)
            .map(|k| sign * normal[k] * light[k])
            .sum::<f32>()
            .max(0.0)
    };
    let light = 0.40 + 0.56 * dot(KEY) + 0.20 * dot(FILL_LIGHT);
    colour.map(|c| (c * light).clamp(0.0, 255.0) as u8)
}
