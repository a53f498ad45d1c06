//! Where the picture is taken from.

use crate::Vec3;

/// An orthographic camera: screen x runs right, screen y up, depth grows toward the viewer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Unit vector to the right of the picture.
    pub right: Vec3,
    /// Unit vector to the top of the picture.
    pub up: Vec3,
    /// Unit vector from the part to the viewer.
    pub toward: Vec3,
    /// Point in the middle of the picture, mm.
    pub centre: Vec3,
    /// Visible half width and half height at least, mm.
    pub half: [f64; 2],
    /// Half the diagonal of the part, mm: the scale of depth offsets.
    pub reach: f64,
}

/// Degrees around z, tried in this order; near-ties keep the first.
const AZIMUTHS: [f64; 4] = [-55.0, 35.0, -35.0, 55.0];
const ELEVATION: f64 = 32.0;

impl Camera {
    /// An isometric view of `points` (z up) from the direction that fills a 4:3 picture best.
    ///
    /// Points that are not finite are ignored; without points the camera looks at a unit cube.
    pub fn fit(points: &[Vec3]) -> Self {
        let finite: Vec<Vec3> = points
            .iter()
            .filter(|p| p.iter().all(|x| x.is_finite()))
            .copied()
            .collect();
        let mut best: Option<(f64, Self)> = None;
        for azimuth in AZIMUTHS {
            let camera = Self::looking(&finite, azimuth, ELEVATION);
            let need = (camera.half[0] / 4.0).max(camera.half[1] / 3.0);
            if best.is_none_or(|(least, _)| need < 0.98 * least) {
                best = Some((need, camera));
            }
        }
        best.map_or_else(
            || Self::looking(&finite, AZIMUTHS[0], ELEVATION),
            |(_, camera)| camera,
        )
    }

    /// Looks at `points` from `azimuth` degrees around z (0 is +x) and `elevation` degrees above the xy plane.
    pub fn looking(points: &[Vec3], azimuth: f64, elevation: f64) -> Self {
        let (az, el) = (azimuth.to_radians(), elevation.to_radians());
        let toward = Vec3::new(el.cos() * az.cos(), el.cos() * az.sin(), el.sin());
        let right = Vec3::new(-az.sin(), az.cos(), 0.0);
        let up = toward.cross(&right);
        let mut camera = Self {
            right,
            up,
            toward,
            centre: Vec3::zeros(),
            half: [1.0; 2],
            reach: 1.0,
        };
        let mut low = Vec3::repeat(f64::INFINITY);
        let mut high = Vec3::repeat(f64::NEG_INFINITY);
        for p in points {
            let q = camera.project(p);
            low = low.inf(&q);
            high = high.sup(&q);
        }
        if low.x <= high.x {
            let middle = (low + high) / 2.0;
            let half = (high - low) / 2.0;
            camera.centre = right * middle.x + up * middle.y + toward * middle.z;
            camera.half = [half.x.max(1e-9), half.y.max(1e-9)];
            camera.reach = half.norm().max(1e-9);
        }
        camera
    }

    /// Right, up and depth of a point relative to the middle of the picture, mm.
    pub fn project(&self, p: &Vec3) -> Vec3 {
        let d = p - self.centre;
        Vec3::new(self.right.dot(&d), self.up.dot(&d), self.toward.dot(&d))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_all_points_inside() {
        let points = [
            Vec3::zeros(),
            Vec3::new(100.0, 3.0, 7.0),
            Vec3::new(20.0, -50.0, 1.0),
        ];
        let camera = Camera::fit(&points);
        for p in &points {
            let q = camera.project(p);
            assert!(q.x.abs() <= camera.half[0] + 1e-9 && q.y.abs() <= camera.half[1] + 1e-9);
        }
        assert!((camera.right.cross(&camera.up) - camera.toward).norm() < 1e-12);
    }

    #[test]
    fn survives_no_points_and_nan() {
        assert_eq!(Camera::fit(&[]).reach, 1.0);
        assert!(Camera::fit(&[Vec3::repeat(f64::NAN), Vec3::zeros()]).reach > 0.0);
    }
}
