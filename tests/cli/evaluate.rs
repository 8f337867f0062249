//! `relit evaluate`: errors against a truth.

use crate::place::Place;
use crate::{common, done, refused, solve};
use serde_json::Value;
use std::fs;

#[test]
fn an_estimate_is_measured_against_the_truth() {
    let place = Place::new();
    done(&place.relit(&solve(&["--views", "none", "--out", "out"])));
    // The truth itself has no error; a lamp switched off is missed, a wall half as bright is half wrong.
    let mut truth = vec!["edit", "out", "--views", "none", "--out", "exact"];
    let values: Vec<[String; 2]> = common::OBJECTS
        .iter()
        .map(|(name, a, e)| {
            let rgb = |c: &[f32; 3]| format!("{name}={},{},{}", c[0], c[1], c[2]);
            [rgb(a), rgb(e)]
        })
        .collect();
    for [albedo, emission] in &values {
        truth.extend(["--albedo", albedo, "--emission", emission]);
    }
    done(&place.relit(&truth));
    let evaluate = |folder: &str| -> Value {
        let output = place.relit(&["evaluate", folder, "--truth", "room", "--json"]);
        done(&output);
        serde_json::from_slice(&output.stdout).expect("JSON alone on stdout")
    };
    let exact = evaluate("exact");
    assert_eq!(exact["objects"], 3);
    for field in [
        "albedo_mae",
        "albedo_rel_median",
        "albedo_rel_p95",
        "emission_log_mse",
        "emission_rel_median",
    ] {
        assert!(
            exact[field].as_f64().is_some_and(|v| v < 1e-6),
            "{field}: {}",
            exact[field]
        );
    }
    assert_eq!(exact["emission_iou"], 1.0);
    assert!(exact["albedo_psnr"].is_null());

    done(&place.relit(&[
        "edit",
        "exact",
        "--emission",
        "lamp=0,0,0",
        "--albedo",
        "floor=0.15,0.1,0.05",
        "--views",
        "none",
        "--out",
        "wrong",
    ]));
    let wrong = evaluate("wrong");
    assert_eq!(wrong["emission_iou"], 0.0);
    assert_eq!(wrong["emission_rel_median"], 1.0);
    let floor = wrong["per_object"]["floor"]["albedo_rel"].as_f64();
    assert!(floor.is_some_and(|v| (v - 0.5).abs() < 1e-6), "{floor:?}");
    let table = place.relit(&["evaluate", "exact", "--truth", "room"]);
    assert!(String::from_utf8_lossy(&table.stdout).contains("objects scored"));
    fs::remove_file(place.path("room/truth.json")).expect("removes");
    refused(
        &place.relit(&["evaluate", "exact", "--truth", "room"]),
        1,
        &["truth.json"],
    );
}
