//! Line plots as PNG, with linear or logarithmic axes, without system fonts.

use crate::error::Result;
use crate::export::canvas::{DrawError, FONT, PlotArea, write_plot};
use crate::export::heading::draw_heading;
use crate::export::scale::Scale;
use crate::inverse::solver::{LossPoint, Progress, Stage};
use plotters::prelude::{
    BLACK, ChartBuilder, Circle, Color, EmptyElement, IntoFont, LineSeries, PathElement, Polygon,
    RGBColor, Text, WHITE,
};
use plotters::style::TextStyle;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::path::Path;

/// Colours that most colour-blind readers can distinguish (Okabe and Ito 2008).
const COLORS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(80, 80, 80),
];

/// Width and height of a plot in pixels.
const SIZE: (u32, u32) = (960, 600);
/// Width of a letter of a mark's name, in pixels.
const LETTER: i32 = 8;
/// Width of a point's name, in pixels.
const LABEL: i32 = 100;

/// Label and scale of an axis.
#[derive(Debug, Clone, Default)]
pub struct Axis {
    /// Name and unit.
    pub label: String,
    /// Whether the scale is logarithmic; values ≤ 0 are then left out.
    pub logarithmic: bool,
}

/// How a series is drawn.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Draw {
    /// Straight lines between points, with dots if they are few.
    #[default]
    Line,
    /// Dots alone.
    Dots,
    /// A black staircase: each value holds until the next point.
    Steps,
}

/// One named curve.
#[derive(Debug, Clone, Default)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Points in drawing order.
    pub points: Vec<[f64; 2]>,
    /// Lower and upper end of each point's error, or empty.
    pub band: Vec<[f64; 2]>,
    /// How it is drawn.
    pub draw: Draw,
}

/// A plot of several curves.
#[derive(Debug, Clone, Default)]
pub struct Plot {
    /// Title above.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Curves, each in its own colour.
    pub series: Vec<Series>,
    /// Vertical lines with names.
    pub marks: Vec<(f64, String)>,
    /// Points with names.
    pub labels: Vec<([f64; 2], String)>,
}

/// The first row in which a name that starts at pixel `left` overlaps no other; `rows` holds the end of the last name in each.
fn row_for(rows: &mut Vec<i32>, left: i32, name: &str) -> i32 {
    let row = (rows.iter().position(|&end| end <= left)).unwrap_or_else(|| {
        rows.push(0);
        rows.len() - 1
    });
    rows[row] = left + width_of(name);
    row as i32
}

/// Width of a mark's name with a gap, in pixels.
fn width_of(name: &str) -> i32 {
    LETTER * (name.chars().count() as i32 + 2)
}

