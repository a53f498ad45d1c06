//! From a project file to voxels.

use std::path::Path;

use nalgebra::Matrix3;

use super::loads::{LoadPlace, exposed, forces_on};
use super::select::Nodes;
use super::shape::{Solid, any};
use super::{Case, CaseError, Load, Shape, grid};
use crate::Vec3;
use crate::fe::{components, free_modes};
use crate::monitor::Monitor;
use crate::topopt::{CORE, DESIGN, FROZEN, LoadCase, OUTSIDE, Problem};

const STAGE: &str = "case";

/// What a selection came to.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SelectionInfo {
    /// Name.
    pub name: String,
    /// Nodes that touch material.
    pub nodes: usize,
    /// Their mean, mm.
    pub centre: [f64; 3],
    /// Lower corner of the box around them, mm.
    pub low: [f64; 3],
    /// Upper corner, mm.
    pub high: [f64; 3],
    /// They were taken from non-design bodies only.
    pub on_frozen: bool,
}

/// A voxel problem and what was found on the way.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Built {
    /// The problem.
    pub problem: Problem,
    /// All selections that a support or load asks for, by name.
    pub selections: Vec<SelectionInfo>,
    /// Non-design bodies: name and voxels.
    pub bodies: Vec<(String, usize)>,
}

/// Turns a project file into voxels; `folder` is where its paths begin.
///
/// 1. The grid is laid around the design space and the non-design bodies; its memory is estimated first.
/// 2. A voxel belongs to a shape when its centre does. Bodies win over keep-outs, these over the space.
/// 3. Selections become nodes. Where a selection meets non-design bodies, only their nodes are taken.
/// 4. Loads are spread over the nodes: forces evenly, moments by the least forces that give them, pressures and bearing forces over
///    the faces of voxels towards the empty side.
/// 5. Pieces that no support holds are taken out with a warning; the others must not be able to move.
///
/// # Errors
/// [`CaseError`] names the key, the place and the value.
pub fn build(case: &Case, folder: &Path, monitor: &Monitor) -> Result<Built, CaseError> {
    case.check()?;
    let space = Solid::load_all(&case.design.space, "design.space", folder, monitor)?;
    let bodies = load_bodies(case, folder, monitor)?;
    let (low, high) = bounds(&space, &bodies)?;
    let (origin, dims) = grid::place(case, case.grid.h, low, high, f64::INFINITY)?;
    let mut problem = Problem {
        origin,
        h: case.grid.h,
        dims,
        labels: vec![OUTSIDE; dims.iter().product()],
        young: case.material.young,
        nu: case.material.nu,
        ..Problem::default()
    };
    let owned = label(&mut problem, case, folder, (&space, &bodies), monitor)?;
    let mut built = Built {
        bodies: case
            .non_design
            .iter()
            .zip(&owned)
            .map(|(body, voxels)| (body.name.clone(), voxels.len()))
            .collect(),
        ..Built::default()
    };
    let nodes = nodes(case, &problem, folder, &owned);
    let conditions = conditions(&nodes, &problem, &mut built.selections, monitor)?;
    problem.fixed = conditions.fixed;
    problem.springs = conditions.springs;
    problem.cases = conditions.cases;
    hold(&mut problem, monitor)?;
    built.problem = problem;
    Ok(built)
}

/// A non-design body ready for questions.
struct BodySolid {
    shapes: Vec<Solid>,
    cut: Vec<Solid>,
}

impl BodySolid {
    /// Which points lie inside, in order.
    fn contains(&self, points: &[Vec3]) -> Vec<bool> {
        let mut inside = any(&self.shapes, points);
        let away = any(&self.cut, points);
        inside.iter_mut().zip(away).for_each(|(i, a)| *i &= !a);
        inside
    }
}

fn load_bodies(case: &Case, folder: &Path, monitor: &Monitor) -> Result<Vec<BodySolid>, CaseError> {
    let load = |key: &str, shapes: &[Shape]| Solid::load_all(shapes, key, folder, monitor);
    let bodies = case.non_design.iter().enumerate().map(|(i, body)| {
        Ok(BodySolid {
            shapes: load(&format!("non_design[{i}].shapes"), &body.shapes)?,
            cut: load(&format!("non_design[{i}].cut"), &body.cut)?,
        })
    });
    bodies.collect()
}

