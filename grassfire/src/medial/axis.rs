//! The whole chain from a field to the pruned medial axis.

use rayon::prelude::*;

use super::burn::{Alive, Collapse, FaceSpheres, burn, distance, regrow};
use super::complex::Complex;
use super::curves::{prune_curves, trim_tips};
use super::delaunay::{NONE, delaunay_lattice};
use super::necks::add_necks;
use super::refit::refit;
use super::union_find::UnionFind;
use super::voxel_solid::VoxelSolid;
use super::{MedialAxis, MedialError, MedialMesh, MedialOptions};
use crate::Vec3;
use crate::monitor::Monitor;
use crate::topology::Betti;
use crate::voxel::VoxelGrid;

const STAGE: &str = "medial";
/// How often necks are looked for, at most.
const NECK_ROUNDS: usize = 3;

/// The pruned medial axis of the solid where `field` is above zero (mm; a signed distance, or any
/// smooth field that grows inwards).
///
/// 1. Take the corners between solid and empty voxels; count the Betti numbers of the solid
///    (6-connected; cavities 26-connected).
/// 2. Exact Delaunay triangulation of the corners ([`delaunay_lattice`]).
/// 3. The Voronoi complex inside the solid, with the homotopy type of the solid: checked.
/// 4. Burn it once to find the erosion thickness (how much longer than its radius a place lasts),
///    then burn it again, stopping where the thickness is above max(`sheet_noise`, `sheet_ratio` R). Where that leaves a
///    curve between sheets shorter than `neck_length` R, once more with `neck_ratio` there: a short neck stays a sheet.
///    Sheets whose thickness stays below `ribbon_ratio` R burn to curves. Rims grow back where the
///    object angle is wide. Small islands burn to curves too. Dangling curves go when thin at their root.
///    Everything is elementary collapses, so the homotopy type cannot change, whatever the options are.
/// 5. Refit the spheres to the zero level of the field.
/// 6. Cut the polygons into triangles.
///
/// A component without loops, cavities or anything long (a ball) shrinks to one edge of half a voxel, so that
/// every component is present in the result. Faces round a cavity are never burnt.
///
/// # Errors
/// [`MedialError::Empty`] without a solid voxel, [`MedialError::BadGrid`] when the grid contradicts itself,
/// [`MedialError::Topology`] should the complex not have the Betti numbers of the solid.
///
/// # Sources
/// Yan, Letscher, Ju 2018, <https://doi.org/10.1145/3197517.3201396> (voxel cores); Yan, Sykes,
/// Chambers, Letscher, Ju 2016, <https://doi.org/10.1145/2897824.2925938> (erosion thickness).
pub fn medial_axis(
    field: &VoxelGrid<f32>,
    options: &MedialOptions,
    monitor: &Monitor,
) -> Result<MedialAxis, MedialError> {
    options.check()?;
    check_grid(field)?;
    monitor.step(STAGE, "corners", 0.0)?;
    let voxels = VoxelSolid::from_field(field);
    let (samples, chi) = voxels.corners();
    if samples.is_empty() {
        return Err(MedialError::Empty);
    }
    let (solid, triangulation) =
        rayon::join(|| voxels.betti(chi), || delaunay_lattice(&samples, monitor));
    let mut complex = {
        let triangulation = triangulation?;
        monitor.step(STAGE, "Voronoi complex", 0.4)?;
        Complex::build(&triangulation, &samples, &voxels)
    };
    drop(voxels);
    let full = complex.betti();
    same(solid, full, "complex")?;
    let spheres = FaceSpheres::of(&complex);
    let (alive, points) = prune(&complex, &spheres, &samples, options, monitor)?;
    drop(spheres);
    monitor.step(STAGE, "spheres", 0.9)?;
    for f in 0..complex.faces() {
        if !alive.faces[f] {
            let [p, q] = complex.face_samples[f];
            complex.complement.unite(p, q);
        }
    }
    let mesh = triangulate(&complex, &alive, &points, &samples, field, options);
    let pruned = betti(&mesh, complex.complement.sets() as i64 - 1);
    same(solid, pruned, "pruned complex")?;
    Ok(MedialAxis {
        mesh,
        solid,
        complex: full,
        pruned,
        samples: samples.len(),
    })
}

fn check_grid(field: &VoxelGrid<f32>) -> Result<(), MedialError> {
    let [nx, ny, nz] = field.dims;
    let count = nx.checked_mul(ny).and_then(|n| n.checked_mul(nz));
    let sound = field.spacing.is_finite()
        && field.spacing > 0.0
        && field.origin.iter().all(|x| x.is_finite());
    if count != Some(field.values.len()) || !sound {
        return Err(MedialError::BadGrid {
            dims: field.dims,
            values: field.values.len(),
            spacing: field.spacing,
        });
    }
    Ok(())
}

fn same(wanted: Betti, found: Betti, at: &'static str) -> Result<(), MedialError> {
    if wanted == found {
        Ok(())
    } else {
        Err(MedialError::Topology { at, wanted, found })
    }
}

