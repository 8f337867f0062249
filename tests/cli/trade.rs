//! `relit trade`: the curve against the truth, or held-out pixels.

use crate::place::Place;
use crate::{done, refused};
use serde_json::Value;
use std::fs;

#[test]
fn the_trade_is_measured_against_the_truth_or_held_out_pixels() {
    let place = Place::new();
    let measured = |time: &str, out: &str| {
        let output = place.relit(&["trade", "room", "--presets", "--time", time, "--out", out]);
        done(&output);
        let text = fs::read_to_string(place.path(out).join("trade.json")).expect("written");
        for name in ["trade.csv", "trade.png"] {
            assert!(place.path(out).join(name).metadata().expect(name).len() > 50);
        }
        serde_json::from_str::<Value>(&text).expect("JSON")
    };
    let trade = measured("3s", "with");
    assert_eq!(trade["measure"], "albedo");
    assert_eq!(trade["curves"].as_array().map(Vec::len), Some(4));
    assert!(trade["machine"]["threads"].as_u64().is_some_and(|n| n > 0));
    fs::remove_file(place.path("room/truth.json")).expect("removed");
    assert_eq!(measured("1s", "without")["measure"], "held_out");

    let around = ["trade", "room", "--around", "preview", "--time", "1s"];
    done(&place.relit(&[&around[..], &["--out", "around"]].concat()));
    let text = fs::read_to_string(place.path("around/trade.json")).expect("written");
    let trade: Value = serde_json::from_str(&text).expect("JSON");
    let curves = trade["curves"].as_array().expect("curves");
    let name = |curve: &Value| curve["name"].as_str().map(|n| n.starts_with("preview"));
    assert!(curves.len() > 1 && curves.iter().all(|c| name(c) == Some(true)));

    let rooms = [
        "trade", "--rooms", "1", "--preset", "preview", "--out", "rooms",
    ];
    let output = place.relit(&rooms);
    done(&output);
    let table = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(table.lines().any(|l| l.starts_with("plain  ")), "{table}");
    let text = fs::read_to_string(place.path("rooms/rooms.csv")).expect("written");
    assert_eq!(text.lines().count(), 2);
    let text = fs::read_to_string(place.path("rooms/rooms.json")).expect("written");
    let summary: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(summary["families"]["plain"]["n"], 1);
    for wrong in [
        &["trade", "--rooms", "1", "--family", "none"][..],
        &["trade", "room", "--family", "plain"],
        &["trade", "--rooms", "1", "--family", "plain", "--presets"],
    ] {
        refused(&place.relit(wrong), 2, &["--family"]);
    }

    refused(
        &place.relit(&["trade", "room", "--around", "best", "--time", "1s"]),
        2,
        &["--around"],
    );
    refused(
        &place.relit(&["trade", "room", "--time", "0"]),
        2,
        &["--time"],
    );
    refused(
        &place.relit(&["trade", "room", "--rooms", "2"]),
        2,
        &["--rooms"],
    );
    refused(&place.relit(&["trade", "nowhere"]), 1, &["nowhere"]);
}