/// Lower and upper corner of the space and the bodies.
fn bounds(space: &[Solid], bodies: &[BodySolid]) -> Result<(Vec3, Vec3), CaseError> {
    let solids = space.iter().chain(bodies.iter().flat_map(|b| &b.shapes));
    let bounds = solids.filter_map(Solid::bounds);
    bounds
        .reduce(|(a, b), (lo, hi)| (a.inf(&lo), b.sup(&hi)))
        .ok_or_else(|| super::value("design.space", "endless", "a shape with an end"))
}

/// Labels the voxels of a problem by what their centres lie in; gives those of every body.
fn label(
    problem: &mut Problem,
    case: &Case,
    folder: &Path,
    (space, bodies): (&[Solid], &[BodySolid]),
    monitor: &Monitor,
) -> Result<Vec<Vec<usize>>, CaseError> {
    let load = |key: &str, shapes: &[Shape]| Solid::load_all(shapes, key, folder, monitor);
    let centres: Vec<Vec3> = (0..problem.labels.len())
        .map(|v| problem.centre(v))
        .collect();
    monitor.step(STAGE, "voxels of the design space", 0.1)?;
    let cut = load("design.cut", &case.design.cut)?;
    let within = any(space, &centres);
    let without = any(&cut, &centres);
    for v in (0..centres.len()).filter(|&v| within[v] && !without[v]) {
        problem.labels[v] = DESIGN;
    }
    for (i, keep) in case.keep_out.iter().enumerate() {
        let shapes = load(&format!("keep_out[{i}].shapes"), &keep.shapes)?;
        let label = if keep.core { CORE } else { OUTSIDE };
        let kept = any(&shapes, &centres);
        for v in (0..centres.len()).filter(|&v| kept[v]) {
            problem.labels[v] = label;
        }
    }
    let mut owned = Vec::new();
    for (body, solid) in case.non_design.iter().zip(bodies) {
        monitor.step(STAGE, &body.name, 0.5)?;
        let inside = solid.contains(&centres);
        let voxels: Vec<usize> = (0..centres.len()).filter(|&v| inside[v]).collect();
        if voxels.is_empty() {
            return Err(CaseError::BodyTooSmall {
                name: body.name.clone(),
                h: problem.h,
            });
        }
        if !touches_space(problem, &within, &voxels) {
            return Err(CaseError::BodyOutside {
                name: body.name.clone(),
                voxels: voxels.len(),
            });
        }
        owned.push(voxels);
    }
    for &v in owned.iter().flatten() {
        problem.labels[v] = FROZEN;
    }
    Ok(owned)
}

/// Supports and load cases on the nodes of a problem that is finer than its project file says: its voxels were cut. The
/// selections reach as far as on the voxels of the project file.
///
/// # Errors
/// As [`build`].
pub(crate) fn conditions_on(
    case: &Case,
    problem: &Problem,
    folder: &Path,
    monitor: &Monitor,
) -> Result<Conditions, CaseError> {
    let centres: Vec<Vec3> = (0..problem.labels.len())
        .map(|v| problem.centre(v))
        .collect();
    let bodies: Vec<Vec<usize>> = in_bodies(case, folder, &centres, monitor)?
        .iter()
        .map(|inside| (0..centres.len()).filter(|&v| inside[v]).collect())
        .collect();
    drop(centres);
    let mut nodes = nodes(case, problem, folder, &bodies);
    nodes.slack = case.grid.h;
    conditions(&nodes, problem, &mut Vec::new(), monitor)
}

/// For every non-design body which points lie in it.
pub(crate) fn in_bodies(
    case: &Case,
    folder: &Path,
    points: &[Vec3],
    monitor: &Monitor,
) -> Result<Vec<Vec<bool>>, CaseError> {
    let bodies = load_bodies(case, folder, monitor)?;
    Ok(bodies.iter().map(|body| body.contains(points)).collect())
}

/// Whether voxels lie in the space or share a face with it.
fn touches_space(problem: &Problem, within: &[bool], voxels: &[usize]) -> bool {
    let [nx, ny, nz] = problem.dims;
    voxels.iter().any(|&v| {
        let at = problem.at(v);
        let sides = [(1, nx), (nx, ny), (nx * ny, nz)];
        within[v]
            || (0..3).any(|d| {
                let (stride, n) = sides[d];
                at[d] > 0 && within[v - stride] || at[d] + 1 < n && within[v + stride]
            })
    })
}

