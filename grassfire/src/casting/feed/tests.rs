use super::constraints::least_solution;
use super::rules::Rules;
use super::*;

/// Numbers in [0, 1), the same in every run.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A sheet of `n` x `n` quads over `size` x `size` mm with random radii of 3 to 5 mm and jittered points.
fn sheet(n: u32, size: f64, dice: &mut Dice) -> Skeleton {
    let mut skeleton = Skeleton::default();
    let step = size / f64::from(n);
    for j in 0..=n {
        for i in 0..=n {
            let jitter = Vec3::new(dice.roll() - 0.5, dice.roll() - 0.5, dice.roll() - 0.5);
            let place = Vec3::new(f64::from(i), f64::from(j), 0.0) * step;
            skeleton.points.push(place + 0.3 * step * jitter);
            skeleton.radii.push(3.0 + 2.0 * dice.roll());
        }
    }
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i;
            skeleton.quads.push([a, a + 1, a + n + 2, a + n + 1]);
        }
    }
    skeleton
}

fn at(place: Vec3) -> FeedOptions {
    FeedOptions {
        feeders: vec![place.into()],
        ..FeedOptions::default()
    }
}

fn run(skeleton: &Skeleton, options: &FeedOptions) -> Result<Fed, FeedError> {
    feed(skeleton, &[], options, &Monitor::default())
}

/// The same system as a linear program, solved by the simplex method of another author.
fn by_lp(rules: &Rules, weights: &[f64]) -> Vec<f64> {
    let mut problem = microlp::Problem::new(microlp::OptimizationDirection::Minimize);
    let each = rules.base.iter().zip(&rules.least).zip(weights);
    let variables: Vec<_> = each
        .map(|((base, least), w)| problem.add_var(*w, (base.max(*least), f64::INFINITY)))
        .collect();
    for arc in &rules.arcs {
        let terms = [
            (variables[arc.to as usize], 1.0),
            (variables[arc.from as usize], -1.0),
        ];
        problem.add_constraint(terms, microlp::ComparisonOp::Ge, arc.gain);
    }
    let Ok(microlp::SolveOutcome::Solution(solution)) = problem.solve() else {
        panic!("it has a solution");
    };
    variables.iter().map(|v| solution[*v]).collect()
}

#[test]
fn least_radii_are_those_of_a_linear_program() {
    let mut dice = Dice(1);
    let mut worst = 0.0_f64;
    for case in 0..100 {
        let n = 3 + case % 4;
        let skeleton = sheet(n, 20.0 * f64::from(n), &mut dice);
        let corner = (dice.roll() * skeleton.points.len() as f64) as usize;
        let options = FeedOptions {
            cone: [0.0, 30.0, 45.0, 60.0, 90.0][case as usize % 5],
            growth: 0.1 * dice.roll(),
            measure: if case % 3 == 0 {
                Measure::Modulus
            } else {
                Measure::Radius
            },
            min_wall: if case % 7 == 0 { 7.0 } else { 0.0 },
            draft: if case % 11 == 0 { 1.0 } else { 0.0 },
            draw: [1.0, 0.0, 0.0],
            ..at(skeleton.points[corner])
        };
        let graph = FeedGraph::new(&skeleton, &[]);
        let seeds = seeds(&graph, &[], &options).expect("on the sheet");
        let distances = distances(&graph, &seeds);
        let rules = Rules::new(&graph, &skeleton.quads, &[], &distances, &options);
        let Ok(least) = rules.raise() else {
            assert!(options.draft > 0.0, "only draft contradicts feeding");
            continue;
        };
        let weights: Vec<f64> = least.values.iter().map(|_| 0.5 + dice.roll()).collect();
        let other = by_lp(&rules, &weights);
        for (a, b) in least.values.iter().zip(&other) {
            worst = worst.max((a - b).abs());
        }
        assert_eq!(rules.violations(&least.values), 0);
    }
    assert!(worst < 1e-9, "largest difference {worst:.2e} mm");
}

#[test]
fn sections_grow_and_nothing_shrinks() {
    let mut dice = Dice(7);
    let skeleton = sheet(16, 200.0, &mut dice);
    let fed = run(&skeleton, &at(skeleton.points[150])).expect("it feeds");
    assert!(fed.violations_before > 100 && fed.violations == 0);
    assert!(fed.radii.iter().zip(&skeleton.radii).all(|(a, b)| a >= b));
    assert!(fed.added_volume > 0.0 && fed.added_volume < fed.volume_before);
    // Fed once more, nothing changes.
    let again = Skeleton {
        radii: fed.radii.clone(),
        ..skeleton
    };
    let twice = run(&again, &at(again.points[150])).expect("it feeds");
    assert_eq!((twice.violations_before, twice.violations), (0, 0));
    assert!(
        twice
            .radii
            .iter()
            .zip(&fed.radii)
            .all(|(a, b)| (a - b).abs() < 1e-9)
    );
}

