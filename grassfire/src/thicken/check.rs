//! Clean-up and the checks that every thickened body must pass.

use super::complex::{Complex, root};
use super::regions::{Draft, NONE};
use super::{BodyTopology, RuleCounts, ThickenError, ThickenedBody};
use crate::Vec3;
use crate::spline::ControlMesh;
use crate::spline::catmull_clark::{CatmullClarkError, QuadTopology};

/// Step 7 of [`super::thicken`], packing and checks.
pub(super) fn finish(
    complex: &Complex,
    draft: Draft,
    mut rules: RuleCounts,
) -> Result<ThickenedBody, ThickenError> {
    let Draft {
        points,
        vertex,
        quads,
        ..
    } = draft;
    let mut quads: Vec<[u32; 4]> = quads.into_iter().flatten().collect();
    rules.doublets = merge_doublets(points.len(), &mut quads);
    // Pack: points in use keep their order.
    let mut number = vec![NONE; points.len()];
    quads.iter().flatten().for_each(|&v| number[v as usize] = 0);
    let used: Vec<usize> = (0..points.len()).filter(|&v| number[v] == 0).collect();
    for (i, &v) in used.iter().enumerate() {
        number[v] = i as u32;
    }
    quads
        .iter_mut()
        .flatten()
        .for_each(|v| *v = number[*v as usize]);
    let vertex: Vec<u32> = used.iter().map(|&v| vertex[v]).collect();
    let mut body = ThickenedBody {
        mesh: ControlMesh {
            points: used.iter().map(|&v| points[v]).collect(),
            quads,
        },
        source: vertex.iter().map(|&v| complex.source[v as usize]).collect(),
        foot: vertex.iter().map(|&v| complex.at(v)).collect(),
        bodies: Vec::new(),
        rules,
    };
    let topology = check_surface(&body, &vertex, complex)?;
    body.bodies = check_bodies(complex, &body, &vertex, &topology)?;
    Ok(body)
}

/// Merges the two quads around every valence-2 point; returns how many.
fn merge_doublets(point_count: usize, quads: &mut Vec<[u32; 4]>) -> u32 {
    let mut at: Vec<Vec<u32>> = vec![Vec::new(); point_count];
    for (q, quad) in quads.iter().enumerate() {
        quad.iter().for_each(|&v| at[v as usize].push(q as u32));
    }
    let mut alive = vec![true; quads.len()];
    let mut stack: Vec<u32> = (0..point_count as u32)
        .rev()
        .filter(|&v| at[v as usize].len() == 2)
        .collect();
    let mut merged = 0;
    while let Some(v) = stack.pop() {
        let [a, b] = at[v as usize][..] else { continue };
        let (qa, qb) = (quads[a as usize], quads[b as usize]);
        let place = |q: &[u32; 4]| q.iter().position(|&w| w == v).unwrap_or(0);
        let (ka, kb) = (place(&qa), place(&qb));
        let (far_a, far_b) = (qa[(ka + 2) % 4], qb[(kb + 2) % 4]);
        if far_a == far_b || qa.contains(&far_b) {
            continue;
        }
        quads[a as usize][ka] = far_b;
        alive[b as usize] = false;
        for w in qb {
            at[w as usize].retain(|&q| q != b);
        }
        at[v as usize].clear();
        at[far_b as usize].push(a);
        stack.extend(qb.iter().filter(|&&w| at[w as usize].len() == 2));
        merged += 1;
    }
    let mut keep = alive.iter();
    quads.retain(|_| *keep.next().unwrap_or(&true));
    merged
}

fn check_surface(
    body: &ThickenedBody,
    vertex: &[u32],
    complex: &Complex,
) -> Result<QuadTopology, ThickenError> {
    let place = |p: u32| {
        (
            complex.source[vertex[p as usize] as usize],
            body.mesh.points[p as usize],
        )
    };
    let bad = |p: u32, what| {
        let (point, place) = place(p);
        ThickenError::BadVertex { point, place, what }
    };
    let topology = match QuadTopology::new(body.mesh.points.len(), &body.mesh.quads) {
        Ok(topology) => topology,
        Err(CatmullClarkError::BadEdge { edge }) => return Err(bad_edges(body, edge)),
        Err(CatmullClarkError::Pinched { point }) => {
            return Err(bad(point, "its quads form more than one fan"));
        }
        Err(CatmullClarkError::BadQuad { quad }) => {
            return Err(bad(
                body.mesh.quads[quad as usize][0],
                "a quad there uses a point twice",
            ));
        }
        Err(CatmullClarkError::TooLarge { count, .. }) => {
            return Err(ThickenError::BadCount {
                points: count,
                radii: complex.radii.len(),
            });
        }
    };
    match topology.valence.iter().position(|&n| n < 3) {
        Some(p) => Err(bad(p as u32, "fewer than three quads meet there")),
        None => Ok(topology),
    }
}

