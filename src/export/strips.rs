//! Strip plots as PNG: the values of named rows as dots, in two panels side by side.

use crate::error::Result;
use crate::export::canvas::{DrawError, FONT, PlotArea, write_plot};
use crate::export::scale::Scale;
use crate::math::stats::quantile;
use plotters::prelude::{BLACK, ChartBuilder, Circle, Color, PathElement, RGBColor, Text, WHITE};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{IntoFont, TextStyle};
use std::path::Path;

const DOT: RGBColor = RGBColor(0, 114, 178);
const MARK: RGBColor = RGBColor(213, 94, 0);
const GRID: RGBColor = RGBColor(225, 225, 225);

/// Width of the picture in pixels.
const WIDTH: u32 = 1200;
/// Width of the column of row names in pixels.
const NAMES: i32 = 110;
/// Height of a row in pixels.
const ROW: u32 = 44;
/// Height of title, axis and margins in pixels.
const FRAME: u32 = 130;

/// A strip plot.
#[derive(Debug, Clone)]
pub struct Strips {
    /// Title above.
    pub title: String,
    /// Names of the rows, from the top.
    pub rows: Vec<String>,
    /// Left and right panel.
    pub panels: [Panel; 2],
}

/// One quantity for all rows.
#[derive(Debug, Clone, Default)]
pub struct Panel {
    /// Label of the axis.
    pub label: String,
    /// Whether the scale is logarithmic; values ≤ 0 are then left out.
    pub logarithmic: bool,
    /// The values of each row.
    pub values: Vec<Vec<f64>>,
    /// A reference value, drawn as a vertical line.
    pub mark: Option<f64>,
}

impl Strips {
    /// Draws the plot and writes it as a PNG. Leaves out values that are not finite.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let height = FRAME + ROW * self.rows.len().max(1) as u32;
        write_plot(path, (WIDTH, height), |area| {
            let area = area.titled(&self.title, (FONT, 22))?;
            let (left, right) = area.split_horizontally((WIDTH as i32 + NAMES) / 2);
            self.panels[0].draw(&left, &self.rows, NAMES)?;
            self.panels[1].draw(&right, &self.rows, 16)
        })
    }
}

impl Panel {
    fn draw(
        &self,
        area: &PlotArea<'_>,
        rows: &[String],
        names: i32,
    ) -> std::result::Result<(), DrawError> {
        let shows = |v: &f64| v.is_finite() && (*v > 0.0 || !self.logarithmic);
        let all = self.values.iter().flatten().copied().chain(self.mark);
        let scale = Scale::around(all.filter(shows), self.logarithmic);
        let (low, high) = (scale.low(), scale.high());
        let count = rows.len().max(1) as f64;
        let mut chart = ChartBuilder::on(area)
            .margin(10)
            .margin_left(names)
            .x_label_area_size(50)
            .build_cartesian_2d(scale, count..0.0)?;
        chart
            .configure_mesh()
            .disable_y_mesh()
            .x_desc(&self.label)
            .label_style((FONT, 15))
            .axis_desc_style((FONT, 17))
            .light_line_style(WHITE)
            .bold_line_style(GRID)
            .draw()?;
        let line = |x: f64, y: [f64; 2]| vec![(x, y[0]), (x, y[1])];
        if let Some(mark) = self.mark.filter(shows) {
            let style = MARK.stroke_width(2);
            chart.draw_series([PathElement::new(line(mark, [0.0, count]), style)])?;
        }
        for (row, values) in self.values.iter().enumerate() {
            let y = row as f64 + 0.5;
            let below = [low, high].map(|x| (x, row as f64 + 1.0));
            chart.draw_series([PathElement::new(below, GRID)])?;
            let mut shown: Vec<f64> = values.iter().copied().filter(shows).collect();
            let dots = shown
                .iter()
                .map(|&x| Circle::new((x, y), 4, DOT.mix(0.55).filled()));
            chart.draw_series(dots)?;
            if let Some(median) = quantile(&mut shown, 0.5) {
                let style = BLACK.stroke_width(3);
                let bar = line(median, [y - 0.3, y + 0.3]);
                chart.draw_series([PathElement::new(bar, style)])?;
            }
        }
        // Only the left panel has row names.
        if names >= NAMES {
            for (row, name) in rows.iter().enumerate() {
                let (_, y) = chart.backend_coord(&(low, row as f64 + 0.5));
                let style = TextStyle::from((FONT, 17).into_font()).color(&BLACK);
                let style = style.pos(Pos::new(HPos::Right, VPos::Center));
                let top = area.get_base_pixel().1;
                area.draw(&Text::new(name.as_str(), (names - 2, y - top), style))?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_numbers_stand_further_right_and_hostile_ones_are_left_out() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("strips.png");
        let middle = |value: f64| {
            let panel = Panel {
                logarithmic: true,
                values: vec![vec![0.01, 1.0], vec![value], vec![f64::NAN, -1.0]],
                ..Panel::default()
            };
            let strips = Strips {
                title: "title".into(),
                rows: ["a", "b", "c"].map(String::from).to_vec(),
                panels: [panel.clone(), panel],
            };
            strips.write(&path).expect("written");
            let image = image::open(&path).expect("a PNG").to_rgb8();
            // The black bar of the second row's median in the left panel.
            let y = image.height() / 2 - 10;
            let black = (150..600).filter(|&x| image.get_pixel(x, y).0 == [0; 3]);
            let places: Vec<u32> = black.collect();
            places.iter().sum::<u32>() / places.len().max(1) as u32
        };
        let [low, high] = [0.03, 0.3].map(middle);
        assert!(low > 150 && low + 50 < high, "{low} {high}");
        let empty = Strips {
            title: String::new(),
            rows: Vec::new(),
            panels: [Panel::default(), Panel::default()],
        };
        empty.write(&path).expect("written");
    }
}
