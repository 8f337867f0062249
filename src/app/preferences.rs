//! What the window remembers between runs: theme, recent captures, tone curve and layout, as one JSON file.

use crate::app::layout::{Pane, Workspace};
use crate::app::picture::look::ToneCurve;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Remembered choices.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Preferences {
    /// Whether the light theme is used.
    pub light: bool,
    /// How large everything is; `None` as the screen asks for.
    pub size: Option<f32>,
    /// Tone curve of radiance.
    pub tone: ToneCurve,
    /// Whether the strip of photographs is shown.
    pub thumbnails: bool,
    /// Whether G, R and S move, rotate and scale the chosen object as in Blender.
    pub blender_keys: bool,
    /// Captures opened before, the newest first.
    pub recent: Vec<PathBuf>,
    /// What the panes are arranged for.
    pub workspace: Workspace,
    /// Where the panes are in *Compose*; `None` as at the first start.
    pub compose: Option<egui_tiles::Tree<Pane>>,
    /// Where the panes are in *Inspect*.
    pub inspect: Option<egui_tiles::Tree<Pane>>,
}

impl Default for Preferences {
    fn default() -> Self {
        Self {
            light: false,
            size: None,
            tone: ToneCurve::None,
            thumbnails: true,
            blender_keys: false,
            recent: Vec::new(),
            workspace: Workspace::Compose,
            compose: None,
            inspect: None,
        }
    }
}

/// Captures that are remembered.
const RECENT: usize = 8;

impl Preferences {
    /// Reads the file; what is missing or cannot be read keeps its default.
    pub fn load(path: &Path) -> Self {
        let bytes = std::fs::read(path).unwrap_or_default();
        serde_json::from_slice(&bytes).unwrap_or_default()
    }

    /// The layout of a workspace.
    pub fn layout(&mut self, workspace: Workspace) -> &mut Option<egui_tiles::Tree<Pane>> {
        match workspace {
            Workspace::Compose => &mut self.compose,
            Workspace::Inspect => &mut self.inspect,
        }
    }

    /// Writes the file through a temporary one beside it, so that a kill leaves the old or the new.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn save(&self, path: &Path) -> std::io::Result<()> {
        let folder = path.parent().unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder)?;
        let file = tempfile::NamedTempFile::new_in(folder)?;
        serde_json::to_writer_pretty(&file, self)?;
        file.persist(path)?;
        Ok(())
    }

    /// Puts a capture at the head of the recent ones.
    pub fn opened(&mut self, folder: &Path) {
        self.recent.retain(|known| known != folder);
        self.recent.insert(0, folder.to_owned());
        self.recent.truncate(RECENT);
    }
}

/// The file of this user, where the system names a folder for it.
pub fn path() -> Option<PathBuf> {
    let folder = folder("APPDATA", "XDG_CONFIG_HOME", ".config")?;
    Some(folder.join("relit").join("window.json"))
}

/// The folder of this user's sessions, where the system names one for such things.
pub fn sessions() -> Option<PathBuf> {
    let folder = folder("LOCALAPPDATA", "XDG_STATE_HOME", ".local/state")?;
    Some(folder.join("relit").join("sessions"))
}

/// A user's folder: named by a variable on Windows, and elsewhere by another, or else below the home.
fn folder(windows: &str, elsewhere: &str, below_home: &str) -> Option<PathBuf> {
    let named = |variable| std::env::var_os(variable).map(PathBuf::from);
    if cfg!(windows) {
        named(windows)
    } else if cfg!(target_os = "macos") {
        Some(std::env::home_dir()?.join("Library/Application Support"))
    } else {
        named(elsewhere).or_else(|| Some(std::env::home_dir()?.join(below_home)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_saved_is_read_again_and_rubbish_is_the_default() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("deep/window.json");
        let mut preferences = Preferences {
            light: true,
            compose: Some(Workspace::Compose.first_layout()),
            ..Preferences::default()
        };
        for name in ["a", "b", "a"] {
            preferences.opened(Path::new(name));
        }
        assert_eq!(preferences.recent, [PathBuf::from("a"), PathBuf::from("b")]);
        preferences.save(&path).expect("saved");
        assert_eq!(Preferences::load(&path), preferences);
        std::fs::write(&path, "{").expect("written");
        assert_eq!(Preferences::load(&path), Preferences::default());
    }
}
