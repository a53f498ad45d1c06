//! Where the outer wall around a bore is missing: the sleeve is notched there instead of filled.

use std::f64::consts::TAU;

/// A part of the circumference in which the material ends before the sleeve's outer wall, at a flat floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Notch {
    /// Direction of its middle, radians from the first direction across the axis.
    pub turn: f64,
    /// Half the angle that it takes, radians.
    pub half_angle: f64,
    /// Distance of its floor from the axis, mm; the floor is flat and faces its middle.
    pub distance: f64,
}

/// Share of the circumference that notches may take: with more it is no wall around the bore.
const MOST: f64 = 0.25;

/// Finds the notches of a wall.
///
/// 1. `reach` is how far from the axis the material goes, mm, in as many evenly spaced directions; where that is less than
///    `enough` the wall is missing.
/// 2. Each run of such directions is a notch; it ends half way to the next direction.
/// 3. Its floor is the plane across its middle that fits the material's ends best.
///
/// `None` when the wall is missing in more than a quarter of the directions.
pub(super) fn notches(reach: &[f64], enough: f64) -> Option<Vec<Notch>> {
    let n = reach.len();
    let missing: Vec<bool> = reach.iter().map(|r| *r < enough).collect();
    let count = missing.iter().filter(|m| **m).count();
    if count as f64 > MOST * n as f64 {
        return None;
    }
    let step = TAU / n as f64;
    let starts = (0..n).filter(|&k| missing[k] && !missing[(k + n - 1) % n]);
    let run = |start: usize| {
        let long = (0..n).take_while(|k| missing[(start + k) % n]).count();
        let middle = (long as f64 - 1.0) / 2.0;
        let ends = (0..long).map(|k| reach[(start + k) % n] * ((k as f64 - middle) * step).cos());
        Notch {
            turn: (start as f64 + middle) * step,
            half_angle: long as f64 * step / 2.0,
            distance: ends.sum::<f64>() / long as f64,
        }
    };
    Some(starts.map(run).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_cut_over_the_first_direction_is_one_notch_with_its_distance() {
        let n = 72;
        let reach: Vec<f64> = (0..n)
            .map(|k| (8.0 / (TAU * f64::from(k) / f64::from(n)).cos().max(0.1)).min(9.0))
            .collect();
        let found = notches(&reach, 8.9).expect("a wall");
        assert_eq!(found.len(), 1);
        let turn = found[0].turn.rem_euclid(TAU);
        assert!(turn.min(TAU - turn) < 1e-9, "{turn}");
        assert!((found[0].distance - 8.0).abs() < 1e-9);
        assert!(((8.0 / 9.0_f64).acos() - found[0].half_angle).abs() < TAU / 72.0);
    }

    #[test]
    fn a_whole_wall_has_no_notch_and_half_a_wall_is_none() {
        assert_eq!(notches(&[9.0; 24], 8.0), Some(Vec::new()));
        let half: Vec<f64> = (0..24).map(|k| if k < 12 { 9.0 } else { 5.0 }).collect();
        assert_eq!(notches(&half, 8.0), None);
    }
}
