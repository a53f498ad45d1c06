//! Which shells of the body are solids, which are cavities, and of which solid.

use super::{CadError, patches};
use crate::Vec3;
use crate::spline::Brep;

/// Cells a patch in the triangulation that classifies; the answer is an integer, so coarse is enough.
const CELLS: usize = 4;

/// For each solid its shells, the outer one first.
///
/// 1. The sign of a shell's volume tells solid from cavity (control meshes are oriented out of the material).
/// 2. The winding number of all other shells at a point of the shell must be 0 for a solid and 1 for a cavity.
/// 3. A cavity belongs to the smallest solid around it.
///
/// # Errors
/// [`CadError::MisplacedShell`] when a winding number is wrong.
pub(crate) fn classify(brep: &Brep) -> Result<Vec<Vec<usize>>, CadError> {
    let meshes: Vec<Vec<[Vec3; 3]>> = brep
        .shells
        .iter()
        .map(|faces| triangulate(brep, faces))
        .collect();
    let volumes: Vec<f64> = meshes.iter().map(|m| volume(m)).collect();
    if meshes.len() == 1 && volumes[0] > 0.0 {
        return Ok(vec![vec![0]]);
    }
    let mut solids: Vec<Vec<usize>> = (0..meshes.len())
        .filter(|&s| volumes[s] > 0.0)
        .map(|s| vec![s])
        .collect();
    for (shell, mesh) in meshes.iter().enumerate() {
        let Some(place) = mesh.first().map(|t| t[0]) else {
            return Err(CadError::BadBrep {
                text: format!("shell {shell} has no faces"),
            });
        };
        let around: Vec<i64> = (0..meshes.len())
            .map(|o| {
                if o == shell {
                    0
                } else {
                    winding(&meshes[o], place)
                }
            })
            .collect();
        let depth: i64 = around.iter().sum();
        let wanted = i64::from(volumes[shell] <= 0.0);
        let owner = (0..solids.len())
            .filter(|&k| around[solids[k][0]] > 0)
            .min_by(|&a, &b| volumes[solids[a][0]].total_cmp(&volumes[solids[b][0]]));
        match (wanted, owner) {
            (0, _) if depth == 0 => {}
            (1, Some(owner)) if depth == 1 => solids[owner].push(shell),
            _ => {
                return Err(CadError::MisplacedShell {
                    shell,
                    volume: volumes[shell],
                    depth,
                    wanted,
                });
            }
        }
    }
    Ok(solids)
}

fn triangulate(brep: &Brep, faces: &[u32]) -> Vec<[Vec3; 3]> {
    let mut out = Vec::new();
    for patch in faces
        .iter()
        .flat_map(|&f| patches::face_beziers(&brep.faces[f as usize]))
    {
        patches::triangles(&patch, CELLS, &mut out);
    }
    out
}

fn volume(mesh: &[[Vec3; 3]]) -> f64 {
    let base = mesh.first().map_or(Vec3::zeros(), |t| t[0]);
    mesh.iter()
        .map(|[a, b, c]| (a - base).dot(&(b - base).cross(&(c - base))) / 6.0)
        .sum()
}

/// Winding number of a closed mesh about a point: sum of solid angles (van Oosterom & Strackee 1983, 10.1109/TBME.1983.325207).
fn winding(mesh: &[[Vec3; 3]], place: Vec3) -> i64 {
    let mut sum = 0.0;
    for t in mesh {
        let [a, b, c] = t.map(|p| p - place);
        let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
        let below = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
        sum += 2.0 * a.dot(&b.cross(&c)).atan2(below);
    }
    (sum / (4.0 * std::f64::consts::PI)).round() as i64
}
