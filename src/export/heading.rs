//! The line above a plot: its title, and the names of its curves where they hide none of them.

use crate::export::canvas::{DrawError, FONT, PlotArea};
use plotters::prelude::{BLACK, Color, IntoFont, IntoTextStyle, RGBColor, Rectangle, Text};

/// Distance of texts from the edges, in pixels.
const MARGIN: i32 = 14;
/// Height of a row of names, in pixels.
const ROW: i32 = 22;
/// Width of the bar that shows a curve's colour, and of the gap after it, in pixels.
const BAR: i32 = 18;
const GAP: i32 = 6;

/// Draws a title, and right of it each curve's name beside its colour, in as many rows as they need. Returns the height of all that in
/// pixels.
///
/// # Errors
/// It cannot be drawn.
pub fn draw_heading(
    area: &PlotArea<'_>,
    title: &str,
    curves: &[(&str, RGBColor)],
) -> std::result::Result<u32, DrawError> {
    let size = area.dim_in_pixel();
    let caption = (FONT, 24).into_font().color(&BLACK);
    let (width, _) = area.estimate_text_size(title, &caption)?;
    area.draw(&Text::new(title, (MARGIN, MARGIN), caption))?;

    let start = MARGIN + width as i32 + 2 * ROW;
    let (mut left, mut top) = (start, MARGIN);
    for (name, color) in curves {
        let style = (FONT, 16).into_text_style(&size);
        let (width, _) = area.estimate_text_size(name, &style)?;
        let right = left + BAR + GAP + width as i32;
        if right > size.0 as i32 - MARGIN && left > start {
            top += ROW;
            left = start;
        }
        let middle = top + ROW / 2;
        let bar = [(left, middle - 2), (left + BAR, middle + 2)];
        area.draw(&Rectangle::new(bar, color.filled()))?;
        area.draw(&Text::new(*name, (left + BAR + GAP, top + 2), style))?;
        left += BAR + GAP + width as i32 + ROW;
    }
    Ok((top + ROW + GAP) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::canvas::write_plot;

    #[test]
    fn names_that_do_not_fit_beside_the_title_take_further_rows() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("heading.png");
        let red = RGBColor(255, 0, 0);
        let height = |names: usize| {
            let mut height = 0;
            write_plot(&path, (300, 200), |area| {
                height = draw_heading(area, "Loss", &vec![("held out", red); names])?;
                Ok(())
            })
            .expect("written");
            let image = image::open(&path).expect("a PNG").to_rgb8();
            let rows: Vec<u32> = (image.enumerate_pixels())
                .filter(|(.., pixel)| pixel.0 == [255, 0, 0])
                .map(|(_, y, _)| y)
                .collect();
            let bars = rows.len() as i32 / (BAR * 4);
            (height, bars, rows.iter().all(|y| *y < height))
        };
        let one = height(1);
        assert_eq!(one, ((MARGIN + ROW + GAP) as u32, 1, true));
        assert_eq!(height(5), (one.0 + 2 * ROW as u32, 5, true));
    }
}
