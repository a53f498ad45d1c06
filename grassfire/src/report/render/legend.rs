//! Colour maps and the scale that explains them.

use noto_sans_mono_bitmap::RasterHeight;

use super::Rgb;
use super::canvas::Canvas;

/// Colour maps that people with colour-vision deficiency can read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColourMap {
    /// Dark violet to yellow, evenly bright steps: sizes.
    Viridis,
    /// Blue over grey to red: signed differences around zero.
    BlueRed,
}

impl ColourMap {
    /// Colour at `t` of 0..=1; outside values are clamped, NaN is grey.
    pub fn at(self, t: f64) -> Rgb {
        if t.is_nan() {
            return [150, 150, 150];
        }
        let t = t.clamp(0.0, 1.0);
        let colour = match self {
            Self::Viridis => colorous::VIRIDIS.eval_continuous(t),
            Self::BlueRed => colorous::RED_BLUE.eval_continuous(1.0 - t),
        };
        [colour.r, colour.g, colour.b]
    }
}

/// A colour scale from `low` to `high`.
#[derive(Debug, Clone, PartialEq)]
pub struct Legend {
    /// What the colour means, with its unit.
    pub title: String,
    /// Value of the first colour.
    pub low: f64,
    /// Value of the last colour.
    pub high: f64,
    /// The colours.
    pub map: ColourMap,
}

const TEXT: Rgb = [60, 64, 70];
const BAR_WIDTH: i64 = 18;
const RIGHT_MARGIN: i64 = 106;

impl Legend {
    /// A scale over the middle 96 % of `values`, so that a few outliers do not wash out the rest; 0..1 when none is
    /// finite.
    pub fn spanning(title: &str, values: &[f64], map: ColourMap) -> Self {
        let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let pick = |share: f64| {
            sorted
                .get(((sorted.len().max(1) - 1) as f64 * share).round() as usize)
                .copied()
        };
        let low = pick(0.02).unwrap_or(0.0);
        let mut high = pick(0.98).unwrap_or(1.0);
        if high - low <= 1e-9 * high.abs().max(low.abs()) {
            high = low + low.abs().max(1.0) * 0.1;
        }
        Self {
            title: title.to_owned(),
            low,
            high,
            map,
        }
    }

    /// A scale from `-limit` to `limit`.
    pub fn symmetric(title: &str, limit: f64) -> Self {
        Self {
            title: title.to_owned(),
            low: -limit,
            high: limit,
            map: ColourMap::BlueRed,
        }
    }

    /// Colour of `value`.
    pub fn colour(&self, value: f64) -> Rgb {
        self.map.at((value - self.low) / (self.high - self.low))
    }

    pub(super) fn draw(&self, canvas: &mut Canvas) {
        let (width, height) = (canvas.width as i64, canvas.height as i64);
        let bar_height = height * 2 / 5;
        let (x, top) = (width - RIGHT_MARGIN - BAR_WIDTH, (height - bar_height) / 2);
        for row in 0..bar_height {
            let t = 1.0 - (row as f64 + 0.5) / bar_height as f64;
            canvas.fill(x, top + row, BAR_WIDTH, 1, self.map.at(t));
        }
        for value in ticks(self.low, self.high) {
            let t = (value - self.low) / (self.high - self.low);
            let y = top + ((1.0 - t) * (bar_height - 1) as f64).round() as i64;
            canvas.fill(x + BAR_WIDTH, y, 5, 1, TEXT);
            canvas.text(
                x + BAR_WIDTH + 9,
                y - 13,
                &tick_label(value, self.low, self.high),
                RasterHeight::Size24,
                TEXT,
            );
        }
        let title_x = (width - 16 - Canvas::text_width(&self.title, RasterHeight::Size24)).min(x);
        canvas.text(
            title_x.max(0),
            top - 44,
            &self.title,
            RasterHeight::Size24,
            TEXT,
        );
    }
}

/// Three to seven round values within `low..=high`.
fn ticks(low: f64, high: f64) -> Vec<f64> {
    let step = tick_step(low, high);
    if !step.is_finite() || step <= 0.0 {
        return Vec::new();
    }
    let first = (low / step - 1e-6).ceil();
    (0..12)
        .map(|n| (first + f64::from(n)) * step)
        .take_while(|v| *v <= high + 1e-6 * step)
        .collect()
}

fn tick_step(low: f64, high: f64) -> f64 {
    let rough = (high - low) / 4.0;
    let decade = 10f64.powf(rough.log10().floor());
    let factor = [1.0, 2.0, 2.5, 5.0, 10.0]
        .into_iter()
        .find(|f| f * decade >= rough * 0.999)
        .unwrap_or(10.0);
    factor * decade
}

fn tick_label(value: f64, low: f64, high: f64) -> String {
    let step = tick_step(low, high);
    let largest = low.abs().max(high.abs());
    if !(1e-4..1e6).contains(&largest) {
        return format!("{value:.1e}");
    }
    let mut decimals = (-step.log10().floor()).max(0.0) as usize;
    let scaled = step * 10f64.powi(decimals as i32);
    if (scaled - scaled.round()).abs() > 1e-6 {
        decimals += 1;
    }
    let value = if value.abs() < step * 1e-6 {
        0.0
    } else {
        value
    };
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        for (low, high) in [
            (0.0, 1.0),
            (-1.0, 1.0),
            (0.73, 9.2),
            (1234.0, 98765.0),
            (1e-7, 3e-7),
        ] {
            let values = ticks(low, high);
            assert!((3..=7).contains(&values.len()), "{low} {high}: {values:?}");
            assert!(
                values
                    .iter()
                    .all(|v| *v >= low - 1e-6 * (high - low) && *v <= high + 1e-6 * (high - low))
            );
        }
        assert_eq!(tick_label(0.25, 0.0, 1.0), "0.25");
        assert_eq!(tick_label(2.0, 0.0, 8.0), "2");
    }

    #[test]
    fn scale_ignores_nan_and_flat_data() {
        let legend = Legend::spanning("radius, mm", &[f64::NAN, 3.0, 3.0], ColourMap::Viridis);
        assert!(legend.high > legend.low);
        assert_eq!(legend.colour(f64::NAN), [150, 150, 150]);
        assert!(Legend::spanning("", &[], ColourMap::Viridis).high > 0.0);
    }
}
