//! The program: the command line, with the window where the build has one.

use relit::cli::{self, Window};

#[cfg(feature = "gui")]
const WINDOW: Option<Window> = Some(relit::app::run);
#[cfg(not(feature = "gui"))]
const WINDOW: Option<Window> = None;

fn main() {
    std::process::exit(cli::run(WINDOW));
}
