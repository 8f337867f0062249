//! `relit solve` and `relit` without a display: everything is written, the same seed gives the same bytes, errors are one line.

use crate::place::Place;
use crate::{QUICK, common, done, refused, solve};
use serde_json::Value;
use std::fs;

#[test]
fn a_solve_writes_everything_and_all_of_it_can_be_read() {
    let place = Place::new();
    done(&place.relit(&solve(&[])));
    let out = "relit-out/room";
    let report = place.json(&format!("{out}/report.json"));
    for field in [
        "seconds",
        "seconds_load",
        "seconds_solve",
        "seconds_write",
        "seed",
        "threads",
        "rays",
        "rays_per_second",
        "peak_memory_bytes",
    ] {
        assert!(report[field].is_number(), "{field}: {}", report[field]);
    }
    assert_eq!(report["capture"]["objects"], 4);
    assert_eq!(report["capture"]["triangles"], 14);
    assert_eq!(report["capture"]["frames"], 2);
    assert_eq!(report["capture"]["pixels"], 2 * 24 * 24);
    assert!(report["stopped_because"].is_string());
    for (name, ..) in common::OBJECTS {
        let object = &report["objects"][name];
        for field in ["albedo", "emission"] {
            let rgb = object[field].as_array().expect("a colour");
            assert!(rgb.iter().all(Value::is_number), "{name} {field}");
        }
        for field in ["identifiable", "albedo_identifiable"] {
            assert!(object[field].is_boolean());
        }
    }
    let estimate = place.json(&format!("{out}/estimate.json"));
    assert_eq!(estimate["capture"]["relative"], "../../room");
    for frame in 0..2 {
        for kind in ["render", "albedo", "emission", "error", "stderr", "seen"] {
            for ending in ["exr", "png"] {
                let name = format!("{out}/views/{frame:03}.{kind}.{ending}");
                let image = image::open(place.path(&name)).expect("an image");
                assert!(image.width() >= 24 && image.height() >= 24, "{name}");
            }
        }
    }
    let losses = fs::read_to_string(place.path(&format!("{out}/loss.csv"))).expect("reads");
    // The fit is told after every iteration, losses where they were measured.
    let rows: Vec<Vec<&str>> = losses
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    assert_eq!(
        rows[0][2..],
        [
            "train",
            "held_out",
            "residual",
            "stderr",
            "unknowns",
            "texture_residual"
        ]
    );
    let told = |column: usize| {
        rows[1..]
            .iter()
            .filter(|row| !row[column].is_empty())
            .count()
    };
    assert!(
        told(2) >= 1 && told(4) >= 4 && told(6) == told(4),
        "{losses}"
    );
    let residual = |row: &&Vec<&str>| row[4].parse::<f64>().ok();
    let fits: Vec<f64> = rows[1..].iter().filter_map(|row| residual(&row)).collect();
    assert!(fits.last() < fits.first(), "{fits:?}");
    image::open(place.path(&format!("{out}/loss.png"))).expect("an image");
    let (scene, ..) = gltf::import(place.path(&format!("{out}/scene.glb"))).expect("a glTF");
    let names: Vec<_> = scene.nodes().filter_map(|node| node.name()).collect();
    for (name, ..) in common::OBJECTS {
        assert!(names.contains(&name), "{name}: {names:?}");
    }
    let left: Vec<_> = fs::read_dir(place.path(out))
        .expect("lists")
        .map(|e| e.expect("lists").file_name())
        .filter(|name| name.to_string_lossy().starts_with('.'))
        .collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn errors_are_one_line_with_the_file_the_field_and_the_remedy() {
    let place = Place::new();
    refused(&place.relit(&["solve", "nowhere"]), 1, &["nowhere", ";"]);
    refused(
        &place.relit(&["render", "room", "--frame", "0", "--out", "a.exr"]),
        1,
        &["estimate.json"],
    );
    refused(
        &place.relit(&["render", "room", "--frame", "0", "--out", "a.gif"]),
        2,
        &["a.gif", ".png"],
    );
    refused(
        &place.relit(&solve(&["--hold-out", "1"])),
        2,
        &["hold_out", "2 photographs"],
    );
    refused(&place.relit(&["solve"]), 2, &["CAPTURE"]);
    refused(&place.relit(&["--frobnicate"]), 2, &["--frobnicate"]);
    refused(
        &place.relit(&solve(&["--batch", "0"])),
        2,
        &["batch", "from 1 to"],
    );
    refused(
        &place.relit(&["solve", "room", "--preset", "fast"]),
        2,
        &["preset", "balanced"],
    );
    refused(
        &place.relit(&["solve", "room", "--time", "soon"]),
        2,
        &["time", "60s"],
    );
    refused(
        &place.relit(&["solve", "room", "--views", "few"]),
        2,
        &["views"],
    );

    let transforms = place.path("room/transforms.json");
    let text = fs::read_to_string(&transforms).expect("reads");
    fs::write(&transforms, &text[..text.len() / 2]).expect("writes");
    refused(&place.relit(&solve(&[])), 1, &["transforms.json"]);
    fs::write(&transforms, text.replace("\"w\":24", "\"w\":23")).expect("writes");
    refused(
        &place.relit(&solve(&[])),
        1,
        &["transforms.json", "w: is 23", "24"],
    );
    fs::write(&transforms, text.replace("images/001", "images/007")).expect("writes");
    refused(&place.relit(&solve(&[])), 1, &["007.exr"]);
}

#[test]
fn a_failed_run_leaves_earlier_results_untouched() {
    let place = Place::new();
    done(&place.relit(&solve(&["--views", "none"])));
    let read = || {
        ["estimate.json", "report.json", "loss.csv"]
            .map(|name| fs::read(place.path(&format!("relit-out/room/{name}"))).expect("reads"))
    };
    let before = read();
    fs::remove_file(place.path("room/images/001.exr")).expect("removes");
    refused(&place.relit(&solve(&[])), 1, &["001.exr"]);
    assert_eq!(before, read());
    // An unreadable checkpoint does no harm either.
    fs::write(place.path("relit-out/room/checkpoint.json"), "{").expect("writes");
    refused(&place.relit(&solve(&["--resume"])), 1, &["checkpoint.json"]);
    assert_eq!(before, read());
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let place = Place::new();
    let estimate = |threads: &str, preset: &str, more: &[&str]| {
        let mut arguments = vec!["solve", "room", "--preset", preset, "--out", "out"];
        arguments.extend(["--views", "1", "--threads", threads]);
        arguments.extend(more);
        done(&place.relit(&arguments));
        let picture = fs::read(place.path("out/views/000.render.exr")).expect("reads");
        let mut json = place.json("out/estimate.json");
        json["capture"].take();
        (json.to_string(), picture)
    };
    for (preset, more) in [("preview", &[][..]), ("paper", &["--steps", "200"])] {
        let one = estimate("1", preset, more);
        for threads in ["2", "8"] {
            assert_eq!(
                one,
                estimate(threads, preset, more),
                "{preset} on {threads}"
            );
        }
    }
}

#[test]
fn truth_is_not_read_by_a_solve() {
    let place = Place::new();
    fs::create_dir(place.path("room/truth")).expect("writes");
    fs::write(place.path("room/truth/albedo_000.exr"), "no picture").expect("writes");
    let estimate = |preset: &str| {
        let arguments = ["--preset", preset, "--steps", "200", "--views", "none"];
        done(&place.relit(&[&["solve", "room"], &arguments[..]].concat()));
        fs::read(place.path("relit-out/room/estimate.json")).expect("reads")
    };
    let with = ["preview", "paper"].map(estimate);
    fs::remove_file(place.path("room/truth.json")).expect("removes");
    fs::remove_dir_all(place.path("room/truth")).expect("removes");
    assert_eq!(with, ["preview", "paper"].map(estimate));
}

#[test]
fn without_a_display_the_plain_command_solves_headless_and_says_so() {
    let place = Place::new();
    let mut arguments = vec!["room", "--views", "1"];
    arguments.extend(QUICK);
    let output = place.relit(&arguments);
    done(&output);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("solving without a window"), "{said}");
    assert!(place.path("relit-out/room/report.json").is_file());
}
