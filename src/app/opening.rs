//! Opening whatever a person has: a capture, results, an object, or a scan of another program, which is imported first.

use crate::app::insertion::is_object;
use crate::app::layout::Pane;
use crate::app::state::App;
use crate::app::task::{Course, Task};
use crate::capture::import::{self, ImportOptions};
use crate::capture::read::CAMERAS;
use crate::error::{Error, Result};
use crate::export;
use crate::session::command::{Command, Source};
use crate::session::save::{CHECKPOINT, ESTIMATE};
use crate::session::snapshot::Level;
use std::path::{Path, PathBuf};

/// A scan being imported; it ends with what was found and guessed.
pub struct Importing {
    out: PathBuf,
    task: Task<(), Vec<String>>,
}

impl Importing {
    /// What it is at, in words.
    pub fn doing(&self) -> String {
        self.task.doing()
    }
}

impl App {
    /// Opens what lies at a path.
    pub fn open_path(&mut self, path: &Path, ctx: &egui::Context) {
        self.trouble = None;
        let holds = |name: &str| path.join(name).exists();
        if is_object(path) && self.capture().is_some() {
            self.insert(path.to_owned());
            self.bring_forward = Some(Pane::Insert);
        } else if path.file_name().is_some_and(|name| name == CAMERAS) {
            let folder = path.parent().unwrap_or(Path::new("."));
            self.open(Source::Folder(folder.to_owned()));
        } else if holds(CAMERAS) {
            self.open(Source::Folder(path.to_owned()));
        } else if holds(ESTIMATE) || holds(CHECKPOINT) {
            self.start_page = false;
            self.send(Command::Resume(path.to_owned()));
        } else if path.is_dir() {
            self.import(path, ctx);
        } else {
            let found = match (path.exists(), is_object(path)) {
                (false, _) => "there is nothing; check the path",
                (true, true) => "is an object; open a capture first, then insert it",
                (true, false) => {
                    "is no capture; choose the folder that holds transforms.json or a scan's files"
                }
            };
            self.trouble = Some(format!("{}: {found}", path.display()));
            self.start_page = true;
        }
    }

    /// Opens the folder whose path was typed.
    pub fn open_typed(&mut self, ctx: &egui::Context) {
        let path = PathBuf::from(self.path.trim());
        if !path.as_os_str().is_empty() {
            self.open_path(&path, ctx);
        }
    }

    /// Begins to import a scan beside the results; one that was imported before is opened.
    fn import(&mut self, source: &Path, ctx: &egui::Context) {
        let results = Source::Folder(source.to_owned()).default_out();
        let out = results.join("capture");
        if out.join(CAMERAS).exists() {
            let said = format!("the scan was imported into {} before", out.display());
            self.notices.say(Level::Info, said);
            self.open(Source::Folder(out));
            return;
        }
        let ctx = ctx.clone();
        let (from, into) = (source.to_owned(), out.clone());
        let work = move |course: &Course<()>| import(course, &from, &into);
        match Task::begin("import", move || ctx.request_repaint(), work) {
            Ok(task) => self.importing = Some(Importing { out, task }),
            Err(error) => self.trouble = Some(error.to_string()),
        }
        self.start_page = true;
    }

    /// Ends an import; nothing is written of it.
    pub fn cancel_import(&mut self) {
        self.importing = None;
    }

    /// Opens what was imported.
    pub(in crate::app) fn take_import(&mut self) {
        let Some(importing) = &mut self.importing else {
            return;
        };
        let Some(end) = importing.task.end() else {
            return;
        };
        let out = importing.out.clone();
        self.importing = None;
        match end {
            Ok(said) => {
                for line in said {
                    self.notices.say(Level::Info, line);
                }
                self.open(Source::Folder(out));
            }
            Err(why) => {
                self.trouble = Some(why);
                self.start_page = true;
            }
        }
    }
}

fn import(course: &Course<()>, source: &Path, out: &Path) -> Result<Vec<String>> {
    course.say("looking for a scan");
    let scan = import::read(source, &ImportOptions::default(), &mut |done, all| {
        course.say(format!("{done} of {all} depth images fused"));
    })?;
    if course.is_ended() {
        return Err(Error::file(
            source,
            "the import was cancelled",
            "import it again",
        ));
    }
    course.say("writing the capture");
    export::import::write(out, &scan)?;
    Ok(scan.remarks)
}
