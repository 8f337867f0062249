//! The paper's experiments in their quick form: every file is there, complete, and says what it must.

use relit::study::experiments::{Bench, Findings, STUDIES, Study};
use std::collections::BTreeSet;
use std::fs;
use std::time::Duration;

fn study(name: &str) -> &'static Study {
    let found = STUDIES.iter().find(|study| study.name == name);
    found.expect("a study of that name")
}

fn quick(name: &str) -> Findings {
    let bench = Bench {
        quick: true,
        time: Duration::from_secs(1),
        seeds: 2,
        subject: None,
        say: &|_| {},
    };
    study(name).run(&bench).expect("runs")
}

/// Rows of a table by column name, after the files were written and looked at.
fn rows(name: &str, findings: &Findings, suffix: &str) -> Vec<Vec<String>> {
    let folder = tempfile::tempdir().expect("temporary folder");
    let written = findings.write(study(name), folder.path()).expect("written");
    let expected = findings.tables.len() + findings.plots.len() + 1;
    assert_eq!(written.len(), expected);
    assert_eq!(written.iter().collect::<BTreeSet<_>>().len(), expected);
    for path in &written {
        assert!(path.metadata().expect("there").len() > 50, "{path:?}");
    }
    let words = fs::read_to_string(folder.path().join(format!("{name}.md"))).expect("written");
    for part in [name, "## Seen", ".csv", ".png"] {
        assert!(words.contains(part), "{part}: {words}");
    }
    assert!(
        !findings.seen.is_empty() && !words.contains("NaN"),
        "{words}"
    );
    let path = folder.path().join(format!("{name}{suffix}.csv"));
    let text = fs::read_to_string(path).expect("written");
    // Commas between quotes part no cells.
    let cells = |line: &str| -> Vec<String> {
        let parts = line.split('"').enumerate();
        let marked = parts.map(|(i, part)| {
            if i % 2 == 0 {
                part.replace(',', "\n")
            } else {
                part.to_owned()
            }
        });
        marked
            .collect::<String>()
            .split('\n')
            .map(str::to_owned)
            .collect()
    };
    text.lines().map(cells).collect()
}

/// The values of a column, as text.
fn column(rows: &[Vec<String>], name: &str) -> Vec<String> {
    let place = rows[0].iter().position(|c| c == name);
    let place = place.unwrap_or_else(|| panic!("no column {name} in {:?}", rows[0]));
    rows[1..].iter().map(|row| row[place].clone()).collect()
}

fn numbers(rows: &[Vec<String>], name: &str) -> Vec<f64> {
    let parse = |text: &String| text.parse().unwrap_or(f64::NAN);
    column(rows, name).iter().map(parse).collect()
}

#[test]
fn names_differ_and_questions_are_asked() {
    let names: BTreeSet<&str> = STUDIES.iter().map(|study| study.name).collect();
    assert_eq!(names.len(), STUDIES.len());
    assert!(!names.contains("all"));
    assert!(
        STUDIES
            .iter()
            .all(|study| study.question.ends_with(['.', '?']))
    );
}

#[test]
fn batches_fall_from_the_dark_and_large_ones_take_fewer_steps_for_as_many_rays() {
    let findings = quick("batch");
    let rows = rows("batch", &findings, "");
    let (batches, seeds) = (column(&rows, "batch"), column(&rows, "seed"));
    let (losses, steps) = (numbers(&rows, "loss"), numbers(&rows, "steps"));
    let of = |batch: &str, seed: &str| -> Vec<usize> {
        let all = 0..batches.len();
        all.filter(|&i| batches[i] == batch && seeds[i] == seed)
            .collect()
    };
    for seed in ["1", "2"] {
        assert_eq!(of("transport cache", seed).len(), 1);
        let mut taken = f64::INFINITY;
        for batch in ["1", "8", "64"] {
            let marks = of(batch, seed);
            assert!(marks.len() >= 5, "{batch}: {} marks", marks.len());
            let (first, last) = (marks[0], marks[marks.len() - 1]);
            assert!(losses[last] <= losses[first], "{batch}: {losses:?}");
            assert!(steps[last] < 0.5 * taken, "{batch}");
            taken = steps[last];
        }
    }
    // The same seed takes the same course; only the clock differs.
    let again = quick("batch");
    let without_seconds = |findings: &Findings| -> Vec<String> {
        let table = findings.tables[0].1.as_str().to_owned();
        let line = |line: &str| {
            let cells: Vec<&str> = line.split(',').collect();
            [&cells[..4], &cells[5..]].concat().join(",")
        };
        table.lines().map(line).collect()
    };
    assert_eq!(without_seconds(&findings), without_seconds(&again));
}

#[test]
fn both_samplings_together_have_no_more_gradient_variance_than_the_worse_of_them() {
    let findings = quick("mis");
    let courses = rows("mis", &findings, "");
    let kinds: BTreeSet<String> = column(&courses, "sampling").into_iter().collect();
    // Two rooms by three samplings, and the transport cache.
    assert_eq!(kinds.len(), 7, "{kinds:?}");
    let rows = rows("mis", &findings, "-variance");
    let (scenes, samplings) = (column(&rows, "scene"), column(&rows, "sampling"));
    let variances = numbers(&rows, "variance");
    let of = |scene: &str, sampling: &str| {
        let mut all = 0..scenes.len();
        let place = all.find(|&i| scenes[i] == scene && samplings[i] == sampling);
        variances[place.expect("a row")]
    };
    for scene in ["small lamp", "large lamp"] {
        let [both, light, bsdf] = ["mis", "emitter", "bsdf"].map(|s| of(scene, s));
        assert!(
            both > 0.0 && both < light.max(bsdf),
            "{scene}: {both} {light} {bsdf}"
        );
    }
    // A small lamp is hardly met by chance.
    assert!(of("small lamp", "bsdf") > 2.0 * of("small lamp", "emitter"));
}

#[test]
fn the_same_samples_darken_an_l2_fit_as_predicted_and_two_sets_do_not() {
    let findings = quick("estimators");
    let rows = rows("estimators", &findings, "");
    let (names, samplings) = (column(&rows, "estimator"), column(&rows, "sampling"));
    let samples = column(&rows, "samples");
    let (scales, predicted) = (numbers(&rows, "scale"), numbers(&rows, "predicted"));
    assert_eq!(scales.len(), 2 * 4 * 3 * 2);
    let of = |name: &str, count: &str| -> Vec<usize> {
        let all = 0..names.len();
        all.filter(|&i| names[i] == name && samples[i] == count && samplings[i] == "BSDF sampling")
            .collect()
    };
    let mean = |places: &[usize], values: &[f64]| {
        places.iter().map(|&i| values[i]).sum::<f64>() / places.len() as f64
    };
    let same = of("l2, same samples", "1");
    assert!(mean(&same, &scales) < 0.8, "{}", mean(&same, &scales));
    let off = mean(&same, &scales) / mean(&same, &predicted);
    assert!((off - 1.0).abs() < 0.15, "{off}");
    let two = of("l2, two sets", "16");
    assert!(
        (mean(&two, &scales) - 1.0).abs() < 0.05,
        "{}",
        mean(&two, &scales)
    );
}
