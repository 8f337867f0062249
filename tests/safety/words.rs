//! Command lines that were meant otherwise.

use crate::place::Place;
use crate::{done, heard, refused, solve};
use serde_json::Value;
use std::fs;

#[test]
fn a_command_that_was_mistyped_is_suggested() {
    let place = Place::new();
    for (typed, meant) in [
        (&["slove", "room"][..], "'solve'"),
        (&["slove"], "'solve'"),
        (&["solve-", "room", "--seed", "3"], "'solve'"),
        (&["rendr", "out", "--frame", "0"], "'render'"),
        (&["improt", "scan"], "'import'"),
    ] {
        let word = format!("unknown command '{}'", typed[0]);
        refused(&place.relit(typed), 2, &[&word, "did you mean", meant]);
    }
    refused(
        &place.relit(&["frobnicate", "room"]),
        2,
        &["unknown command 'frobnicate'"],
    );
    refused(
        &place.relit(&["room", "--frobnicate"]),
        2,
        &["--frobnicate"],
    );
    // A folder is a folder, whatever it is called.
    fs::rename(place.path("room"), place.path("slove")).expect("renames");
    let mut as_folder = vec!["slove"];
    as_folder.extend(&solve("", "out")[2..]);
    done(&place.relit(&as_folder));
}

#[test]
fn numbers_below_zero_are_refused_for_what_they_are() {
    let place = Place::new();
    let with = |more: &[&'static str]| [&["solve", "room"], more].concat();
    refused(
        &place.relit(&with(&["--seed", "-1"])),
        2,
        &["seed", "whole number from 0"],
    );
    refused(&place.relit(&with(&["--time", "-1"])), 2, &["time", "60s"]);
    refused(
        &place.relit(&with(&["--bounces", "-2"])),
        2,
        &["bounces", "whole number"],
    );
    for (option, value, wanted) in [
        ("--focal", "-1", "a number above 0"),
        ("--mesh-scale", "0", "a number above 0"),
        ("--shift", "a", "a whole number such as 1 or -1"),
        ("--threads", "-2", "a whole number from 1"),
        ("--scale", "-0.01", "a number above 0"),
    ] {
        let refusal = place.relit(&with(&[option, value]));
        refused(&refusal, 2, &[option, value, wanted]);
    }
    let demo = ["demo", "--out", "demo", "--seed", "-1"];
    refused(&place.relit(&demo), 2, &["seed", "whole number from 0"]);
    let demo = ["demo", "--out", "demo", "--seed", "1", "--width", "8"];
    refused(&place.relit(&demo), 2, &["--width", "from 16 to 4096"]);
    let trade = ["trade", "room", "--seed", "-1"];
    refused(&place.relit(&trade), 2, &["seed", "whole number from 0"]);
}

#[test]
fn no_more_threads_are_used_than_the_machine_can_do_something_with() {
    let place = Place::new();
    let output = place.relit(&[&solve("room", "out")[..], &["--threads", "1000"]].concat());
    done(&output);
    assert!(
        heard(&output).contains("warning: --threads 1000"),
        "{}",
        heard(&output)
    );
    let report = fs::read(place.path("out/report.json")).expect("reads");
    let report: Value = serde_json::from_slice(&report).expect("JSON");
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    assert_eq!(report["threads"], cores * 4);
}
