//! Shells: which are too small to matter, which are inside out, which are voids.

use super::super::TriMesh;
use super::edges::Edges;
use super::rays::Rays;
use super::{Repair, RepairError, RepairKind, RepairOptions, retain};
use crate::Vec3;
use crate::monitor::Monitor;

/// Faces of a shell that are asked whether they lie inside another shell.
const SAMPLES: usize = 15;
/// A shell with a larger share of open edges has no certain inside.
const MAX_OPEN: f64 = 0.05;

/// One connected piece of the surface.
struct Shell {
    faces: Vec<u32>,
    /// Signed, about its own middle, mm3.
    volume: f64,
    centre: Vec3,
    closed: bool,
}

/// Drops small pieces, then turns each shell outward or, inside an odd number of others, inward.
pub(super) fn sort_out(
    mesh: &mut TriMesh,
    options: &RepairOptions,
    repairs: &mut Vec<Repair>,
    monitor: &Monitor,
) -> Result<(), RepairError> {
    drop_islands(mesh, options, repairs)?;
    let (shells, of_face) = shells(mesh);
    let nesting = nesting(mesh, &shells, &of_face, monitor)?;
    turn(mesh, &shells, &nesting, repairs);
    if !nesting.overlaps.is_empty() {
        let text = format!(
            "{} pairs of bodies overlap: the remesh unites them, the volume counts the common part twice",
            nesting.overlaps.len()
        );
        repairs.push(Repair::new(
            RepairKind::Overlap,
            nesting.overlaps.len(),
            text,
        ));
    }
    let bodies = nesting.depth.iter().filter(|d| **d % 2 == 0).count();
    if bodies > 1 {
        repairs.push(Repair::new(
            RepairKind::Bodies,
            bodies,
            format!("{bodies} separate bodies, all kept"),
        ));
    }
    Ok(())
}

fn shells(mesh: &TriMesh) -> (Vec<Shell>, Vec<u32>) {
    let edges = Edges::new(mesh);
    let pieces = edges.components(mesh.triangles.len());
    let mut faces = vec![Vec::new(); pieces.count];
    for (t, &piece) in pieces.of_face.iter().enumerate() {
        faces[piece as usize].push(t as u32);
    }
    let mut open = vec![0usize; pieces.count];
    for halves in edges.iter().filter(|h| h.len() == 1) {
        open[pieces.of_face[halves[0] as usize / 3] as usize] += 1;
    }
    let shells = faces.into_iter().zip(open).map(|(faces, open)| {
        let centre = middle(mesh, &faces);
        let volume = faces
            .iter()
            .map(|&t| wedge(mesh, t as usize, &centre))
            .sum();
        let closed = open as f64 <= MAX_OPEN * 1.5 * faces.len() as f64;
        Shell {
            faces,
            volume,
            centre,
            closed,
        }
    });
    (shells.collect(), pieces.of_face)
}

/// Area-weighted centre; the middle that makes the volume of an open piece least arbitrary.
fn middle(mesh: &TriMesh, faces: &[u32]) -> Vec3 {
    let Some(&first) = faces.first() else {
        return Vec3::zeros();
    };
    let base = mesh.corners(first as usize)[0];
    let (mut sum, mut total) = (Vec3::zeros(), 0.0);
    for &t in faces {
        let [a, b, c] = mesh.corners(t as usize).map(|p| p - base);
        let area = (b - a).cross(&(c - a)).norm();
        sum += (a + b + c) * (area / 3.0);
        total += area;
    }
    if total > 0.0 {
        base + sum / total
    } else {
        base
    }
}

fn wedge(mesh: &TriMesh, t: usize, base: &Vec3) -> f64 {
    let [a, b, c] = mesh.corners(t).map(|p| p - base);
    a.dot(&b.cross(&c)) / 6.0
}

