//! Holds the library's imports to the module diagram of ARCHITECTURE.md.
//!
//! The sources' `crate::name` and `use crate::{name, …}` paths are read as text, outside comments;
//! what follows a `#[cfg(test)] mod` counts as test code, and so do the files such a line names.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Modules that everybody may import.
const FOR_ALL: [&str; 1] = ["problem"];
/// Modules that exist for tests, and that all tests may import.
const FOR_TESTS: [&str; 2] = ["check", "fixture"];
/// What the tests of a module may import beyond the list: (module, imported).
const TEST_EXCEPTIONS: [(&str, &str); 3] = [
    ("pattern", "io"),
    ("pattern", "garment"),
    ("body_model", "io"),
];

/// A top-level module, its imports, and whether each is made by test code.
type Imports = BTreeMap<String, BTreeSet<(String, bool)>>;

#[test]
fn imports_keep_to_the_diagram() {
    let allowed = listed();
    let mut wrong = Vec::new();
    for (module, imports) in &found() {
        let Some(may) = allowed.get(module) else {
            wrong.push(format!("`{module}` is not in the list of ARCHITECTURE.md"));
            continue;
        };
        for (imported, in_test) in imports {
            let fine = imported == module
                || may.contains(imported)
                || FOR_ALL.contains(&imported.as_str())
                || *in_test && FOR_TESTS.contains(&imported.as_str())
                || *in_test && TEST_EXCEPTIONS.contains(&(module, imported));
            if !fine {
                let part = if *in_test { "tests of " } else { "" };
                wrong.push(format!("{part}`{module}` imports `{imported}`"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_list_names_every_module_and_no_other() {
    let declared: BTreeSet<String> = found().into_keys().collect();
    let named: BTreeSet<String> = listed().into_keys().collect();
    assert_eq!(named, declared, "ARCHITECTURE.md (left) and the sources");
}

#[test]
fn the_drawing_and_the_list_name_the_same_modules() {
    let text = document();
    let drawing = text.split("```").nth(1).expect("ARCHITECTURE.md draws");
    let words: BTreeSet<&str> = drawing
        .split(|c: char| !c.is_ascii_alphanumeric() && c != '-' && c != '_')
        .collect();
    for module in listed().keys() {
        let drawn = words.contains(module.as_str()) || FOR_ALL.contains(&module.as_str());
        assert!(drawn, "`{module}` is missing in the drawing");
    }
}

#[test]
fn the_middle_modules_are_strangers_and_the_list_has_no_circle() {
    let allowed = listed();
    let middle = ["cage", "transfer", "sim", "loss"];
    for module in middle {
        let known = middle
            .iter()
            .find(|other| allowed[module].contains(**other));
        assert_eq!(known, None, "`{module}` may import another of the four");
    }
    // Taking away what imports nothing that is left must take away everything.
    let mut left = allowed;
    while let Some(leaf) = left
        .iter()
        .find(|(_, may)| may.iter().all(|other| !left.contains_key(other)))
        .map(|(module, _)| module.clone())
    {
        left.remove(&leaf);
    }
    assert!(left.is_empty(), "a circle among {:?}", left.keys());
}

#[test]
fn an_import_in_the_middle_of_code_is_found() {
    let text = "use crate::{body::Body, io};\n// crate::loss\nfn f() { crate::sim::go() }\n\
                #[cfg(test)]\n#[allow(x)]\nmod tests {\nuse crate::check::noise;\n}\n";
    let found = imports(text);
    let expected = [
        ("body", false),
        ("check", true),
        ("io", false),
        ("sim", false),
    ];
    let expected = expected.map(|(name, in_test)| (name.to_owned(), in_test));
    assert_eq!(found, BTreeSet::from(expected));
}

/// The table of ARCHITECTURE.md: what each module may import.
fn listed() -> BTreeMap<String, BTreeSet<String>> {
    let text = document();
    let names = |cell: &str| -> BTreeSet<String> {
        let quoted = cell.split('`').skip(1).step_by(2);
        quoted.map(str::to_owned).collect()
    };
    let table = text
        .lines()
        .skip_while(|line| *line != "| module | may import |")
        .skip(2)
        .take_while(|line| line.starts_with('|'));
    let row = |line: &str| {
        let cells: Vec<&str> = line.split('|').collect();
        let module = names(cells[1]).pop_first().expect("a row names a module");
        (module, names(cells[2]))
    };
    let listed: BTreeMap<_, _> = table.map(row).collect();
    assert!(!listed.is_empty(), "ARCHITECTURE.md has lost its list");
    listed
}

fn document() -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    fs::read_to_string(root.join("ARCHITECTURE.md")).expect("ARCHITECTURE.md can be read")
}

/// The imports of every module of the library, by its first path segment.
fn found() -> Imports {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    collect(&sources, &mut files);
    let texts: BTreeMap<PathBuf, String> = files
        .into_iter()
        .map(|file| {
            let text = fs::read_to_string(&file).expect("a source file can be read");
            (file, text)
        })
        .collect();
    let test_only: Vec<PathBuf> = texts
        .iter()
        .flat_map(|(file, text)| test_modules(text).map(|name| folder_of(file).join(name)))
        .collect();
    let mut found = Imports::new();
    for (file, text) in &texts {
        let module = module_of(&sources, file);
        if module == "lib" || FOR_TESTS.contains(&module.as_str()) {
            continue;
        }
        let whole = file.with_extension("");
        let in_test = test_only.iter().any(|only| whole.starts_with(only));
        let imports = imports(text).into_iter();
        let imports = imports.map(|(name, test)| (name, test || in_test));
        found.entry(module).or_default().extend(imports);
    }
    found
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("the sources can be listed") {
        let path = entry.expect("the sources can be listed").path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
}

/// Where the modules that `file` declares are: `foo/` for `foo.rs`, beside it for `lib.rs`.
fn folder_of(file: &Path) -> PathBuf {
    if file.ends_with("lib.rs") {
        file.with_file_name("")
    } else {
        file.with_extension("")
    }
}

/// The first path segment of `file` below `sources`, without extension.
fn module_of(sources: &Path, file: &Path) -> String {
    let below = file.strip_prefix(sources).expect("found below the sources");
    let first = below.iter().next().expect("a file has a name");
    Path::new(first)
        .with_extension("")
        .to_string_lossy()
        .into_owned()
}

/// Names declared as `#[cfg(test)] mod name;`.
fn test_modules(text: &str) -> impl Iterator<Item = &str> {
    let declared = text.split("#[cfg(test)]").skip(1).map(declaration);
    declared.filter_map(|line| line.split("mod ").nth(1)?.strip_suffix(';'))
}

/// The line of code after an attribute, other attributes skipped.
fn declaration(after: &str) -> &str {
    let mut lines = after.lines().map(str::trim);
    let found = lines.find(|line| !line.is_empty() && !line.starts_with("#["));
    found.unwrap_or_default()
}

/// First segments of all `crate::` paths, with whether they stand in test code.
fn imports(text: &str) -> BTreeSet<(String, bool)> {
    let inline =
        |(at, attribute): &(usize, &str)| declaration(&text[at + attribute.len()..]).ends_with('{');
    let mut attributes = text.match_indices("#[cfg(test)]");
    let test_starts = attributes.find(inline).map_or(text.len(), |(at, _)| at);
    let (code, tests) = text.split_at(test_starts);
    let of = |part: &str, in_test: bool| {
        let names = paths(part).into_iter();
        names.map(|name| (name, in_test)).collect::<Vec<_>>()
    };
    of(code, false).into_iter().chain(of(tests, true)).collect()
}

/// First segments of all `crate::` paths outside comments.
fn paths(code: &str) -> Vec<String> {
    let code: String = code
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default())
        .collect::<Vec<_>>()
        .join("\n");
    let mut names = Vec::new();
    for after in code.split("crate::").skip(1) {
        match after.strip_prefix('{') {
            Some(group) => names.extend(group_heads(group)),
            None => names.push(head(after)),
        }
    }
    names
}

/// First segments of the members of a `{…}` group whose opening brace is already read.
fn group_heads(group: &str) -> Vec<String> {
    let mut depth = 1;
    let mut heads = vec![head(group)];
    for (at, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 1 => heads.push(head(&group[at + 1..])),
            _ => {}
        }
        if depth == 0 {
            break;
        }
    }
    heads.retain(|name| !name.is_empty());
    heads
}

/// The identifier `text` begins with.
fn head(text: &str) -> String {
    let is_part = |c: &char| c.is_ascii_alphanumeric() || *c == '_';
    text.trim_start().chars().take_while(is_part).collect()
}
