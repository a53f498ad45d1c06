//! Pictures of parts: a small software renderer, no window and no graphics card needed.
//!
//! 1. A [`Scene`] holds meshes, lines and spheres in millimetres.
//! 2. [`Camera::fit`] looks at a part from one of a few isometric directions; use the same camera for all
//!    pictures of a part so that they can be compared.
//! 3. [`render`] rasterises with a depth buffer at twice the size in both directions, shades with two lights and
//!    ambient occlusion, draws outlines, and averages down.
//! 4. [`pictures`] has the ready-made views of every stage.
//!
//! Orthographic, opaque surfaces only.

mod camera;
mod canvas;
pub mod conditions;
pub mod findings;
mod finish;
mod legend;
pub mod pictures;
mod raster;
mod scene;
pub mod section;

pub use camera::Camera;
pub use legend::{ColourMap, Legend};
pub use scene::{Colours, Rgb, Scene, SceneLabel, SceneLine, SceneMesh, SceneSphere, Shading};

use canvas::Canvas;

/// Why a picture could not be made.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The size asked for is zero or beyond [`MAX_SIZE`].
    #[error("a picture of {width} x {height} pixels is outside 16..={MAX_SIZE}")]
    Size {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// The PNG encoder failed.
    #[error("writing the PNG failed")]
    Png(#[from] png::EncodingError),
}

/// Largest width or height of a picture, pixels.
pub const MAX_SIZE: u32 = 4096;

/// Size of a picture, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PictureSize {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

impl Default for PictureSize {
    fn default() -> Self {
        Self {
            width: 1000,
            height: 750,
        }
    }
}

/// Draws `scene` seen by `camera` and returns the bytes of a PNG file.
///
/// # Errors
/// [`RenderError::Size`] when a side is below 16 or above [`MAX_SIZE`] pixels.
pub fn render(scene: &Scene, camera: &Camera, size: PictureSize) -> Result<Vec<u8>, RenderError> {
    let PictureSize { width, height } = size;
    if !(16..=MAX_SIZE).contains(&width) || !(16..=MAX_SIZE).contains(&height) {
        return Err(RenderError::Size { width, height });
    }
    let image = raster::draw(scene, camera, width as usize, height as usize);
    let mut canvas = Canvas {
        width: width as usize,
        height: height as usize,
        pixels: image,
    };
    for label in &scene.labels {
        let [x, y] = raster::pixel(&label.place, camera, width as usize, height as usize);
        canvas.tag(x as i64, y as i64, &label.text);
    }
    if let Some(legend) = &scene.legend {
        legend.draw(&mut canvas);
    }
    canvas.into_png()
}
