//! Exact solids from the recognised surfaces of a mesh.

use std::collections::{BTreeMap, BTreeSet};

use grassfire_occt::{Operation, Shape};
use nalgebra::{Matrix2, Matrix3, Vector2};

use super::primitives::{self, Primitive, Region, neighbours};
use super::{CadError, NonDesignOptions, array, non_design::Rebuilt};
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::monitor::Monitor;

/// Relative difference between mesh and exact volume that facets of a coarse mesh can explain.
const VOLUME_MARGIN: f64 = 0.08;
/// Above this number of triangles a faceted solid is too heavy for booleans.
const MAX_FACETS: usize = 20_000;

/// The best solid for a closed mesh: turned profile, prismatic body with bores, or its own facets.
///
/// # Errors
/// [`CadError::BadMesh`] when even the facets make no valid solid.
pub(crate) fn solid(
    name: &str,
    part: &TriMesh,
    options: &NonDesignOptions,
    monitor: &Monitor,
) -> Result<(Shape, Rebuilt), CadError> {
    let regions = primitives::regions(part, options.sharp_angle, options.mesh_tolerance);
    if let Some((shape, residual)) =
        revolution(part, &regions, options.mesh_tolerance).filter(|(s, _)| agrees(s, part))
    {
        return Ok((shape, Rebuilt::Revolution { residual }));
    }
    if let Some((shape, residual)) = prismatic(part, &regions).filter(|(s, _)| agrees(s, part)) {
        return Ok((shape, Rebuilt::Prismatic { residual }));
    }
    let unknown = regions.iter().filter(|r| r.primitive.is_none()).count();
    monitor.warn(
        "cad",
        format!(
            "{name}: {unknown} of {} surfaces are neither planes nor cylinders nor turned about one axis within {} mm; its {} triangles are used as they are",
            regions.len(),
            options.mesh_tolerance,
            part.triangles.len()
        ),
    );
    Ok((faceted(name, part)?, Rebuilt::Faceted))
}

fn agrees(shape: &Shape, part: &TriMesh) -> bool {
    let sound = matches!(shape.faults(), Ok(None))
        && shape
            .counts()
            .is_ok_and(|c| c.solids == 1 && c.bad_edges == 0);
    let exact = part.volume();
    sound
        && shape
            .volume(1e-9)
            .is_ok_and(|v| (v - exact).abs() < VOLUME_MARGIN * exact)
}

fn faceted(name: &str, part: &TriMesh) -> Result<Shape, CadError> {
    let bad = |text: String| CadError::BadMesh {
        name: name.to_owned(),
        text,
    };
    if part.triangles.len() > MAX_FACETS {
        return Err(bad(format!(
            "{} triangles on surfaces that are neither planes nor cylinders; at most {MAX_FACETS} can be used as they are",
            part.triangles.len()
        )));
    }
    let points: Vec<[f64; 3]> = part.points.iter().map(|p| array(*p)).collect();
    let raw = Shape::from_triangles(&points, &part.triangles)?;
    if let Some(better) = raw.unified().ok().filter(|s| agrees(s, part)) {
        return Ok(better);
    }
    if agrees(&raw, part) {
        Ok(raw)
    } else {
        Err(bad("its triangles make no valid solid".into()))
    }
}

// ---------------------------------------------------------------------------------------------- turned bodies

/// A straight piece of the profile: `normal . (r, z) = offset`.
struct ProfileLine {
    normal: Vector2<f64>,
    offset: f64,
}

/// Turns the profile when all regions are straight lines in (radius, height) about the axis of the largest cylinder.
fn revolution(part: &TriMesh, regions: &[Region], tolerance: f64) -> Option<(Shape, f64)> {
    let largest = regions
        .iter()
        .filter(|r| matches!(r.primitive, Some(Primitive::Cylinder { .. })))
        .max_by_key(|r| (r.triangles.len(), std::cmp::Reverse(r.triangles[0])))?;
    let Some(Primitive::Cylinder {
        origin, direction, ..
    }) = largest.primitive
    else {
        return None;
    };
    let mut lines = Vec::with_capacity(regions.len());
    let mut worst = 0.0f64;
    for region in regions {
        let (line, residual) = profile_line(part, region, origin, direction);
        worst = worst.max(residual);
        lines.push(line);
    }
    if worst > tolerance {
        return None;
    }
    let order = profile_order(part, regions)?;
    let closed = order.closed;
    let ids = order.regions;
    let mut profile = Vec::new();
    if !closed {
        profile.push(meet(&axis_line(), &lines[ids[0]])?);
    }
    for pair in ids.windows(2) {
        profile.push(meet(&lines[pair[0]], &lines[pair[1]])?);
    }
    let (first, last) = (ids[0], *ids.last()?);
    profile.push(if closed {
        meet(&lines[last], &lines[first])?
    } else {
        meet(&lines[last], &axis_line())?
    });
    let profile: Vec<[f64; 2]> = profile
        .iter()
        .map(|p| [if p.x.abs() < 1e-9 { 0.0 } else { p.x }, p.y])
        .collect();
    let shape = Shape::revolve(array(origin), array(direction), &profile).ok()?;
    Some((shape, worst))
}