fn drop_islands(
    mesh: &mut TriMesh,
    options: &RepairOptions,
    repairs: &mut Vec<Repair>,
) -> Result<(), RepairError> {
    let (shells, of_face) = shells(mesh);
    let largest = shells.iter().map(|s| s.volume.abs()).fold(0.0, f64::max);
    if largest <= 0.0 {
        return Err(RepairError::NotASolid {
            why: format!("none of its {} pieces encloses a volume", shells.len()),
        });
    }
    let small: Vec<bool> = shells
        .iter()
        .map(|s| s.volume.abs() < options.min_volume_share * largest)
        .collect();
    let count = small.iter().filter(|s| **s).count();
    if count == 0 {
        return Ok(());
    }
    let gone = shells
        .iter()
        .zip(&small)
        .filter(|(_, small)| **small)
        .map(|(s, _)| s);
    let volume: f64 = gone.clone().map(|s| s.volume.abs()).sum();
    let first = gone.clone().next().map(|s| s.centre).unwrap_or_default();
    let text = format!(
        "{count} pieces below {} of the largest volume dropped, {volume:.4} mm3 together, the first at ({:.2}, {:.2}, {:.2})",
        options.min_volume_share, first.x, first.y, first.z
    );
    repairs.push(Repair::new(RepairKind::Islands, count, text));
    let keep: Vec<bool> = of_face.iter().map(|&s| !small[s as usize]).collect();
    retain(mesh, &keep);
    Ok(())
}

struct Nesting {
    /// How many closed shells contain each shell wholly.
    depth: Vec<usize>,
    /// Sorted pairs of shells of which one lies partly in the other.
    overlaps: Vec<(u32, u32)>,
}

fn nesting(
    mesh: &TriMesh,
    shells: &[Shell],
    of_face: &[u32],
    monitor: &Monitor,
) -> Result<Nesting, RepairError> {
    let mut nesting = Nesting {
        depth: vec![0; shells.len()],
        overlaps: Vec::new(),
    };
    if shells.len() < 2 {
        return Ok(nesting);
    }
    let rays = Rays::new(mesh, of_face);
    for (index, shell) in shells.iter().enumerate() {
        monitor.check()?;
        let stride = shell.faces.len().div_ceil(SAMPLES).max(1);
        let mut containers: Vec<u32> = Vec::new();
        let mut samples = 0;
        for &t in shell.faces.iter().step_by(stride) {
            let [a, b, c] = mesh.corners(t as usize);
            containers.extend(rays.containing(&((a + b + c) / 3.0)));
            samples += 1;
        }
        containers.sort_unstable();
        // One sample in fifteen may go wrong where the ray grazes an edge.
        let slack = samples / SAMPLES;
        for run in containers.chunk_by(|a, b| a == b) {
            let other = run[0] as usize;
            if other == index || !shells[other].closed {
                continue;
            }
            if run.len() + slack >= samples {
                nesting.depth[index] += 1;
            } else if run.len() > slack {
                nesting
                    .overlaps
                    .push((index.min(other) as u32, index.max(other) as u32));
            }
        }
    }
    nesting.overlaps.sort_unstable();
    nesting.overlaps.dedup();
    Ok(nesting)
}

fn turn(mesh: &mut TriMesh, shells: &[Shell], nesting: &Nesting, repairs: &mut Vec<Repair>) {
    let (mut inverted, mut voids) = (0, Vec::new());
    for (shell, depth) in shells.iter().zip(&nesting.depth) {
        let is_void = depth % 2 == 1;
        if (shell.volume < 0.0) != is_void {
            for &t in &shell.faces {
                mesh.triangles[t as usize].swap(1, 2);
            }
            inverted += usize::from(!is_void);
        }
        if is_void {
            voids.push((shell, shell.volume > 0.0));
        }
    }
    if inverted > 0 {
        let text = format!(
            "{inverted} of {} shells were inside out and were turned",
            shells.len()
        );
        repairs.push(Repair::new(RepairKind::InsideOut, inverted, text));
    }
    if let Some((first, _)) = voids.first() {
        let outward = voids.iter().filter(|(_, outward)| *outward).count();
        let text = format!(
            "{} shells inside a body are taken as voids ({outward} of them had outward normals), the first of {:.4} mm3 at ({:.2}, {:.2}, {:.2})",
            voids.len(),
            first.volume.abs(),
            first.centre.x,
            first.centre.y,
            first.centre.z
        );
        repairs.push(Repair::new(RepairKind::Cavity, voids.len(), text));
    }
}
