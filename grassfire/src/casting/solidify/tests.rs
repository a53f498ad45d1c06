use std::f64::consts::PI;

use super::march::march;
use super::sweep::{State, step};
use super::*;

/// A metal with constant properties.
fn plain(conductivity: f64, density: f64, capacity: f64, latent: f64, range: [f64; 3]) -> Metal {
    Metal {
        name: "plain".into(),
        solidus: range[0],
        liquidus: range[1],
        pour: range[2],
        density,
        conductivity: vec![[0.0, conductivity]],
        heat_capacity: vec![[0.0, capacity]],
        latent_heat: latent,
        solid_fraction: Vec::new(),
        feeding_ends: 0.5,
        interface: vec![[0.0, 500.0]],
        niyama: 0.3,
        shrinkage: 0.06,
        source: "test".into(),
    }
}

fn aluminium() -> Metal {
    plain(150.0, 2500.0, 1080.0, 430.0, [555.0, 615.0, 700.0])
}

fn steel() -> Metal {
    plain(30.0, 7200.0, 700.0, 260.0, [1440.0, 1505.0, 1580.0])
}

fn plain_sand() -> Sand {
    Sand {
        name: "plain".into(),
        density: 1550.0,
        conductivity: vec![[0.0, 0.7]],
        heat_capacity: vec![[0.0, 1050.0]],
        temperature: 25.0,
        source: "test".into(),
    }
}

/// `erf` by its series, to rounding for small arguments.
fn erf(x: f64) -> f64 {
    let (mut term, mut sum) = (x, x);
    for n in 1..200 {
        term *= -x * x / f64::from(n);
        sum += term / f64::from(2 * n + 1);
    }
    2.0 / PI.sqrt() * sum
}

