//! Forty random non-design bodies against a smooth body: coaxial with its members, tangent, grazing, and through its
//! seams. Each union is right, by an integral that knows no boolean, or says that it is not.
#![cfg(feature = "occt")]

#[path = "spline/shapes.rs"]
#[allow(dead_code, reason = "only some shapes are needed here")]
mod shapes;

use std::f64::consts::{PI, TAU};

use grassfire::Vec3;
use grassfire::cad::{CadOptions, NonDesignBody, NonDesignOptions, build, from_mesh};
use grassfire::mesh::{Bvh, TriMesh, Winding};
use grassfire::monitor::Monitor;
use grassfire::spline::{
    Brep, BrepOptions, PatchOptions, TessellateOptions, build_brep, patches, tessellate,
};
use nalgebra::Rotation3;

type Result<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Edge of the cubes that the organic body is made of, mm.
const CELL: f64 = 12.0;
/// Points a direction of the integral over a body's box.
const POINTS: usize = 40;
/// Largest difference of the integral, as a share of the body's volume: what `POINTS` resolve.
const TOLERANCE: f64 = 0.01;

/// The smooth body with what is needed to place others on it.
struct Organic {
    brep: Brep,
    surface: TriMesh,
    bvh: Bvh,
    /// Control points: where patches meet, extraordinary ones among them.
    nodes: Vec<Vec3>,
}

fn organic() -> Result<Organic> {
    let monitor = Monitor::default();
    let mut mesh = shapes::bracket();
    shapes::jitter(&mut mesh, 0.05, 7);
    mesh.points.iter_mut().for_each(|p| *p *= CELL);
    let faces = patches(&mesh, &PatchOptions::default(), &monitor)?;
    let brep = build_brep(&mesh, &faces, &BrepOptions::default(), &monitor)?;
    let fine = TessellateOptions {
        chord: 0.02,
        ..TessellateOptions::default()
    };
    let surface = tessellate(&mesh, &faces, &fine)?.mesh;
    Ok(Organic {
        brep,
        bvh: Bvh::new(&surface),
        surface,
        nodes: mesh.points,
    })
}

/// A seeded sequence of numbers in 0..1 (xorshift64*, S. Vigna, doi:10.1145/2845077).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * self.next()
    }

    fn index(&mut self, n: usize) -> usize {
        ((self.next() * n as f64) as usize).min(n - 1)
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let v = Vec3::from_fn(|_, _| self.between(-1.0, 1.0));
            if (0.1..1.0).contains(&v.norm()) {
                return v.normalize();
            }
        }
    }
}

#[derive(Debug, Clone, Copy)]
enum Form {
    /// Radius and height; the bore's radius.
    Sleeve([f64; 2], f64),
    /// Radius and height.
    Cylinder([f64; 2]),
    /// Edges.
    Cuboid([f64; 3]),
}

impl Form {
    fn random(kind: usize, random: &mut Random) -> Self {
        match kind % 4 {
            0 => Self::Cylinder([random.between(3.0, 9.0), random.between(6.0, 24.0)]),
            1 => {
                let radius = random.between(4.0, 9.0);
                Self::Sleeve(
                    [radius, random.between(6.0, 24.0)],
                    radius * random.between(0.4, 0.75),
                )
            }
            2 => Self::Cuboid([(); 3].map(|()| random.between(5.0, 18.0))),
            _ => Self::Cuboid([
                random.between(14.0, 30.0),
                random.between(14.0, 30.0),
                random.between(1.5, 3.0),
            ]),
        }
    }

    /// From the middle to the side along x, mm.
    fn reach(self) -> f64 {
        match self {
            Self::Sleeve([radius, _], _) | Self::Cylinder([radius, _]) => radius,
            Self::Cuboid([x, ..]) => 0.5 * x,
        }
    }

    /// About the origin, a cylinder's axis along z.
    fn mesh(self) -> TriMesh {
        match self {
            Self::Sleeve([outer, height], inner) => turned(
                &[[outer, -0.5], [outer, 0.5], [inner, 0.5], [inner, -0.5]],
                height,
                true,
            ),
            Self::Cylinder([radius, height]) => turned(
                &[[0.0, -0.5], [radius, -0.5], [radius, 0.5], [0.0, 0.5]],
                height,
                false,
            ),
            Self::Cuboid(edges) => cuboid(edges),
        }
    }

