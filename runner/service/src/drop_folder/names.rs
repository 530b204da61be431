//! Names in a drop folder: those that are passed over, and those under which files are put away.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::{OsStrExt as _, OsStringExt as _};

use softplug_live::plain_text;

/// Ends of names under which programs that copy keep what is not whole yet.
const TEMPORARY: [&[u8]; 9] = [
    b".tmp",
    b".temp",
    b".part",
    b".partial",
    b".filepart",
    b".crdownload",
    b".download",
    b".swp",
    b"~",
];
/// What Windows puts into a folder by itself.
const OF_WINDOWS: [&[u8]; 2] = [b"thumbs.db", b"desktop.ini"];
/// Most bytes of a file's name on the file systems that there are.
const LONGEST: usize = 255;
/// Behind a file's name: what became of it.
const RESULT: &[u8] = b".txt";
/// Most characters of a name that is shown.
const SHOWN: usize = 100;

/// Whether a name is that of something that is being written, or of no program at all.
pub(super) fn is_passed_over(name: &OsStr) -> bool {
    let name = name.as_bytes().to_ascii_lowercase();
    name.starts_with(b".")
        || name.starts_with(b"~")
        || TEMPORARY.iter().any(|end| name.ends_with(end))
        || OF_WINDOWS.contains(&&*name)
}

/// A name for people: without anything that a terminal or a page would take for more than text.
pub(super) fn shown(name: &OsStr) -> String {
    let text = String::from_utf8_lossy(name.as_bytes());
    let mut short: String = text.chars().take(SHOWN).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    plain_text(&short)
}

/// Names under which a file is put away, each with that of its result: its own, then with `tag`
/// before the extension, then the tag alone.
pub(super) fn put_away(name: &OsStr, tag: &str) -> [(OsString, OsString); 3] {
    let bytes = name.as_bytes();
    let (stem, extension) = match bytes.iter().rposition(|byte| *byte == b'.') {
        Some(at) if at > 0 && bytes.len() - at <= 16 => bytes.split_at(at),
        _ => (bytes, &b""[..]),
    };
    let tagged = [b"-", tag.as_bytes(), extension].concat();
    let tagged = [cut(stem, LONGEST - tagged.len() - RESULT.len()), &tagged].concat();
    [bytes.to_vec(), tagged, tag.as_bytes().to_vec()].map(|file| {
        let result = [cut(&file, LONGEST - RESULT.len()), RESULT].concat();
        (OsString::from_vec(file), OsString::from_vec(result))
    })
}

/// At most so many bytes, and no half of a character where the name is text.
fn cut(name: &[u8], most: usize) -> &[u8] {
    if name.len() <= most {
        return name;
    }
    let is_inside = |at: &usize| name[*at] & 0xC0 == 0x80;
    let mut end = most;
    while end > most.saturating_sub(4) && is_inside(&end) {
        end -= 1;
    }
    &name[..end]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_being_copied_is_passed_over() {
        for name in [
            ".O1.nc",
            "~$O1.doc",
            "O1.nc.tmp",
            "O1.PART",
            "O1.nc.filepart",
            "O1.nc~",
            "Thumbs.db",
            "O1.crdownload",
            ".new-x",
        ] {
            assert!(is_passed_over(OsStr::new(name)), "{name}");
        }
        for name in ["O1.nc", "O1", "part", "tmp", "a~b", "O1.nc.txt", "\u{1b}[2J"] {
            assert!(!is_passed_over(OsStr::new(name)), "{name}");
        }
        assert!(!is_passed_over(OsStr::from_bytes(b"\xff\xfe.nc")));
    }

    #[test]
    fn names_never_grow_too_long_and_keep_their_extension() {
        let names = |name: &[u8]| {
            let made = put_away(OsStr::from_bytes(name), "17");
            made.map(|(file, result)| (file.into_vec(), result.into_vec()))
        };
        let text = |name: &str| {
            names(name.as_bytes()).map(|(file, result)| {
                (String::from_utf8(file).unwrap(), String::from_utf8(result).unwrap())
            })
        };
        let pair = |file: &str, result: &str| (file.to_owned(), result.to_owned());
        assert_eq!(
            text("O1.nc"),
            [pair("O1.nc", "O1.nc.txt"), pair("O1-17.nc", "O1-17.nc.txt"), pair("17", "17.txt")]
        );
        assert_eq!(text("O1")[1], pair("O1-17", "O1-17.txt"));
        let long = "ä".repeat(126) + "a.nc";
        assert_eq!(long.len(), 256);
        for (file, result) in text(&long[2..]).into_iter().skip(1).chain(text(&"x".repeat(255))) {
            assert!(file.len() <= 255 && result.len() <= 255, "{file} {result}");
        }
        for (file, result) in names(&[0xBF; 255]) {
            assert!(file.len() <= 255 && result.len() <= 255);
        }
    }

    #[test]
    fn a_shown_name_is_text_and_no_more() {
        assert_eq!(shown(OsStr::new("O1\u{1b}[2J\n.nc")), "O1\\u{1b}[2J\\n.nc");
        assert_eq!(shown(OsStr::from_bytes(b"\xff.nc")), "\u{fffd}.nc");
        assert_eq!(shown(OsStr::new(&"x".repeat(255))).chars().count(), 101);
    }
}
