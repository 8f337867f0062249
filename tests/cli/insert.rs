//! `relit insert`: objects in a photograph, as their files have them or made of something else.

use crate::place::Place;
use crate::{done, refused, solve};
use std::fs;
use std::process::Output;

/// Solves, and writes an object.
fn solved() -> Place {
    let place = Place::new();
    done(&place.relit(&solve(&["--views", "none", "--out", "out"])));
    let block = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    fs::write(place.path("block.obj"), block).expect("writes");
    place
}

fn insert(place: &Place, more: &[&str]) -> Output {
    let object = ["insert", "out", "--frame", "0", "--object", "block.obj"];
    place.relit(&[&object, more, &["--spp", "4"]].concat())
}

const THERE: [&str; 4] = ["--at", "0,0,-0.3", "--scale", "0.5"];

#[test]
fn an_object_is_put_into_a_photograph() {
    let place = solved();
    done(&insert(&place, &[&THERE[..], &["--out", "with"]].concat()));
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
    refused(&insert(&place, &["--out", "x"]), 2, &["block.obj", "--at"]);
    // Far behind the wall: written, but not without a word.
    let far = insert(&place, &["--at", "0,0,-50", "--out", "far"]);
    done(&far);
    let said = String::from_utf8_lossy(&far.stderr);
    assert!(said.contains("no inserted object is seen"), "{said}");
}

#[test]
fn a_material_replaces_that_of_the_file() {
    let place = solved();
    let mean = |name: &str, material: &[&str]| {
        let arguments = [&THERE[..], material, &["--out", name]].concat();
        done(&insert(&place, &arguments));
        let picture = image::open(place.path(&format!("{name}.composite.exr")));
        let picture = picture.expect("an image").to_rgb32f();
        let mut sum = [0.0; 3];
        for pixel in picture.pixels() {
            assert!(pixel.0.iter().all(|v| v.is_finite()), "{name}");
            sum.iter_mut().zip(pixel.0).for_each(|(s, v)| *s += v);
        }
        sum
    };
    // The file says nothing, which is a grey of one half.
    let plain = mean("plain", &[]);
    assert_eq!(plain, mean("grey", &["--material", "diffuse:0.5,0.5,0.5"]));
    let red = mean("red", &["--material", "diffuse:0.5,0,0"]);
    assert!((red[0] / plain[0] - 1.0).abs() < 0.01, "{red:?} {plain:?}");
    assert!(
        red[1] < 0.99 * plain[1] && red[2] < 0.99 * plain[2],
        "{red:?} {plain:?}"
    );
    let black = mean("black", &["--material", "diffuse:0,0,0"]);
    for roughness in ["1", "0.2", "0"] {
        let metal = mean(
            "metal",
            &["--material", &format!("metal:1,1,1,{roughness}")],
        );
        // By 1.7 % in each channel at least.
        let brighter = (metal.iter().zip(black)).all(|(metal, black)| *metal > 1.01 * black);
        assert!(brighter, "{roughness}: {metal:?} {black:?}");
    }
    refused(
        &insert(
            &place,
            &[&THERE[..], &["--material", "glass:1,1,1,0", "--out", "x"]].concat(),
        ),
        2,
        &["--material", "metal:R,G,B,ROUGHNESS"],
    );
}
