//! What goes wrong is an error value.

use crate::card;
use crate::scenes::{capture, lamp_room, room_views};
use relit::gpu::{Adapters, Card, Tracer, View};
use relit::scene::Scene;
use relit::transport::lit::LitScene;
use relit::transport::path::PathOptions;
use std::sync::Arc;

#[test]
fn a_lost_device_is_an_error_in_one_line_and_no_picture() {
    if card().is_none() {
        return;
    }
    let Some(card) = Card::open(Adapters::Any) else {
        return;
    };
    let (mesh, materials) = lamp_room();
    let capture = capture(mesh, &room_views(), [12, 9]);
    let scene = Arc::new(Scene::new(&capture).expect("the test scene is sound"));
    let lit = LitScene::new(scene, materials, None);
    let mut tracer = Tracer::new(&card, &lit, &[]).expect("the scene fits");
    let options = PathOptions::default();
    let view = View {
        camera: &lit.scene.cameras[0],
        options: &options,
        seed: 1,
        frame: 0,
    };
    assert!(tracer.film(&view, 1).is_ok());
    card.lose();
    let error = tracer.film(&view, 1).expect_err("the device is gone");
    println!("{error}");
    assert!(error.place == card.name() && !error.to_string().contains('\n'));
    assert!(Tracer::new(&card, &lit, &[]).is_err());
    // Another device of the same adapter is as good as new.
    let again = Card::open(Adapters::Any).expect("the adapter is still there");
    assert!(Tracer::new(&again, &lit, &[]).is_ok());
}

/// A software adapter is never taken for a card.
#[test]
fn software_adapters_are_no_cards() {
    if let Some(card) = Card::open(Adapters::Cards) {
        let name = card.name().to_lowercase();
        assert!(
            !name.contains("llvmpipe") && !name.contains("swiftshader"),
            "{name}"
        );
    }
}
