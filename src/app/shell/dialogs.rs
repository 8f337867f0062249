//! File dialogs on a thread of their own, so that the window goes on while one is open.

use crate::app::task::Task;
use std::path::PathBuf;

/// What a dialog asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ask {
    Capture,
    SaveFolder,
    ExportFile,
    Object,
}

/// The dialog that is open.
#[derive(Default)]
pub struct Dialogs(Option<(Ask, Task<(), Option<PathBuf>>)>);

impl Dialogs {
    /// Opens a dialog unless one is open.
    pub fn open(&mut self, ask: Ask, ctx: &egui::Context) {
        if self.0.is_none() {
            let task = Task::begin("file dialog", ctx, move |_| Ok(choose(ask)));
            self.0 = task.ok().map(|task| (ask, task));
        }
    }

    /// The answer of a dialog that has closed. Where there is no portal and no dialog program it is the same as for Cancel.
    pub fn take(&mut self) -> Option<(Ask, Option<PathBuf>)> {
        let (ask, task) = self.0.as_mut()?;
        let answer = (*ask, task.end()?.ok().flatten());
        self.0 = None;
        Some(answer)
    }
}

fn choose(ask: Ask) -> Option<PathBuf> {
    let dialog = rfd::FileDialog::new();
    match ask {
        Ask::Capture => dialog.set_title("Open capture").pick_folder(),
        Ask::SaveFolder => dialog.set_title("Save results").pick_folder(),
        Ask::ExportFile => dialog.set_title("Export").save_file(),
        Ask::Object => dialog
            .set_title("Insert object")
            .add_filter("Objects", &crate::app::insertion::ENDINGS)
            .pick_file(),
    }
}
