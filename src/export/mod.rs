//! Output: pictures, plots, tables, and scenes for other programs. Every file is written atomically.

pub mod atlas;
pub mod atomic;
pub mod canvas;
pub mod capture;
pub mod compare;
pub mod exr;
pub mod falsecolor;
pub mod glb;
pub mod heading;
pub mod import;
pub mod light_layers;
pub mod mitsuba;
pub mod new_folder;
pub mod obj;
pub mod overwrite;
pub mod part;
pub mod picture;
pub mod plot;
pub mod ply;
pub mod probe;
pub mod resample;
pub mod scale;
pub mod scene;
pub mod strips;
pub mod table;
