//! Imports point downwards only: every `crate::…` path in the sources, against the layers of `src/lib.rs`.

use std::fs;
use std::path::{Path, PathBuf};

/// Layers from the bottom; those of one row may not import each other unless listed in [`BESIDE`].
const LAYERS: &[&[&str]] = &[
    &["error"],
    &["say"],
    &["math"],
    &["capture"],
    &["scene"],
    &["transport"],
    &["gpu"],
    &["render"],
    &["calibrate"],
    &["inverse"],
    &["compose", "export", "room"],
    &["study"],
    &["session"],
    &["cli", "app"],
];

/// Imports within a row: (from, to).
const BESIDE: &[(&str, &str)] = &[("compose", "export"), ("room", "export")];

fn level(module: &str) -> Option<usize> {
    LAYERS.iter().position(|row| row.contains(&module))
}

fn sources(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("src is readable") {
        let path = entry.expect("src is readable").path();
        if path.is_dir() {
            sources(&path, files);
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
}

/// The top modules that a source names, by `crate::module` or in a braced `use crate::{…}`.
fn imports(source: &str) -> Vec<String> {
    let word = |text: &str| -> String {
        text.chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect()
    };
    let code: String = source
        .lines()
        .map(|line| line.split("//").next().unwrap_or(""))
        .collect::<Vec<_>>()
        .join("\n");
    code.split("crate::")
        .skip(1)
        .flat_map(|rest| match rest.strip_prefix('{') {
            Some(list) => {
                let end = list.find(';').unwrap_or(list.len());
                let mut depth = 0;
                let mut names = vec![String::new()];
                for c in list[..end].chars() {
                    match c {
                        '{' => depth += 1,
                        '}' => depth -= 1,
                        ',' if depth == 0 => names.push(String::new()),
                        _ => {}
                    }
                    if depth == 0 && c != ',' {
                        names.last_mut().expect("never empty").push(c);
                    }
                }
                names.iter().map(|n| word(n.trim())).collect()
            }
            None => vec![word(rest)],
        })
        .filter(|name| !name.is_empty())
        .collect()
}

/// Imports that point upwards or sideways in one file of a module.
fn violations(module: &str, source: &str) -> Vec<String> {
    let Some(own) = level(module) else {
        return vec![format!("{module} is in no layer")];
    };
    imports(source)
        .into_iter()
        .filter(|to| to != module && !BESIDE.contains(&(module, to)))
        .filter(|to| level(to).is_none_or(|level| level >= own))
        .map(|to| format!("{module} imports {to}"))
        .collect()
}

#[test]
fn imports_point_downwards() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    assert!(files.len() > 20, "only {} sources found", files.len());
    let mut wrong = Vec::new();
    for file in files {
        let inside = file.strip_prefix(&root).expect("within src");
        let first = inside.components().next().expect("a file");
        let module = Path::new(first.as_os_str()).with_extension("");
        let module = module.to_str().expect("a plain name");
        if ["lib", "main"].contains(&module) {
            continue;
        }
        let source = fs::read_to_string(&file).expect("readable");
        for violation in violations(module, &source) {
            wrong.push(format!("{}: {violation}", inside.display()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Layers inside a folder, from the bottom; a row's modules do not import each other.
const INSIDE: &[(&str, &[&[&str]])] = &[
    (
        "calibrate",
        &[
            &["problem", "held_out", "alignment"],
            &["gbuffer", "sharpness", "photographs"],
            &["measured_radiance", "censored"],
            &["exposure"],
            &["calibrated", "segments"],
        ],
    ),
    (
        "inverse",
        &[
            &["unknowns", "known", "roles", "settings", "estimate", "sky"],
            &["outside"],
            &["solver", "loss"],
            &["monitor", "paths", "lobe", "texture"],
            &["fit"],
            &["emitters"],
            &["pipeline", "paper"],
        ],
    ),
];

#[test]
fn imports_inside_a_folder_point_downwards() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut wrong = Vec::new();
    for (folder, layers) in INSIDE {
        let level = |module: &str| layers.iter().position(|row| row.contains(&module));
        let mut files = Vec::new();
        sources(&root.join(folder), &mut files);
        for file in files {
            let inside = file.strip_prefix(root.join(folder)).expect("within it");
            let first = inside.components().next().expect("a file");
            let own = Path::new(first.as_os_str()).with_extension("");
            let own = own.to_str().expect("a plain name");
            if own == "mod" {
                continue;
            }
            let source = fs::read_to_string(&file).expect("readable");
            assert!(!source.contains("use super::super"), "{}", inside.display());
            let from = level(own).unwrap_or_else(|| panic!("{folder}/{own} is in no layer"));
            for to in imports(&source.replace(&format!("crate::{folder}::"), "inside crate::")) {
                if to != own && level(&to).is_some_and(|to| to >= from) {
                    wrong.push(format!("{folder}/{}: imports {to}", inside.display()));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The sources that read environment variables: folders of preferences, the display, and the library of a denoiser.
const READ_ENVIRONMENT: [&str; 3] = ["app/preferences.rs", "cli/mod.rs", "transport/oidn.rs"];

#[test]
fn no_hidden_switch_is_read_from_the_environment() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let mut found: Vec<String> = (files.iter())
        .filter(|file| {
            let source = fs::read_to_string(file).expect("src is readable");
            source.contains("env::var")
        })
        .map(|file| {
            let inside = file.strip_prefix(&root).expect("inside src");
            inside.to_string_lossy().replace('\\', "/")
        })
        .collect();
    found.sort();
    assert_eq!(found, READ_ENVIRONMENT);
}

#[test]
fn the_window_library_stays_in_the_window() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    for file in files {
        let inside = file.strip_prefix(&root).expect("within src");
        if inside.starts_with("app") {
            continue;
        }
        let source = fs::read_to_string(&file).expect("readable");
        for name in ["egui::", "eframe::", "wgpu::"] {
            let is_gpu = name == "wgpu::" && inside.starts_with("gpu");
            let used = source.contains(name) && !is_gpu;
            assert!(!used, "{} uses {name}", inside.display());
        }
    }
}

/// Files of the window that may name all of its state: they make, update and change it, or hand its parts to panes.
const WHOLE: [&str; 6] = ["state", "update", "perform", "panes", "window", "run"];

/// All paths below `crate::` that a source names, one a name in braces; tests are left out.
fn paths(source: &str) -> Vec<Vec<String>> {
    let code = source.split("#[cfg(test)]").next().unwrap_or("");
    let code: String = (code.lines())
        .filter_map(|line| line.split("//").next())
        .collect();
    let mut paths = Vec::new();
    for rest in code.split("crate::").skip(1) {
        let mut open: Vec<usize> = Vec::new();
        let mut path = vec![String::new()];
        for c in rest.chars() {
            match c {
                '{' => open.push(path.len() - 1),
                ',' | '}' if !open.is_empty() => {
                    paths.push(path.clone());
                    if c == '}' {
                        open.pop();
                    }
                    path.truncate(open.last().copied().unwrap_or(0));
                    path.push(String::new());
                }
                ':' if path.last().is_some_and(|name| !name.is_empty()) => path.push(String::new()),
                c if c.is_alphanumeric() || c == '_' => path.last_mut().expect("one").push(c),
                ':' => {}
                c if c.is_whitespace() && !open.is_empty() => {}
                _ => break,
            }
        }
        paths.push(path);
    }
    paths
}

/// The modules of the window by their paths below `app`, and the text of each.
fn window() -> Vec<(Vec<String>, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/app");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let module = |file: &PathBuf| {
        let inside = file
            .strip_prefix(&root)
            .expect("within app")
            .with_extension("");
        let names = inside
            .iter()
            .map(|name| name.to_string_lossy().into_owned());
        names.filter(|name| name != "mod").collect()
    };
    let text = |file| fs::read_to_string(file).expect("readable");
    files
        .iter()
        .map(|file| (module(file), text(file)))
        .collect()
}

/// Modules that import each other in a circle: taken away one by one, those that import none of the others.
fn circle(modules: &[(Vec<String>, String)]) -> Vec<Vec<String>> {
    let find = |path: &[String]| {
        let fits = |k: &usize| modules.iter().any(|(module, _)| module == &path[..*k]);
        let longest = (1..=path.len()).rev().find(fits)?;
        modules
            .iter()
            .position(|(module, _)| module == &path[..longest])
    };
    let imports: Vec<Vec<usize>> = (modules.iter().enumerate())
        .map(|(own, (_, text))| {
            let paths = paths(text);
            let inside = paths.iter().filter(|path| path[0] == "app");
            inside
                .filter_map(|path| find(&path[1..]))
                .filter(|to| *to != own)
                .collect()
        })
        .collect();
    let mut left: Vec<usize> = (0..modules.len()).collect();
    loop {
        let before = left.clone();
        left.retain(|&own| imports[own].iter().any(|to| before.contains(to)));
        if left.len() == before.len() {
            return left.iter().map(|&own| modules[own].0.clone()).collect();
        }
    }
}

#[test]
fn panes_borrow_parts_of_the_windows_state_and_no_files_of_it_import_each_other() {
    let modules = window();
    assert!(modules.len() > 60, "only {} files found", modules.len());
    for (module, text) in &modules {
        let whole = module
            .first()
            .is_some_and(|name| WHOLE.contains(&name.as_str()));
        let state = ["app".to_owned(), "state".to_owned()];
        let names = paths(text).iter().any(|path| path.starts_with(&state));
        assert!(whole || !names, "{} names App", module.join("/"));
    }
    let circle = circle(&modules);
    assert!(circle.is_empty(), "in a circle, or above one: {circle:?}");
}

#[test]
fn a_circle_would_be_found() {
    let module = |name: &str, text: &str| (vec![name.to_owned()], text.to_owned());
    let [a, b] = ["use crate::app::{b::B, c};", "use crate::app::a::{A};"];
    let modules = [module("a", a), module("b", b), module("c", "")];
    assert_eq!(circle(&modules), [["a"], ["b"]]);
    assert!(
        circle(&[
            module("a", a),
            module("b", "// crate::app::a"),
            module("c", "")
        ])
        .is_empty()
    );
    let found = paths("use crate::app::{a::{A, B}, state::App};\n#[cfg(test)]\nuse crate::x;");
    assert!(found.contains(&vec!["app".into(), "state".into(), "App".into()]));
}

#[test]
fn upward_and_sideways_imports_would_be_found() {
    assert!(violations("math", "use crate::scene::Scene;").len() == 1);
    assert!(violations("session", "fn f() { crate::cli::run() }").len() == 1);
    assert!(violations("cli", "use crate::{app::run, error::{Error, Result}};").len() == 1);
    assert!(violations("export", "use crate::room::write;").len() == 1);
    assert!(violations("scene", "use crate::nowhere::X;").len() == 1);
    assert!(violations("session", "use crate::session::slot::Slot; // crate::cli").is_empty());
    assert!(violations("cli", "use crate::{error::{Error, Result}, math};").is_empty());
}
