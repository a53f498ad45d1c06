//! Optimality criteria: the fast update for plain compliance.

/// New variables for `min f` under a volume that is linear in them: `x_i sqrt(-df_i / (l dv_i))`, within `step` of x.
///
/// `room`: what the volume may still grow by. The multiplier l is found by bisection.
/// M. P. Bendsoe: Optimal shape design as a material distribution problem, 1989, doi:10.1007/BF01650949.
pub(super) fn update(x: &[f64], df: &[f64], dv: &[f64], room: f64, step: f64) -> Vec<f64> {
    let largest = dv
        .iter()
        .fold(0.0f64, |m, &v| m.max(v))
        .max(f64::MIN_POSITIVE);
    // In the shadow of a draw the volume does not answer: a floor keeps the ratio finite.
    let ratio: Vec<f64> = df
        .iter()
        .zip(dv)
        .map(|(df, dv)| (-df).max(0.0) / dv.max(1e-6 * largest))
        .collect();
    let new = |i: usize, l: f64| {
        let wanted = x[i] * (ratio[i] / l).sqrt();
        wanted.max(x[i] - step).min(x[i] + step).clamp(0.0, 1.0)
    };
    let growth = |l: f64| -> f64 { (0..x.len()).map(|i| dv[i] * (new(i, l) - x[i])).sum() };
    let top = ratio
        .iter()
        .fold(0.0f64, |m, &v| m.max(v))
        .max(f64::MIN_POSITIVE);
    let (mut a, mut b) = (1e-12 * top, 1e6 * top);
    while b / a > 1.0 + 1e-9 {
        let l = (a * b).sqrt();
        if growth(l) > room {
            a = l;
        } else {
            b = l;
        }
    }
    let l = (a * b).sqrt();
    (0..x.len()).map(|i| new(i, l)).collect()
}
