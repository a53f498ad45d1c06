//! Solids of known sheets, seams, members and tunnels, drawn at random from a seed.

use grassfire::Vec3;
use grassfire::monitor::Monitor;
use grassfire::remesh::{RemeshOptions, iso_surface};
use grassfire::topology::Betti;
use grassfire::voxel::VoxelGrid;

/// Voxels across a wall or a rod: coarse, so that a chain takes a few seconds.
const VOXELS_ACROSS: f64 = 4.0;

/// A distance to a surface, mm, positive inside.
type Distance = Box<dyn Fn(Vec3) -> f64>;

/// What a solid is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// A plate with no to two holes.
    Plate,
    /// A rib on a plate.
    RibOnPlate,
    /// Two plates through each other.
    Cross,
    /// Three plates from one line.
    Star,
    /// A round tube, open at both ends.
    Tube,
    /// Rods along the edges of a prism or a pyramid.
    Frame,
    /// A hollow ball that a plane cuts open.
    Bowl,
    /// A closed hollow ball.
    HollowBall,
    /// Two ribs that cross on a plate.
    CrossedRibs,
    /// Two plates held apart by rods.
    Sandwich,
}

/// A solid and what is known about it.
pub struct Generated {
    /// Its surface as a file has it.
    pub mesh: grassfire::mesh::TriMesh,
    /// Edge of a voxel that resolves its walls, mm.
    pub voxel: f64,
    /// Pieces, tunnels, cavities.
    pub betti: Betti,
    /// Sheets of its medial axis.
    pub sheets: usize,
    /// Whether its medial axis has a seam.
    pub seams: bool,
}

/// A seeded sequence of numbers (xorshift64*, S. Vigna, doi:10.1145/2845077).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    fn count(&mut self, low: usize, high: usize) -> usize {
        low + ((self.next() * (high - low + 1) as f64) as usize).min(high - low)
    }

    /// Three orthonormal axes.
    fn frame(&mut self) -> [Vec3; 3] {
        loop {
            let mut vector = || Vec3::from_fn(|_, _| self.between(-1.0, 1.0));
            let (a, b) = (vector(), vector());
            let normal = a.cross(&b);
            if a.norm() > 0.2 && normal.norm() > 0.2 {
                let (x, z) = (a.normalize(), normal.normalize());
                return [x, z.cross(&x), z];
            }
        }
    }
}

/// A box with its middle at `centre` and its edges along the axes.
fn block(centre: Vec3, half: Vec3) -> Distance {
    Box::new(move |p| {
        let out = (p - centre).abs() - half;
        -(out.map(|x| x.max(0.0)).norm() + out.max().min(0.0))
    })
}

/// A plate whose edge starts on the z axis and whose other end lies at `angle` about it.
fn wing(angle: f64, length: f64, height: f64, thickness: f64) -> Distance {
    let along = Vec3::new(angle.cos(), angle.sin(), 0.0);
    let across = Vec3::new(-angle.sin(), angle.cos(), 0.0);
    let at_origin = block(
        Vec3::new(0.5 * length, 0.0, 0.0),
        Vec3::new(0.5 * length, 0.5 * thickness, 0.5 * height),
    );
    Box::new(move |p| at_origin(Vec3::new(p.dot(&along), p.dot(&across), p.z)))
}

