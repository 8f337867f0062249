//! Opens captures, results, objects, and scans of other programs, which are imported first.

use crate::app::insertion::is_object;
use crate::app::layout::Pane;
use crate::app::state::App;
use crate::app::task::{Progress, Task};
use crate::capture::import::{self, ImportOptions};
use crate::capture::read::CAMERAS;
use crate::error::{Error, Result};
use crate::export;
use crate::session::command::{Command, PathKind, Source};
use crate::session::snapshot::Level;
use std::path::{Path, PathBuf};

impl App {
    /// Opens what lies at a path.
    pub fn open_path(&mut self, path: &Path, ctx: &egui::Context) {
        self.view.shell.start.problem = None;
        if is_object(path) && self.document.capture().is_some() {
            self.insert(path.to_owned());
            self.view.bring_forward(Pane::Insert);
            return;
        }
        match PathKind::at(path) {
            Ok(PathKind::Capture(folder)) => self.open(Source::Folder(folder)),
            Ok(PathKind::Results(folder)) => self.resume(folder),
            Ok(PathKind::Scan(folder)) => self.import(&folder, ctx),
            Err(_) => {
                let found = match (path.exists(), is_object(path)) {
                    (false, _) => "there is nothing; check the path",
                    (true, true) => "is an object; open a capture first, then insert it",
                    (true, false) => {
                        "is no capture; choose the folder that holds transforms.json or a scan's files"
                    }
                };
                self.view.shell.start.problem = Some(format!("{}: {found}", path.display()));
                self.view.shell.start.asked = true;
            }
        }
    }

    /// Begins to import a scan beside the results; one that was imported before is opened.
    fn import(&mut self, source: &Path, ctx: &egui::Context) {
        let out = PathKind::imported(source);
        if out.join(CAMERAS).exists() {
            let said = format!("the scan was imported into {} before", out.display());
            self.say(Level::Info, said);
            self.open(Source::Folder(out));
            return;
        }
        let (from, into) = (source.to_owned(), out.clone());
        let work = move |progress: &Progress<()>| import(progress, &from, &into);
        match Task::begin("import", ctx, work) {
            Ok(task) => self.jobs.importing = Some((out, task)),
            Err(error) => self.view.shell.start.problem = Some(error.to_string()),
        }
        self.view.shell.start.asked = true;
    }

    pub(in crate::app) fn take_import(&mut self) {
        let Some((out, task)) = &mut self.jobs.importing else {
            return;
        };
        let Some(end) = task.end() else {
            return;
        };
        let out = std::mem::take(out);
        self.jobs.importing = None;
        match end {
            Ok(said) => {
                for line in said {
                    self.say(Level::Info, line);
                }
                self.open(Source::Folder(out));
            }
            Err(why) => {
                self.view.shell.start.problem = Some(why);
                self.view.shell.start.asked = true;
            }
        }
    }

    /// Goes on with a session that is kept, or with results.
    pub(super) fn resume(&mut self, folder: PathBuf) {
        self.view.shell.start.asked = false;
        self.send(Command::Resume(folder));
    }
}

fn import(progress: &Progress<()>, source: &Path, out: &Path) -> Result<Vec<String>> {
    progress.say("looking for a scan");
    let scan = import::read(source, &ImportOptions::default(), &mut |done, all| {
        progress.say(format!("{done} of {all} depth images fused"));
    })?;
    if progress.is_cancelled() {
        let problem = "the import was cancelled";
        return Err(Error::file(source, problem, "import it again"));
    }
    progress.say("writing the capture");
    export::import::write(out, &scan)?;
    Ok(scan.remarks)
}
