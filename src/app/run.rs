//! Opens the window on a session of its own; if it cannot be opened, the error says why in one line.

use crate::app::pace::Pace;
use crate::app::preferences::{self, Preferences};
use crate::app::shell::size::WINDOW;
use crate::app::state::App;
use crate::app::window::Window;
use crate::error::{Error, Result, panic_message};
use crate::inverse::settings::Settings;
use crate::render::{Device, Renderer};
use crate::session::Session;
use crate::session::command::{Source, Start};
use crate::session::worker::Backend;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether the window has been opened.
static OPENED: AtomicBool = AtomicBool::new(false);

/// Opens the window and returns when it is closed. With no `start` it shows the start page.
///
/// # Errors
/// There is no display, no library for it, or no graphics adapter.
pub fn run(start: Option<Start>, settings: Settings, device: Device) -> Result<()> {
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("relit")
            .with_app_id("relit")
            .with_inner_size(WINDOW)
            .with_min_inner_size([760.0, 480.0]),
        renderer: eframe::Renderer::Wgpu,
        // Dithering costs time at every pixel; the window has no gradients.
        dithering: false,
        ..Default::default()
    };
    let create: eframe::AppCreator<'_> = Box::new(|cc| {
        let window = window(cc, start, settings, device)?;
        OPENED.store(true, Ordering::Relaxed);
        Ok(Box::new(window))
    });

    // A missing X library makes the window library panic, which is kept quiet until the window is open.
    let before: Arc<dyn Fn(&std::panic::PanicHookInfo<'_>) + Send + Sync> =
        Arc::from(std::panic::take_hook());
    let loud = before.clone();
    std::panic::set_hook(Box::new(move |info| {
        if OPENED.load(Ordering::Relaxed) {
            loud(info);
        }
    }));
    let ended = catch_unwind(AssertUnwindSafe(|| {
        eframe::run_native("relit", options, create)
    }));
    std::panic::set_hook(Box::new(move |info| before(info)));

    match ended {
        Ok(Ok(())) => Ok(()),
        Ok(Err(eframe::Error::Wgpu(_))) => Err(Error::new(
            "window",
            "no graphics adapter can draw on this display",
            "install a graphics driver (a software one will do, such as Mesa's for Vulkan)",
        )),
        Ok(Err(error)) => Err(no_window(&error.to_string())),
        Err(panic) if OPENED.load(Ordering::Relaxed) => resume_unwind(panic),
        Err(panic) => Err(no_window(panic_message(panic.as_ref()))),
    }
}

/// The window on a worker that wakes it.
fn window(
    cc: &eframe::CreationContext<'_>,
    start: Option<Start>,
    settings: Settings,
    device: Device,
) -> Result<Window> {
    let software = cc.wgpu_render_state.as_ref().is_none_or(|render_state| {
        render_state.adapter.get_info().device_type == wgpu::DeviceType::Cpu
    });
    let pace = Arc::new(Pace::new(software));
    let (ctx, paced) = (cc.egui_ctx.clone(), pace.clone());
    let wake = Arc::new(move || ctx.request_repaint_after(paced.interval()));
    let kept = preferences::path();
    let preferences =
        (kept.as_ref()).map_or_else(Preferences::default, |path| Preferences::load(path));
    let renderer = Renderer::find_later(device);
    let backend = Backend {
        sessions: preferences::sessions(),
        renderer: renderer.clone(),
        ..Backend::default()
    };
    let session = Session::spawn_with(start.clone(), settings.clone(), wake, backend)?;
    let mut app = App::new(Box::new(session), preferences);
    app.jobs.renderer = renderer;
    app.document.settings = settings;
    app.document.opening = start.map(|start| match start {
        Start::Capture(source, _) => source,
        Start::Results(folder) => Source::Folder(folder),
    });
    let mut window = Window::new(cc, app, kept);
    window.pace = Some(pace);
    Ok(window)
}

/// The reason in one line.
fn no_window(reason: &str) -> Error {
    let line = reason.split_whitespace().collect::<Vec<_>>().join(" ");
    let remedy = "install what is missing, or use `relit solve`";
    Error::new("window", line, remedy)
}