/// Counts the edges that are not used once in each sense; `first` is one of them.
fn bad_edges(body: &ThickenedBody, first: [u32; 2]) -> ThickenError {
    let mut uses: Vec<([u32; 2], bool)> = Vec::with_capacity(4 * body.mesh.quads.len());
    for quad in &body.mesh.quads {
        for k in 0..4 {
            let (a, b) = (quad[k], quad[(k + 1) % 4]);
            uses.push(([a.min(b), a.max(b)], a > b));
        }
    }
    uses.sort_unstable();
    let count_of =
        |e: &[([u32; 2], bool)], sense: bool| e.iter().filter(|u| u.1 == sense).count() as u32;
    let wrong = |e: &&[([u32; 2], bool)]| count_of(e, false) != 1 || count_of(e, true) != 1;
    let count = uses.chunk_by(|a, b| a.0 == b.0).filter(wrong).count();
    let here: Vec<([u32; 2], bool)> = uses.iter().filter(|u| u.0 == first).copied().collect();
    ThickenError::NotManifold {
        points: first.map(|p| body.source[p as usize]),
        place: first
            .iter()
            .map(|&p| body.mesh.points[p as usize])
            .sum::<Vec3>()
            / 2.0,
        along: count_of(&here, false),
        against: count_of(&here, true),
        count,
    }
}

/// Components of the complex by vertex: index of the component, `NONE` for unused vertices.
fn components(complex: &Complex) -> (Vec<u32>, Vec<u32>) {
    let n = complex.points.len();
    let mut parent: Vec<usize> = (0..n).collect();
    let mut used = vec![false; n];
    let links = complex
        .edges
        .iter()
        .map(|e| e.ends)
        .chain(complex.beams.iter().copied());
    for [a, b] in links {
        used[a as usize] = true;
        used[b as usize] = true;
        let (a, b) = (root(&mut parent, a as usize), root(&mut parent, b as usize));
        parent[a.max(b)] = a.min(b);
    }
    let mut component = vec![NONE; n];
    let mut first = Vec::new();
    for v in (0..n).filter(|&v| used[v]) {
        let r = root(&mut parent, v);
        if r == v {
            component[v] = first.len() as u32;
            first.push(v as u32);
        } else {
            component[v] = component[r];
        }
    }
    (component, first)
}

fn check_bodies(
    complex: &Complex,
    body: &ThickenedBody,
    vertex: &[u32],
    topology: &QuadTopology,
) -> Result<Vec<BodyTopology>, ThickenError> {
    let (component, first) = components(complex);
    let mut bodies = vec![BodyTopology::default(); first.len()];
    for v in component.iter().filter(|c| **c != NONE) {
        bodies[*v as usize].skeleton_chi += 1;
    }
    for ends in complex
        .edges
        .iter()
        .map(|e| e.ends)
        .chain(complex.beams.iter().copied())
    {
        bodies[component[ends[0] as usize] as usize].skeleton_chi -= 1;
    }
    for quad in &complex.quads {
        bodies[component[quad[0] as usize] as usize].skeleton_chi += 1;
    }
    let of_point = |p: u32| component[vertex[p as usize] as usize] as usize;
    let mut shell: Vec<usize> = (0..body.mesh.points.len()).collect();
    for p in 0..body.mesh.points.len() as u32 {
        bodies[of_point(p)].chi += 1;
    }
    for (q, quad) in topology.quads.iter().enumerate() {
        let here = &mut bodies[of_point(quad[0])];
        here.chi -= 1;
        here.quads += 1;
        here.volume += quad_volume(body, q, &complex.at(first[of_point(quad[0])]));
        for &p in quad {
            let (a, b) = (
                root(&mut shell, quad[0] as usize),
                root(&mut shell, p as usize),
            );
            shell[a.max(b)] = a.min(b);
        }
    }
    for p in 0..shell.len() {
        if shell[p] == p {
            bodies[of_point(p as u32)].shells += 1;
        }
    }
    for (i, b) in bodies.iter().enumerate() {
        let place = complex.at(first[i]);
        if b.chi != 2 * b.skeleton_chi {
            return Err(ThickenError::BadTopology {
                body: i as u32,
                place,
                chi: b.chi,
                wanted: 2 * b.skeleton_chi,
            });
        }
        if b.volume.is_nan() || b.volume <= 0.0 {
            return Err(ThickenError::NotPositive {
                body: i as u32,
                place,
                volume: b.volume,
            });
        }
    }
    Ok(bodies)
}

/// Signed volume between `base` and quad `q`, split along its first diagonal.
fn quad_volume(body: &ThickenedBody, q: usize, base: &Vec3) -> f64 {
    let [a, b, c, d] = body.mesh.quads[q].map(|p| body.mesh.points[p as usize] - base);
    (a.dot(&b.cross(&c)) + a.dot(&c.cross(&d))) / 6.0
}
