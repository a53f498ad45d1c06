//! From the medial mesh to the quad skeleton: the order of the phases, and the topology check after each.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::anneal::{Annealing, anneal};
use super::arcs;
use super::bends::{bend_beams, lengthen_balls};
use super::check::{check, check_cells, check_points};
use super::coarsen::{Sizing, coarsen};
use super::complex::Complex;
use super::edges::edge;
use super::layout::Layout;
use super::members::burn_members;
use super::nodes::merge_nodes;
use super::pairing::{make_even, pair, split_all, split_rims};
use super::polygons::Polygon;
use super::quad_mesh::QuadMesh;
use super::reduce::{SpurLimits, collapse_short, prune_spurs};
use super::reference::Reference;
use super::shape_cost::settle;
use super::split_chords::split_chords;
use super::square::square_up;
use super::tidy::Tidy;
use super::walk::walk_triangles;
use super::{QuadSkeleton, Skeleton, SkeletonError, stats, topology};
use crate::Vec3;
use crate::medial::MedialMesh;
use crate::monitor::Monitor;
use crate::topology::Betti;

const STAGE: &str = "skeleton";

/// Smoothing rounds after rows of quads were split.
const SETTLE_ROUNDS: usize = 5;

/// A dangling beam is slight when it has less material outside of its root's sphere than this many such spheres: on real parts
/// remnants beside bodies that were cut out have up to 2.5, members at least 4.
const SLIGHT: f64 = 3.0;

/// How the skeleton is meshed. Lengths without a unit are multiples of the local radius (half the thickness).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SkeletonOptions {
    /// Edge length of the quads, mm, everywhere; without it the quads follow the thickness.
    pub quad_size: Option<f64>,
    /// Edge length over the local radius.
    pub size_factor: f64,
    /// Shortest edge length over the part's median radius.
    pub size_least: f64,
    /// Longest edge length over the part's median radius.
    pub size_most: f64,
    /// How the quads are laid out.
    pub layout: Layout,
    /// Rows of quads are split in the end so that quads are this many times as short; no irregular vertex comes with them. 1
    /// leaves the quads as laid out. Default: 1.43 for the regular layout, else 1.
    pub split: Option<f64>,
    /// Sheets narrower than this many radii become beams; 0 keeps them.
    pub member_width: f64,
    /// Sheets smaller than the square of this many radii become beams; 0 keeps them.
    pub member_size: f64,
    /// Dangling beams that stick out of their root's sphere by less than this many radii go.
    pub spur: f64,
    /// So do those, once narrow sheets are beams, that have little material and stick out by less than this many radii: what tapers
    /// off beside a non-design body. 0 keeps them.
    pub slight_spur: f64,
    /// Beams between nodes that are shorter than this multiple of the nodes' mean radius are contracted: such nodes are one. 0
    /// keeps them.
    pub node_distance: f64,
    /// Smoothing rounds along rims, seams and beams.
    pub smoothing: usize,
    /// Searches for quads with few irregular vertices; the best one counts, 0 leaves the quads as matched.
    pub searches: usize,
    /// Seed of the searches.
    pub seed: u64,
}

impl Default for SkeletonOptions {
    fn default() -> Self {
        Self {
            quad_size: None,
            size_factor: 1.8,
            size_least: 2.0,
            size_most: 5.6,
            layout: Layout::Auto,
            split: None,
            member_width: 1.2,
            member_size: 4.0,
            spur: 0.6,
            slight_spur: 0.0,
            node_distance: 0.0,
            smoothing: 80,
            searches: 4,
            seed: 1,
        }
    }
}

impl SkeletonOptions {
    fn splits(&self) -> f64 {
        self.split.unwrap_or(self.layout.split())
    }

