//! Around the panes: menus, tool bar, status bar, notices, palette, start page, sheets.

pub mod alignment;
pub mod dialogs;
pub mod files;
pub mod keys;
pub mod menu;
pub mod notices;
pub mod palette;
pub mod path;
pub mod photographs;
pub mod sessions;
pub mod sheet;
pub mod size;
pub mod start;
pub mod status;
pub mod thumbnails;
pub mod toolbar;

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
    pub sessions: sessions::Sessions,
    /// The strip of photographs.
    pub thumbnails: thumbnails::Thumbnails,
    /// Memory in use.
    pub memory: status::Memory,
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