/// A rod with round ends.
fn rod(a: Vec3, b: Vec3, radius: f64) -> Distance {
    Box::new(move |p| {
        let along = b - a;
        let s = ((p - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        radius - (p - a - s * along).norm()
    })
}

/// An endless round hole along z.
fn hole(x: f64, y: f64, radius: f64) -> Distance {
    Box::new(move |p| radius - (p.x - x).hypot(p.y - y))
}

fn union(parts: Vec<Distance>) -> Distance {
    Box::new(move |p| {
        parts
            .iter()
            .map(|part| part(p))
            .fold(f64::NEG_INFINITY, f64::max)
    })
}

fn without(part: Distance, holes: Vec<Distance>) -> Distance {
    let holes = union(holes);
    Box::new(move |p| part(p).min(-holes(p)))
}

/// A shape before it is turned and sampled.
struct Shape {
    distance: Distance,
    /// Half of a box around the origin that holds it, mm.
    reach: f64,
    tunnels: i64,
    cavities: i64,
    sheets: usize,
    seams: bool,
}

/// The solid of a family that belongs to a seed: sizes, thickness ratio, counts and direction are random.
pub fn generate(family: Family, seed: u64) -> Generated {
    let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
    for _ in 0..8 {
        random.next();
    }
    let thickness = random.between(2.5, 5.0);
    let shape = shape(family, thickness, &mut random);
    let voxel = thickness / VOXELS_ACROSS;
    let axes = random.frame();
    let shift = Vec3::from_fn(|_, _| random.between(-50.0, 50.0));
    let cells = (2.0 * shape.reach * 3.0_f64.sqrt() / voxel).ceil() as usize + 4;
    let middle = 0.5 * (cells as f64 - 1.0) * voxel;
    let mut density = VoxelGrid::filled(shift, voxel, [cells; 3], 0.0_f32);
    for at in 0..density.values.len() {
        let from_middle = density.ijk(at).map(|i| i as f64 * voxel - middle);
        let p = Vec3::from(from_middle);
        let local = Vec3::from_fn(|k, _| axes[k].dot(&p));
        density.values[at] = (0.5 + (shape.distance)(local) / voxel) as f32;
    }
    let mesh = iso_surface(
        &density,
        0.5,
        &RemeshOptions::default(),
        &Monitor::default(),
    )
    .expect("the grid holds the shape");
    Generated {
        mesh,
        voxel,
        betti: Betti::from_chi(1, shape.cavities, 1 - shape.tunnels + shape.cavities),
        sheets: shape.sheets,
        seams: shape.seams,
    }
}

fn shape(family: Family, t: f64, random: &mut Random) -> Shape {
    let (a, b) = (t * random.between(6.0, 9.0), t * random.between(4.0, 6.0));
    let plate = |a: f64, b: f64| block(Vec3::zeros(), 0.5 * Vec3::new(a, b, t));
    let reach = 0.5 * a.hypot(b) + t;
    let sheet_like = |distance, reach, sheets, seams| Shape {
        distance,
        reach,
        tunnels: 0,
        cavities: 0,
        sheets,
        seams,
    };
    match family {
        Family::Plate => {
            let count = random.count(0, 2);
            let radius = t * random.between(0.8, 1.0);
            let holes = (0..count).map(|k| hole((k as f64 - 0.5) * 0.5 * a, 0.0, radius));
            let distance = match count {
                0 => plate(a, b),
                _ => without(plate(a, b), holes.collect()),
            };
            Shape {
                tunnels: count as i64,
                ..sheet_like(distance, reach, 1, false)
            }
        }
        Family::RibOnPlate => {
            let (height, rib) = (t * random.between(3.0, 5.0), t * random.between(0.7, 1.3));
            let standing = block(
                Vec3::new(0.1 * a, 0.0, 0.5 * height),
                0.5 * Vec3::new(rib, b, height),
            );
            let reach = 0.5 * a.hypot(b).hypot(2.0 * height) + t;
            sheet_like(union(vec![plate(a, b), standing]), reach, 3, true)
        }
        Family::Cross => {
            let other = block(Vec3::zeros(), 0.5 * Vec3::new(t, b, a));
            let reach = 0.5 * a.hypot(b).hypot(a) + t;
            sheet_like(union(vec![plate(a, b), other]), reach, 4, true)
        }
        Family::Star => {
            let wings = (0..3).map(|k| {
                let angle = std::f64::consts::TAU * k as f64 / 3.0 + random.between(-0.2, 0.2);
                wing(angle, t * random.between(3.5, 5.0), b, t)
            });
            let distance = union(wings.collect());
            sheet_like(distance, 5.0 * t + 0.5 * b, 3, true)
        }
        Family::Tube => {
            let (radius, length) = (t * random.between(2.0, 3.0), t * random.between(5.0, 8.0));
            let outside = hole(0.0, 0.0, radius + 0.5 * t);
            let distance: Distance = Box::new(move |p| outside(p).min(0.5 * length - p.z.abs()));
            let distance = without(distance, vec![hole(0.0, 0.0, radius - 0.5 * t)]);
            Shape {
                tunnels: 1,
                ..sheet_like(distance, radius.hypot(0.5 * length) + t, 1, false)
            }
        }
        Family::Frame => frame(t, random),
        Family::Bowl => {
            let (radius, open) = (t * random.between(3.0, 4.0), t * random.between(0.0, 1.5));
            let distance: Distance =
                Box::new(move |p| (0.5 * t - (p.norm() - radius).abs()).min(open - p.z));
            sheet_like(distance, radius + t, 1, false)
        }
        Family::HollowBall => {
            let radius = t * random.between(2.0, 3.0);
            let distance: Distance = Box::new(move |p| 0.5 * t - (p.norm() - radius).abs());
            Shape {
                cavities: 1,
                ..sheet_like(distance, radius + t, 1, false)
            }
        }
        Family::CrossedRibs => {
            let height = t * random.between(3.0, 4.0);
            let side = t * random.between(7.0, 8.5);
            let rib = |x, y| {
                block(
                    Vec3::new(0.0, 0.0, 0.5 * height),
                    0.5 * Vec3::new(x, y, height),
                )
            };
            let parts = vec![plate(side, side), rib(t, side), rib(side, t)];
            let reach = 0.5 * (2.0_f64.sqrt() * side).hypot(2.0 * height) + t;
            sheet_like(union(parts), reach, 8, true)
        }
        Family::Sandwich => {
            let (count, gap) = (random.count(1, 4), t * random.between(2.5, 4.0));
            let half = 0.5 * Vec3::new(b, b, t);
            let mut parts = vec![
                block(Vec3::new(0.0, 0.0, -0.5 * gap - 0.5 * t), half),
                block(Vec3::new(0.0, 0.0, 0.5 * gap + 0.5 * t), half),
            ];
            let places = [(-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (1.0, -1.0)];
            parts.extend(places.iter().take(count).map(|&(x, y)| {
                let foot = Vec3::new(0.25 * b * x, 0.25 * b * y, 0.5 * gap + 0.5 * t);
                rod(Vec3::new(foot.x, foot.y, -foot.z), foot, 0.5 * t)
            }));
            let reach = 0.5 * b.hypot(b).hypot(gap + 2.0 * t) + t;
            Shape {
                tunnels: count as i64 - 1,
                ..sheet_like(union(parts), reach, 2, false)
            }
        }
    }
}

/// Rods along the edges of a prism, or of a pyramid, over a regular polygon.
fn frame(t: f64, random: &mut Random) -> Shape {
    let (sides, pyramid) = (random.count(3, 4), random.next() < 0.5);
    let (radius, height) = (t * random.between(4.0, 5.0), t * random.between(4.0, 6.0));
    let corner = |k: usize, z: f64| {
        let angle = std::f64::consts::TAU * k as f64 / sides as f64;
        Vec3::new(radius * angle.cos(), radius * angle.sin(), z)
    };
    let top = Vec3::new(0.0, 0.0, 0.5 * height);
    let mut rods = Vec::new();
    for k in 0..sides {
        let foot = corner(k, -0.5 * height);
        let mut add = |a, b| rods.push(rod(a, b, 0.5 * t));
        add(foot, corner(k + 1, -0.5 * height));
        if pyramid {
            add(foot, top);
        } else {
            add(foot, corner(k, 0.5 * height));
            add(corner(k, 0.5 * height), corner(k + 1, 0.5 * height));
        }
    }
    let corners = if pyramid { sides + 1 } else { 2 * sides };
    Shape {
        tunnels: rods.len() as i64 + 1 - corners as i64,
        cavities: 0,
        sheets: 0,
        seams: false,
        distance: union(rods),
        reach: radius.hypot(0.5 * height) + t,
    }
}