/// Places of all nodes, and what they touch.
fn nodes<'a>(
    case: &'a Case,
    problem: &'a Problem,
    folder: &'a Path,
    bodies: &[Vec<usize>],
) -> Nodes<'a> {
    let counts = problem.dims.map(|n| n + 1);
    let total = counts.iter().product();
    let touch = |voxels: &mut dyn Iterator<Item = usize>| {
        let mut out = vec![false; total];
        for v in voxels {
            let [x, y, z] = problem.at(v);
            for c in 0..8 {
                let (x, y, z) = (x + (c & 1), y + (c >> 1 & 1), z + (c >> 2));
                out[(z * counts[1] + y) * counts[0] + x] = true;
            }
        }
        out
    };
    let all = 0..problem.labels.len();
    Nodes {
        case,
        folder,
        places: (0..total)
            .map(|i| problem.node(problem.at_node(i)))
            .collect(),
        slack: problem.h,
        active: touch(&mut all.clone().filter(|&v| problem.is_active(v))),
        frozen: touch(&mut all.filter(|&v| problem.labels[v] == FROZEN)),
        bodies: bodies
            .iter()
            .map(|b| touch(&mut b.iter().copied()))
            .collect(),
    }
}

/// Supports and load cases on nodes.
#[derive(Debug, Default)]
pub(crate) struct Conditions {
    /// Node and component, ascending.
    pub fixed: Vec<([usize; 3], usize)>,
    /// Nodes that springs hold, N/mm.
    pub springs: Vec<([usize; 3], Matrix3<f64>)>,
    pub cases: Vec<LoadCase>,
}

fn conditions(
    nodes: &Nodes,
    problem: &Problem,
    infos: &mut Vec<SelectionInfo>,
    monitor: &Monitor,
) -> Result<Conditions, CaseError> {
    let (mut fixed, mut springs) = (Vec::new(), Vec::new());
    for support in &nodes.case.support {
        let found = resolve(nodes, &support.on, "support", infos, monitor)?;
        for axis in support.fixed() {
            fixed.extend(found.iter().map(|&i| (problem.at_node(i), axis)));
        }
        let count = found.len() as f64;
        if let Some(stiffness) = support.stiffness(count * problem.young * problem.h) {
            let share = stiffness / count;
            springs.extend(found.iter().map(|&i| (problem.at_node(i), share)));
        }
    }
    fixed.sort_unstable();
    fixed.dedup();
    let mut cases = Vec::new();
    for table in &nodes.case.case {
        let mut forces = Vec::new();
        for load in &table.loads {
            let found = resolve(nodes, &load.on, "load", infos, monitor)?;
            let spread = spread(nodes, problem, &found, load)?;
            forces.extend(found.iter().map(|&i| problem.at_node(i)).zip(spread));
        }
        cases.push(LoadCase {
            name: table.name.clone(),
            weight: table.weight,
            forces,
            body_force: table.body_force(&nodes.case.material).into(),
        });
    }
    Ok(Conditions {
        fixed,
        springs,
        cases,
    })
}

/// The nodes of a selection that touch material; those of non-design bodies where there are any.
fn resolve(
    nodes: &Nodes,
    name: &str,
    what: &'static str,
    infos: &mut Vec<SelectionInfo>,
    monitor: &Monitor,
) -> Result<Vec<usize>, CaseError> {
    let selected = nodes.select(nodes.case.find(name, what)?, monitor)?;
    let all: Vec<usize> = (0..selected.len()).filter(|&i| selected[i]).collect();
    if all.is_empty() {
        return Err(CaseError::EmptySelection {
            name: name.to_owned(),
        });
    }
    let of = |flags: &[bool]| -> Vec<usize> { all.iter().copied().filter(|&i| flags[i]).collect() };
    let frozen = of(&nodes.frozen);
    let on_frozen = !frozen.is_empty();
    let found = if on_frozen { frozen } else { of(&nodes.active) };
    if found.is_empty() {
        return Err(CaseError::OnVoid {
            what,
            name: name.to_owned(),
            nodes: all.len(),
            place: mean(nodes, &all).into(),
        });
    }
    if !on_frozen && nodes.frozen.iter().any(|&f| f) {
        let text = format!(
            "the {what} on {name:?} touches no non-design body: it holds on to voxels that may become empty"
        );
        monitor.warn(STAGE, text);
    }
    if !infos.iter().any(|info| info.name == name) {
        let corner = |pick: fn(f64, f64) -> f64| {
            let first = nodes.places[found[0]];
            found
                .iter()
                .fold(first, |m, &i| m.zip_map(&nodes.places[i], pick))
                .into()
        };
        infos.push(SelectionInfo {
            name: name.to_owned(),
            nodes: found.len(),
            centre: mean(nodes, &found).into(),
            low: corner(f64::min),
            high: corner(f64::max),
            on_frozen,
        });
    }
    Ok(found)
}

