//! Flows with a graphics adapter: what is on the screen. Skipped where there is none, unless one is demanded.

use crate::connection::solving;
use egui::{Key, Modifiers, Pos2, Rect};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use relit::app::layout::Pane;
use relit::app::picture::copy::as_seen;
use relit::app::picture::look::ToneCurve;
use relit::app::picture::quantity::Quantity;
use relit::app::window::Window;
use relit::math::color::linear_to_srgb;

/// Whether an adapter was found; says so where not.
fn adapter() -> bool {
    let instance = wgpu::Instance::default();
    let adapters = instance.enumerate_adapters(wgpu::Backends::all());
    if !pollster(adapters).is_empty() {
        return true;
    }
    let demanded = std::env::var_os("RELIT_REQUIRE_ADAPTER").is_some_and(|value| value == "1");
    assert!(!demanded, "no graphics adapter, but one is demanded");
    println!("skipped: no graphics adapter");
    false
}

/// Waits for a future that is ready at once.
fn pollster<T>(future: impl Future<Output = T>) -> T {
    let mut future = std::pin::pin!(future);
    let mut context = std::task::Context::from_waker(std::task::Waker::noop());
    loop {
        if let std::task::Poll::Ready(value) = future.as_mut().poll(&mut context) {
            return value;
        }
        std::thread::yield_now();
    }
}

fn pixel(image: &image::RgbaImage, at: Pos2) -> [u8; 3] {
    let [r, g, b, _] = image.get_pixel(at.x as u32, at.y as u32).0;
    [r, g, b]
}

fn expected(linear: f32, exposure: f32) -> u8 {
    (linear_to_srgb(linear * exposure.exp2()) * 255.0 + 0.5) as u8
}

fn picture_rect(harness: &Harness<'_, Window>, label: &str) -> Rect {
    let pane = harness.get_by_label(label).rect();
    harness.state().app.view.look.placement(pane, [64, 48])
}

#[test]
fn pictures_are_drawn_with_exposure_and_the_srgb_curve() {
    if !adapter() {
        return;
    }
    let (mut harness, _recorder) = solving(Harness::builder().wgpu());
    for exposure in [0.0, 1.0, -2.0] {
        harness.state_mut().app.view.look.exposure = exposure;
        harness.run_steps(2);
        let image = harness.render().expect("rendered");
        let render = picture_rect(&harness, "Re-render picture").center();
        let value = expected(0.25, exposure);
        assert_eq!(pixel(&image, render), [value; 3], "{exposure} stops");
        // Reflectance has no exposure.
        let albedo = picture_rect(&harness, "Albedo picture").center();
        assert_eq!(
            pixel(&image, albedo),
            [0.8, 0.4, 0.2].map(|v| expected(v, 0.0))
        );
    }
    // Each pixel of the photograph is where the cursor says it is.
    harness.state_mut().app.view.look.exposure = 0.0;
    harness.run_steps(2);
    let image = harness.render().expect("rendered");
    let rect = picture_rect(&harness, "Photograph picture");
    for (x, y) in [(3.5, 40.5), (60.5, 5.5)] {
        let at = rect.min + rect.size() * egui::vec2(x / 64.0, y / 48.0);
        let found = pixel(&image, at);
        let color = [(x - 0.5) / 63.0, (y - 0.5) / 47.0, 0.0].map(|v| expected(v, 0.0));
        for (found, color) in found.into_iter().zip(color) {
            assert!(found.abs_diff(color) <= 4, "{found} instead of {color}");
        }
    }
}

#[test]
fn holding_shows_the_photograph_everywhere() {
    if !adapter() {
        return;
    }
    let (mut harness, _recorder) = solving(Harness::builder().wgpu());
    harness.key_down_modifiers(Modifiers::NONE, Key::P);
    harness.run_steps(2);
    let image = harness.render().expect("rendered");
    let rect = picture_rect(&harness, "Re-render picture");
    let at = rect.min + rect.size() * egui::vec2(0.98, 0.02);
    let [r, g, _] = pixel(&image, at);
    assert!(r > 200 && g < 60, "{r} {g}");
}

