//! The command line as a person meets it: exit codes, one-line errors, complete results, nothing lost.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/files.rs"]
mod files;
#[path = "../common/place.rs"]
mod place;
#[path = "../common/said.rs"]
mod said;

mod evaluate;
mod export;
mod insert;
mod interrupted;
mod render;
mod solve;
mod trade;

use place::Place;
use said::{done, refused};
use serde_json::Value;
use std::fs;

impl Place {
    fn json(&self, name: &str) -> Value {
        let text = fs::read_to_string(self.path(name)).expect("the file is there");
        assert!(!text.contains("NaN"), "{name} holds NaN");
        serde_json::from_str(&text).expect("the file is JSON")
    }
}

const QUICK: [&str; 4] = ["--preset", "preview", "--time", "20s"];

fn solve<'a>(more: &[&'a str]) -> Vec<&'a str> {
    let mut all = vec!["solve", "room"];
    all.extend(QUICK);
    all.extend(more);
    all
}
