//! Captures and objects that lie beside the project and are no part of it.

use std::path::{Path, PathBuf};

/// The folder or file of that name in `../shared`, as `captures/cornell`.
///
/// Where it is absent the test says so in a line and is left out; where `RELIT_REQUIRE_CAPTURES` is 1 it fails.
pub fn beside(name: &str) -> Option<PathBuf> {
    let required = std::env::var_os("RELIT_REQUIRE_CAPTURES").is_some_and(|value| value == "1");
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../shared")
        .join(name);
    if path.exists() {
        return Some(path);
    }
    assert!(
        !required,
        "../shared/{name} is absent, and RELIT_REQUIRE_CAPTURES is 1"
    );
    println!("skipped: ../shared/{name} is absent");
    None
}
