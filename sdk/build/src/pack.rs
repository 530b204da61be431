//! Puts a manifest into a module.

use crate::MANIFEST;
use crate::sections::{HEADER, Kind, push_bytes, sections};

/// What to take out of a module, beside an earlier manifest.
///
/// The example of [`pack()`] shows all three.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Strip {
    /// Nothing.
    Nothing,
    /// Debug information and what compilers say of themselves; names of functions stay.
    Debug,
    /// All custom sections: the backtrace of a trap has no names then.
    All,
}

/// The module with the manifest behind its sections; none if it is not a whole module.
///
/// ```
/// use softplug_build::{Kind, Strip, pack, sections};
///
/// let module = wat::parse_str(r#"(module (func $f) (@custom "producers" "x"))"#)?;
/// let custom = |strip| {
///     let packed = pack(&module, b"{}", strip).expect("it is a whole module");
///     let sections = sections(&packed).expect("so is this").into_iter();
///     sections.filter(|section| matches!(section.kind, Kind::Custom(_))).count()
/// };
/// // The manifest, and beside it: names of functions and producers, names, nothing.
/// assert_eq!([Strip::Nothing, Strip::Debug, Strip::All].map(custom), [3, 2, 1]);
/// # Ok::<(), wat::Error>(())
/// ```
pub fn pack(module: &[u8], manifest: &[u8], strip: Strip) -> Option<Vec<u8>> {
    let mut packed = HEADER.to_vec();
    for section in sections(module)? {
        let stays = match (section.kind, strip) {
            (Kind::Custom(MANIFEST), _) | (Kind::Custom(_), Strip::All) => false,
            (Kind::Custom(name), Strip::Debug) => name == "name",
            // Nothing is asked to be taken out, or it is no custom section.
            _ => true,
        };
        if stays {
            packed.extend(section.whole);
        }
    }
    push_custom(&mut packed, MANIFEST, manifest);
    Some(packed)
}

/// Appends a custom section.
fn push_custom(module: &mut Vec<u8>, name: &str, content: &[u8]) {
    let mut body = Vec::with_capacity(content.len() + name.len() + 1);
    push_bytes(&mut body, name.as_bytes());
    body.extend(content);
    module.push(0);
    push_bytes(module, &body);
}

/// JSON without the spaces between its parts: those in strings stay.
///
/// ```
/// use softplug_build::without_spaces;
///
/// assert_eq!(without_spaces("{ \"name\": \"my plug-in\" }\n"), "{\"name\":\"my plug-in\"}");
/// ```
pub fn without_spaces(json: &str) -> String {
    let (mut in_string, mut escaped) = (false, false);
    let keep = |c: &char| {
        let stays = in_string || !matches!(c, ' ' | '\t' | '\n' | '\r');
        match c {
            '"' if !escaped => in_string = !in_string,
            _ => {}
        }
        escaped = in_string && *c == '\\' && !escaped;
        stays
    };
    json.chars().filter(keep).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manifest_is_replaced_and_the_rest_stays_as_it_is_asked() {
        let mut module = HEADER.to_vec();
        module.extend([5, 4, 1, 1, 1, 1]);
        push_custom(&mut module, "long", &[7; 300]);
        push_custom(&mut module, "name", b"x");
        let names = |strip| {
            let once = pack(&module, b"{}", strip).unwrap();
            let twice = pack(&once, b"[]", strip).unwrap();
            assert_eq!(twice.len(), once.len());
            let found = sections(&twice).unwrap();
            assert_eq!(found.last().map(|section| section.content), Some(&b"[]"[..]));
            found.iter().map(|section| format!("{:?}", section.kind)).collect::<Vec<_>>()
        };
        let manifest = "Custom(\"softplug.manifest\")";
        let (long, name) = ("Custom(\"long\")", "Custom(\"name\")");
        assert_eq!(names(Strip::Nothing), ["Memory", long, name, manifest]);
        assert_eq!(names(Strip::Debug), ["Memory", name, manifest]);
        assert_eq!(names(Strip::All), ["Memory", manifest]);
        assert_eq!(pack(&module[..20], b"{}", Strip::Nothing), None);
    }

    #[test]
    fn spaces_in_strings_stay() {
        let json = "{ \"a b\" :\n\t[ 1, \"c \\\" d \\\\\" , \" \" ] }\r\n";
        assert_eq!(without_spaces(json), "{\"a b\":[1,\"c \\\" d \\\\\",\" \"]}");
    }
}
