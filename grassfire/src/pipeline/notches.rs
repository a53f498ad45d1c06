//! Notches of recognised sleeves that a repair of undercuts made solid.

use std::mem::take;

use super::ReconstructOptions;
use super::bodies::Bodies;
use super::error::StageError;
use super::recognise::{SOURCE, STAGE};
use crate::cad::{self, primitives::across};
use crate::monitor::Monitor;
use crate::non_design::{Boss, Notch};
use crate::voxel::VoxelGrid;

/// Places in a notch along its turn, from its floor to the outer wall, and along the axis.
const PLACES: [u32; 3] = [3, 3, 5];
/// A notch with this share of its places in the material is solid.
const SOLID: f64 = 0.9;

/// Makes the outer walls of recognised sleeves whole where `field`, the repaired proposal, has filled their notches: what is
/// left of a notch in the sleeve would be an undercut again, too thin a gap for the body to fill.
///
/// # Errors
/// Cancelled.
pub(super) fn close(
    bodies: &mut Bodies,
    field: &VoxelGrid<f32>,
    options: &ReconstructOptions,
    monitor: &Monitor,
) -> Result<(), StageError> {
    let mut closed = false;
    let mut sleeves = take(&mut bodies.sleeves);
    for (number, boss) in &mut sleeves {
        let open = |notch: &Notch| share(boss, notch, field) < SOLID;
        let left: Vec<Notch> = boss.notches.iter().copied().filter(open).collect();
        if left.len() == boss.notches.len() {
            continue;
        }
        let whole = Boss {
            notches: left,
            ..boss.clone()
        };
        let name = bodies.solids[*number].name.clone();
        match cad::from_boss(&name, SOURCE, &whole, &options.non_design, monitor) {
            Ok(solid) => {
                let less = boss.notches.len() - whole.notches.len();
                monitor.warn(
                    STAGE,
                    format!("the outer wall of {name} is whole where the repair filled {less} of its notches"),
                );
                bodies.solids[*number] = solid;
                *boss = whole;
                closed = true;
            }
            Err(cad::CadError::Cancelled(cancelled)) => return Err(cancelled.into()),
            Err(error) => monitor.warn(STAGE, format!("{name} keeps its notches: {error}")),
        }
    }
    bodies.sleeves = sleeves;
    if closed {
        bodies.measure_again()?;
    }
    Ok(())
}

/// Share of a notch that lies in the material of `field`.
fn share(boss: &Boss, notch: &Notch, field: &VoxelGrid<f32>) -> f64 {
    let [x, y] = across(&boss.direction);
    let part = |k: u32, of: u32| (f64::from(k) + 0.5) / f64::from(of);
    let [turns, depths, lengths] = PLACES;
    let mut inside = 0;
    for t in 0..turns {
        let turn = (2.0 * part(t, turns) - 1.0) * notch.half_angle;
        let away = x * (notch.turn + turn).cos() + y * (notch.turn + turn).sin();
        let floor = notch.distance / turn.cos().max(1e-3);
        for d in 0..depths {
            let radius = floor + (boss.outer_radius - floor) * part(d, depths);
            for l in 0..lengths {
                let [from, to] = boss.extent;
                let along = from + (to - from) * part(l, lengths);
                let p = boss.origin + radius * away + along * boss.direction;
                inside += u32::from(field.sample(&p) > 0.0);
            }
        }
    }
    f64::from(inside) / f64::from(turns * depths * lengths)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;

    /// A window beside an eye left a notch in the eye's recognised wall; the repair filled the window, and the notch stayed: an undercut.
    #[test]
    fn a_notch_that_the_repair_filled_is_closed_and_an_open_one_stays() -> Result<(), StageError> {
        let notch = |turn: f64| Notch {
            turn,
            half_angle: 0.3,
            distance: 6.5,
        };
        let boss = Boss {
            bore: 0,
            wall: Some(1),
            ends: [None; 2],
            origin: Vec3::zeros(),
            direction: Vec3::z(),
            radius: 4.0,
            outer_radius: 8.0,
            extent: [-3.0, 3.0],
            notches: vec![notch(0.0), notch(std::f64::consts::PI)],
            free: 4.0,
            residual: 0.0,
        };
        let [x, _] = across(&boss.direction);
        // The repaired proposal has material on one side only.
        let mut field = VoxelGrid::filled(Vec3::repeat(-12.0), 1.0, [25; 3], 1.0_f32);
        for v in 0..field.values.len() {
            let [i, j, k] = field.ijk(v);
            field.values[v] = field.centre(i, j, k).dot(&x) as f32;
        }
        let (options, monitor) = (ReconstructOptions::default(), Monitor::default());
        let mut bodies = Bodies::default();
        bodies.sleeves.push((0, boss.clone()));
        let body = cad::from_boss("boss 1", SOURCE, &boss, &options.non_design, &monitor);
        bodies.add(vec![body.map_err(StageError::from)?])?;
        let before = bodies.solids[0].volume;
        close(&mut bodies, &field, &options, &monitor)?;
        assert_eq!(bodies.sleeves[0].1.notches, [notch(std::f64::consts::PI)]);
        let gained = 6.0 * 0.3 * 8.0 * 8.0 - 6.0 * 6.5 * 6.5 * 0.3_f64.tan();
        let gain = bodies.solids[0].volume - before;
        assert!(
            (gain - gained).abs() < 1e-6 * gained,
            "{gain} of {gained} mm3"
        );
        Ok(())
    }
}
