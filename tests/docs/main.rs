//! The documentation against the program: chapters made from it are as it makes them, the summary lists every chapter, links
//! lead somewhere, source files that it names exist, commands are lines that it takes, and the example of a capture can be read.
//!
//! `RELIT_WRITE_DOCS=1 cargo test --test docs` writes the made parts anew.

mod reference;

use relit::capture::read::{ReadOptions, read};
use relit::cli;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

const CHAPTERS: &str = "docs/src";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn text(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Compares a file with what the program makes of it, or writes it.
fn is_as_made(name: &str, made: &str) {
    let path = root().join(CHAPTERS).join(name);
    if std::env::var_os("RELIT_WRITE_DOCS").is_some_and(|value| value == "1") {
        fs::write(&path, made).expect("the docs can be written");
        return;
    }
    let found = text(&path);
    let differs = (found.lines().zip(made.lines())).find(|(found, made)| found != made);
    assert!(
        found == made,
        "{name} is not what the program makes; RELIT_WRITE_DOCS=1 cargo test --test docs writes it. First difference: {differs:#?}"
    );
}

/// All Markdown files that a person reads: those of the book and those at the top.
fn pages() -> Vec<PathBuf> {
    let folders = [root().to_path_buf(), root().join(CHAPTERS)];
    let mut pages: Vec<PathBuf> = (folders.iter())
        .flat_map(|folder| fs::read_dir(folder).expect("the docs are there"))
        .map(|entry| entry.expect("the docs are there").path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "md"))
        .collect();
    pages.sort();
    pages
}

/// The lines of a page, each with whether it is code: fenced, or indented by four spaces below an empty line.
fn lines(page: &str) -> Vec<(bool, &str)> {
    let (mut fenced, mut indented, mut empty) = (false, false, true);
    let mut lines = Vec::new();
    for line in page.lines() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
            lines.push((true, ""));
            continue;
        }
        indented = line.starts_with("    ") && (indented || empty);
        empty = line.trim().is_empty();
        lines.push((fenced || indented, line));
    }
    lines
}

/// A line of text without what stands between backticks.
fn without_code(line: &str) -> String {
    line.split('`').step_by(2).collect()
}

/// Targets of links and pictures.
fn targets(page: &str) -> Vec<String> {
    let text: Vec<String> = (lines(page).into_iter())
        .map(|(code, line)| {
            if code {
                String::new()
            } else {
                without_code(line)
            }
        })
        .collect();
    let text = text.join("\n");
    let ends = text.split("](").skip(1);
    ends.filter_map(|rest| rest.split([')', ' ', '\n']).next())
        .map(str::to_owned)
        .collect()
}

/// The anchor of a heading, as mdBook and GitHub make it.
fn anchor(heading: &str) -> String {
    let kept = |c: char| match c {
        c if c.is_whitespace() => Some('-'),
        c if c.is_alphanumeric() || c == '-' || c == '_' => Some(c),
        _ => None,
    };
    heading
        .trim()
        .to_lowercase()
        .chars()
        .filter_map(kept)
        .collect()
}

fn anchors(page: &str) -> BTreeSet<String> {
    let headings = lines(page).into_iter().filter(|(code, _)| !code);
    headings
        .filter_map(|(_, line)| Some(anchor(line.strip_prefix('#')?.trim_start_matches('#'))))
        .collect()
}

#[test]
fn the_command_line_is_documented_as_it_is() {
    is_as_made("command-line.md", &reference::markdown());
}

/// The commands of the window: by menu, with their keys.
#[cfg(feature = "gui")]
#[test]
fn the_keys_are_documented_as_they_are() {
    use relit::app::action::{Action, Menu};

    const BEGIN: &str = "<!-- keys: made by `RELIT_WRITE_DOCS=1 cargo test --test docs` -->\n";
    const END: &str = "<!-- end of keys -->";
    let mut made = String::new();
    for menu in Menu::ALL {
        made += &format!(
            "\n### {}\n\n| keys | command | what it does |\n| --- | --- | --- |\n",
            menu.name()
        );
        for action in Action::ALL.iter().filter(|action| action.menu() == menu) {
            let keys = action.shortcut().map_or_else(String::new, |shortcut| {
                let names = egui::ModifierNames::NAMES;
                format!("`{}`", symbols(&shortcut.format(&names, false)))
            });
            made += &format!("| {keys} | {} | {} |\n", action.text(), action.help());
        }
    }
    let page = text(&root().join(CHAPTERS).join("window.md"));
    let (before, rest) = page
        .split_once(BEGIN)
        .expect("window.md has a place for the keys");
    let (_, after) = rest.split_once(END).expect("the keys have an end");
    is_as_made("window.md", &format!("{before}{BEGIN}{made}\n{END}{after}"));
}

/// Keys as they stand on a keyboard.
#[cfg(feature = "gui")]
fn symbols(keys: &str) -> String {
    let (modifiers, key) = match keys.rsplit_once('+') {
        Some((modifiers, key)) => (format!("{modifiers}+"), key),
        None => (String::new(), keys),
    };
    let symbol = match key {
        "Plus" => "+",
        "Minus" => "-",
        "Period" => ".",
        "OpenBracket" => "[",
        "CloseBracket" => "]",
        "Questionmark" => "?",
        "Escape" => "Esc",
        key => key,
    };
    modifiers + symbol
}