    fn check(&self, spacing: f64) -> Result<(), SkeletonError> {
        let inside = |good: bool, name, value: f64, range| {
            if good && value.is_finite() {
                Ok(())
            } else {
                Err(SkeletonError::Option { name, value, range })
            }
        };
        let positive = |name, value: f64| inside(value > 0.0, name, value, "above 0");
        let not_negative = |name, value: f64| inside(value >= 0.0, name, value, "0 or more");
        positive("spacing", spacing)?;
        positive("skeleton.quad_size", self.quad_size.unwrap_or(1.0))?;
        positive("skeleton.size_factor", self.size_factor)?;
        positive("skeleton.size_least", self.size_least)?;
        positive("skeleton.size_most", self.size_most)?;
        inside(
            (1.0..=8.0).contains(&self.splits()),
            "skeleton.split",
            self.splits(),
            "1 to 8",
        )?;
        not_negative("skeleton.member_width", self.member_width)?;
        not_negative("skeleton.member_size", self.member_size)?;
        not_negative("skeleton.spur", self.spur)?;
        not_negative("skeleton.slight_spur", self.slight_spur)?;
        not_negative("skeleton.node_distance", self.node_distance)?;
        inside(
            self.searches <= 1000,
            "skeleton.searches",
            self.searches as f64,
            "0 to 1000",
        )?;
        inside(
            self.smoothing <= 1000,
            "skeleton.smoothing",
            self.smoothing as f64,
            "0 to 1000",
        )
    }
}

/// Meshes the pruned medial axis with quads and beams. `spacing` is the voxel size in mm.
///
/// 1. Clean the fine complex: collapse lattice edges, prune spurs by protrusion, smooth rims, seams and beams (Taubin).
/// 2. Burn narrow and tiny sheets to beams by elementary collapses from their rims.
/// 3. Coarsen to edges of about the local thickness, every vertex kept on the smoothed fine rim, seam, beam or sheet.
/// 4. Make every sheet even, pair its triangles by maximum-weight matching, never across a seam; leftovers get a rim
///    vertex or meet by a triangle walk; doublets, bad diagonals and edges are cleaned up.
/// 5. Anneal the quads toward few irregular vertices of the thickened body, rims and seams kept; square them up.
/// 6. In the regular layout, or when asked, split every chord (row of quads, over all sheets of a seam) into strips: all new vertices are regular.
///
/// The Betti numbers of `medial` are asserted after each phase. A point of `medial` that nothing uses counts as a
/// component of its own (a ball). All faces are quads in every case; when a sheet resists, all faces are split in the
/// middle and the monitor is warned. Time is near-linear in the medial mesh: 75k triangles take seconds.
///
/// # Errors
/// [`SkeletonError`] for broken input or options, a changed topology, or cancellation.
pub fn quad_skeleton(
    medial: &MedialMesh,
    spacing: f64,
    options: &SkeletonOptions,
    monitor: &Monitor,
) -> Result<QuadSkeleton, SkeletonError> {
    options.check(spacing)?;
    let mut c = complex_of(medial)?;
    let expected = c.betti();
    let verify = |phase: &'static str, after: Betti| {
        if after == expected {
            Ok(())
        } else {
            Err(SkeletonError::Topology {
                phase,
                before: expected,
                after,
            })
        }
    };
    let median = median_radius(&c);
    // Sizes follow the thickness; the voxel is only a lower bound.
    let unit = spacing.max(0.4 * median);

    monitor.step(STAGE, "cleaning", 0.0)?;
    clean(&mut c, unit, options, monitor)?;
    verify("cleaning", c.betti())?;
    if options.member_width > 0.0 || options.member_size > 0.0 {
        monitor.step(STAGE, "members", 0.3)?;
        burn_members(&mut c, unit, options, monitor)?;
        verify("burning members", c.betti())?;
        // Burning leaves a branch for every corner of the sheet: those are not members.
        let limits = SpurLimits {
            absolute: 3.0 * unit,
            relative: (2.0 * options.spur).max(1.2 + options.member_width),
            relative_slight: options.slight_spur,
            balls: SLIGHT,
        };
        prune_spurs(&mut c, &limits);
        c.compact();
        collapse_short(&mut c, 0.6 * unit, unit, 2, monitor)?;
        let traced = arcs::trace(&c);
        arcs::smooth(&mut c, &traced, options.smoothing, 6);
        verify("pruning", c.betti())?;
    }

    let traced = arcs::trace(&c);
    let table = c.edge_table();
    c.label_sheets(&table);
    // The plain layout stays as it was: it is what parts fall back to, and on bulky ones the nearest arc does better.
    let own_arcs = options.layout == Layout::Regular;
    let reference = Reference::new(&c, &traced, 0.2 * unit, own_arcs);
    let sizing = sizing(options, median, spacing);
    coarsen(&mut c, &reference, &sizing, unit, monitor)?;
    merge_nodes(&mut c, options.node_distance);
    bend_beams(&mut c, &reference, unit);
    lengthen_balls(&mut c);
    verify("coarsening", c.betti())?;

    monitor.step(STAGE, "quads", 0.8)?;
    let (skeleton, whole) = quads(c, &reference, &sizing, options, monitor)?;
    if !whole {
        monitor.warn(
            STAGE,
            format!(
                "a sheet could not be paired into quads: all faces were split ({} quads)",
                skeleton.quads.len()
            ),
        );
    }
    verify("meshing with quads", topology(&skeleton))?;
    check(&skeleton)?;
    Ok(QuadSkeleton {
        topology: expected,
        stats: stats(&skeleton),
        skeleton,
    })
}

