//! The status bar: what the worker does, how fast, how long still, and with how much memory.

use crate::app::action::Action;
use crate::app::controls::named;
use crate::app::number::number;
use crate::app::request::Requests;
use crate::app::shell::Memory;
use crate::app::task::Task;
use crate::app::theme;
use crate::app::view::Parts;
use crate::inverse::solver::Termination;
use crate::render::Renderer;
use crate::session::photographs::{WriteProgress, Written};
use crate::session::save::memory::resident_bytes;
use crate::session::snapshot::Phase;
use egui::{Button, ProgressBar, RichText, Role, Ui};
use std::path::PathBuf;
use std::time::{Duration, Instant};

impl Memory {
    /// Resident bytes, at most two seconds old.
    fn bytes(&mut self) -> u64 {
        let age = self.looked_up.map(|at| at.elapsed());
        if age.is_none_or(|age| age >= Duration::from_secs(2)) {
            self.bytes = resident_bytes().unwrap_or(0);
            self.looked_up = Some(Instant::now());
        }
        self.bytes
    }
}

/// Photographs that are being written.
pub struct Batch {
    pub folder: PathBuf,
    pub doing: Option<WriteProgress>,
    /// How many photographs it is to write.
    pub wanted: usize,
    pub task: Task<WriteProgress, Written>,
}

/// How a solve ended, in words.
pub fn ending(why: Termination) -> &'static str {
    match why {
        Termination::Converged => "Finished: converged",
        Termination::Target => "Finished: as exact as asked",
        Termination::Time => "Finished: the time is up",
        Termination::Steps => "Finished: all steps done",
        Termination::Cancelled => "Stopped",
        Termination::Diverged => "Stopped: diverged",
    }
}

pub fn bar(ui: &mut Ui, parts: &mut Parts<'_>, batch: Option<&Batch>, renderer: &Renderer) {
    let (document, tokens) = (parts.document, theme::tokens(ui));
    let bytes = parts.view.shell.memory.bytes();
    let snapshot = &document.snapshot;
    let color = match snapshot.phase {
        Phase::Solving | Phase::Loading => tokens.accent,
        Phase::Paused | Phase::Idle | Phase::Finished(Termination::Cancelled) => tokens.weak,
        Phase::Failed | Phase::Finished(Termination::Diverged) => tokens.error,
        Phase::Finished(_) => tokens.good,
    };
    ui.horizontal_centered(|ui| {
        let phase = match &snapshot.phase {
            Phase::Finished(why) => ending(*why).to_owned(),
            phase => format!("{phase:?}"),
        };
        ui.label(RichText::new(phase).color(color).strong());
        let progress = &snapshot.progress;
        if document.is_running() {
            if let Some(fraction) = progress.fraction {
                let bar = ProgressBar::new(fraction).desired_width(90.0);
                ui.add(bar.desired_height(8.0));
            }
            ui.label(&progress.phase);
        }
        if let Some(stage) = progress.stages.last() {
            ui.separator();
            let count = progress.stages.len();
            ui.label(format!("after stage {count}: {}", stage.name));
        }
        if let Some(batch) = batch {
            photographs(ui, batch, parts.requests);
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.label(format!("{} MB", bytes / 1_000_000))
                .on_hover_text("Memory in use");
            ui.separator();
            if let Some(left) = snapshot.seconds_left {
                ui.label(format!("{} left", duration(left)));
                ui.separator();
            }
            ui.label(duration(progress.seconds))
                .on_hover_text("Seconds of solving, pauses excluded");
            ui.separator();
            let rays = ui.label(format!("{} rays/s", magnitude(snapshot.rays_per_second)));
            rays.on_hover_ui(|ui| {
                let card = renderer.card();
                let card = card.as_deref().unwrap_or("none");
                ui.label(format!(
                    "Rays of the solve, by the processor. Graphics card for pictures: {card}"
                ));
            });
            ui.separator();
            let rate = number(snapshot.iterations_per_second as f32);
            ui.label(format!("{rate} iterations/s"));
            ui.separator();
            ui.label(format!("iteration {}", progress.iterations));
        });
    });
}

/// How far the photographs are, with a button that ends them.
fn photographs(ui: &mut Ui, batch: &Batch, requests: &mut Requests) {
    let folder = format!("Writes into {}", batch.folder.display());
    ui.separator();
    // The button comes first, where it stays while the rest changes.
    let (action, cancel) = (Action::CancelPhotographs, Button::new("Cancel").small());
    let cancel = requests.button(ui, action, cancel);
    named(cancel, Role::Button, action.text());
    if let Some(doing) = batch.doing {
        let bar = ProgressBar::new(doing.fraction).desired_width(90.0);
        ui.add(bar.desired_height(8.0)).on_hover_text(&folder);
        ui.label(format!("photograph {}", doing.frame + 1))
            .on_hover_text(folder);
    }
}

fn duration(seconds: f64) -> String {
    let seconds = seconds.max(0.0);
    let (minutes, hours) = ((seconds / 60.0).floor(), (seconds / 3600.0).floor());
    match seconds {
        s if s < 60.0 => format!("{s:.1} s"),
        s if s < 3600.0 => format!("{minutes} min {:02} s", (s % 60.0).floor()),
        _ => format!("{hours} h {:02} min", minutes % 60.0),
    }
}

/// A large number with a letter for its power of a thousand.
fn magnitude(value: f64) -> String {
    match value {
        v if v >= 1e9 => format!("{:.1} G", v / 1e9),
        v if v >= 1e6 => format!("{:.1} M", v / 1e6),
        v if v >= 1e3 => format!("{:.0} k", v / 1e3),
        v => format!("{v:.0}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_and_magnitudes_are_short() {
        assert_eq!(duration(3.25), "3.2 s");
        assert_eq!(duration(185.0), "3 min 05 s");
        assert_eq!(duration(7260.0), "2 h 01 min");
        assert_eq!(magnitude(2_340_000.0), "2.3 M");
        assert_eq!(magnitude(12.0), "12");
    }
}
