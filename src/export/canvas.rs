//! An 8-bit picture for drawing text and pictures, with a built-in font.

use crate::error::{Error, Result};
use crate::export::picture::write_png_bytes;
use plotters::coord::Shift;
use plotters::prelude::{
    BitMapBackend, DrawingArea, DrawingBackend, FontStyle, IntoDrawingArea, IntoFont, RGBColor,
};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{IntoTextStyle, register_font};
use std::path::Path;
use std::sync::Once;

/// What plotters draws into.
pub type PlotArea<'a> = DrawingArea<BitMapBackend<'a>, Shift>;

/// Name under which plotters finds the built-in font.
pub const FONT: &str = "sans-serif";

/// Registers the built-in font with plotters, so that no system font is needed.
pub fn register_fonts() {
    static REGISTERED: Once = Once::new();
    REGISTERED.call_once(|| {
        for style in [FontStyle::Normal, FontStyle::Bold] {
            // The compiled-in font always parses; if it did not, plots would lack text.
            let _ = register_font(FONT, style, epaint_default_fonts::UBUNTU_LIGHT);
        }
    });
}

/// An 8-bit sRGB picture to draw on.
#[derive(Debug, Clone)]
pub struct Canvas {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Three bytes a pixel, row by row from the top left.
    pub bytes: Vec<u8>,
}

impl Canvas {
    /// A canvas of one colour.
    pub fn new(width: u32, height: u32, color: [u8; 3]) -> Self {
        Self {
            width,
            height,
            bytes: color.repeat(width as usize * height as usize),
        }
    }

    /// Writes the canvas as a PNG.
    ///
    /// # Errors
    /// The file cannot be written, or the canvas has no pixels.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_png_bytes(path, self.width, self.height, &self.bytes)
    }

    /// Copies sRGB bytes of a picture `width` pixels wide, with its top-left corner at (x, y). Clips what falls outside.
    pub fn paste(&mut self, bytes: &[u8], width: u32, x: u32, y: u32) {
        if width == 0 || x >= self.width {
            return;
        }
        let visible = width.min(self.width - x) as usize * 3;
        let rows = bytes.chunks_exact(width as usize * 3);
        let start = (y as usize * self.width as usize + x as usize) * 3;
        for (row, line) in rows.zip(0..self.height.saturating_sub(y) as usize) {
            let at = start + line * self.width as usize * 3;
            self.bytes[at..at + visible].copy_from_slice(&row[..visible]);
        }
    }

    /// Fills a rectangle.
    pub fn fill(&mut self, x: u32, y: u32, width: u32, height: u32, color: [u8; 3]) {
        let bytes = color.repeat(width as usize * height as usize);
        self.paste(&bytes, width, x, y);
    }

    /// Draws one line of text centred at (x, y).
    pub fn text(&mut self, text: &str, x: u32, y: u32, size: u32, color: [u8; 3]) {
        register_fonts();
        let [r, g, b] = color;
        let dimensions = (self.width, self.height);
        let mut backend = BitMapBackend::with_buffer(&mut self.bytes, dimensions);
        let style = (FONT, size)
            .into_font()
            .color(&RGBColor(r, g, b))
            .pos(Pos::new(HPos::Center, VPos::Center))
            .into_text_style(&dimensions);
        // A picture without its text is still of use, so a failure is ignored.
        let _ = backend.draw_text(text, &style, (x as i32, y as i32));
    }
}

/// Why a plot could not be drawn.
pub type DrawError = Box<dyn std::error::Error>;

/// Writes a PNG of a size that plotters draws into; it begins white.
///
/// # Errors
/// It cannot be drawn, or the file cannot be written.
pub fn write_plot(
    path: &Path,
    size: (u32, u32),
    draw: impl FnOnce(&PlotArea<'_>) -> std::result::Result<(), DrawError>,
) -> Result<()> {
    register_fonts();
    let mut canvas = Canvas::new(size.0, size.1, [255; 3]);
    let area = BitMapBackend::with_buffer(&mut canvas.bytes, size).into_drawing_area();
    let drawn = draw(&area).and_then(|()| Ok(area.present()?));
    drawn.map_err(|error| Error::file(path, error, "nothing was written there"))?;
    drop(area);
    canvas.write(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_leaves_marks_and_pictures_are_clipped() {
        let mut canvas = Canvas::new(60, 20, [0; 3]);
        canvas.text("Ag 1", 30, 10, 14, [255; 3]);
        let lit = canvas.bytes.iter().filter(|&&b| b > 128).count();
        assert!(lit > 30, "{lit}");
        canvas.paste(&[7; 4 * 4 * 3], 4, 58, 18);
        assert_eq!(canvas.bytes[canvas.bytes.len() - 6..], [7; 6]);
        canvas.paste(&[9; 3], 1, 60, 0);
        canvas.paste(&[9; 3], 1, 0, 20);
        assert!(!canvas.bytes.contains(&9));
    }
}