fn axis_line() -> ProfileLine {
    ProfileLine {
        normal: Vector2::new(1.0, 0.0),
        offset: 0.0,
    }
}

fn meet(a: &ProfileLine, b: &ProfileLine) -> Option<Vector2<f64>> {
    let m = Matrix2::new(a.normal.x, a.normal.y, b.normal.x, b.normal.y);
    if m.determinant().abs() < 1e-3 {
        return None;
    }
    m.lu().solve(&Vector2::new(a.offset, b.offset))
}

fn profile_line(
    part: &TriMesh,
    region: &Region,
    origin: Vec3,
    direction: Vec3,
) -> (ProfileLine, f64) {
    let mut vertices: Vec<u32> = region
        .triangles
        .iter()
        .flat_map(|&t| part.triangles[t as usize])
        .collect();
    vertices.sort_unstable();
    vertices.dedup();
    let points: Vec<Vector2<f64>> = vertices
        .iter()
        .map(|&v| {
            let q = part.points[v as usize] - origin;
            let z = q.dot(&direction);
            Vector2::new((q - direction * z).norm(), z)
        })
        .collect();
    let centre = points.iter().sum::<Vector2<f64>>() / points.len() as f64;
    let mut spread = Matrix2::zeros();
    for p in &points {
        spread += (p - centre) * (p - centre).transpose();
    }
    let eigen = spread.symmetric_eigen();
    let mut normal: Vector2<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into();
    // A flat end without inner vertices has one radius only: its line is across the axis all the same.
    if let Some(Primitive::Plane { normal: n, .. }) =
        region.primitive.filter(|_| eigen.eigenvalues.max() < 1e-9)
    {
        normal = if n.dot(&direction).abs() > 0.5 {
            Vector2::new(0.0, 1.0)
        } else {
            normal
        };
    }
    // Mesh noise must not turn walls and ends into cones.
    let snap = 1e-4;
    if normal.x.abs() < snap {
        normal = Vector2::new(0.0, 1.0);
    } else if normal.y.abs() < snap {
        normal = Vector2::new(1.0, 0.0);
    }
    let residual = points
        .iter()
        .map(|p| (p - centre).dot(&normal).abs())
        .fold(0.0, f64::max);
    (
        ProfileLine {
            normal,
            offset: normal.dot(&centre),
        },
        residual,
    )
}

struct ProfileOrder {
    regions: Vec<usize>,
    closed: bool,
}

fn region_of(part: &TriMesh, regions: &[Region]) -> Vec<u32> {
    let mut of = vec![0u32; part.triangles.len()];
    for (r, region) in regions.iter().enumerate() {
        region
            .triangles
            .iter()
            .for_each(|&t| of[t as usize] = r as u32);
    }
    of
}

/// Regions in the order of the profile: a cycle (hollow body) or a path that ends on the axis.
fn profile_order(part: &TriMesh, regions: &[Region]) -> Option<ProfileOrder> {
    let of = region_of(part, regions);
    let mut links = vec![BTreeSet::new(); regions.len()];
    for (t, next) in neighbours(part).ok()?.iter().enumerate() {
        for &n in next {
            let (a, b) = (of[t], of[n as usize]);
            if a != b {
                links[a as usize].insert(b as usize);
            }
        }
    }
    if regions.len() < 3 || links.iter().any(|l| l.is_empty() || l.len() > 2) {
        return None;
    }
    let ends: Vec<usize> = (0..links.len()).filter(|&r| links[r].len() == 1).collect();
    let closed = match ends.len() {
        0 => true,
        2 => false,
        _ => return None,
    };
    let mut order = vec![*ends.first().unwrap_or(&0)];
    let mut used = vec![false; regions.len()];
    used[order[0]] = true;
    while let Some(&next) = links[*order.last()?].iter().find(|&&n| !used[n]) {
        used[next] = true;
        order.push(next);
    }
    (order.len() == regions.len()).then_some(ProfileOrder {
        regions: order,
        closed,
    })
}

// ---------------------------------------------------------------------------------------------- planes and bores

