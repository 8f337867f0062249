//! `relit render` and `relit edit`: results seen again, changed, and found where their capture was moved.

use crate::place::Place;
use crate::{done, refused, solve};
use serde_json::Value;
use std::fs;

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

/// The mean of a picture, over all its numbers.
fn mean(place: &Place, name: &str) -> f64 {
    let image = image::open(place.path(name)).expect("an image").to_rgb32f();
    let sum: f64 = image.as_raw().iter().map(|&v| f64::from(v)).sum();
    sum / image.as_raw().len() as f64
}

/// The processor gives the same bits, named or not where there is no card; an adapter gives the same picture up to rounding.
fn what_traces_is_chosen_and_named(place: &Place) {
    let render = |device: &str, out: &str| {
        let words = ["render", "out", "--frame", "0", "--spp", "16"];
        place.relit(&[&words[..], &["--device", device, "--out", out]].concat())
    };
    let by_processor = render("cpu", "cpu.exr");
    done(&by_processor);
    assert!(String::from_utf8_lossy(&by_processor.stderr).contains("traced by the processor"));
    refused(
        &render("tpu", "tpu.exr"),
        2,
        &["--device", "tpu", "auto, cpu or gpu"],
    );
    let auto = render("auto", "auto.exr");
    done(&auto);
    if !String::from_utf8_lossy(&auto.stderr).contains("traced by") {
        let [cpu, auto] = ["cpu.exr", "auto.exr"].map(|name| fs::read(place.path(name)));
        assert_eq!(cpu.expect("reads"), auto.expect("reads"));
    }
    let by_adapter = render("gpu", "gpu.exr");
    if by_adapter.status.code() == Some(1) {
        refused(&by_adapter, 1, &["--device gpu", "no graphics adapter"]);
        let demanded = std::env::var_os("RELIT_REQUIRE_ADAPTER").is_some_and(|value| value == "1");
        assert!(!demanded, "no graphics adapter, but one is demanded");
        println!("skipped: no graphics adapter");
        return;
    }
    done(&by_adapter);
    assert!(String::from_utf8_lossy(&by_adapter.stderr).contains("traced by"));
    let [cpu, gpu] = ["cpu.exr", "gpu.exr"].map(|name| mean(place, name));
    assert!((gpu / cpu - 1.0).abs() < 1e-3, "{gpu} against {cpu}");
    let edit = [
        "edit",
        "out",
        "--albedo",
        "floor=0.5,0.1,0.1",
        "--views",
        "1",
        "--photographs",
        "--spp",
        "2",
    ];
    for device in ["cpu", "gpu"] {
        done(
            &place.relit(
                &[
                    &edit[..],
                    &["--device", device, "--out", &format!("edited-{device}")],
                ]
                .concat(),
            ),
        );
    }
    for picture in ["views/000.render.exr", "photographs/001.relit.exr"] {
        let [cpu, gpu] =
            ["cpu", "gpu"].map(|device| mean(place, &format!("edited-{device}/{picture}")));
        assert!(
            (gpu / cpu - 1.0).abs() < 2e-3,
            "{picture}: {gpu} against {cpu}"
        );
    }
}

#[test]
fn results_are_rendered_edited_and_moved() {
    let place = Place::new();
    done(&place.relit(&solve(&["--views", "none", "--out", "out"])));
    what_traces_is_chosen_and_named(&place);
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
    // Its lens is read as a capture's is: other models are refused, not taken for a pinhole.
    let model = camera.replace(r#""w": 8"#, r#""camera_model": "EQUIRECTANGULAR", "w": 8"#);
    for (text, parts) in [
        (model, ["camera_model", "EQUIRECTANGULAR"]),
        (camera.replace(r#""w": 8, "#, ""), ["w", "is absent"]),
        (
            camera.replace("[0,0,0,1]", "[0,0,1,1]"),
            ["transform_matrix", "last row"],
        ),
    ] {
        fs::write(place.path("other.json"), text).expect("writes");
        let words = ["render", "out", "--camera", "other.json", "--out", "d.png"];
        refused(&place.relit(&words), 1, &parts);
    }
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
    let in_place = ["edit", "out", "--albedo", "floor=0,0,0", "--out", "./out"];
    refused(&place.relit(&in_place), 2, &["--out", "another folder"]);
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
        ("floor=1.5", "at most 1"),
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