#[test]
fn the_summary_lists_every_chapter_and_every_chapter_that_it_lists_is_there() {
    let listed: BTreeSet<String> = targets(&text(&root().join(CHAPTERS).join("SUMMARY.md")))
        .into_iter()
        .collect();
    let there: BTreeSet<String> = fs::read_dir(root().join(CHAPTERS))
        .expect("the docs are there")
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| name.ends_with(".md") && name != "SUMMARY.md")
        .collect();
    assert!(!there.is_empty());
    assert_eq!(listed, there);
}

#[test]
fn every_link_and_every_picture_leads_somewhere() {
    let mut broken = Vec::new();
    for page in pages() {
        let own = text(&page);
        for target in targets(&own) {
            if ["http://", "https://", "mailto:"]
                .iter()
                .any(|far| target.starts_with(far))
            {
                continue;
            }
            let (path, place) = target.split_once('#').unwrap_or((&target, ""));
            let file = match path {
                "" => page.clone(),
                path => page.with_file_name(path),
            };
            let leads = file.exists()
                && (place.is_empty() || file.is_file() && anchors(&text(&file)).contains(place));
            if !leads {
                broken.push(format!("{}: {target}", page.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
}

/// All files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("the source is there");
    let paths = entries.map(|entry| entry.expect("the source is there").path());
    let all = paths.flat_map(|path| match path.is_dir() {
        true => files(&path),
        false => vec![path],
    });
    all.collect()
}

#[test]
fn every_source_file_that_is_named_exists() {
    let sources: Vec<PathBuf> = (["src", "tests", "benches", "fuzz"].iter())
        .flat_map(|folder| files(&root().join(folder)))
        .collect();
    let (mut missing, mut named) = (Vec::new(), 0);
    for page in pages() {
        let own = text(&page);
        // NAME stands for any.
        let names = (own.split('`').skip(1).step_by(2))
            .filter(|name| name.ends_with(".rs") && !name.contains([' ', '*', '{']))
            .filter(|name| !name.contains("NAME"));
        for name in names {
            named += 1;
            if !sources.iter().any(|path| path.ends_with(name)) {
                missing.push(format!("{}: {name}", page.display()));
            }
        }
    }
    assert!(named > 20, "only {named} names were found");
    assert!(missing.is_empty(), "{missing:#?}");
}

#[test]
fn every_command_is_one_that_the_program_takes() {
    let (mut refused, mut tried) = (Vec::new(), 0);
    for page in pages() {
        let own = text(&page);
        let mut rest = lines(&own).into_iter().filter(|(code, _)| *code);
        while let Some((_, line)) = rest.next() {
            let Some(command) = line.trim().strip_prefix("relit ") else {
                continue;
            };
            let mut whole = command.to_owned();
            while let Some(begun) = whole.strip_suffix('\\') {
                let next = rest.next().map_or("", |(_, line)| line.trim());
                whole = format!("{begun}{next}");
            }
            let words = words(&whole);
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            // A synopsis, not a line to type.
            if words.iter().any(|word| word.starts_with(['[', '<'])) {
                continue;
            }
            tried += 1;
            // Help and the version are printed too.
            if let Err(error) = cli::check(&words)
                && error.use_stderr()
            {
                refused.push(format!("{}: relit {whole}: {error}", page.display()));
            }
        }
    }
    assert!(tried > 20, "only {tried} commands were found");
    assert!(refused.is_empty(), "{}", refused.join("\n"));
}

/// The words of a line for a shell, up to a comment or another program.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut quoted) = (vec![String::new()], false);
    for letter in line.chars() {
        match letter {
            '"' | '\'' => quoted = !quoted,
            ' ' if !quoted => words.push(String::new()),
            letter => {
                if let Some(word) = words.last_mut() {
                    word.push(letter);
                }
            }
        }
    }
    let said = words.into_iter().filter(|word| !word.is_empty());
    said.take_while(|word| !["#", "|", "&&"].contains(&word.as_str()))
        .collect()
}

/// The blocks of code of a language in a page.
fn blocks(page: &str, language: &str) -> Vec<String> {
    let begin = format!("\n```{language}\n");
    (page.split(&begin).skip(1))
        .filter_map(|rest| Some(rest.split_once("\n```")?.0.to_owned()))
        .collect()
}

#[test]
fn the_example_of_a_capture_can_be_read() {
    let page = text(&root().join(CHAPTERS).join("capture-format.md"));
    let first = |language: &str| blocks(&page, language).into_iter().next();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let write = |name: &str, contents: &str| fs::write(folder.path().join(name), contents);
    write(
        "transforms.json",
        &first("json").expect("the example has cameras"),
    )
    .expect("written");
    write("mesh.obj", &first("obj").expect("the example has a mesh")).expect("written");
    fs::create_dir(folder.path().join("images")).expect("made");
    let photograph = image::RgbImage::from_pixel(64, 48, image::Rgb([120, 110, 100]));
    photograph
        .save(folder.path().join("images/000.png"))
        .expect("written");

    let capture = read(folder.path(), &ReadOptions::default()).expect("the example can be read");
    assert_eq!(capture.warnings, [""; 0]);
    assert_eq!(capture.mesh.objects, ["floor", "wall", "lamp"]);
    assert_eq!(capture.frames.len(), 1);
    // Its lamp looks down and its floor up.
    for (object, up) in [(0, 1.0), (2, -1.0)] {
        let triangle = capture.mesh.object_of.iter().position(|&o| o == object);
        let [a, b, c] = capture.mesh.triangles[triangle.expect("it has faces")]
            .map(|corner| capture.mesh.positions[corner as usize]);
        assert!((b - a).cross(c - a).normalize().y * up > 0.99);
    }
}
