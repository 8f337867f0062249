//! Around the panes: menus, tool bar, status bar, notices, palette, start page, sheets.

pub(super) mod alignment;
pub(super) mod dialogs;
pub(super) mod files;
pub(super) mod keys;
pub(super) mod menu;
pub(super) mod notices;
pub(super) mod palette;
pub(super) mod sessions;
pub mod sheet;
pub(super) mod size;
pub(super) mod start;
pub(super) mod status;
pub(super) mod thumbnails;
pub(super) mod toolbar;

use crate::session::snapshot::OpenCapture;
use egui::TextureHandle;
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Instant, SystemTime};

/// The state of what is around and above the panes.
#[derive(Default)]
pub struct Shell {
    /// The open sheet.
    pub sheet: sheet::Sheet,
    /// The command palette, while it is open.
    pub palette: Option<palette::Palette>,
    /// Whether the window of keys is open.
    pub keys: bool,
    /// The start page.
    pub start: StartPage,
    /// The list of sessions.
    pub sessions: Sessions,
    /// The strip of photographs.
    pub thumbnails: Thumbnails,
    /// Memory in use.
    pub memory: Memory,
    /// How large everything is.
    pub size: size::Size,
}

/// The state of the page.
#[derive(Debug, Default)]
pub struct StartPage {
    /// Whether it was asked for, to cover the panes.
    pub asked: bool,
    /// The capture's path as typed.
    pub path: String,
    /// Why nothing was opened, with the remedy.
    pub problem: Option<String>,
}

/// What the list shows beside what the worker tells.
#[derive(Default)]
pub struct Sessions {
    /// Whether the line that names the continued session was closed.
    pub closed: bool,
    /// The session whose button to remove it was clicked once.
    removing: Option<PathBuf>,
    pictures: HashMap<PathBuf, (SystemTime, Option<TextureHandle>)>,
}

/// Small textures of photographs, made as they come into view.
#[derive(Default)]
pub struct Thumbnails {
    capture: Option<Arc<OpenCapture>>,
    exposure: f32,
    textures: HashMap<usize, TextureHandle>,
    followed: usize,
}

/// Memory of this process, looked up now and then.
#[derive(Default)]
pub struct Memory {
    looked_up: Option<Instant>,
    bytes: u64,
}
