//! Courses of several kinds of solves over several seeds, as tables, plots and comparisons.

use crate::error::Result;
use crate::export::plot::{Axis, Draw, Plot, Series};
use crate::export::table::Table;
use crate::math::stats::Moments;
use crate::study::experiments::course::{Errors, Mark};
use crate::study::experiments::study::{Bench, brief};

/// Courses of one kind of solve, one for each seed.
#[derive(Debug, Clone)]
pub struct Kind {
    pub name: String,
    /// One course for each seed, in order of seeds from 1.
    pub courses: Vec<Vec<Mark>>,
}

/// Mean and spread of an error over seeds.
#[derive(Debug, Clone, Copy)]
pub struct Spread {
    /// Geometric mean.
    pub mean: f64,
    /// Standard deviation between seeds, as a factor.
    pub factor: f64,
    pub count: u64,
}

pub type Quantity = fn(&Errors) -> Option<f64>;

/// Label of a plot's horizontal axis, and what it shows of a mark.
pub type Over = (&'static str, fn(&Mark) -> f64);
pub const RAYS: Over = ("rays", |mark| mark.rays as f64);
pub const SECONDS: Over = ("seconds", |mark| mark.seconds);

/// Label of a plot's vertical axis, and the error that it shows.
pub type Shown = (&'static str, Quantity);
pub const LOSS: Shown = ("held-out l1 loss, radiance", |errors| errors.loss);
pub const ALBEDO: Shown = ("mean absolute error of albedo", |errors| errors.albedo);

impl Spread {
    /// Over positive values; `None` without any.
    pub fn over(values: impl Iterator<Item = f64>) -> Option<Self> {
        let known = values.filter(|value| value.is_finite() && *value > 0.0);
        let moments: Moments = known.map(f64::ln).collect();
        (moments.count > 0).then(|| Self {
            mean: moments.mean.exp(),
            factor: moments.variance().sqrt().exp(),
            count: moments.count,
        })
    }

    /// Mean ± one standard deviation.
    pub fn band(&self) -> [f64; 2] {
        [self.mean / self.factor, self.mean * self.factor]
    }

    /// Whether two means differ by more than two standard errors. False if either has one seed, whose noise is unknown.
    pub fn differs(&self, other: &Self) -> bool {
        if self.count.min(other.count) < 2 {
            return false;
        }
        let squared = |s: &Self| s.factor.ln().powi(2) / s.count as f64;
        let error = (squared(self) + squared(other)).sqrt();
        (self.mean / other.mean).ln().abs() > 2.0 * error
    }

    /// As text: "0.0123 (×/÷ 1.05)", without the factor for a single seed.
    pub fn words(&self) -> String {
        match self.count {
            1 => brief(self.mean),
            _ => format!("{} (×/÷ {:.2})", brief(self.mean), self.factor),
        }
    }
}

/// How errors over seeds are compared: a sentence that ends with a space.
pub fn comparison(seeds: u64) -> &'static str {
    match seeds {
        0 | 1 => "One seed tells nothing of the noise: no two errors are said to differ. ",
        _ => {
            "Errors are geometric means over seeds, with one deviation between seeds as a factor; two are said to differ where \
             they are more than two standard errors apart. "
        }
    }
}

/// A spread as text; a dash if there is none.
pub fn words(spread: Option<Spread>) -> String {
    spread.map_or("-".to_owned(), |spread| spread.words())
}

/// Runs a course of each kind and seed in turn, and shows the plot so far after each. Fails if the study is stopped.
pub fn run(
    bench: &Bench,
    names: impl IntoIterator<Item = String>,
    course: impl Fn(usize, u64) -> Vec<Mark>,
    plot: impl Fn(&[Kind]) -> Plot,
) -> Result<Vec<Kind>> {
    let mut kinds: Vec<Kind> = Vec::new();
    for (index, name) in names.into_iter().enumerate() {
        kinds.push(Kind {
            name: name.clone(),
            courses: Vec::new(),
        });
        for seed in bench.seeds() {
            bench.begin(&format!("{name}, seed {seed}"))?;
            kinds[index].courses.push(course(index, seed));
            (bench.show)(plot(&kinds));
        }
    }
    bench.go_on()?;
    Ok(kinds)
}

/// The last mark that every course has passed; `None` if one has passed none.
pub fn common_mark<'a>(kinds: impl IntoIterator<Item = &'a Kind>) -> Option<u32> {
    let ends = kinds.into_iter().flat_map(|kind| &kind.courses);
    ends.map(|course| course.last().and_then(|mark| mark.index))
        .min()
        .flatten()
}

