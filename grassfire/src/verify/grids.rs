//! The two grids of a verification.

use super::{STAGE, VerifyError, VerifyOptions};
use crate::Vec3;
use crate::case::{Case, CaseError, place_grid};
use crate::fe::FeError;
use crate::mesh::TriMesh;
use crate::monitor::Monitor;
use crate::topopt::TopoptError;

/// Where a grid lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Layout {
    pub origin: Vec3,
    pub h: f64,
    pub dims: [usize; 3],
}

/// Coarse over fine edge where a grid of half the edge takes too much memory.
const CLOSE: f64 = 1.5;
/// With less than this share of the voxels wanted across a wall a warning is given.
const FEWER: f64 = 0.75;
/// Attempts to find an edge that fits.
const ATTEMPTS: usize = 12;

/// The coarser and the finer grid around a part.
///
/// 1. `verify.h` is the edge of the coarser grid; without it the finer one gets `verify.voxels_across` voxels across the
///    mean wall `2 V / A`, at most `verify.max_voxels` voxels in all.
/// 2. The other edge is half or double of it. Where the memory does not allow half of a given edge, the given one is the
///    finer and 1.5 times it the coarser.
///
/// # Errors
/// [`FeError::Memory`] when a given edge does not fit.
pub(super) fn choose(
    case: &Case,
    mesh: &TriMesh,
    options: &VerifyOptions,
    monitor: &Monitor,
) -> Result<[Layout; 2], VerifyError> {
    let Some((low, high)) = mesh.bounds().filter(|_| !mesh.triangles.is_empty()) else {
        return Err(VerifyError::Empty);
    };
    let (volume, area) = (mesh.volume().abs(), mesh.area());
    let layout = |h: f64| -> Result<Layout, CaseError> {
        let margin = Vec3::repeat(h);
        // Voxels that the surface cuts count whole.
        let filled = volume + h * area;
        let (origin, dims) = place_grid(case, h, low - margin, high + margin, filled)?;
        Ok(Layout { origin, h, dims })
    };
    if let Some(h) = options.h {
        return match layout(h / 2.0) {
            Ok(fine) => Ok([layout(h)?, fine]),
            Err(error) if is_memory(&error) => {
                let fine = layout(h)?;
                let text = format!(
                    "{error}: the part is solved with voxels of {h:.4} and {:.4} mm instead of {:.4} mm",
                    CLOSE * h,
                    h / 2.0
                );
                monitor.warn(STAGE, text);
                Ok([layout(CLOSE * h)?, fine])
            }
            Err(error) => Err(error.into()),
        };
    }
    let size = high - low;
    let wall = 2.0 * volume / area;
    let wanted = wall / options.voxels_across;
    let count = |h: f64| size.map(|s| s / h + 2.0).product();
    let mut h = wanted;
    for _ in 0..ATTEMPTS {
        let over = count(h) / options.max_voxels as f64;
        if over > 1.0 {
            h *= over.cbrt() * 1.01;
            continue;
        }
        match layout(h) {
            Ok(fine) => {
                if h * FEWER > wanted {
                    let text = format!(
                        "{:.1} voxels across the mean wall of {wall:.3} mm instead of {}: more would not fit into verify.max_voxels or the memory",
                        wall / h,
                        options.voxels_across
                    );
                    monitor.warn(STAGE, text);
                }
                return Ok([layout(2.0 * h)?, fine]);
            }
            Err(error) if is_memory(&error) => h *= 1.15,
            Err(error) => return Err(error.into()),
        }
    }
    Ok([layout(2.0 * h)?, layout(h)?])
}

fn is_memory(error: &CaseError) -> bool {
    matches!(
        error,
        CaseError::Problem(TopoptError::Fe(FeError::Memory { .. }))
    )
}