impl Plot {
    /// Draws the plot and writes it as a PNG. Leaves out points that are not finite.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_plot(path, SIZE, |area| self.draw(area))
    }

    fn draw(&self, area: &PlotArea<'_>) -> std::result::Result<(), DrawError> {
        let shown = |p: &[f64; 2]| self.x.shows(p[0]) && self.y.shows(p[1]);
        let all = || self.series.iter().flat_map(|s| &s.points);
        let ends = self.series.iter().flat_map(|s| s.band.iter().flatten());
        let xs = all().map(|p| p[0]).filter(|&v| self.x.shows(v));
        let ys = all().map(|p| p[1]).chain(ends.copied());
        let x_scale = Scale::around(xs, self.x.logarithmic);
        let y_scale = Scale::around(ys.filter(|&v| self.y.shows(v)), self.y.logarithmic);
        let (bottom, top) = (y_scale.low(), y_scale.high());

        let curves = self.series.iter().zip(COLORS.into_iter().cycle());
        let curves: Vec<(&Series, RGBColor)> = curves
            .map(|(series, color)| match series.draw {
                Draw::Steps => (series, BLACK),
                Draw::Line | Draw::Dots => (series, color),
            })
            .collect();
        let named = curves.iter().filter(|(series, _)| !series.name.is_empty());
        let named: Vec<_> = named
            .map(|(series, color)| (&*series.name, *color))
            .collect();
        let height = draw_heading(area, &self.title, &named)?;

        let mut chart = ChartBuilder::on(&area.split_vertically(height).1)
            .margin(14)
            .x_label_area_size(48)
            .y_label_area_size(80)
            .build_cartesian_2d(x_scale, y_scale)?;
        chart
            .configure_mesh()
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .label_style((FONT, 16))
            .axis_desc_style((FONT, 18))
            .light_line_style(WHITE)
            .bold_line_style(RGBColor(225, 225, 225))
            .draw()?;

        // Marks below the curves.
        let mut rows: Vec<i32> = Vec::new();
        for (x, name) in self.marks.iter().filter(|(x, _)| self.x.shows(*x)) {
            let line = vec![(*x, bottom), (*x, top)];
            chart.draw_series([PathElement::new(line, RGBColor(150, 150, 150))])?;
            let (left, _) = chart.backend_coord(&(*x, top));
            // Near the right edge, the name lies to the left of its line.
            let (text, start, side) = match left + width_of(name) > SIZE.0 as i32 {
                true => (format!("{name} "), left - width_of(name), HPos::Right),
                false => (format!(" {name}"), left, HPos::Left),
            };
            let row = row_for(&mut rows, start, name);
            let style = TextStyle::from((FONT, 14).into_font()).color(&RGBColor(110, 110, 110));
            let style = style.pos(Pos::new(side, VPos::Top));
            let text = Text::new(text, (0, 16 * row), style);
            chart.draw_series([EmptyElement::at((*x, top)) + text])?;
        }

        // Bands, curves, and dots.
        for (series, color) in curves {
            let banded = series.points.iter().zip(&series.band);
            let (lower, upper): (Vec<_>, Vec<_>) = banded
                .filter(|(p, band)| shown(p) && band.iter().all(|&v| self.y.shows(v)))
                .map(|(p, band)| ((p[0], band[0]), (p[0], band[1])))
                .unzip();
            if lower.len() > 1 {
                let outline: Vec<_> = lower.into_iter().chain(upper.into_iter().rev()).collect();
                chart.draw_series([Polygon::new(outline, color.mix(0.18).filled())])?;
            }
            let points = series.points.iter().filter(|p| shown(p));
            let points: Vec<(f64, f64)> = points.map(|p| (p[0], p[1])).collect();
            // Radius of the dots, points and width of the line.
            let (radius, line, width) = match series.draw {
                Draw::Line if points.len() <= 40 => (4, points.clone(), 2),
                Draw::Line => (0, points.clone(), 2),
                Draw::Dots => (2, Vec::new(), 2),
                Draw::Steps => (0, steps(&points), 1),
            };
            if radius > 0 {
                let dot = |&p: &(f64, f64)| Circle::new(p, radius, color.filled());
                chart.draw_series(points.iter().map(dot))?;
            }
            chart.draw_series(LineSeries::new(line, color.stroke_width(width)))?;
        }
        for (point, name) in self.labels.iter().filter(|(point, _)| shown(point)) {
            let at = (point[0], point[1]);
            chart.draw_series([Circle::new(at, 6, BLACK.stroke_width(2))])?;
            // Near the right edge, put the name to the left of its point.
            let near_edge = chart.backend_coord(&at).0 > SIZE.0 as i32 - LABEL;
            let (text, side) = match near_edge {
                true => (format!("{name}   "), HPos::Right),
                false => (format!("   {name}"), HPos::Left),
            };
            let style = TextStyle::from((FONT, 17).into_font()).color(&BLACK);
            let style = style.pos(Pos::new(side, VPos::Top));
            chart.draw_series([Text::new(text, at, style)])?;
        }
        Ok(())
    }
}

impl Series {
    /// A curve of straight lines between points.
    pub fn line(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self {
            name: name.into(),
            points: points.into_iter().collect(),
            ..Self::default()
        }
    }
}

impl Axis {
    /// A linear axis.
    pub fn linear(label: &str) -> Self {
        Self {
            label: label.to_owned(),
            logarithmic: false,
        }
    }

    /// A logarithmic axis.
    pub fn logarithmic(label: &str) -> Self {
        Self {
            label: label.to_owned(),
            logarithmic: true,
        }
    }

    /// Whether a value can be shown.
    fn shows(&self, value: f64) -> bool {
        value.is_finite() && (value > 0.0 || !self.logarithmic)
    }
}

/// Corners of the staircase through points in order: horizontal to the next point's x, then vertical.
fn steps(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let turns = points.windows(2).flat_map(|pair| {
        let [from, to] = [pair[0], pair[1]];
        [(to.0, from.1), to]
    });
    points.first().copied().into_iter().chain(turns).collect()
}