impl Kind {
    /// An error over seeds at a mark; `None` without a mark.
    pub fn at_mark(&self, mark: Option<u32>, quantity: Quantity) -> Option<Spread> {
        let mark = Some(mark?);
        let values = self.courses.iter().filter_map(|course| {
            let passed = course.iter().find(|m| m.index >= mark)?;
            quantity(&passed.errors)
        });
        Spread::over(values)
    }

    /// An error over seeds at the ends of the courses.
    pub fn at_end(&self, quantity: Quantity) -> Option<Spread> {
        let ends = self.courses.iter().filter_map(|course| course.last());
        Spread::over(ends.filter_map(|mark| quantity(&mark.errors)))
    }

    /// Mean over seeds of a count at the ends of the courses.
    pub fn mean_end(&self, count: fn(&Mark) -> f64) -> f64 {
        let ends = self.courses.iter().filter_map(|course| course.last());
        ends.map(count).sum::<f64>() / self.courses.len().max(1) as f64
    }

    /// Mean error and spread at the marks, over `x`.
    fn series(&self, x: fn(&Mark) -> f64, quantity: Quantity) -> Series {
        let last = self.courses.iter().filter_map(|c| c.last()?.index).max();
        let means = (0..=last.unwrap_or(0)).filter_map(|index| {
            let here: Vec<&Mark> = (self.courses.iter())
                .filter_map(|course| course.iter().find(|m| m.index == Some(index)))
                .collect();
            let spread = Spread::over(here.iter().filter_map(|mark| quantity(&mark.errors)))?;
            let place = here.iter().map(|mark| x(mark)).sum::<f64>() / here.len() as f64;
            Some((place, spread))
        });
        curve(&self.name, means)
    }
}

/// A curve of means, with their deviations between seeds as its band.
pub fn curve(name: &str, means: impl Iterator<Item = (f64, Spread)>) -> Series {
    let (points, band) = means
        .map(|(x, spread)| ([x, spread.mean], spread.band()))
        .unzip();
    Series {
        name: name.to_owned(),
        points,
        band,
        ..Series::default()
    }
}

/// A plot of mean courses over rays or seconds, with the transport cache's ends as dots.
pub fn plot(
    title: &str,
    (x_label, x): Over,
    (y_label, quantity): Shown,
    kinds: &[Kind],
    cache: &[Mark],
) -> Plot {
    let mut series: Vec<Series> = kinds.iter().map(|kind| kind.series(x, quantity)).collect();
    series.retain(|series| !series.points.is_empty());
    let ends: Vec<[f64; 2]> = (cache.iter())
        .filter_map(|mark| Some([x(mark), quantity(&mark.errors)?]))
        .collect();
    // A ring without a label; the legend names it.
    let labels = ends.iter().map(|&end| (end, String::new())).collect();
    series.push(Series {
        draw: Draw::Dots,
        ..Series::line("transport cache, ends", ends)
    });
    Plot {
        title: title.to_owned(),
        x: Axis::logarithmic(x_label),
        y: Axis::logarithmic(y_label),
        series,
        labels,
        ..Plot::default()
    }
}

/// All marks of all courses and the transport cache's ends, a row each.
pub fn table(axis: &str, kinds: &[Kind], cache: &[Mark]) -> Table {
    let columns = "seed,mark,rays,seconds,steps,loss,albedo_error,emission_error";
    let mut table = Table::new(&format!("{axis},{columns}"));
    let mut add = |name: &str, seed: usize, mark: &Mark| {
        table.row((
            name,
            seed,
            mark.index,
            mark.rays,
            mark.seconds,
            mark.steps,
            mark.errors.loss,
            mark.errors.albedo,
            mark.errors.emission,
        ));
    };
    for kind in kinds {
        for (seed, course) in (1..).zip(&kind.courses) {
            course.iter().for_each(|mark| add(&kind.name, seed, mark));
        }
    }
    for (seed, mark) in (1..).zip(cache) {
        add("transport cache", seed, mark);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_is_geometric_and_differences_are_measured_against_it() {
        let spread = |values: &[f64]| Spread::over(values.iter().copied()).expect("values");
        let wide = spread(&[0.5, 2.0]);
        assert!((wide.mean - 1.0).abs() < 1e-12);
        assert!((wide.factor - (2f64.ln() * 2f64.sqrt()).exp()).abs() < 1e-12);
        assert!(!wide.differs(&spread(&[1.5, 1.6])));
        assert!(spread(&[1.0, 1.01]).differs(&spread(&[1.5, 1.51])));
        // The noise of a single value is unknown.
        assert!(!spread(&[1.0]).differs(&spread(&[9.0, 9.01])));
        assert_eq!(spread(&[0.25]).words(), "0.250");
        assert!(Spread::over([f64::NAN, 0.0].into_iter()).is_none());
    }
}
