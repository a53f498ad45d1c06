//! What a support holds.

use nalgebra::{Matrix3, Unit};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{CaseError, finite, value};
use crate::Vec3;

/// Stiffness of a roller that lies along no axis over that of the material beneath it: its play is a hundredth of what a voxel
/// gives way.
const UNYIELDING: f64 = 100.0;
/// Normals that differ from an axis by less are along it.
const ALONG: f64 = 1e-9;

/// A support: exactly one of `fix`, `roller` and `spring`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Support {
    /// Selection.
    pub on: String,
    /// Fixed directions: some of `x`, `y`, `z`, such as `xyz`.
    pub fix: String,
    /// Normal of a plane that the selection slides on. Along an axis it is held exactly, otherwise by stiff springs.
    pub roller: Option<[f64; 3]>,
    /// Springs between the selection and the ground.
    pub spring: Option<Spring>,
}

/// Springs that are spread evenly over a selection, as a bush of rubber is.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Spring {
    /// Stiffness of all together, N/mm.
    pub stiffness: f64,
    /// The one direction in which they act. Default: all.
    pub along: Option<[f64; 3]>,
}

impl Support {
    /// Refuses values that mean nothing; `key` is its place in the file.
    pub(super) fn check(&self, key: &str) -> Result<(), CaseError> {
        let key = |name: &str| format!("{key}.{name}");
        let kinds = [
            !self.fix.is_empty(),
            self.roller.is_some(),
            self.spring.is_some(),
        ];
        let fix = &self.fix;
        if !fix.chars().all(|c| "xyz".contains(c)) || kinds == [false; 3] {
            let wanted = "some of x, y, z, such as \"xyz\"";
            return Err(value(&key("fix"), format!("{fix:?}"), wanted));
        }
        if kinds.iter().filter(|k| **k).count() > 1 {
            let wanted = "left out: a support has one of fix, roller and spring";
            return Err(value(&key("fix"), format!("{fix:?}"), wanted));
        }
        let spring = self.spring.as_ref();
        let directions = [
            ("roller", self.roller),
            ("spring.along", spring.and_then(|s| s.along)),
        ];
        for (name, direction) in directions {
            finite(&key(name), direction.iter().flatten())?;
            if direction == Some([0.0; 3]) {
                return Err(value(&key(name), "0 0 0", "a direction"));
            }
        }
        match spring.map(|s| s.stiffness) {
            Some(k) if !(k.is_finite() && k > 0.0) => {
                let wanted = "a positive number, N/mm for the whole selection";
                Err(value(&key("spring.stiffness"), k, wanted))
            }
            _ => Ok(()),
        }
    }

    /// Components that are held fast.
    pub(crate) fn fixed(&self) -> Vec<usize> {
        match self.rolls_along() {
            Some(axis) => vec![axis],
            None => self.fix.chars().filter_map(|c| "xyz".find(c)).collect(),
        }
    }

    /// Stiffness of its springs together, N/mm; none where it has none. `beneath`: what the material under the whole selection has
    /// over one voxel or element.
    pub(crate) fn stiffness(&self, beneath: f64) -> Option<Matrix3<f64>> {
        let along = |direction: [f64; 3]| {
            let n = Unit::new_normalize(Vec3::from(direction));
            n.into_inner() * n.transpose()
        };
        match (&self.spring, self.roller, self.rolls_along()) {
            (Some(spring), _, _) => {
                Some(spring.stiffness * spring.along.map_or_else(Matrix3::identity, along))
            }
            (None, Some(normal), None) => Some(UNYIELDING * beneath * along(normal)),
            _ => None,
        }
    }

    /// The axis of a roller along one.
    fn rolls_along(&self) -> Option<usize> {
        let normal = Vec3::from(self.roller?).normalize();
        (0..3).find(|&d| normal[d].abs() > 1.0 - ALONG)
    }
}