/// A plane polyhedron with cut bores, when all regions are planes and full concave cylinders between planes across them.
///
/// 1. Take the bores' triangles away and close the holes with flat caps.
/// 2. Move every vertex onto the fitted planes that meet there.
/// 3. Make the polyhedron, merge coplanar facets, cut the bores.
fn prismatic(part: &TriMesh, regions: &[Region]) -> Option<(Shape, f64)> {
    let of = region_of(part, regions);
    if regions.iter().any(|r| {
        !matches!(
            r.primitive,
            Some(Primitive::Plane { .. } | Primitive::Cylinder { concave: true, .. })
        )
    }) {
        return None;
    }
    let mut points = snapped(part, regions, &of)?;
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for (t, triangle) in part.triangles.iter().enumerate() {
        if matches!(
            regions[of[t] as usize].primitive,
            Some(Primitive::Plane { .. })
        ) {
            triangles.push(*triangle);
        }
    }
    cap(&mut points, &mut triangles)?;
    let closed = TriMesh {
        points,
        triangles,
        tags: Vec::new(),
    };
    let mut body: Option<Shape> = None;
    for piece in primitives::parts("polyhedron", &closed).ok()? {
        // A closed bottom and its cap make a flat body of no volume.
        if piece.volume() < 1e-6 * part.volume() {
            continue;
        }
        let points: Vec<[f64; 3]> = piece.points.iter().map(|p| array(*p)).collect();
        let shape = Shape::from_triangles(&points, &piece.triangles).ok()?;
        if body.replace(shape.unified().ok()?).is_some() {
            return None;
        }
    }
    let mut body = body?;
    for region in regions {
        if let Some(Primitive::Cylinder {
            origin,
            direction,
            radius,
            ..
        }) = region.primitive
        {
            let tool = bore_tool(part, regions, &of, region, (origin, direction, radius))?;
            body = body
                .boolean(Operation::Cut, &tool, 1e-5, false, &|| false)
                .ok()?
                .shape;
        }
    }
    Some((body, regions.iter().map(|r| r.residual).fold(0.0, f64::max)))
}

/// Vertices of plane regions, each moved onto its planes by the least motion.
fn snapped(part: &TriMesh, regions: &[Region], of: &[u32]) -> Option<Vec<Vec3>> {
    let mut planes: Vec<BTreeSet<u32>> = vec![BTreeSet::new(); part.points.len()];
    for (t, triangle) in part.triangles.iter().enumerate() {
        triangle.iter().for_each(|&v| {
            planes[v as usize].insert(of[t]);
        });
    }
    let mut out = part.points.clone();
    for (v, point) in out.iter_mut().enumerate() {
        let mut m = Matrix3::zeros();
        let mut right = Vec3::zeros();
        for &r in &planes[v] {
            if let Some(Primitive::Plane { normal, offset }) = regions[r as usize].primitive {
                m += normal * normal.transpose();
                right += normal * (offset - normal.dot(point));
            }
        }
        *point += m.pseudo_inverse(1e-9).ok()? * right;
    }
    Some(out)
}

/// Closes every hole with a fan around its middle.
fn cap(points: &mut Vec<Vec3>, triangles: &mut Vec<[u32; 3]>) -> Option<()> {
    let mut half = BTreeSet::new();
    for t in triangles.iter() {
        (0..3).for_each(|k| {
            half.insert((t[k], t[(k + 1) % 3]));
        });
    }
    // Border edges reversed: they run the way the cap needs.
    let mut next: BTreeMap<u32, u32> = BTreeMap::new();
    for &(a, b) in half.iter().filter(|&&(a, b)| !half.contains(&(b, a))) {
        if next.insert(b, a).is_some() {
            return None;
        }
    }
    while let Some((&start, _)) = next.first_key_value() {
        let mut ring = vec![start];
        while let Some(n) = next.remove(ring.last()?) {
            if n == start {
                break;
            }
            ring.push(n);
        }
        let middle = points.len() as u32;
        points.push(ring.iter().map(|&v| points[v as usize]).sum::<Vec3>() / ring.len() as f64);
        triangles.extend((0..ring.len()).map(|k| [ring[k], ring[(k + 1) % ring.len()], middle]));
    }
    Some(())
}

/// The cylinder between the two planes at its ends; a little longer where it is open.
fn bore_tool(
    part: &TriMesh,
    regions: &[Region],
    of: &[u32],
    bore: &Region,
    (origin, direction, radius): (Vec3, Vec3, f64),
) -> Option<Shape> {
    let own = of[bore.triangles[0] as usize];
    let inside: BTreeSet<u32> = bore.triangles.iter().copied().collect();
    let all = neighbours(part).ok()?;
    let around: BTreeSet<u32> = inside
        .iter()
        .flat_map(|&t| all[t as usize])
        .map(|t| of[t as usize])
        .filter(|&r| r != own)
        .collect();
    let mut heights = Vec::new();
    for r in around {
        let Some(Primitive::Plane { normal, offset }) = regions[r as usize].primitive else {
            return None;
        };
        let slope = normal.dot(&direction);
        if slope.abs() < 1.0 - 1e-6 {
            return None;
        }
        heights.push(((offset - normal.dot(&origin)) / slope, slope));
    }
    heights.sort_by(|a, b| a.0.total_cmp(&b.0));
    let &[(low, low_slope), (high, high_slope)] = heights.as_slice() else {
        return None;
    };
    let more = 0.05 * radius;
    let from = if low_slope < 0.0 { low - more } else { low };
    let to = if high_slope > 0.0 { high + more } else { high };
    Shape::cylinder(
        array(origin + direction * from),
        array(direction),
        radius,
        to - from,
    )
    .ok()
}
