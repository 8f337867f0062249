//! File dialogs on a thread of their own, so that the window goes on while one is open.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};

/// What a dialog asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ask {
    /// A capture's folder.
    Capture,
    /// A folder for results.
    SaveFolder,
    /// A file to export to.
    ExportFile,
    /// An object to insert.
    Object,
}

/// The dialogs' mailbox.
#[derive(Debug)]
pub struct Dialogs {
    sender: Sender<(Ask, Option<PathBuf>)>,
    receiver: Receiver<(Ask, Option<PathBuf>)>,
    open: bool,
}

impl Default for Dialogs {
    fn default() -> Self {
        let (sender, receiver) = channel();
        Self {
            sender,
            receiver,
            open: false,
        }
    }
}

impl Dialogs {
    /// Opens a dialog unless one is open. `answered` is called on the dialog's thread when it has closed.
    pub fn open(&mut self, ask: Ask, answered: impl FnOnce() + Send + 'static) {
        if self.open {
            return;
        }
        let sender = self.sender.clone();
        let spawned = std::thread::Builder::new()
            .name("file dialog".to_owned())
            .spawn(move || {
                // Where there is no portal and no dialog program the answer is the same as for Cancel.
                let answer = std::panic::catch_unwind(|| choose(ask)).ok().flatten();
                if sender.send((ask, answer)).is_ok() {
                    answered();
                }
            });
        self.open = spawned.is_ok();
    }

    /// The answer of a dialog that has closed since the last call.
    pub fn take(&mut self) -> Option<(Ask, Option<PathBuf>)> {
        let answer = self.receiver.try_recv().ok();
        if answer.is_some() {
            self.open = false;
        }
        answer
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
