//! Flat sections through voxel fields, coloured by value.

use super::canvas::Canvas;
use super::{Legend, MAX_SIZE, PictureSize, RenderError, Rgb};

/// A section: rows from the bottom, none outside the part.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Section {
    /// Values a row.
    pub width: usize,
    /// All values.
    pub values: Vec<Option<f64>>,
    /// Places to mark with a cross: column, row.
    pub marks: Vec<[f64; 2]>,
}

const PAPER: Rgb = [250, 250, 248];
const MARK: Rgb = [214, 40, 40];
/// Space for the colour scale on the right, pixels.
const SCALE: usize = 230;
const MARGIN: usize = 16;

/// Draws a section with its colour scale, as large as it fits, and gives the bytes of a PNG file.
///
/// # Errors
/// [`RenderError::Size`] when a side is below 16 or above [`MAX_SIZE`] pixels.
pub fn section(
    section: &Section,
    legend: &Legend,
    size: PictureSize,
) -> Result<Vec<u8>, RenderError> {
    let PictureSize { width, height } = size;
    if !(16..=MAX_SIZE).contains(&width) || !(16..=MAX_SIZE).contains(&height) {
        return Err(RenderError::Size { width, height });
    }
    let (width, height) = (width as usize, height as usize);
    let mut canvas = Canvas {
        width,
        height,
        pixels: vec![PAPER; width * height],
    };
    let columns = section.width.max(1);
    let rows = (section.values.len() / columns).max(1);
    let room = |side: usize, less: usize| side.saturating_sub(less + 2 * MARGIN).max(1) as f64;
    let scale = (room(width, SCALE) / columns as f64).min(room(height, 0) / rows as f64);
    let [w, h] = [columns, rows].map(|n| (n as f64 * scale) as usize);
    let left = MARGIN + (room(width, SCALE) as usize).saturating_sub(w) / 2;
    let top = MARGIN + (room(height, 0) as usize).saturating_sub(h) / 2;
    for y in 0..h {
        let row = rows - 1 - ((y as f64 / scale) as usize).min(rows - 1);
        for x in 0..w {
            let column = ((x as f64 / scale) as usize).min(columns - 1);
            if let Some(Some(value)) = section.values.get(row * columns + column) {
                canvas.fill(
                    (left + x) as i64,
                    (top + y) as i64,
                    1,
                    1,
                    legend.colour(*value),
                );
            }
        }
    }
    for [column, row] in &section.marks {
        let x = left as i64 + ((column + 0.5) * scale) as i64;
        let y = top as i64 + ((rows as f64 - row - 0.5) * scale) as i64;
        canvas.fill(x - 9, y - 1, 19, 3, MARK);
        canvas.fill(x - 1, y - 9, 3, 19, MARK);
    }
    legend.draw(&mut canvas);
    canvas.into_png()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::render::ColourMap;

    #[test]
    fn a_section_is_a_png_and_sizes_are_checked() {
        let values = (0..12).map(|n| (n != 5).then_some(f64::from(n)));
        let one = Section {
            width: 4,
            values: values.collect(),
            marks: vec![[1.0, 2.0]],
        };
        let legend = Legend::spanning("s", &[0.0, 11.0], ColourMap::Viridis);
        let png = section(&one, &legend, PictureSize::default()).expect("a picture");
        assert_eq!(&png[1..4], b"PNG");
        let none = PictureSize {
            width: 1,
            height: 1,
        };
        assert!(matches!(
            section(&one, &legend, none),
            Err(RenderError::Size { .. })
        ));
    }
}