fn complex_of(medial: &MedialMesh) -> Result<Complex, SkeletonError> {
    let n = medial.points.len();
    check_points(&medial.points, &medial.radii, false)?;
    check_cells("triangle", &medial.triangles, n)?;
    check_cells("edge", &medial.edges, n)?;
    let mut keys: Vec<([u32; 3], u32)> = medial
        .triangles
        .iter()
        .enumerate()
        .map(|(i, t)| {
            let mut key = *t;
            key.sort_unstable();
            (key, i as u32)
        })
        .collect();
    keys.sort_unstable();
    keys.dedup_by_key(|k| k.0);
    keys.sort_unstable_by_key(|k| k.1);
    let triangles: Vec<[u32; 3]> = keys
        .iter()
        .map(|k| medial.triangles[k.1 as usize])
        .collect();
    let mut c = Complex::new(medial.points.clone(), medial.radii.clone(), &triangles, &[]);
    let mut beams: Vec<[u32; 2]> = medial.edges.iter().map(|e| edge(e[0], e[1])).collect();
    beams.sort_unstable();
    beams.dedup();
    for [a, b] in beams {
        // Some files list the edges of the triangles too.
        if c.face_count(a, b) == 0 {
            c.add_beam([a, b]);
        }
    }
    for v in 0..n as u32 {
        if !c.used(v) {
            let r = c.radii[v as usize];
            let tip = c.add_point(c.points[v as usize] + Vec3::new(0.5 * r, 0.0, 0.0), r);
            c.add_beam([v, tip]);
        }
    }
    c.compact();
    if c.points.is_empty() {
        return Err(SkeletonError::Empty("the medial axis"));
    }
    Ok(c)
}

fn median_radius(c: &Complex) -> f64 {
    let mut radii = c.radii.clone();
    radii.sort_by(f64::total_cmp);
    radii[radii.len() / 2]
}

fn sizing(options: &SkeletonOptions, median: f64, spacing: f64) -> Sizing {
    if let Some(size) = options.quad_size {
        return Sizing {
            factor: 0.0,
            least: size,
            most: size,
        };
    }
    let least = (options.size_least * median).max(2.0 * spacing);
    Sizing {
        factor: options.size_factor,
        least,
        most: (options.size_most * median).max(least),
    }
}

fn clean(
    c: &mut Complex,
    unit: f64,
    options: &SkeletonOptions,
    monitor: &Monitor,
) -> Result<(), SkeletonError> {
    for (length, rounds) in [(0.9, 4), (0.6, 2)] {
        collapse_short(c, length * unit, unit, rounds, monitor)?;
        let limits = SpurLimits {
            absolute: 2.5 * unit,
            relative: options.spur,
            ..SpurLimits::default()
        };
        prune_spurs(c, &limits);
        c.compact();
        let traced = arcs::trace(c);
        monitor.check()?;
        arcs::smooth(c, &traced, options.smoothing, 6);
    }
    Ok(())
}

