//! Non-design bodies as cutting and fitting see them.

use super::Capsule;
use crate::Vec3;
use crate::mesh::TriMesh;

/// Non-design bodies as cutting and fitting see them.
#[derive(Debug, Clone, Default)]
pub struct Bosses {
    /// Their closed surfaces, bores filled; the tag of a triangle is the number of its body.
    pub surface: TriMesh,
    /// The walls of their bores: a cylinder about `a`-`b` each.
    pub bores: Vec<Capsule>,
    /// The lengths of the bores that stay free of material, likewise.
    pub free: Vec<Capsule>,
}

/// A core is wider than its bore by up to this share of it where the bore leaves its body: there it fills the rounded rim of what
/// stands around the mouth.
const MOUTH: f64 = 0.5;

impl Bosses {
    /// What the cores of the bores make: their free lengths, and the mouths of these outside the bodies.
    pub fn cored(&self) -> Vec<Capsule> {
        let mouths = self.bores.iter().zip(&self.free).flat_map(|(wall, free)| {
            let radius = (1.0 + MOUTH) * wall.radius;
            [(free.a, wall.a), (wall.b, free.b)].map(|(a, b)| Capsule { a, b, radius })
        });
        self.free.iter().cloned().chain(mouths).collect()
    }

    /// The box of each body and of each free length of a bore.
    pub(super) fn boxes(&self) -> Vec<(Vec3, Vec3)> {
        let count = self.surface.tags.iter().max().map_or(0, |t| t + 1);
        let none = (Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY));
        let mut out = vec![none; count as usize];
        for (t, &tag) in self.surface.tags.iter().enumerate() {
            let (lo, hi) = &mut out[tag as usize];
            for p in self.surface.corners(t) {
                *lo = lo.inf(&p);
                *hi = hi.sup(&p);
            }
        }
        out.extend(self.free.iter().map(|bore| {
            let by = Vec3::repeat(bore.radius);
            (bore.a.inf(&bore.b) - by, bore.a.sup(&bore.b) + by)
        }));
        out
    }
}