#[test]
fn the_front_follows_neumann() {
    // Half-space of metal against a wall at 300 degrees, nearly no freezing range.
    let (k, rho, c, latent) = (150.0, 2500.0, 1080.0, 430.0);
    let (melting, poured, wall) = (600.0, 650.0, 300.0);
    let metal = Metal {
        interface: vec![[0.0, 1e9]],
        ..plain(k, rho, c, latent, [melting - 0.1, melting + 0.1, poured])
    };
    let (rc, heat) = (rho * c, rho * latent * 1e3);
    let alpha = k / rc;
    let [ste, superheat] = [rc * (melting - wall) / heat, rc * (poured - melting) / heat];
    let balance = |l: f64| {
        let e = (-l * l).exp();
        ste * e / erf(l) - superheat * e / (1.0 - erf(l)) - l * PI.sqrt()
    };
    let (mut low, mut high) = (1e-3, 2.0);
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if balance(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    let lambda = (low + high) / 2.0;
    // The wall is one cell of sand that conducts and holds heat without limit.
    let sand = Sand {
        density: 1e12,
        conductivity: vec![[0.0, 1e9]],
        temperature: wall,
        ..plain_sand()
    };
    let n = 101;
    let mut field = VoxelGrid::filled(Vec3::zeros(), 1.0, [n, 1, 1], 1.0_f32);
    field.values[0] = -1.0;
    let grid = Grid::new(&field, 0.0, |_| false);
    let laws = Laws::new(&metal, &sand);
    let temperature: Vec<f64> = grid
        .cells
        .iter()
        .map(|c| if c.is_metal() { poured } else { wall })
        .collect();
    let enthalpy = grid.cells.iter().zip(&temperature);
    let mut state = State {
        enthalpy: enthalpy.map(|(c, t)| laws.enthalpy(*c).of(*t)).collect(),
        temperature,
    };
    let dt = 0.01;
    let mut worst = 0.0_f64;
    for number in 0..1200 {
        step(&grid, &laws, &mut state, dt, number);
        let time = dt * (number + 1) as f64;
        let exact = 2.0 * lambda * (alpha * time).sqrt() * 1e3;
        if exact > 20.0 && exact < 40.0 {
            let solid = state.temperature[1..].iter().map(|t| laws.solid.at(*t));
            worst = worst.max((solid.sum::<f64>() / exact - 1.0).abs());
        }
    }
    assert!(worst > 0.0 && worst < 5e-3, "off by {:.2} %", 100.0 * worst);
}

/// Freezing time of a plate, cylinder or ball (0, 1, 2) of radius `r` m by explicit radial shells.
fn radial(power: i32, r: f64, metal: &Metal, sand: &Sand) -> f64 {
    let (nm, ns, ls) = (40, 240, 0.05);
    let (k, rc) = (
        metal.conductivity[0][1],
        metal.density * metal.heat_capacity[0][1],
    );
    let heat = metal.density * 1e3 * metal.latent_heat;
    let (ks, rcs) = (
        sand.conductivity[0][1],
        sand.density * sand.heat_capacity[0][1],
    );
    let n = nm + ns;
    let face = |i: usize| {
        if i <= nm {
            r * i as f64 / nm as f64
        } else {
            r + ls * (i - nm) as f64 / ns as f64
        }
    };
    let volume =
        |i: usize| (face(i + 1).powi(power + 1) - face(i).powi(power + 1)) / f64::from(power + 1);
    let mut conductance = vec![0.0; n + 1];
    for (i, conductance) in conductance.iter_mut().enumerate().take(n).skip(1) {
        let half = |i: usize| (face(i + 1) - face(i)) / 2.0 / if i < nm { k } else { ks };
        let skin = if i == nm {
            1.0 / metal.interface[0][1]
        } else {
            0.0
        };
        *conductance = face(i).powi(power) / (half(i - 1) + half(i) + skin);
    }
    let volumes: Vec<f64> = (0..n).map(volume).collect();
    let slack = |i: usize| {
        let c = if i < nm { rc } else { rcs };
        c * volumes[i] / (conductance[i] + conductance[i + 1]).max(1e-30)
    };
    let dt = 0.9 * (0..n).map(slack).fold(f64::INFINITY, f64::min);
    let hs = rc * metal.solidus;
    let hl = rc * metal.liquidus + heat;
    let warm = |i: usize, h: f64| {
        if i >= nm {
            h / rcs
        } else if h <= hs {
            h / rc
        } else if h >= hl {
            (h - heat) / rc
        } else {
            metal.solidus + (metal.liquidus - metal.solidus) * (h - hs) / (hl - hs)
        }
    };
    let mut h: Vec<f64> = (0..n)
        .map(|i| {
            if i < nm {
                rc * metal.pour + heat
            } else {
                rcs * sand.temperature
            }
        })
        .collect();
    let mut t: Vec<f64> = (0..n).map(|i| warm(i, h[i])).collect();
    let mut time = 0.0;
    while h[..nm].iter().any(|h| *h > hs) {
        for i in 0..n {
            let left = if i > 0 {
                conductance[i] * (t[i - 1] - t[i])
            } else {
                0.0
            };
            let right = if i + 1 < n {
                conductance[i + 1] * (t[i + 1] - t[i])
            } else {
                0.0
            };
            h[i] += dt * (left + right) / volumes[i];
        }
        for i in 0..n {
            t[i] = warm(i, h[i]);
        }
        time += dt;
    }
    time
}

/// The same on cells: a quarter or an eighth, the axis in a corner, with 30 mm of sand.
fn on_cells(power: i32, r: f64, per_radius: f64, metal: &Metal) -> (f64, f64) {
    let cell = r * 1e3 / per_radius;
    let n = ((r * 1e3 + 30.0) / cell).round() as usize;
    let dims = match power {
        0 => [n, 1, 1],
        1 => [n, n, 1],
        _ => [n, n, n],
    };
    let mut field = VoxelGrid::filled(Vec3::repeat(cell / 2.0), cell, dims, 0.0_f32);
    for v in 0..field.values.len() {
        let [i, j, k] = field.ijk(v);
        let p = field.centre(i, j, k);
        let squares = [p.x, p.y, p.z].map(|x| x * x);
        let distance = squares[..=power as usize].iter().sum::<f64>().sqrt();
        field.values[v] = (r * 1e3 - distance) as f32;
    }
    let grid = Grid::new(&field, 0.0, |_| false);
    let sand = plain_sand();
    let laws = Laws::new(metal, &sand);
    let expected = radial_guess(power, r, metal);
    let monitor = Monitor::default();
    let history = march(&grid, &laws, metal, &sand, expected, 150, &monitor).expect("it freezes");
    let last = history.solid.iter().copied().fold(0.0, f64::max);
    (last, history.drift)
}

fn radial_guess(power: i32, r: f64, metal: &Metal) -> f64 {
    plate_time(metal, &plain_sand(), r * 1e3 / f64::from(power + 1))
}

#[test]
fn cylinders_and_balls_freeze_as_fine_shells_do() {
    for metal in [aluminium(), steel()] {
        for (power, r) in [(0, 0.005), (1, 0.010), (2, 0.015)] {
            let exact = radial(power, r, &metal, &plain_sand());
            for (per_radius, allowed) in [(6.0, 0.05), (12.0, 0.02)] {
                let (time, drift) = on_cells(power, r, per_radius, &metal);
                let off = time / exact - 1.0;
                assert!(
                    off.abs() < allowed,
                    "{} power {power}, {per_radius} cells: {:.2} %",
                    metal.latent_heat,
                    100.0 * off
                );
                assert!(drift.abs() < 1e-9, "{drift:.1e}");
            }
        }
    }
}

/// `t = C M^2 + b M`: the second term is the resistance between metal and mould.
#[test]
fn plates_freeze_by_chvorinov_with_a_linear_term() {
    let metal = aluminium();
    let time = |modulus: f64| on_cells(0, modulus * 1e-3, 24.0, &metal).0;
    let (thin, thick) = (time(5.0) / 5.0, time(10.0) / 10.0);
    let c = (thick - thin) / 5.0;
    let b = thin - 5.0 * c;
    for modulus in [6.0, 7.5, 9.0] {
        let off = time(modulus) / (c * modulus * modulus + b * modulus) - 1.0;
        assert!(off.abs() < 0.01, "{modulus} mm: {:.2} %", 100.0 * off);
    }
}

/// Triangles of a box without its inner faces are not needed: the remesh takes overlapping bodies.
fn boxes(list: &[[f64; 6]]) -> TriMesh {
    let mut mesh = TriMesh::default();
    for [x0, y0, z0, x1, y1, z1] in list {
        let one = crate::mesh::shapes::cuboid(Vec3::new(*x0, *y0, *z0), Vec3::new(*x1, *y1, *z1));
        mesh.append(one.points, one.triangles);
    }
    mesh
}

#[test]
fn a_plate_with_two_bosses_freezes_last_in_them() {
    let mesh = boxes(&[
        [0.0, 0.0, 0.0, 120.0, 40.0, 8.0],
        [10.0, 8.0, 0.0, 34.0, 32.0, 24.0],
        [86.0, 8.0, 0.0, 110.0, 32.0, 24.0],
    ]);
    let options = SolidifyOptions {
        cell: Some(2.0),
        steps: 60,
        ..SolidifyOptions::default()
    };
    let monitor = Monitor::default();
    let alone = solidify(&mesh, &options, &monitor).expect("it freezes");
    assert_eq!(alone.hot_spots.len(), 2);
    for x in [22.0, 98.0] {
        let near = |p: &Vec3| (p - Vec3::new(x, 20.0, 11.0)).norm() < 5.0;
        assert!(alone.places.iter().any(near), "{:?}", alone.places);
    }
    assert!(alone.energy_drift.abs() < 1e-9 && alone.directional == 0.0);
    // With a feeder on one boss the other stays isolated.
    let fed = SolidifyOptions {
        feeders: vec![[22.0, 20.0, 24.0]],
        feeder_diameter: 40.0,
        ..options
    };
    let fed = solidify(&mesh, &fed, &monitor).expect("it freezes");
    let isolated: Vec<usize> = (0..fed.hot_spots.len())
        .filter(|&n| !fed.hot_spots[n].fed)
        .collect();
    assert_eq!(isolated.len(), 1);
    assert!((fed.places[isolated[0]].x - 98.0).abs() < 5.0);
    assert!(
        fed.directional > 0.3 && fed.directional < 0.95,
        "{}",
        fed.directional
    );
    assert!(fed.isolated_volume < alone.isolated_volume);
}

#[test]
fn a_step_wedge_freezes_towards_its_thick_end() {
    // Where a step begins, and how high it is; the last one is long, so that its end does not cool all of it.
    let steps = [[0.0, 8.0], [24.0, 12.0], [48.0, 16.0], [72.0, 20.0]];
    let ends = [24.0, 48.0, 72.0, 132.0];
    let wedge = |([x, height], end): (&[f64; 2], &f64)| [*x, 0.0, 0.0, *end, 40.0, *height];
    let mesh = boxes(&steps.iter().zip(&ends).map(wedge).collect::<Vec<_>>());
    let options = SolidifyOptions {
        cell: Some(2.5),
        steps: 40,
        ..SolidifyOptions::default()
    };
    let found = solidify(&mesh, &options, &Monitor::default()).expect("it freezes");
    assert_eq!(found.hot_spots.len(), 1, "{:?}", found.places);
    let last = found.places[0];
    assert!(last.x > 74.0 && (last.y - 20.0).abs() < 4.0, "{last:?}");
    let middles = steps.iter().zip(&ends);
    let times = middles.map(|([x, height], end)| {
        let middle = Vec3::new((x + end) / 2.0, 20.0, height / 2.0);
        found.time.sample(&middle)
    });
    let times: Vec<f64> = times.collect();
    assert!(times.windows(2).all(|t| t[0] < t[1]), "{times:?}");
}

/// A foot that was pointed at from above hung in the air beside a higher wall, and the feeder fed nothing.
#[test]
fn a_feeder_stands_on_what_is_below_its_foot() {
    let mesh = boxes(&[[0.0, 0.0, 0.0, 60.0, 60.0, 10.0]]);
    let run = |height: f64| {
        let options = SolidifyOptions {
            cell: Some(2.0),
            steps: 40,
            feeders: vec![[30.0, 30.0, height]],
            feeder_diameter: 40.0,
            ..SolidifyOptions::default()
        };
        solidify(&mesh, &options, &Monitor::default()).expect("it freezes")
    };
    let fed = run(13.0);
    assert!(fed.directional > 0.9, "{}", fed.directional);
    assert_eq!(fed.isolated_volume, 0.0);
    // Out of its reach.
    assert_eq!(run(19.5).directional, 0.0);
}

#[test]
fn unusable_tables_and_feeders_are_refused() {
    let mesh = boxes(&[[0.0, 0.0, 0.0, 20.0, 20.0, 20.0]]);
    let run = |options: &SolidifyOptions| solidify(&mesh, options, &Monitor::default()).map(|_| ());
    let metal = Metal {
        conductivity: Vec::new(),
        ..aluminium()
    };
    let without = SolidifyOptions {
        metal: Some(metal),
        ..SolidifyOptions::default()
    };
    assert!(matches!(run(&without), Err(SolidifyError::Material { .. })));
    let far = SolidifyOptions {
        feeders: vec![[200.0, 0.0, 0.0]],
        feeder_diameter: 20.0,
        ..SolidifyOptions::default()
    };
    assert!(matches!(
        run(&far),
        Err(SolidifyError::Feeder { feeder: 0, .. })
    ));
    let thin = SolidifyOptions {
        cell: Some(1.0),
        padding: Some(0.5),
        ..SolidifyOptions::default()
    };
    assert!(matches!(run(&thin), Err(SolidifyError::Mould { .. })));
    let many = SolidifyOptions {
        cell: Some(0.5),
        max_cells: 1000,
        ..SolidifyOptions::default()
    };
    assert!(matches!(
        run(&many),
        Err(SolidifyError::Grid { .. } | SolidifyError::TooMany { .. })
    ));
}