#[test]
fn the_mesh_is_drawn_and_its_selected_object_stands_out() {
    if !adapter() {
        return;
    }
    let (mut harness, _recorder) = solving(Harness::builder().wgpu());
    harness.state_mut().app.view.model.coloring = relit::app::model::coloring::Coloring::Albedo;
    harness.state_mut().app.view.model.cameras = false;
    // The faces are made on a thread.
    let mut colors = Vec::new();
    for _ in 0..200 {
        harness.run_steps(1);
        if harness.query_by_label("Preparing the mesh…").is_none() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    for selected in [None, Some(0)] {
        harness.state_mut().app.view.selection.object = selected;
        harness.run_steps(2);
        let image = harness.render().expect("rendered");
        let rect = harness.get_by_label("3D view picture").rect();
        let surround = pixel(&image, rect.min + egui::vec2(4.0, 4.0));
        let mut drawn = 0;
        let mut sum = [0u64; 3];
        for y in rect.top() as u32..rect.bottom() as u32 {
            for x in rect.left() as u32..rect.right() as u32 {
                let color = pixel(&image, egui::pos2(x as f32, y as f32));
                if color != surround {
                    drawn += 1;
                    (0..3).for_each(|c| sum[c] += u64::from(color[c]));
                }
            }
        }
        let fraction = drawn as f32 / (rect.width() * rect.height());
        assert!(fraction > 0.05 && fraction < 0.9, "{fraction}");
        colors.push(sum.map(|s| s / drawn));
    }
    // Grey walls, and a floor in the accent colour once it is selected.
    assert!(colors[0][0].abs_diff(colors[0][2]) < 8, "{colors:?}");
    assert!(colors[1][0] > colors[1][2] + 15, "{colors:?}");
}

#[test]
fn what_is_copied_is_what_is_seen() {
    if !adapter() {
        return;
    }
    let (mut harness, _recorder) = solving(Harness::builder().wgpu());
    for quantity in [
        Quantity::Render,
        Quantity::Albedo,
        Quantity::Irradiance,
        Quantity::Error,
        Quantity::StandardError,
    ] {
        for tone in ToneCurve::ALL {
            let app = &mut harness.state_mut().app;
            app.view.layout.front = Some(Pane::Picture(quantity));
            app.view.look.tone = tone;
            harness.run_steps(4);
            let image = harness.render().expect("rendered");
            let app = &harness.state().app;
            let drawn = app.view.drawn(&app.document, quantity).expect("a picture");
            let copied = as_seen(&drawn, &app.view.look);
            let at = picture_rect(&harness, &format!("{} picture", quantity.name())).center();
            let [r, g, b, _] = copied.pixels[24 * 64 + 32].to_array();
            for (seen, copied) in pixel(&image, at).into_iter().zip([r, g, b]) {
                let off = i32::from(seen) - i32::from(copied);
                assert!(off.abs() <= 2, "{quantity:?} {tone:?}: {seen} {copied}");
            }
        }
    }
}

#[test]
fn the_handles_of_an_object_are_drawn_where_they_are_taken() {
    if !adapter() {
        return;
    }
    let (mut harness, _recorder) = solving(Harness::builder().wgpu());
    let folder = tempfile::tempdir().expect("a folder");
    crate::photographs::insert_block(&mut harness, folder.path());
    let [foot, top] = [0.0, 0.6].map(|height| crate::photographs::seen(&harness, height));
    // Handles are drawn in the picture under the pointer alone.
    harness.hover_at(egui::pos2(640.0, 795.0));
    harness.run_steps(3);
    let bare = harness.render().expect("rendered");
    harness.hover_at(foot + egui::vec2(60.0, 0.0));
    harness.run_steps(3);
    let image = harness.render().expect("rendered");
    for at in [foot, top] {
        let different = pixel(&image, at) != pixel(&bare, at);
        assert!(different, "{at}: {:?}", pixel(&image, at));
    }
}
