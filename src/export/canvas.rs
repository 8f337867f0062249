//! Text and plots on 8-bit pictures, with a built-in font.

use crate::error::{Error, Result};
use crate::export::picture::write_image;
use image::{Rgb, RgbImage};
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

/// Draws one line of grey text centred at (x, y).
pub fn draw_text(image: &mut RgbImage, text: &str, x: u32, y: u32, size: u32, grey: u8) {
    register_fonts();
    let dimensions = image.dimensions();
    let mut backend = BitMapBackend::with_buffer(image, dimensions);
    let style = (FONT, size)
        .into_font()
        .color(&RGBColor(grey, grey, grey))
        .pos(Pos::new(HPos::Center, VPos::Center))
        .into_text_style(&dimensions);
    // A picture without its text is still of use, so a failure is ignored.
    let _ = backend.draw_text(text, &style, (x as i32, y as i32));
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
    let mut image = RgbImage::from_pixel(size.0, size.1, Rgb([255; 3]));
    let area = BitMapBackend::with_buffer(&mut image, size).into_drawing_area();
    let drawn = draw(&area).and_then(|()| Ok(area.present()?));
    drawn.map_err(|error| Error::file(path, error, "nothing was written there"))?;
    drop(area);
    write_image(path, &image)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_leaves_marks() {
        let mut image = RgbImage::new(60, 20);
        draw_text(&mut image, "Ag 1", 30, 10, 14, 255);
        let lit = image.iter().filter(|&&b| b > 128).count();
        assert!(lit > 30, "{lit}");
    }
}