/// Step 4: what of the complex is kept, and the edges that stand for components without extent.
fn prune(
    complex: &Complex,
    spheres: &FaceSpheres,
    samples: &[[i32; 3]],
    options: &MedialOptions,
    monitor: &Monitor,
) -> Result<(Alive, Vec<u32>), MedialError> {
    monitor.step(STAGE, "burning", 0.5)?;
    let radius = |f: u32| spheres.radii[f as usize];
    let limit = |f: u32| options.sheet_limit(radius(f));
    let mut alive = Alive::all(complex);
    let (full, pruning) = rayon::join(
        || {
            burn(
                complex,
                spheres,
                &mut Alive::all(complex),
                |_| f32::INFINITY,
                monitor,
            )
        },
        || burn(complex, spheres, &mut alive, limit, monitor),
    );
    let (times, collapses) = (full?.0, pruning?.1);
    let pruning = Pruning {
        complex,
        spheres,
        samples,
        times,
        options,
        monitor,
    };
    let mut points = pruning.finish(&mut alive, collapses)?;
    let mut neck = vec![false; complex.faces()];
    // A neck that came back as a sheet may leave a shorter one at its ends.
    for _ in 0..NECK_ROUNDS {
        if options.neck_length <= 0.0
            || !add_necks(complex, spheres, &alive, options.neck_length, &mut neck)
        {
            break;
        }
        let limit = |f: u32| {
            if neck[f as usize] {
                options.neck_limit(radius(f))
            } else {
                limit(f)
            }
        };
        alive = Alive::all(complex);
        let (_, collapses) = burn(complex, spheres, &mut alive, limit, monitor)?;
        points = pruning.finish(&mut alive, collapses)?;
    }
    Ok((alive, points))
}

/// What pruning needs once the complex was burnt.
struct Pruning<'a> {
    complex: &'a Complex,
    spheres: &'a FaceSpheres,
    samples: &'a [[i32; 3]],
    /// When each face burns in the full burn.
    times: Vec<f32>,
    options: &'a MedialOptions,
    monitor: &'a Monitor,
}

impl Pruning<'_> {
    /// Ribbons and islands to curves, rims back, dangling curves away.
    fn finish(&self, alive: &mut Alive, collapses: Vec<Collapse>) -> Result<Vec<u32>, MedialError> {
        let Self {
            complex,
            spheres,
            options,
            monitor,
            ..
        } = *self;
        monitor.step(STAGE, "sheets", 0.75)?;
        let ribbon = ribbons(complex, spheres, alive, &self.times, options);
        burn(complex, spheres, alive, only(&ribbon), monitor)?;
        regrow(
            complex,
            spheres,
            self.samples,
            &self.times,
            alive,
            &collapses,
            options.regrow_sine,
        );
        drop(collapses);
        let island = islands(complex, spheres, alive, options);
        burn(complex, spheres, alive, only(&island), monitor)?;
        monitor.step(STAGE, "curves", 0.85)?;
        let points = prune_curves(complex, alive, |r| options.curve_limit(r));
        trim_tips(complex, alive, |r| options.tip_limit(r));
        Ok(points)
    }
}

/// Faces of sheets that are nowhere thicker than `ribbon_ratio` times their radius.
fn ribbons(
    complex: &Complex,
    spheres: &FaceSpheres,
    alive: &Alive,
    times: &[f32],
    options: &MedialOptions,
) -> Vec<bool> {
    let sheet = alive.sheets(complex);
    let mut deepest = vec![0.0f32; complex.faces()];
    for (f, &s) in sheet.iter().enumerate().filter(|(_, s)| **s != NONE) {
        let ratio = (times[f] - spheres.radii[f]) / spheres.radii[f];
        deepest[s as usize] = deepest[s as usize].max(ratio);
    }
    sheet
        .iter()
        .map(|&s| s != NONE && f64::from(deepest[s as usize]) < options.ribbon_ratio)
        .collect()
}

/// Faces of sheets without seams that are too small to be worth a sheet: they flicker along slender members.
fn islands(
    complex: &Complex,
    spheres: &FaceSpheres,
    alive: &Alive,
    options: &MedialOptions,
) -> Vec<bool> {
    let sheet = alive.sheets(complex);
    let mut area = vec![0.0f64; complex.faces()];
    let mut moment = vec![0.0f64; complex.faces()];
    let mut seam = vec![false; complex.faces()];
    for (f, &s) in sheet.iter().enumerate().filter(|(_, s)| **s != NONE) {
        let a = face_area(complex, &spheres.centres[f], f as u32);
        area[s as usize] += a;
        moment[s as usize] += a * f64::from(spheres.radii[f]);
        seam[s as usize] |= complex
            .edges_of(f as u32)
            .iter()
            .any(|&e| alive.faces_at(complex, e).count() > 2);
    }
    let small = |s: usize| !seam[s] && area[s].powi(3) < (options.island_ratio * moment[s]).powi(2);
    sheet
        .iter()
        .map(|&s| s != NONE && small(s as usize))
        .collect()
}

