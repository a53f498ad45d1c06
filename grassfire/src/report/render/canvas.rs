//! Finished pixels: filled boxes, text and the PNG encoder.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use super::{RenderError, Rgb};

/// An opaque picture, rows from the top.
pub(super) struct Canvas {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<Rgb>,
}

impl Canvas {
    /// Fills the box from (x, y) on; what lies outside the picture is left out.
    pub fn fill(&mut self, x: i64, y: i64, width: i64, height: i64, colour: Rgb) {
        for row in y..y + height {
            for column in x..x + width {
                self.blend(column, row, colour, 255);
            }
        }
    }

    /// Writes `text` with its top left corner at (x, y); characters without a picture become `?`.
    pub fn text(&mut self, x: i64, y: i64, text: &str, size: RasterHeight, colour: Rgb) {
        let advance = get_raster_width(FontWeight::Regular, size) as i64;
        for (n, c) in text.chars().enumerate() {
            let glyph = get_raster(c, FontWeight::Regular, size)
                .or_else(|| get_raster('?', FontWeight::Regular, size));
            let Some(glyph) = glyph else { continue };
            for (row, line) in glyph.rows().enumerate() {
                for (column, &alpha) in line.iter().enumerate() {
                    self.blend(
                        x + n as i64 * advance + column as i64,
                        y + row as i64,
                        colour,
                        alpha,
                    );
                }
            }
        }
    }

    /// Writes `text` white in a red box around (x, y).
    pub fn tag(&mut self, x: i64, y: i64, text: &str) {
        const SIZE: RasterHeight = RasterHeight::Size24;
        const BOX: Rgb = [198, 40, 40];
        let (width, height) = (Self::text_width(text, SIZE), SIZE.val() as i64);
        let (left, top) = (x - width / 2, y - height / 2);
        self.fill(left - 3, top, width + 6, height, BOX);
        self.text(left, top, text, SIZE, [255; 3]);
    }

    /// Width of `text`, pixels.
    pub fn text_width(text: &str, size: RasterHeight) -> i64 {
        (text.chars().count() * get_raster_width(FontWeight::Regular, size)) as i64
    }

    fn blend(&mut self, x: i64, y: i64, colour: Rgb, alpha: u8) {
        if x < 0 || y < 0 || x >= self.width as i64 || y >= self.height as i64 {
            return;
        }
        let pixel = &mut self.pixels[y as usize * self.width + x as usize];
        for (old, new) in pixel.iter_mut().zip(colour) {
            let mix =
                u32::from(*old) * (255 - u32::from(alpha)) + u32::from(new) * u32::from(alpha);
            *old = ((mix + 127) / 255) as u8;
        }
    }

    /// Encodes as an 8-bit RGB PNG.
    pub fn into_png(self) -> Result<Vec<u8>, RenderError> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Balanced);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(self.pixels.as_flattened())?;
        writer.finish()?;
        Ok(bytes)
    }
}
