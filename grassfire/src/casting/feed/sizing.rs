//! How large a feeder and its neck must be.

use std::f64::consts::PI;

use serde::Serialize;

/// Modulus of the neck and of the feeder over that of the section they feed: 1.1 and 1.2 (steel in sand). To be quoted
/// as foundry practice.
pub const NECK: f64 = 1.1;
/// See [`NECK`].
pub const FEEDER: f64 = 1.2;

/// What a feeder has to feed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct FeedZone {
    /// Metal of the zone, mm3.
    pub volume: f64,
    /// Length, mm.
    pub length: f64,
    /// Width, mm.
    pub width: f64,
    /// Mean thickness, mm.
    pub thickness: f64,
    /// Modulus where the feeder stands, mm.
    pub modulus: f64,
}

/// A cylinder as high as it is wide on a round neck.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct FeederSize {
    /// Diameter and height, mm.
    pub diameter: f64,
    /// Diameter of the neck, mm.
    pub neck: f64,
    /// Volume of the feeder, mm3.
    pub volume: f64,
    /// The volume, not the modulus, decided.
    pub by_volume: bool,
}

/// The smallest feeder that solidifies last and holds enough metal.
///
/// 1. Modulus: feeder 1.2, neck 1.1 times that of the section. A cylinder of equal height and diameter D that cools all
///    around has the modulus D / 6, a long round neck D / 4.
/// 2. Volume: `V_F = 2.51 V_C SF^-0.74` with the shape factor `SF = (L + W) / T` of the zone, a fit to the feeder volumes
///    of the Steel Founders' Society of America.
///
/// The larger diameter counts. Lengths in mm; a zone without volume gets the feeder that its modulus asks for.
pub fn feeder_size(zone: &FeedZone) -> FeederSize {
    let by_modulus = 6.0 * FEEDER * zone.modulus;
    let shape = (zone.length + zone.width) / zone.thickness.max(1e-9);
    // The fit was made for shapes from a cube (2) on.
    let volume = 2.51 * zone.volume * shape.max(2.0).powf(-0.74);
    let by_volume = (4.0 * volume / PI).cbrt();
    let diameter = by_modulus.max(by_volume);
    FeederSize {
        diameter,
        neck: 4.0 * NECK * zone.modulus,
        volume: PI / 4.0 * diameter.powi(3),
        by_volume: by_volume > by_modulus,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modulus_rules_chunky_zones_and_volume_none_is_too_small() {
        let cube = FeedZone {
            volume: 100.0_f64.powi(3),
            length: 100.0,
            width: 100.0,
            thickness: 100.0,
            modulus: 100.0 / 6.0,
        };
        let size = feeder_size(&cube);
        assert!(size.diameter / 6.0 >= 1.2 * cube.modulus - 1e-9);
        // 2.51 * 2^-0.74 = 1.503 times the volume of the cube.
        assert!(size.by_volume && (size.volume / cube.volume - 1.503).abs() < 1e-3);
        let plate = FeedZone {
            volume: 200.0 * 200.0 * 5.0,
            length: 200.0,
            width: 200.0,
            thickness: 5.0,
            modulus: 20.0,
        };
        let size = feeder_size(&plate);
        assert!(!size.by_volume && (size.diameter - 144.0).abs() < 1e-9);
        assert!((size.neck - 88.0).abs() < 1e-9);
    }
}
