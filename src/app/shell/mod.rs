//! Around the panes: menus, tool bar, status bar, notices, palette, start page, dialogs.

pub mod alignment;
pub mod dialogs;
pub mod files;
pub mod keys;
pub mod menu;
pub mod notices;
pub mod palette;
pub mod photographs;
pub mod sessions;
pub mod start;
pub mod status;
pub mod thumbnails;
pub mod toolbar;
