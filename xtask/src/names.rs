//! Checks that what the documentation names exists.
//!
//! The rule: in docs/architecture.md and README.md, a piece of code in backticks without spaces that
//! - holds `::` behind a path, as in `planner/src/feed/table.rs::FeedTable::duration`, names items: the file
//!   exists, and each part behind it is defined there (`fn`, `struct`, `enum`, `trait`, `type`, `const`,
//!   `static`, `mod`, or a variant of an enum);
//! - or begins with a folder of the workspace and `/`, as in `jobs/cat.ngc`, names a file or folder that exists.
//!
//! Everything else in backticks is left alone, fenced blocks are not looked at.

use std::fs;
use std::path::Path;

use crate::shell::Step;

const PAGES: [&str; 2] = ["docs/architecture.md", "README.md"];

/// Words that define an item.
const DEFINE: [&str; 8] = ["fn", "struct", "enum", "trait", "type", "const", "static", "mod"];

/// Checks the pages that exist.
pub(crate) fn check(root: &Path) -> Step {
    let mut wrong = Vec::new();
    let mut right = 0;
    for page in PAGES {
        let path = root.join(page);
        if !path.exists() {
            eprintln!("names: {page} does not exist yet, nothing to check there");
            continue;
        }
        let text = fs::read_to_string(&path).map_err(|e| format!("{page}: {e}"))?;
        for (line, name) in names(&text, &folders(root)?) {
            match exists(root, name) {
                Ok(()) => right += 1,
                Err(why) => wrong.push(format!("{page}:{line}: `{name}`: {why}")),
            }
        }
    }
    for message in &wrong {
        eprintln!("{message}");
    }
    eprintln!("names: {right} exist, {} do not", wrong.len());
    if wrong.is_empty() { Ok(()) } else { Err(format!("{} names do not exist", wrong.len())) }
}

/// Folders at the top of the workspace that hold sources or papers.
fn folders(root: &Path) -> Result<Vec<String>, String> {
    let entries = fs::read_dir(root).map_err(|e| e.to_string())?;
    let names = entries.filter_map(Result::ok).filter(|e| e.path().is_dir());
    let names = names.map(|e| e.file_name().to_string_lossy().into_owned());
    Ok(names.filter(|n| n != "target" && n != "out" && n != ".git").collect())
}

/// The pieces of code in backticks that the rule applies to, each with its line.
fn names<'a>(text: &'a str, folders: &[String]) -> Vec<(usize, &'a str)> {
    let mut found = Vec::new();
    let mut fenced = false;
    for (index, line) in text.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
            continue;
        }
        if fenced {
            continue;
        }
        for code in line.split('`').skip(1).step_by(2) {
            let inside = code.split_once('/').is_some_and(|(top, _)| folders.iter().any(|f| f == top));
            let named = code.split_once("::").is_some_and(|(path, _)| path.contains('/'));
            if (inside || named) && !code.contains(char::is_whitespace) && !code.contains(['*', '<']) {
                found.push((index + 1, code));
            }
        }
    }
    found
}

fn exists(root: &Path, name: &str) -> Result<(), String> {
    let mut parts = name.split("::");
    let path = parts.next().unwrap_or_default();
    let file = root.join(path);
    if !file.exists() {
        return Err(format!("{path} does not exist"));
    }
    for item in parts {
        let item = item.trim_end_matches("()");
        let source = fs::read_to_string(&file).map_err(|e| format!("{path}: {e}"))?;
        if !defines(&source, item) {
            return Err(format!("{path} does not define {item}"));
        }
    }
    Ok(())
}

/// The source defines the item, or has a variant of that name.
fn defines(source: &str, item: &str) -> bool {
    source.lines().any(|line| {
        let code = line.split("//").next().unwrap_or_default();
        let words: Vec<&str> =
            code.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|w| !w.is_empty()).collect();
        let defined = words.windows(2).any(|w| DEFINE.contains(&w[0]) && w[1] == item);
        let variant = item.starts_with(char::is_uppercase)
            && words.first() == Some(&item)
            && code.trim_start().trim_start_matches(item).starts_with([',', ' ', '(', '{']);
        defined || variant
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_code_with_a_path_is_a_name() {
        let text = "`a b/c` `planner/src/x.rs` and `x.rs::f`, `planner/src/x.rs::f`\n```\n`planner/no`\n```\n`std::mem`";
        let folders = vec!["planner".to_string()];
        assert_eq!(names(text, &folders), [(1, "planner/src/x.rs"), (1, "planner/src/x.rs::f")]);
    }

    #[test]
    fn items_and_variants_are_found_and_mentions_are_not() {
        let source = "/// fn gone\npub struct Table {\n}\nenum E {\n    Launch {\n        h: f64,\n    },\n    Free,\n}\n\
                      impl Table { pub(crate) const fn size(&self) {} }\nlet used = gone2();";
        for item in ["Table", "E", "Launch", "Free", "size"] {
            assert!(defines(source, item), "{item}");
        }
        for item in ["gone", "gone2", "Tab", "h"] {
            assert!(!defines(source, item), "{item}");
        }
    }

    #[test]
    fn this_file_is_checked_by_its_own_rule() {
        let root = crate::root();
        assert_eq!(exists(&root, "xtask/src/names.rs::exists"), Ok(()));
        assert!(exists(&root, "xtask/src/names.rs::absent_item").is_err());
        assert!(exists(&root, "xtask/src/absent.rs").is_err());
    }
}
