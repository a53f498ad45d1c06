//! A finished design without the steps of its voxels.

use super::{Chain, Fields, OptimizeOptions, Problem, TopoptError};

/// Slope of the smooth field by the field before the projection.
const STEEP: f64 = 2.0;
/// Voxels are cut into two along each axis where that makes no more than so many: they take less memory than the solver did.
const MOST: usize = 1 << 22;
/// Filter radii, voxels: with a smaller one there is no filter, with a larger one the field is even enough as it is.
const RADII: [f64; 2] = [1.0, 6.0];

/// A field whose surface at about 0.5 is that of a part.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Smooth {
    /// Voxels of the optimization are cut into so many along each axis.
    pub split: usize,
    /// One value a voxel, `[z][y][x]`: 1 in frozen voxels, 0 outside; design voxels may be below 0 and above 1.
    pub values: Vec<f32>,
}

/// The field of the variables `x` before the projection with threshold `eta`, on finer voxels.
///
/// 1. Densities are nearly full or empty, so that their surface has the steps of the voxels; the field before the projection
///    passes through the same places and is smooth. It is steepened about the threshold, which comes to lie at 0.5: a quarter
///    off the threshold begin 0 and 1, so that faces of the design space stay where they are.
/// 2. Crests of walls that are one voxel thick lie between the centres of voxels, and what is interpolated there is too low:
///    such walls would be wavy, or break. So the filter is evaluated on voxels of half the edge, each with the variable of
///    the voxel that it belongs to, and the draw hull with it.
///
/// # Errors
/// As [`Chain::new`].
pub fn smooth(
    problem: &Problem,
    options: &OptimizeOptions,
    x: &[f64],
    eta: Option<f64>,
) -> Result<Smooth, TopoptError> {
    let split = split(problem.dims, options.radius(problem.h));
    on_voxels(problem, options, x, eta, split)
}

/// [`smooth`] on voxels cut into `split` along each axis.
fn on_voxels(
    problem: &Problem,
    options: &OptimizeOptions,
    x: &[f64],
    eta: Option<f64>,
    split: usize,
) -> Result<Smooth, TopoptError> {
    let fine = problem.cut(split);
    let variables = fine.at_design(&spread(problem, &problem.on_grid(x, 1.0), split));
    let options = OptimizeOptions {
        filter_radius: Some(options.radius(problem.h) * problem.h),
        ..options.clone()
    };
    let chain = Chain::new(&fine, &options)?;
    let mut fields = Fields::default();
    chain.forward(&variables, None, &mut fields);
    let (gain, eta) = eta.map_or((1.0, 0.5), |eta| (STEEP, eta));
    let mut values = chain.unprojected(&fields);
    values.iter_mut().for_each(|m| *m = 0.5 + gain * (*m - eta));
    let values = fine.on_grid(&values, 1.0);
    Ok(Smooth {
        split,
        values: values.iter().map(|&v| v as f32).collect(),
    })
}

/// Into how many voxels along each axis [`smooth`] cuts those of a grid; `radius`: that of the filter, voxels.
pub fn split(dims: [usize; 3], radius: f64) -> usize {
    let few = 8 * dims.iter().product::<usize>() <= MOST;
    let filtered = RADII[0] < radius && radius <= RADII[1];
    if few && filtered { 2 } else { 1 }
}

/// A field of the voxels of `problem` on voxels cut into `split` along each axis.
pub fn spread<T: Copy>(problem: &Problem, field: &[T], split: usize) -> Vec<T> {
    let [nx, ny, nz] = problem.dims.map(|n| n * split);
    let row = |row: usize| {
        let (y, z) = (row % ny, row / ny);
        (0..nx).map(move |x| field[problem.index([x, y, z].map(|i| i / split))])
    };
    (0..ny * nz).flat_map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::super::DESIGN;
    use super::*;

    /// Lowest over highest crest of a slanting wall of one voxel, interpolated between voxel centres.
    fn evenness(split: usize) -> f64 {
        let dims = [30, 20, 6];
        let problem = Problem {
            h: 1.0,
            dims,
            labels: vec![DESIGN; dims.iter().product()],
            ..Problem::default()
        };
        let middle = |x: f64| 3.0 + 0.45 * x;
        let x: Vec<f64> = (0..problem.labels.len())
            .map(|v| {
                let at = problem.centre(v);
                f64::from(u8::from((at.y - middle(at.x)).abs() < 0.5))
            })
            .collect();
        let options = OptimizeOptions {
            filter_radius: Some(2.33),
            ..OptimizeOptions::default()
        };
        let smooth = on_voxels(&problem, &options, &x, Some(0.3), split).expect("a field");
        let fine = problem.cut(split);
        let value = |x: f64, y: f64| {
            let at = [x, y].map(|c| c / fine.h - 0.5);
            let (i, f) = (at.map(|c| c as usize), at.map(f64::fract));
            let corner = |a: usize, b: usize| {
                let value = smooth.values[fine.index([i[0] + a, i[1] + b, fine.dims[2] / 2])];
                let weight = |f: f64, far: usize| if far == 1 { f } else { 1.0 - f };
                f64::from(value) * weight(f[0], a) * weight(f[1], b)
            };
            corner(0, 0) + corner(1, 0) + corner(0, 1) + corner(1, 1)
        };
        let crest = |x: f64| {
            let across = (-10..=10).map(|k| value(x, middle(x) + 0.05 * f64::from(k)));
            across.fold(0.0, f64::max)
        };
        let crests: Vec<f64> = (0..200).map(|k| crest(5.0 + 0.1 * f64::from(k))).collect();
        let highest = crests.iter().copied().fold(0.0, f64::max);
        crests.iter().copied().fold(highest, f64::min) / highest
    }

    #[test]
    fn walls_of_one_voxel_are_more_even_on_finer_voxels() {
        let (whole, cut) = (evenness(1), evenness(2));
        assert!(cut > whole + 0.05, "{whole} {cut}");
    }

    #[test]
    fn voxels_are_cut_where_the_filter_reaches_others_and_memory_allows() {
        assert_eq!(split([100, 50, 50], 2.0), 2);
        assert_eq!(split([100, 50, 50], 1.0), 1);
        assert_eq!(split([100, 50, 50], 12.0), 1);
        assert_eq!(split([400, 200, 200], 2.0), 1);
    }
}
