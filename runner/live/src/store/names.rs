//! File names out of what a machine sent.

use std::path::{Path, PathBuf};

/// Longer names are cut: every file system takes this many bytes and a number.
const MOST_BYTES: usize = 120;

/// Names that mean a device on Windows, whatever follows the first dot.
const RESERVED: [&str; 4] = ["CON", "PRN", "AUX", "NUL"];

/// Ends of names that this library gives itself: a machine must not be able to
/// make a whole program look like a failed one, or the other way round.
const MARKS: [&str; 2] = ["failed", "partial"];

/// A file name out of a name that came from the line, for use in one folder:
/// without separators, control characters and reserved names, neither hidden nor
/// an option of a command. `None` if nothing of it can stand in a name.
///
/// ```
/// use softplug_live::store::safe_name;
/// assert_eq!(safe_name("O1234").as_deref(), Some("O1234"));
/// assert_eq!(safe_name("../../etc/passwd").as_deref(), Some("_.._etc_passwd"));
/// assert_eq!(safe_name(".."), None);
/// ```
pub fn safe_name(name: &str) -> Option<String> {
    let clean: String = name.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
    let clean = clean.trim_start_matches(['.', '-', ' ']);
    let mut end = clean.len().min(MOST_BYTES);
    while !clean.is_char_boundary(end) {
        end -= 1;
    }
    let mut clean = clean[..end].trim_end_matches(['.', ' ']).to_owned();
    if !clean.contains(char::is_alphanumeric) {
        return None;
    }
    if is_reserved(&clean) {
        clean.insert(0, '_');
    }
    if let Some((stem, end)) = clean.rsplit_once('.')
        && MARKS.iter().any(|mark| end.eq_ignore_ascii_case(mark))
    {
        clean = format!("{stem}_{end}");
    }
    Some(clean)
}

fn is_plain(c: char) -> bool {
    c.is_alphanumeric() || " .-_+=,()#@&".contains(c)
}

fn is_reserved(name: &str) -> bool {
    let stem = name.split('.').next().unwrap_or_default().trim_end();
    if RESERVED.iter().any(|reserved| stem.eq_ignore_ascii_case(reserved)) {
        return true;
    }
    // COM1 to COM9 and LPT1 to LPT9; some systems take superscript digits too.
    let mut chars = stem.chars();
    let port: String = chars.by_ref().take(3).collect();
    let is_port = port.eq_ignore_ascii_case("COM") || port.eq_ignore_ascii_case("LPT");
    is_port && matches!((chars.next(), chars.next()), (Some('0'..='9' | '¹' | '²' | '³'), None))
}

/// `folder/name`, then with numbers before the extension: `O1.nc`, `O1-2.nc`,
/// `O1-3.nc` and so on, each with `end` behind it.
pub fn numbered(folder: &Path, name: &str, end: &str) -> impl Iterator<Item = PathBuf> + use<> {
    let (stem, extension) = match name.rsplit_once('.') {
        Some((stem, extension)) if !stem.is_empty() => (stem, format!(".{extension}")),
        _ => (name, String::new()),
    };
    let (folder, stem, end) = (folder.to_owned(), stem.to_owned(), end.to_owned());
    (1_u32..).map(move |number| {
        let version = if number == 1 { String::new() } else { format!("-{number}") };
        folder.join(format!("{stem}{version}{extension}{end}"))
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn safe(name: &str) -> String {
        safe_name(name).unwrap_or_else(|| "-".to_owned())
    }

    #[test]
    fn names_of_programs_stay_as_they_are() {
        for name in ["O1234", "PART A (ROUGH)", "1.NC", "a,b=c#1@2&3", "Gehäuse-07"] {
            assert_eq!(safe(name), name);
        }
    }

    #[test]
    fn no_name_leads_out_of_its_folder() {
        let cases = [
            ("/etc/passwd", "_etc_passwd"),
            ("..\\..\\boot.ini", "_.._boot.ini"),
            ("C:\\O1", "C__O1"),
            ("O1\0.nc", "O1_.nc"),
            ("O1\u{1b}[2J\r\n", "O1__2J__"),
            ("~/.ssh/id", "__.ssh_id"),
            ("$(reboot)`x`;|&", "_(reboot)_x___&"),
            ("O1\u{202e}cn.exe", "O1_cn.exe"),
            ("-rf", "rf"),
            (".bashrc", "bashrc"),
            ("O1. . .", "O1"),
            ("con", "_con"),
            ("Aux.nc", "_Aux.nc"),
            ("COM1", "_COM1"),
            ("lpt9.txt", "_lpt9.txt"),
            ("COM10", "COM10"),
            ("O1.failed", "O1_failed"),
            ("O1.PARTIAL", "O1_PARTIAL"),
        ];
        for (name, expected) in cases {
            assert_eq!(safe(name), expected, "{name:?}");
        }
        for name in ["", ".", "..", "...", "///", " ", "\u{7f}\u{80}", "(*)", "_"] {
            assert_eq!(safe_name(name), None, "{name:?}");
        }
    }

    #[test]
    fn long_names_are_cut_between_characters() {
        let name = "ä".repeat(100);
        assert_eq!(safe(&name), "ä".repeat(60));
        assert_eq!(safe(&format!("x{name}")).len(), 119);
    }

    #[test]
    fn versions_stand_before_the_extension() {
        let first = |name, end| -> Vec<_> {
            numbered(Path::new("in"), name, end).take(2).map(|p| p.display().to_string()).collect()
        };
        assert_eq!(first("O1.nc", ""), ["in/O1.nc", "in/O1-2.nc"]);
        assert_eq!(first("O1", ".failed"), ["in/O1.failed", "in/O1-2.failed"]);
    }

    proptest! {
        #[test]
        fn whatever_comes_is_one_plain_name(name in any::<String>()) {
            if let Some(safe) = safe_name(&name) {
                let path = Path::new("in").join(&safe);
                prop_assert_eq!(path.parent(), Some(Path::new("in")));
                prop_assert_eq!(path.file_name(), Some(safe.as_ref()));
                prop_assert!(!safe.chars().any(|c| c.is_control() || "/\\:*?\"<>|".contains(c)));
                prop_assert!(!safe.starts_with(['.', '-', ' ']) && !safe.ends_with(['.', ' ']));
                prop_assert!(safe.len() <= MOST_BYTES + 1);
                prop_assert_eq!(safe_name(&safe), Some(safe));
            }
        }
    }
}
