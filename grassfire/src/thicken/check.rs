//! Clean-up and the checks that every thickened body must pass.

use super::complex::{Complex, root};
use super::regions::{Draft, NONE};
use super::{BodyTopology, RuleCounts, ThickenError, ThickenedBody};
use crate::Vec3;
use crate::spline::ControlMesh;
use crate::spline::catmull_clark::{CatmullClarkError, QuadTopology};
use crate::spline::half_edges::{BadEdge, bad_edges};

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
    let topology = check_surface(&body)?;
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

/// Connectivity of a surface that is closed, manifold and oriented.
pub(super) fn connect(body: &ThickenedBody) -> Result<QuadTopology, ThickenError> {
    QuadTopology::new(body.mesh.points.len(), &body.mesh.quads).map_err(|error| match error {
        CatmullClarkError::BadEdge { .. } => name_bad_edges(body),
        CatmullClarkError::Pinched { point } => {
            bad_vertex(body, point, "its quads form more than one fan")
        }
        CatmullClarkError::BadQuad { quad } => bad_vertex(
            body,
            body.mesh.quads[quad as usize][0],
            "a quad there uses a point twice",
        ),
        CatmullClarkError::TooLarge { count, .. } => ThickenError::BadCount {
            points: count,
            radii: body.source.len(),
        },
    })
}

fn check_surface(body: &ThickenedBody) -> Result<QuadTopology, ThickenError> {
    let topology = connect(body)?;
    match topology.valence.iter().position(|&n| n < 3) {
        Some(p) => Err(bad_vertex(
            body,
            p as u32,
            "fewer than three quads meet there",
        )),
        None => Ok(topology),
    }
}

fn bad_vertex(body: &ThickenedBody, p: u32, what: &'static str) -> ThickenError {
    ThickenError::BadVertex {
        point: body.source[p as usize],
        place: body.mesh.points[p as usize],
        what,
    }
}

/// The error for the edges that are not used once in each sense.
fn name_bad_edges(body: &ThickenedBody) -> ThickenError {
    let bad = bad_edges(&body.mesh.quads);
    let Some(&BadEdge {
        edge: [a, b],
        along,
        against,
        ..
    }) = bad.first()
    else {
        return ThickenError::Empty;
    };
    let points = &body.mesh.points;
    ThickenError::NotManifold {
        points: [a, b].map(|p| body.source[p as usize]),
        place: (points[a as usize] + points[b as usize]) / 2.0,
        along,
        against,
        count: bad.len(),
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
pub(super) fn quad_volume(body: &ThickenedBody, q: usize, base: &Vec3) -> f64 {
    let [a, b, c, d] = body.mesh.quads[q].map(|p| body.mesh.points[p as usize] - base);
    (a.dot(&b.cross(&c)) + a.dot(&c.cross(&d))) / 6.0
}