#[test]
fn added_metal_does_not_depend_on_the_quads() {
    let smooth = |n: u32| {
        let mut skeleton = sheet(n, 160.0, &mut Dice(3));
        let step = 160.0 / f64::from(n);
        for (v, (p, r)) in (0..).zip(skeleton.points.iter_mut().zip(&mut skeleton.radii)) {
            *p = Vec3::new(f64::from(v % (n + 1)), f64::from(v / (n + 1)), 0.0) * step;
            *r = 4.0 + 0.5 * (p.x / 25.0).sin() * (p.y / 30.0).cos();
        }
        let fed = run(&skeleton, &at(Vec3::new(80.0, 80.0, 4.0))).expect("it feeds");
        fed.added_volume / fed.volume_before
    };
    let (coarse, fine) = (smooth(32), smooth(64));
    assert!(
        (coarse - fine).abs() < 0.01,
        "{coarse:.4} against {fine:.4}"
    );
}

#[test]
fn equal_volume_changes_both_ways() {
    let skeleton = sheet(10, 150.0, &mut Dice(5));
    let options = FeedOptions {
        neutral: true,
        ..at(skeleton.points[60])
    };
    let fed = run(&skeleton, &options).expect("it feeds");
    assert_eq!(fed.violations, 0);
    assert!((fed.added_volume / fed.volume_before).abs() < 1e-9);
    let thinner = fed.radii.iter().zip(&skeleton.radii).filter(|(a, b)| a < b);
    assert!(thinner.count() > 10);
}

#[test]
fn bounds_that_are_too_tight_are_named_with_the_path() {
    let mut skeleton = sheet(8, 160.0, &mut Dice(2));
    skeleton.radii.fill(3.0);
    skeleton.radii[80] = 6.0;
    let options = FeedOptions {
        bounds: vec![RadiusBound {
            place: skeleton.points[60].into(),
            reach: 1.0,
            least: 0.0,
            most: Some(3.0),
        }],
        ..at(skeleton.points[40])
    };
    let fed = run(&skeleton, &options).expect("bounds do not stop it");
    let place = &fed.infeasible[0];
    assert_eq!((place.point, place.path[0]), (60, 80));
    assert!(place.wanted > 6.0 && place.most == 3.0 && fed.radii[60] == 3.0);
    assert!(fed.violations > 0);
}

#[test]
fn draft_against_feeding_is_a_contradiction_with_its_cycle() {
    // An upright rib: its root lies on the parting plane, the feeder on its top.
    let mut skeleton = sheet(4, 40.0, &mut Dice(9));
    let points = skeleton.points.iter_mut();
    points.for_each(|p| *p = Vec3::new(p.x, 0.0, 10.0 * (p.y / 10.0).round()));
    let top = skeleton.points[22];
    let options = FeedOptions {
        draft: 2.0,
        growth: 0.05,
        ..at(top)
    };
    let Err(FeedError::Contradiction { places, gain }) = run(&skeleton, &options) else {
        panic!("the rules contradict each other");
    };
    assert!(places.len() >= 2 && gain > 0.0);
    let below = FeedOptions {
        feeders: vec![skeleton.points[2].into()],
        ..options
    };
    assert_eq!(run(&skeleton, &below).map(|fed| fed.violations), Ok(0));
}

#[test]
fn a_direction_names_places_that_need_a_feeder() {
    let mut skeleton = sheet(6, 60.0, &mut Dice(4));
    for p in &mut skeleton.points {
        // A saddle of two hills along x.
        p.z = 10.0 * (p.x / 60.0 * 2.0 * std::f64::consts::PI).cos();
    }
    let options = FeedOptions {
        mode: FeedMode::Direction,
        ..FeedOptions::default()
    };
    let fed = run(&skeleton, &options).expect("a direction needs no feeder");
    assert_eq!(fed.violations, 0);
    assert!(fed.sinks.iter().any(|p| p.x < 15.0) && fed.sinks.iter().any(|p| p.x > 45.0));
}