/// Turns the coarse triangulation into quads; false when the last resort (splitting all faces) was needed.
fn quads(
    mut c: Complex,
    reference: &Reference,
    sizing: &Sizing,
    options: &SkeletonOptions,
    monitor: &Monitor,
) -> Result<(Skeleton, bool), SkeletonError> {
    make_even(&mut c, reference, |c, a, b| sizing.edge(c, a, b));
    let table = c.edge_table();
    c.label_sheets(&table);
    let mut polygons = pair(&c, monitor)?;
    let mut beams: Vec<[u32; 2]> = c.alive_beams().collect();
    let (mut points, mut radii) = (c.points, c.radii);
    split_rims(&mut polygons, &mut points, &mut radii, reference);
    let left = walk_triangles(&mut polygons, &beams, &points, monitor)?;
    let mut whole = left == 0;
    if whole {
        let mut tidy = Tidy {
            points: &mut points,
            radii: &mut radii,
            quads: polygons,
            beams,
            reference,
        };
        tidy.run(monitor)?;
        (polygons, beams) = (tidy.quads, tidy.beams);
        let annealing = Annealing {
            reference,
            sizing,
            effort: options.layout.effort(),
            searches: options.searches,
            seed: options.seed,
        };
        let m = QuadMesh::new(&points, &radii, &polygons, &beams);
        if let Some(better) = anneal(&m, &annealing, monitor)? {
            polygons = better.polygons();
            (points, radii) = (better.points, better.radii);
        }
        square_up(&mut points, &mut radii, &polygons, &beams, reference);
        if options.splits() > 1.0 {
            let wanted = sizing.times(1.0 / options.splits());
            split_chords(&mut points, &mut radii, &mut polygons, reference, &wanted);
            let mut m = QuadMesh::new(&points, &radii, &polygons, &beams);
            settle(&mut m, reference, SETTLE_ROUNDS);
            (points, radii) = (m.points, m.radii);
            square_up(&mut points, &mut radii, &polygons, &beams, reference);
        }
        whole = !has_twins(&polygons);
    }
    if !whole {
        (polygons, beams) = split_all(&polygons, &beams, &mut points, &mut radii);
    }
    let quads = polygons
        .iter()
        .flatten()
        .filter_map(Polygon::as_quad)
        .collect();
    let mut skeleton = Skeleton {
        points,
        radii,
        quads,
        beams,
    };
    split_lone_beams(&mut skeleton);
    drop_unused(&mut skeleton);
    Ok((skeleton, whole))
}

/// Two quads over the same four points.
fn has_twins(polygons: &[Option<Polygon>]) -> bool {
    let mut keys: Vec<Vec<u32>> = polygons
        .iter()
        .flatten()
        .map(|p| {
            let mut key = p.corners().to_vec();
            key.sort_unstable();
            key
        })
        .collect();
    keys.sort_unstable();
    keys.windows(2).any(|w| w[0] == w[1])
}

/// A beam of one edge gets a middle point, so that thickening has a section between its two ends.
fn split_lone_beams(s: &mut Skeleton) {
    let mut beams = vec![0u32; s.points.len()];
    let mut on_quad = vec![false; s.points.len()];
    for &v in s.beams.iter().flatten() {
        beams[v as usize] += 1;
    }
    for &v in s.quads.iter().flatten() {
        on_quad[v as usize] = true;
    }
    let plain = |v: u32| beams[v as usize] == 2 && !on_quad[v as usize];
    let mut out = Vec::with_capacity(s.beams.len());
    for &[a, b] in &s.beams {
        if plain(a) || plain(b) {
            out.push([a, b]);
            continue;
        }
        let m = s.points.len() as u32;
        s.points
            .push((s.points[a as usize] + s.points[b as usize]) / 2.0);
        s.radii
            .push((s.radii[a as usize] + s.radii[b as usize]) / 2.0);
        out.extend([[a, m], [m, b]]);
    }
    s.beams = out;
}

fn drop_unused(s: &mut Skeleton) {
    let mut new = vec![u32::MAX; s.points.len()];
    for &v in s.quads.iter().flatten().chain(s.beams.iter().flatten()) {
        new[v as usize] = 0;
    }
    let kept: Vec<usize> = (0..new.len()).filter(|&v| new[v] == 0).collect();
    for (i, &v) in kept.iter().enumerate() {
        new[v] = i as u32;
    }
    s.points = kept.iter().map(|&v| s.points[v]).collect();
    s.radii = kept.iter().map(|&v| s.radii[v]).collect();
    s.quads
        .iter_mut()
        .flatten()
        .chain(s.beams.iter_mut().flatten())
        .for_each(|v| *v = new[*v as usize]);
}
