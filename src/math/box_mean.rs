//! Means over square windows.

use rayon::prelude::*;

/// The mean of `values`, a picture of `shape` (width, height), over the pixels of the window of `radius` around each pixel that lie in
/// the picture. The cost does not depend on the radius.
pub fn box_mean(values: &[f32], shape: [usize; 2], radius: usize) -> Vec<f32> {
    let [width, height] = shape;
    let rows = along_rows(values, width, radius);
    // Sums over the rows of the window, for all columns at once.
    let mut sums = vec![0.0; width];
    let add = |sums: &mut [f64], y: usize, sign: f64| {
        let row = &rows[y * width..(y + 1) * width];
        for (sum, value) in sums.iter_mut().zip(row) {
            *sum += sign * f64::from(*value);
        }
    };
    for y in 0..radius.min(height) {
        add(&mut sums, y, 1.0);
    }
    let mut means = Vec::with_capacity(rows.len());
    for y in 0..height {
        if y + radius < height {
            add(&mut sums, y + radius, 1.0);
        }
        if y > radius {
            add(&mut sums, y - radius - 1, -1.0);
        }
        let count = (y + radius + 1).min(height) - y.saturating_sub(radius);
        means.extend(sums.iter().map(|sum| (sum / count as f64) as f32));
    }
    means
}

/// Means over `2 radius + 1` pixels of each row of `width`.
fn along_rows(values: &[f32], width: usize, radius: usize) -> Vec<f32> {
    let mut means = vec![0.0; values.len()];
    let rows = values.par_chunks(width.max(1));
    (means.par_chunks_mut(width.max(1)).zip(rows)).for_each(|(means, row)| {
        let mut sum: f64 = row.iter().take(radius).map(|&v| f64::from(v)).sum();
        for (x, mean) in means.iter_mut().enumerate() {
            if let Some(&enters) = row.get(x + radius) {
                sum += f64::from(enters);
            }
            if let Some(leaves) = x.checked_sub(radius + 1) {
                sum -= f64::from(row[leaves]);
            }
            let count = (x + radius + 1).min(row.len()) - x.saturating_sub(radius);
            *mean = (sum / count as f64) as f32;
        }
    });
    means
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_is_over_the_pixels_of_the_window_that_exist() {
        let shape = [7, 5];
        let values: Vec<f32> = (0..35).map(|i| ((i * 11) % 17) as f32).collect();
        for radius in [0, 1, 2, 9] {
            let means = box_mean(&values, shape, radius);
            for (i, mean) in means.iter().enumerate() {
                let near = |a: usize, b: usize| a.abs_diff(b) <= radius;
                let window: Vec<f32> = (0..35)
                    .filter(|j| near(j % 7, i % 7) && near(j / 7, i / 7))
                    .map(|j| values[j])
                    .collect();
                let truth = window.iter().sum::<f32>() / window.len() as f32;
                assert!((mean - truth).abs() < 1e-5, "{i} {radius}: {mean} {truth}");
            }
        }
        assert!(box_mean(&[], [0, 0], 3).is_empty());
    }
}