#[test]
fn misplaced_feeders_and_separate_pieces_are_refused() {
    let mut dice = Dice(6);
    let mut skeleton = sheet(4, 80.0, &mut dice);
    let far = run(&skeleton, &at(Vec3::new(40.0, 40.0, 50.0)));
    assert!(matches!(far, Err(FeedError::Outside { feeder: 0, .. })));
    assert!(matches!(
        run(&skeleton, &FeedOptions::default()),
        Err(FeedError::NoFeeder)
    ));
    let steep = FeedOptions {
        growth: 0.5,
        ..at(skeleton.points[0])
    };
    assert!(matches!(
        run(&skeleton, &steep),
        Err(FeedError::Option { name: "growth", .. })
    ));
    let other = sheet(4, 80.0, &mut dice);
    let shift = Vec3::new(120.0, 0.0, 0.0);
    let before = skeleton.points.len() as u32;
    skeleton
        .points
        .extend(other.points.iter().map(|p| p + shift));
    skeleton.radii.extend(&other.radii);
    skeleton
        .quads
        .extend(other.quads.iter().map(|q| q.map(|v| v + before)));
    let apart = run(&skeleton, &at(skeleton.points[0]));
    assert!(matches!(
        apart,
        Err(FeedError::Unreachable { points: 25, .. })
    ));
    // A body that both touch lets metal through, and a feeder may stand on it.
    let body = Contact {
        touching: vec![4, 25],
        inside: Vec::new(),
        feeders: vec![0],
    };
    let on_it = at(Vec3::new(100.0, 0.0, 20.0));
    let fed = feed(&skeleton, &[body], &on_it, &Monitor::default()).expect("both are reached");
    assert_eq!((fed.violations, fed.zones[0].points), (0, 50));
}

#[test]
fn a_modulus_needs_thicker_bars_than_a_radius() {
    // A plate that goes on as a bar towards the feeder.
    let mut skeleton = sheet(4, 40.0, &mut Dice(8));
    skeleton.radii.fill(4.0);
    let mut last = 14;
    for k in 1..6 {
        skeleton
            .points
            .push(Vec3::new(40.0 + 10.0 * f64::from(k), 20.0, 0.0));
        skeleton.radii.push(4.0);
        let next = skeleton.points.len() as u32 - 1;
        skeleton.beams.push([last, next]);
        last = next;
    }
    let options = at(skeleton.points[last as usize]);
    let end = |measure| {
        let options = FeedOptions {
            measure,
            ..options.clone()
        };
        run(&skeleton, &options).expect("it feeds").radii[last as usize]
    };
    let (radius, modulus) = (end(Measure::Radius), end(Measure::Modulus));
    assert!(modulus > 1.5 * radius, "{modulus:.2} against {radius:.2}");
}

#[test]
fn placement_is_the_best_of_all_candidates() {
    let skeleton = sheet(8, 160.0, &mut Dice(11));
    let all: Vec<u32> = (0..81).collect();
    let monitor = Monitor::default();
    let options = FeedOptions::default();
    let one = place_feeders(&skeleton, &[], &all, 1, &options, &monitor).expect("it feeds");
    for v in &all {
        let other = place_feeders(&skeleton, &[], &[*v], 1, &options, &monitor).expect("it feeds");
        assert!(one.cost() <= other.cost());
    }
    let two = place_feeders(&skeleton, &[], &all, 2, &options, &monitor).expect("they feed");
    assert!(two.points.len() == 2 && two.added < one.added);
}

#[test]
fn two_and_three_feeders_are_the_best_of_all_sets_on_small_sheets() {
    let (monitor, options) = (Monitor::default(), FeedOptions::default());
    for seed in [12, 13] {
        let skeleton = sheet(3, 60.0, &mut Dice(seed));
        let cost = |candidates: &[u32], count: usize| {
            let placed = place_feeders(&skeleton, &[], candidates, count, &options, &monitor);
            placed.expect("they feed").cost()
        };
        let all: Vec<u32> = (0..16).collect();
        let (two, three) = (cost(&all, 2), cost(&all, 3));
        for a in 0..16 {
            for b in 0..a {
                assert!(two <= cost(&[a, b], 2) * (1.0 + 1e-9), "{seed}: {a} {b}");
                for c in 0..b {
                    assert!(
                        three <= cost(&[a, b, c], 3) * (1.0 + 1e-9),
                        "{seed}: {a} {b} {c}"
                    );
                }
            }
        }
    }
}

#[test]
fn the_growth_factors_agree() {
    for (area, slope) in [(1.05, 0.0122), (1.1, 0.0238), (1.2, 0.0455), (1.5, 0.1010)] {
        let options = FeedOptions {
            growth: area,
            growth_as: GrowthKind::Area,
            ..FeedOptions::default()
        };
        assert!((options.slope() - slope).abs() < 1e-4);
        assert!((area_factor(options.slope()) - area).abs() < 1e-12);
    }
    // No arcs: the bounds are the solution.
    let least = least_solution(&[1.0, 2.0], &[], &[0.0; 2]).expect("no arcs");
    assert_eq!(least.values, [1.0, 2.0]);
}
