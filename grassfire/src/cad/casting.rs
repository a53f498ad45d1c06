//! The part with its feeders, as the foundry pours it.

use std::path::Path;

use grassfire_occt::Shape;

use super::build::CadSolid;
use super::output::{by_kernel, texts};
use super::{CadError, StepOptions};
use crate::Vec3;

/// Height of a neck over its diameter: it must not freeze before the feeder, so it is short.
const NECK_HEIGHT: f64 = 0.3;
/// Faces of a cylinder.
const FACES: usize = 3;
/// Colours of necks and feeders.
const NECK: [u8; 3] = [225, 140, 60];
const FEEDER: [u8; 3] = [200, 90, 60];

/// A feeder and its neck, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeederBody {
    /// Where the neck begins.
    pub foot: [f64; 3],
    /// Diameter and height of the feeder.
    pub diameter: f64,
    /// Diameter of the neck.
    pub neck: f64,
}

/// Writes the part with its feeders as STEP AP242 in mm: an assembly of the part, `neck 1`, `feeder 1` and so on.
///
/// A feeder is a cylinder as high as it is wide along `up`, on a neck of three tenths of its diameter. The neck begins at the
/// height of its foot; it is not united with the part, whose surface may be curved there.
///
/// # Errors
/// [`CadError::Kernel`], [`CadError::Write`], [`CadError::File`].
pub fn write_casting(
    solid: &CadSolid,
    feeders: &[FeederBody],
    up: [f64; 3],
    path: &Path,
    options: &StepOptions,
) -> Result<(), CadError> {
    let mut texts = texts(solid, options)?;
    texts.description = "the part with its feeders".into();
    let mut bodies = solid.shape.solids()?;
    let up = Vec3::from(up).normalize();
    for (number, feeder) in feeders.iter().enumerate() {
        let foot = Vec3::from(feeder.foot);
        let height = NECK_HEIGHT * feeder.neck;
        let top = foot + height * up;
        for (name, colour, start, diameter, height) in [
            ("neck", NECK, foot, feeder.neck, height),
            ("feeder", FEEDER, top, feeder.diameter, feeder.diameter),
        ] {
            let name = format!("{name} {}", number + 1);
            bodies.push(Shape::cylinder(
                start.into(),
                up.into(),
                diameter / 2.0,
                height,
            )?);
            texts.faces.extend(vec![name.clone(); FACES]);
            texts.colors.extend([colour; FACES]);
            texts.solids.push(name);
        }
    }
    let whole = Shape::compound(&bodies)?;
    by_kernel(path, "casting.step", |file| whole.write_step(file, &texts))
}