    /// Belongs to the body with its bore filled.
    fn fills(self, p: &Vec3) -> bool {
        match self {
            Self::Sleeve([radius, height], _) | Self::Cylinder([radius, height]) => {
                p.xy().norm() <= radius && 2.0 * p.z.abs() <= height
            }
            Self::Cuboid(edges) => (0..3).all(|a| 2.0 * p[a].abs() <= edges[a]),
        }
    }

    fn volume(self) -> f64 {
        match self {
            Self::Sleeve([radius, height], inner) => {
                PI * (radius * radius - inner * inner) * height
            }
            Self::Cylinder([radius, height]) => PI * radius * radius * height,
            Self::Cuboid([x, y, z]) => x * y * z,
        }
    }
}

/// A profile of (radius, height share) turned about z; points on the axis become one.
fn turned(profile: &[[f64; 2]], height: f64, closed: bool) -> TriMesh {
    const FACETS: u32 = 96;
    let n = profile.len() as u32;
    let mut mesh = TriMesh::default();
    for k in 0..FACETS {
        let (s, c) = (TAU * f64::from(k) / f64::from(FACETS)).sin_cos();
        mesh.points.extend(
            profile
                .iter()
                .map(|[r, z]| Vec3::new(r * c, r * s, z * height)),
        );
    }
    for k in 0..FACETS {
        let next = (k + 1) % FACETS;
        for j in 0..n - u32::from(!closed) {
            let (i, m) = (j, (j + 1) % n);
            let (a, b, c, d) = (n * k + i, n * next + i, n * next + m, n * k + m);
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    // Triangles at the axis have two equal corners.
    mesh.triangles.retain(|t| {
        let [a, b, c] = t.map(|v| mesh.points[v as usize]);
        (b - a).cross(&(c - a)).norm() > 1e-9
    });
    mesh
}

fn cuboid(edges: [f64; 3]) -> TriMesh {
    let mut mesh = TriMesh::default();
    for corner in 0..8_usize {
        mesh.points.push(Vec3::from_fn(|a, _| {
            edges[a] * (f64::from(u8::from(corner >> a & 1 == 1)) - 0.5)
        }));
    }
    for [a, b, c, d] in [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ] {
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
    mesh
}

/// Where a body sits.
struct Place {
    rotation: Rotation3<f64>,
    centre: Vec3,
}

/// Turns `from` into `to`.
fn turn(from: &Vec3, to: &Vec3) -> Rotation3<f64> {
    Rotation3::rotation_between(from, to)
        .unwrap_or_else(|| Rotation3::from_axis_angle(&Vec3::y_axis(), PI))
}

/// A point of the surface with its outward normal.
fn on_surface(organic: &Organic, random: &mut Random) -> (Vec3, Vec3) {
    let t = random.index(organic.surface.triangles.len());
    let [a, b, c] = organic.surface.corners(t);
    ((a + b + c) / 3.0, (b - a).cross(&(c - a)).normalize())
}

fn place(kind: usize, form: Form, organic: &Organic, random: &mut Random) -> Place {
    match kind {
        // Along a coordinate axis, on the middle line of a row of cubes.
        0 => {
            let middle = loop {
                let node = organic.nodes[random.index(organic.nodes.len())] / CELL;
                let middle = node.map(|x| (x.round() - 0.5) * CELL);
                if Winding::new(&organic.bvh).at(&middle) > 0.5 {
                    break middle;
                }
            };
            let axis = [Vec3::x(), Vec3::y(), Vec3::z()][random.index(3)];
            Place {
                rotation: turn(&Vec3::z(), &axis),
                centre: middle + random.between(-6.0, 6.0) * axis,
            }
        }
        // The side touches the surface, or dips in by up to 0.2 mm.
        1 | 2 => {
            let (p, normal) = on_surface(organic, random);
            let depth = if kind == 1 {
                0.0
            } else {
                random.between(0.02, 0.2)
            };
            let spin = Rotation3::from_axis_angle(&Vec3::x_axis(), random.between(0.0, TAU));
            Place {
                rotation: turn(&Vec3::x(), &-normal) * spin,
                centre: p + (form.reach() - depth) * normal,
            }
        }
        // Any which way through a corner of patches.
        _ => {
            let node = organic.nodes[random.index(organic.nodes.len())];
            let found = organic.bvh.nearest(&node, f64::INFINITY);
            let centre = found.map_or(node, |nearest| nearest.point);
            Place {
                rotation: turn(&Vec3::z(), &random.direction()),
                centre,
            }
        }
    }
}

/// What the union holds more than the organic body, by a random point in each cell of a
/// lattice over the body's box with its bores' free length.
fn added(organic: &Organic, form: Form, place: &Place, body: &NonDesignBody) -> f64 {
    let beyond = body
        .bores
        .iter()
        .flat_map(|b| b.extension)
        .fold(0.0, f64::max);
    let half = match form {
        Form::Cuboid(edges) => Vec3::from(edges) / 2.0,
        Form::Cylinder([r, h]) | Form::Sleeve([r, h], _) => Vec3::new(r, r, 0.5 * h + beyond),
    };
    let step = 2.0 * half / POINTS as f64;
    let mut random = Random(1);
    let mut points = Vec::with_capacity(POINTS.pow(3));
    for i in 0..POINTS {
        for j in 0..POINTS {
            for k in 0..POINTS {
                let mut at = |a: usize, n: usize| (n as f64 + random.next()) * step[a] - half[a];
                points.push(Vec3::new(at(0, i), at(1, j), at(2, k)));
            }
        }
    }
    let world: Vec<Vec3> = points
        .iter()
        .map(|p| place.centre + place.rotation * p)
        .collect();
    let inside = Winding::new(&organic.bvh).at_all(&world);
    let in_bore = |p: &Vec3| {
        body.bores.iter().any(|bore| {
            let d = p - bore.origin;
            let along = d.dot(&bore.direction);
            let free = bore.extent[0] - bore.extension[0]..bore.extent[1] + bore.extension[1];
            free.contains(&along) && (d - along * bore.direction).norm() < bore.radius
        })
    };
    let mut sum = 0.0;
    for ((p, at), w) in points.iter().zip(&world).zip(&inside) {
        let before = f64::from(u8::from(*w > 0.5));
        let filled = *w > 0.5 || form.fills(p);
        sum += f64::from(u8::from(filled && !in_bore(at))) - before;
    }
    sum * step.product()
}

#[test]
fn forty_placements_are_right_or_say_so() -> Result {
    let organic = organic()?;
    let monitor = Monitor::default();
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let mut wrong = Vec::new();
    for n in 0..40 {
        let name = ["coaxial", "tangent", "grazing", "through a seam"][n / 10];
        let form = Form::random(n, &mut random);
        let place = place(n / 10, form, &organic, &mut random);
        let mut mesh = form.mesh();
        mesh.points
            .iter_mut()
            .for_each(|p| *p = place.centre + place.rotation * *p);
        let bodies = from_mesh(
            "body",
            "test",
            &mesh,
            &NonDesignOptions::default(),
            &monitor,
        )?;
        assert_eq!(bodies.len(), 1, "{form:?}");
        let solid = build(&organic.brep, &bodies, &CadOptions::default(), &monitor)?;
        let want = added(&organic, form, &place, &bodies[0]);
        let have = solid.volume - organic.brep.volume;
        let off = (have - want).abs() / form.volume();
        println!(
            "{n:2} {name:15} {form:.1?}: valid {}, {} bodies, {} faces, volume {:+.4} of the body off; {}",
            solid.valid,
            solid.bodies,
            solid.faces,
            (have - want) / form.volume(),
            if solid.valid {
                solid.messages.join(" | ")
            } else {
                format!("{:?} {:?}", solid.messages, solid.non_design)
            }
        );
        if solid.valid && off > TOLERANCE {
            wrong.push(format!(
                "{n}: {have:.2} mm3 instead of {want:.2} called valid"
            ));
        }
        if !solid.valid && solid.messages.is_empty() {
            wrong.push(format!("{n}: not valid, without a word"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    Ok(())
}