/// Loss of a solve over seconds, in the fit and on held-out pixels, and relative residuals of the fit and of textures, with the stages marked.
pub fn loss_plot(progress: &Progress) -> Plot {
    let curve = |name: &str, value: fn(&LossPoint) -> Option<f64>| {
        let points = progress.losses.iter();
        Series::line(name, points.filter_map(|p| Some([p.seconds, value(p)?])))
    };
    let mark = |stage: &Stage| (stage.ended - stage.seconds, stage.name.clone());
    let residuals = progress.fits.iter().map(|p| [p.seconds, p.residual]);
    let textures = progress.textures.iter().map(|p| [p.seconds, p.residual]);
    let series = [
        curve("in the fit", |p| p.train),
        curve("held out", |p| p.held_out),
        Series::line("residual, relative", residuals),
        Series {
            draw: Draw::Dots,
            ..Series::line("textures, relative", textures)
        },
    ];
    Plot {
        title: "Loss".to_owned(),
        x: Axis::linear("seconds"),
        y: Axis::logarithmic("mean absolute difference, radiance; residuals, relative"),
        series: (series.into_iter().filter(|s| !s.points.is_empty())).collect(),
        marks: progress.stages.iter().map(mark).collect(),
        labels: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draw(plot: &Plot) -> image::RgbImage {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("plot.png");
        plot.write(&path).expect("written");
        image::open(&path).expect("a PNG").to_rgb8()
    }

    /// The mean row of the pixels near a colour, in a range of columns.
    fn height_of(image: &image::RgbImage, color: RGBColor, columns: std::ops::Range<u32>) -> f64 {
        let rows: Vec<f64> = image
            .enumerate_pixels()
            .filter(|(x, _, p)| columns.contains(x) && p.0 == [color.0, color.1, color.2])
            .map(|(_, y, _)| f64::from(y))
            .collect();
        assert!(!rows.is_empty(), "the curve is drawn there");
        rows.iter().sum::<f64>() / rows.len() as f64
    }

    #[test]
    fn names_of_near_lines_lie_in_rows_of_their_own() {
        let mut rows = Vec::new();
        let lefts = [100, 105, 110, 400];
        let found = lefts.map(|left| row_for(&mut rows, left, "materials"));
        assert_eq!(found, [0, 1, 2, 0]);
    }

    #[test]
    fn a_power_law_is_a_straight_line_on_logarithmic_axes() {
        let points: Vec<[f64; 2]> = (0..=60)
            .map(|i| 10f64.powf(f64::from(i) * 0.05))
            .map(|x| [x, 3e-7 * x.powf(-0.5)])
            .collect();
        let image = draw(&Plot {
            x: Axis::logarithmic("samples"),
            y: Axis::logarithmic("error"),
            series: vec![Series::line("", points)],
            ..Default::default()
        });
        let [a, b, c] = [200, 400, 600].map(|x| height_of(&image, COLORS[0], x..x + 20));
        assert!(a < b && b < c, "it falls");
        assert!(((b - a) - (c - b)).abs() < 3.0, "{a} {b} {c}");
    }

    #[test]
    fn steps_are_level_up_to_the_next_point() {
        let corners = steps(&[(1.0, 8.0), (2.0, 4.0), (4.0, 1.0)]);
        let expected = [(1.0, 8.0), (2.0, 8.0), (2.0, 4.0), (4.0, 4.0), (4.0, 1.0)];
        assert_eq!(corners, expected);
        assert!(steps(&[]).is_empty());
    }

    #[test]
    fn hostile_values_are_left_out_and_an_empty_plot_is_still_a_picture() {
        draw(&Plot::default());
        let ys = [-1.0, f64::NAN, f64::INFINITY, 0.0];
        let mut odd: Vec<[f64; 2]> = (0..4).map(|i| [f64::from(i), ys[i as usize]]).collect();
        odd.push([f64::NAN, 1.0]);
        for y in [Axis::linear(""), Axis::logarithmic("")] {
            let series = Series {
                name: "odd".into(),
                points: odd.clone(),
                band: vec![[f64::NAN, 1.0]; 5],
                draw: Draw::Steps,
            };
            let plot = Plot {
                y,
                series: vec![series],
                marks: vec![(f64::NAN, "never".into()), (1e300, "far".into())],
                labels: vec![([f64::NAN, 1.0], "nowhere".into())],
                ..Default::default()
            };
            draw(&plot);
        }
    }

    #[test]
    fn the_loss_plot_shows_both_curves_and_leaves_out_what_was_not_measured() {
        let point = |i: u32, held_out| LossPoint {
            seconds: f64::from(i),
            iteration: u64::from(i),
            train: Some(0.5f64.powi(i as i32)),
            held_out,
        };
        let losses = [point(0, Some(1.0)), point(1, None), point(2, Some(0.5))];
        let plot = loss_plot(&Progress {
            losses: losses.to_vec(),
            ..Progress::default()
        });
        assert_eq!(plot.series[0].points.len(), 3);
        assert_eq!(plot.series[1].points, [[0.0, 1.0], [2.0, 0.5]]);
        let image = draw(&plot);
        assert!(height_of(&image, COLORS[1], 400..900) < height_of(&image, COLORS[0], 400..900));
    }
}