/// Area of a face as a fan about its centre, in square voxels.
fn face_area(complex: &Complex, centre: &[f32; 3], face: u32) -> f64 {
    let triangle = |&e: &u32| {
        let [p, q] = complex.edges[e as usize].map(|v| &complex.centres[v as usize]);
        let (a, b, c) = (distance(p, q), distance(q, centre), distance(centre, p));
        let s = 0.5 * (a + b + c);
        f64::from((s * (s - a) * (s - b) * (s - c)).max(0.0)).sqrt()
    };
    complex.edges_of(face).iter().map(triangle).sum()
}

/// A burn limit that lets the wanted faces burn and no others.
fn only(wanted: &[bool]) -> impl Fn(u32) -> f32 {
    |f| {
        if wanted[f as usize] {
            f32::INFINITY
        } else {
            f32::NEG_INFINITY
        }
    }
}

/// Steps 5 and 6.
fn triangulate(
    complex: &Complex,
    alive: &Alive,
    points: &[u32],
    samples: &[[i32; 3]],
    field: &VoxelGrid<f32>,
    options: &MedialOptions,
) -> MedialMesh {
    let mut used = vec![false; complex.radii.len()];
    for (ends, _) in complex
        .edges
        .iter()
        .zip(&alive.edges)
        .filter(|(_, alive)| **alive)
    {
        ends.iter().for_each(|&v| used[v as usize] = true);
    }
    let wanted: Vec<u32> = (0..used.len() as u32)
        .filter(|&v| used[v as usize])
        .collect();
    let mut number = vec![NONE; used.len()];
    wanted
        .iter()
        .enumerate()
        .for_each(|(i, &v)| number[v as usize] = i as u32);
    let mut mesh = MedialMesh::default();
    (mesh.points, mesh.radii) = refit(complex, &wanted, samples, field, options)
        .into_iter()
        .unzip();
    for f in (0..complex.faces() as u32).filter(|&f| alive.faces[f as usize]) {
        let polygon: Vec<u32> = complex
            .polygon(f)
            .iter()
            .map(|&v| number[v as usize])
            .collect();
        add_polygon(&mut mesh, &polygon);
    }
    for e in (0..complex.edges.len() as u32).filter(|&e| alive.edges[e as usize]) {
        if alive.faces_at(complex, e).next().is_none() {
            mesh.edges
                .push(complex.edges[e as usize].map(|v| number[v as usize]));
        }
    }
    for &e in points {
        spread(
            &mut mesh,
            complex.edges[e as usize].map(|v| number[v as usize] as usize),
            0.5 * field.spacing,
        );
    }
    mesh
}

/// A triangle as it is, a longer polygon as a fan about its mean sphere.
fn add_polygon(mesh: &mut MedialMesh, polygon: &[u32]) {
    if let &[a, b, c] = polygon {
        mesh.triangles.push([a, b, c]);
        return;
    }
    let share = 1.0 / polygon.len() as f64;
    let centre = polygon
        .iter()
        .fold(Vec3::zeros(), |sum, &v| sum + mesh.points[v as usize])
        * share;
    let radius = polygon.iter().map(|&v| mesh.radii[v as usize]).sum::<f64>() * share;
    let hub = mesh.points.len() as u32;
    mesh.points.push(centre);
    mesh.radii.push(radius);
    for (i, &v) in polygon.iter().enumerate() {
        mesh.triangles
            .push([v, polygon[(i + 1) % polygon.len()], hub]);
    }
}

/// Gives an edge that stands for a point a length of at least `length`.
fn spread(mesh: &mut MedialMesh, [a, b]: [usize; 2], length: f64) {
    let along = mesh.points[b] - mesh.points[a];
    if along.norm() >= length {
        return;
    }
    let middle = 0.5 * (mesh.points[a] + mesh.points[b]);
    let direction = along.try_normalize(1e-6 * length).unwrap_or_else(Vec3::x);
    mesh.points[a] = middle - 0.5 * length * direction;
    mesh.points[b] = middle + 0.5 * length * direction;
}

/// Betti numbers of a triangulated complex whose complement has `cavities` bounded parts.
fn betti(mesh: &MedialMesh, cavities: i64) -> Betti {
    let mut edges: Vec<u64> = mesh
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .chain(mesh.edges.iter().copied())
        .map(|[a, b]| u64::from(a.min(b)) << 32 | u64::from(a.max(b)))
        .collect();
    edges.par_sort_unstable();
    edges.dedup();
    let mut sets = UnionFind::new(mesh.points.len());
    edges
        .iter()
        .for_each(|&e| sets.unite((e >> 32) as u32, e as u32));
    let chi = mesh.points.len() as i64 - edges.len() as i64 + mesh.triangles.len() as i64;
    Betti::from_chi(sets.sets() as i64, cavities, chi)
}