fn mean(nodes: &Nodes, of: &[usize]) -> Vec3 {
    of.iter().map(|&i| nodes.places[i]).sum::<Vec3>() / of.len() as f64
}

/// The force on every node of a load.
fn spread(
    nodes: &Nodes,
    problem: &Problem,
    found: &[usize],
    load: &Load,
) -> Result<Vec<[f64; 3]>, CaseError> {
    let areas = if load.pressure.is_some() || load.bearing.is_some() {
        exposed(problem, found)
    } else {
        vec![Vec3::zeros(); found.len()]
    };
    let places: Vec<LoadPlace> = found
        .iter()
        .zip(areas)
        .map(|(&i, area)| LoadPlace {
            place: nodes.places[i],
            weight: 1.0,
            area,
        })
        .collect();
    let forces = forces_on(&places, load)?;
    Ok(forces.into_iter().map(Into::into).collect())
}

/// Takes out the pieces that no support holds; refuses those that can move or carry a load.
fn hold(problem: &mut Problem, monitor: &Monitor) -> Result<(), CaseError> {
    let active: Vec<bool> = (0..problem.labels.len())
        .map(|v| problem.is_active(v))
        .collect();
    let (labels, pieces) = components(problem.dims, &active);
    let of_node = |node: &[usize; 3]| -> Vec<u32> {
        let mut out = Vec::new();
        for c in 0..8 {
            let below = |d: usize| {
                let i = node[d].checked_sub(c >> d & 1)?;
                (i < problem.dims[d]).then_some(i)
            };
            if let (Some(x), Some(y), Some(z)) = (below(0), below(1), below(2)) {
                let label = labels[problem.index([x, y, z])];
                if label != u32::MAX && !out.contains(&label) {
                    out.push(label);
                }
            }
        }
        out
    };
    let mut fixed = vec![Vec::new(); pieces.len()];
    let mut springs = vec![Vec::new(); pieces.len()];
    for dof in &problem.fixed {
        of_node(&dof.0)
            .into_iter()
            .for_each(|p| fixed[p as usize].push(*dof));
    }
    for spring in &problem.springs {
        of_node(&spring.0)
            .into_iter()
            .for_each(|p| springs[p as usize].push(*spring));
    }
    let is_held = |p: usize| !fixed[p].is_empty() || !springs[p].is_empty();
    for case in &problem.cases {
        for (node, _) in &case.forces {
            let held = of_node(node).into_iter().any(|p| is_held(p as usize));
            if held || problem.fixed.is_empty() && problem.springs.is_empty() {
                continue;
            }
            return Err(CaseError::LooseLoad {
                name: case.name.clone(),
                voxels: of_node(node)
                    .first()
                    .map_or(0, |&p| pieces[p as usize].size),
                place: problem.node(*node).into(),
            });
        }
    }
    let mut loose = 0;
    for (p, piece) in pieces.iter().enumerate() {
        if !is_held(p) && pieces.len() > 1 {
            loose += piece.size;
            continue;
        }
        let modes = free_modes(&fixed[p], &springs[p]);
        if !modes.is_empty() {
            return Err(CaseError::Mechanism { modes });
        }
    }
    if loose > 0 {
        for (v, &label) in labels.iter().enumerate() {
            if label != u32::MAX && !is_held(label as usize) {
                problem.labels[v] = OUTSIDE;
            }
        }
        monitor.warn(
            STAGE,
            format!("{loose} voxels of the space hang together with no support and are left out"),
        );
    }
    Ok(())
}
