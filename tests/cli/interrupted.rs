//! Solves that are interrupted, and taken up again.

use crate::done;
use crate::place::Place;
use serde_json::Value;
use std::fs;
use std::process::Command;

#[test]
fn a_resumed_solve_ends_like_one_that_was_never_interrupted() {
    let place = Place::new();
    let solve = |out: &str, steps: &str, more: &[&str]| {
        let arguments = [
            "solve", "room", "--preset", "paper", "--views", "none", "--out", out, "--steps", steps,
        ];
        done(&place.relit(&[&arguments, more].concat()));
        let read = |name: &str| fs::read(place.path(&format!("{out}/{name}"))).expect("reads");
        (read("estimate.json"), read("checkpoint.json"))
    };
    let whole = solve("whole", "40", &[]);
    let half = solve("parts", "20", &[]);
    assert_ne!(half.0, whole.0);
    let resumed = solve("parts", "40", &["--resume"]);
    assert_eq!(resumed.0, whole.0);
    let state = |file: &[u8]| {
        let file: Value = serde_json::from_slice(file).expect("JSON");
        let checkpoint = &file["checkpoint"];
        (
            checkpoint["state"]["descent"].clone(),
            checkpoint["progress"]["iterations"].clone(),
        )
    };
    assert_eq!(state(&resumed.1), state(&whole.1));
    let losses = fs::read_to_string(place.path("parts/loss.csv")).expect("reads");
    let iterations: Vec<&str> = (losses.lines().skip(1))
        .filter_map(|line| line.split(',').nth(1))
        .collect();
    assert_eq!(iterations, ["0", "20", "40"]);
}

#[test]
fn a_resumed_solve_reads_the_capture_as_it_was_read_before() {
    let place = Place::new();
    let arguments = [
        "solve", "room", "--preset", "paper", "--views", "none", "--out", "out",
    ];
    let scale = || {
        let file = fs::read(place.path("out/estimate.json")).expect("reads");
        let file: Value = serde_json::from_slice(&file).expect("JSON");
        file["capture"]["options"]["scale"].as_f64()
    };
    done(&place.relit(&[&arguments[..], &["--steps", "5", "--scale", "2"]].concat()));
    done(&place.relit(&[&arguments[..], &["--steps", "10", "--resume"]].concat()));
    assert_eq!(scale(), Some(2.0));
    done(&place.relit(&[&arguments[..], &["--steps", "5"]].concat()));
    assert_eq!(scale(), None);
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_the_solve_cleanly_with_its_results() {
    let place = Place::new();
    let mut relit = place
        .command(&[
            "solve", "room", "--preset", "paper", "--time", "10m", "--views", "none",
        ])
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("relit starts");
    // The first loss says that the solve is under way.
    let mut said = String::new();
    let mut lines = std::io::BufReader::new(relit.stderr.take().expect("piped"));
    while !said.contains(", loss ") {
        let read = std::io::BufRead::read_line(&mut lines, &mut said).expect("reads");
        assert!(read > 0, "{said}");
    }
    let sent = Command::new("kill")
        .args(["-INT", &relit.id().to_string()])
        .status()
        .expect("kill runs");
    assert!(sent.success());
    std::io::Read::read_to_string(&mut lines, &mut said).expect("reads");
    assert_eq!(relit.wait().expect("ends").code(), Some(130), "{said}");
    assert!(said.contains("interrupted"), "{said}");
    let report = place.json("relit-out/room/report.json");
    assert_eq!(report["stopped_because"], "cancelled");
}
