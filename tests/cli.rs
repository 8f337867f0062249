//! The command line as a person meets it: exit codes, one-line errors, complete results, nothing lost.

mod common;
#[path = "common/files.rs"]
mod files;
#[path = "common/place.rs"]
mod place;

use place::Place;
use serde_json::Value;
use std::fs;
use std::process::{Command, Output};

impl Place {
    fn relit(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("relit starts")
    }

    fn json(&self, name: &str) -> Value {
        let text = fs::read_to_string(self.path(name)).expect("the file is there");
        assert!(!text.contains("NaN"), "{name} holds NaN");
        serde_json::from_str(&text).expect("the file is JSON")
    }
}

/// Succeeds, or shows what was said.
fn done(output: &Output) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
}

/// Fails with a code, and with one line that holds each of the words.
fn refused(output: &Output, code: i32, words: &[&str]) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{said}");
    let errors: Vec<&str> = said.lines().filter(|l| l.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "{said}");
    assert!(said.ends_with(&format!("{}\n", errors[0])), "{said}");
    assert!(!said.contains("panicked"), "{said}");
    for word in words {
        assert!(errors[0].contains(word), "{word} is not in: {said}");
    }
}

const QUICK: [&str; 4] = ["--preset", "preview", "--time", "20s"];

fn solve<'a>(more: &[&'a str]) -> Vec<&'a str> {
    let mut all = vec!["solve", "room"];
    all.extend(QUICK);
    all.extend(more);
    all
}

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
    for name in ["loss.csv", "loss.png", "scene.glb"] {
        assert!(place.path(&format!("{out}/{name}")).is_file(), "{name}");
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

/// Renders a frame whole and by lamp.
fn layers_add_up_to_the_render(place: &Place) {
    let render = |out: &str, more: &[&str]| {
        let mut all = vec!["render", "out", "--frame", "1", "--spp", "4", "--out", out];
        all.extend(more);
        place.relit(&all)
    };
    done(&render("whole.exr", &[]));
    done(&render("layers.exr", &["--layers"]));
    refused(&render("layers.png", &["--layers"]), 2, &["layers.png"]);
    let whole = image::open(place.path("whole.exr")).expect("an image");
    let image =
        exr::prelude::read_all_flat_layers_from_file(place.path("layers.exr")).expect("layers");
    let names: Vec<String> = (image.layer_data.iter())
        .filter_map(|layer| Some(layer.attributes.layer_name.as_ref()?.to_string()))
        .collect();
    assert!(names.iter().any(|name| name == "lamp"), "{names:?}");
    for (pixel, color) in whole.to_rgb32f().pixels().enumerate() {
        for (channel, letter) in ["R", "G", "B"].into_iter().enumerate() {
            let channels = image.layer_data.iter().flat_map(|l| &l.channel_data.list);
            let sum: f32 = channels
                .filter(|c| c.name.eq(letter))
                .map(|c| c.sample_data.values_as_f32().nth(pixel).expect("a value"))
                .sum();
            let apart = (sum - color.0[channel]).abs();
            assert!(
                apart <= 1e-5 * color.0[channel].max(1.0),
                "{pixel}: {apart}"
            );
        }
    }
}

/// Switches everything off as the window writes it, and renders that.
fn edits_beside_an_estimate_are_applied(place: &Place) {
    let found = fs::read(place.path("out/estimate.json")).expect("the file is there");
    let write = |name: &str| {
        let mut file: Value = serde_json::from_slice(&found).expect("JSON");
        let off = serde_json::json!({"off": true});
        file["edits"] = serde_json::json!({"objects": {
            "walls": off, "floor": off, "ceiling": off, name: off,
        }});
        fs::write(place.path("out/estimate.json"), file.to_string()).expect("writes");
        place.relit(&[
            "render", "out", "--frame", "0", "--spp", "4", "--out", "off.exr",
        ])
    };
    refused(&write("moon"), 1, &["moon"]);
    done(&write("lamp"));
    let render = image::open(place.path("off.exr"))
        .expect("an image")
        .to_rgb32f();
    assert!(render.pixels().all(|p| p.0 == [0.0; 3]), "all is off");
    fs::write(place.path("out/estimate.json"), &found).expect("writes");
}

#[test]
fn results_are_rendered_edited_and_moved() {
    let place = Place::new();
    done(&place.relit(&solve(&["--views", "none", "--out", "out"])));
    done(&place.relit(&[
        "render", "out", "--frame", "1", "--spp", "4", "--out", "a.exr",
    ]));
    let camera = r#"{"w": 8, "h": 6, "fl_x": 4, "fl_y": 4, "cx": 4, "cy": 3,
        "transform_matrix": [[1,0,0,0],[0,1,0,1],[0,0,1,0.5],[0,0,0,1]]}"#;
    fs::write(place.path("camera.json"), camera).expect("writes");
    done(&place.relit(&[
        "render",
        "out",
        "--camera",
        "camera.json",
        "--spp",
        "4",
        "--out",
        "b.png",
    ]));
    let picture = image::open(place.path("b.png")).expect("an image");
    assert_eq!((picture.width(), picture.height()), (8, 6));
    refused(
        &place.relit(&["render", "out", "--frame", "9", "--out", "c.exr"]),
        2,
        &["9", "2 frames"],
    );

    layers_add_up_to_the_render(&place);
    edits_beside_an_estimate_are_applied(&place);

    let dark = [
        "--emission",
        "lamp=0,0,0",
        "--emission",
        "walls=0,0,0",
        "--emission",
        "floor=0,0,0",
        "--emission",
        "ceiling=0,0,0",
    ];
    let mut edit = vec![
        "edit",
        "out",
        "--out",
        "dark",
        "--views",
        "1",
        "--albedo",
        "floor=0.1,0.2,0.3",
        "--roughness",
        "floor=0.25",
        "--specular",
        "floor=0.5",
    ];
    edit.extend(dark);
    done(&place.relit(&edit));
    let render = image::open(place.path("dark/views/000.render.exr"))
        .expect("an image")
        .to_rgb32f();
    assert!(
        render.pixels().all(|p| p.0 == [0.0; 3]),
        "the lamps are off"
    );
    let edited = place.json("dark/estimate.json");
    assert_eq!(
        edited["objects"]["floor"]["albedo"],
        serde_json::json!([0.1, 0.2, 0.3])
    );
    assert_eq!(edited["objects"]["floor"]["roughness"], 0.25);
    assert_eq!(edited["objects"]["floor"]["specular"], 0.5);
    for (value, words) in [
        ("floor=0", "above 0"),
        ("floor=1.5", "not above 1"),
        ("moon=0.5", "lamp"),
        ("floor=NaN", "NaN"),
        ("floor", "NAME=v"),
    ] {
        refused(
            &place.relit(&["edit", "out", "--roughness", value, "--out", "x"]),
            2,
            &[words],
        );
    }
    refused(
        &place.relit(&["edit", "out", "--specular", "floor=-1", "--out", "x"]),
        2,
        &["floor", "from 0"],
    );
    refused(
        &place.relit(&["edit", "out", "--emission", "moon=1,1,1", "--out", "x"]),
        2,
        &["moon", "lamp"],
    );
    refused(
        &place.relit(&["edit", "out", "--albedo", "floor=2,0,0", "--out", "x"]),
        2,
        &["floor", "0 to 1"],
    );

    fs::rename(place.path("room"), place.path("elsewhere")).expect("moves");
    refused(
        &place.relit(&["render", "out", "--frame", "0", "--out", "c.exr"]),
        1,
        &["room"],
    );
    done(&place.relit(&[
        "render",
        "out",
        "--capture",
        "elsewhere",
        "--frame",
        "0",
        "--spp",
        "1",
        "--out",
        "c.exr",
    ]));
    // Another mesh is another capture.
    let mesh = place.path("elsewhere/mesh.obj");
    let text = fs::read_to_string(&mesh).expect("reads");
    fs::write(&mesh, text.replace("1.9", "1.8")).expect("writes");
    refused(
        &place.relit(&[
            "render",
            "out",
            "--capture",
            "elsewhere",
            "--frame",
            "0",
            "--out",
            "d.exr",
        ]),
        1,
        &["estimate.json", "hash"],
    );
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

#[test]
fn results_are_exported_and_objects_inserted() {
    let place = Place::new();
    done(&place.relit(&solve(&["--views", "none", "--out", "out"])));
    for (format, file) in [
        ("glb", "a.glb"),
        ("obj", "a.obj"),
        ("ply", "a.ply"),
        ("mitsuba", "a.xml"),
        ("csv", "a.csv"),
    ] {
        done(&place.relit(&["export", "out", "--format", format, "--out", file]));
        assert!(
            place.path(file).metadata().is_ok_and(|m| m.len() > 100),
            "{file}"
        );
    }
    refused(
        &place.relit(&["export", "out", "--format", "probe", "--out", "p.exr"]),
        2,
        &["--at"],
    );

    let block = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    fs::write(place.path("block.obj"), block).expect("writes");
    done(&place.relit(&[
        "insert",
        "out",
        "--frame",
        "0",
        "--object",
        "block.obj",
        "--at",
        "0,0,-0.3",
        "--scale",
        "0.5",
        "--spp",
        "4",
        "--out",
        "with",
    ]));
    for ending in [
        "composite.exr",
        "composite.png",
        "naive.exr",
        "naive.png",
        "delta.exr",
        "layers.exr",
        "compare.png",
    ] {
        assert!(place.path(&format!("with.{ending}")).is_file(), "{ending}");
    }
    refused(
        &place.relit(&[
            "insert",
            "out",
            "--frame",
            "0",
            "--object",
            "block.obj",
            "--out",
            "x",
        ]),
        2,
        &["block.obj", "--at"],
    );
}

#[test]
fn the_built_in_room_is_written_with_its_truth() {
    let place = Place::new();
    done(&place.relit(&["demo", "--out", "demo"]));
    for name in [
        "transforms.json",
        "mesh.obj",
        "truth.json",
        "truth/albedo_000.exr",
    ] {
        assert!(place.path("demo").join(name).is_file(), "{name}");
    }
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
    // The first line of progress says that the solve is under way.
    let mut said = String::new();
    let mut lines = std::io::BufReader::new(relit.stderr.take().expect("piped"));
    while !said.contains(" s  ") {
        let read = std::io::BufRead::read_line(&mut lines, &mut said).expect("reads");
        assert!(read > 0, "{said}");
    }
    let sent = Command::new("kill")
        .args(["-INT", &relit.id().to_string()])
        .status()
        .expect("kill runs");
    assert!(sent.success());
    std::io::Read::read_to_string(&mut lines, &mut said).expect("reads");
    assert_eq!(relit.wait().expect("ends").code(), Some(0), "{said}");
    assert!(said.contains("interrupted"), "{said}");
    let report = place.json("relit-out/room/report.json");
    assert_eq!(report["stopped_because"], "cancelled");
}
