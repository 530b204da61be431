//! Shortens a module's function names, so that they cost little and backtraces
//! stay readable.
//!
//! A mangled symbol spells out crate, modules, generics and a hash: of a small
//! plug-in some 12 of 43 kB. What a reader needs is the method, and its type where several have
//! one of that name. Functions of the language's own library and of the ABI's codec have none: they are
//! called from everywhere, and the fault is never theirs.

use std::collections::BTreeMap;

use crate::sections::{HEADER, Kind, bytes, number, push_bytes, push_number, sections};

/// The subsection of function names in the section `name`.
const FUNCTION_NAMES: u8 = 1;

/// The module with short function names and without the sections that only
/// tools look at; none where it is damaged. All else stays byte for byte.
pub(crate) fn shorten(module: &[u8]) -> Option<Vec<u8>> {
    let mut out = HEADER.to_vec();
    for section in sections(module)? {
        match section.kind {
            Kind::Custom("producers" | "target_features") => {}
            Kind::Custom("name") => {
                let mut content = Vec::new();
                push_bytes(&mut content, b"name");
                content.extend(names(section.content)?);
                out.push(0);
                push_bytes(&mut out, &content);
            }
            _ => out.extend(section.whole),
        }
    }
    Some(out)
}

/// Of all subsections only the function names.
fn names(section: &[u8]) -> Option<Vec<u8>> {
    let functions = shortest(&functions(section)?);
    let mut names = Vec::new();
    push_number(&mut names, functions.len() as u64);
    for (index, name) in functions {
        push_number(&mut names, index);
        push_bytes(&mut names, name.as_bytes());
    }
    let mut out = vec![FUNCTION_NAMES];
    push_bytes(&mut out, &names);
    Some(out)
}

/// Number and symbol of each function in a section `name`.
pub(crate) fn functions(mut section: &[u8]) -> Option<Vec<(u64, &str)>> {
    while let Some((&id, rest)) = section.split_first() {
        section = rest;
        let mut names = bytes(&mut section)?;
        if id == FUNCTION_NAMES {
            let count = number(&mut names)?;
            let mut function = || {
                let index = number(&mut names)?;
                Some((index, std::str::from_utf8(bytes(&mut names)?).ok()?))
            };
            return (0..count).map(|_| function()).collect();
        }
    }
    Some(Vec::new())
}

/// Whose functions need no names.
const LIBRARIES: [&str; 5] = ["__rustc", "alloc", "compiler_builtins", "core", "softplug_abi"];

fn is_of_library(symbol: &str) -> bool {
    let path = format!("{:#}", rustc_demangle::demangle(symbol));
    path.trim_start_matches('<').split("::").next().is_some_and(|first| LIBRARIES.contains(&first))
}

/// `method` where no other function is called so, else `Type.method`.
fn shortest(functions: &[(u64, &str)]) -> Vec<(u64, String)> {
    let own = functions.iter().filter(|(_, symbol)| !is_of_library(symbol));
    let names: Vec<_> = own.map(|(index, symbol)| (*index, short(symbol))).collect();
    let bare = |name: &str| name.split_once("::").map_or(name, |(_, method)| method).to_owned();
    let mut uses = BTreeMap::new();
    for (_, name) in &names {
        *uses.entry(bare(name)).or_insert(0) += 1;
    }
    let name = |name: String| match uses[&bare(&name)] {
        1 => bare(&name),
        _ => name.replacen("::", ".", 1),
    };
    names.into_iter().map(|(index, own)| (index, name(own))).collect()
}

/// `Type::method` or `function` of a symbol, mangled or not.
fn short(symbol: &str) -> String {
    let path = format!("{:#}", rustc_demangle::demangle(symbol));
    let mut segments = split(&path, "::");
    let is_turbofish = |segment: &str| segment.starts_with('<') && !segment.starts_with("<impl ");
    let mut is_first = true;
    segments.retain(|segment| std::mem::take(&mut is_first) || !is_turbofish(segment));
    let mut tail = String::new();
    while segments.len() > 1 && segments.last().is_some_and(|last| last.starts_with('{')) {
        segments.pop();
        // Closures and shims: which of several it is, nobody can tell anyway.
        "::{}".clone_into(&mut tail);
    }
    let Some((function, owners)) = segments.split_last() else { return path };
    let function = without_generics(function);
    match owners.last().map(|owner| type_name(owner)) {
        Some(owner) if !owner.starts_with(|c: char| c.is_lowercase() || c == '_') => {
            format!("{owner}::{function}{tail}")
        }
        _ => format!("{function}{tail}"),
    }
}

/// The name of the type that a segment of a path stands for.
fn type_name(segment: &str) -> &str {
    let bare = |path| without_generics(split(path, "::").last().copied().unwrap_or(path));
    let Some(inner) = segment.strip_prefix('<').and_then(|rest| rest.strip_suffix('>')) else {
        return bare(segment);
    };
    let (of, through) = match inner.strip_prefix("impl ") {
        Some(implementation) => match split(implementation, " for ")[..] {
            [through, of] => (of, Some(through)),
            _ => (implementation, None),
        },
        None => match split(inner, " as ")[..] {
            [of, through] => (of, Some(through)),
            _ => (inner, None),
        },
    };
    // A parameter says less than the trait that it was used through.
    match through {
        Some(through) if of.len() == 1 => bare(through),
        _ => bare(of),
    }
}

fn without_generics(segment: &str) -> &str {
    match segment.find('<') {
        Some(at) if at > 0 => &segment[..at],
        _ => segment,
    }
}

/// Splits where `separator` stands outside all brackets.
fn split<'a>(text: &'a str, separator: &str) -> Vec<&'a str> {
    let mut parts = Vec::new();
    let (mut depth, mut start, mut before) = (0_u32, 0, ' ');
    for (at, character) in text.char_indices() {
        match character {
            '<' | '[' | '(' | '{' => depth += 1,
            // The arrow of a function's type closes nothing.
            '>' if before == '-' => {}
            '>' | ']' | ')' | '}' => depth = depth.saturating_sub(1),
            _ if depth == 0 && at >= start && text[at..].starts_with(separator) => {
                parts.push(&text[start..at]);
                start = at + separator.len();
            }
            _ => {}
        }
        before = character;
    }
    parts.push(&text[start..]);
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use wasmparser::{KnownCustom, Name, Parser, Payload, Validator};

    const MODULE: &str = r#"(module
        (@custom "softplug.manifest" "{\"abi\":\"1.0\"}")
        (memory 1 1)
        (data (i32.const 8) "XON")
        (func $_ZN12softplug_abi5event5Event6decode17hb4bc8954a4770745E (export "a")
            (param $code i32) (result i32) (local $kept i32) local.get $code)
        (func $memset (param i32 i32 i32) (result i32) local.get 2)
        (func $_ZN8xon_xoff8receiver8Receiver4take17h8709b7db1cea3ee5E)
        (@custom "producers" (after last) "\00")
        (@custom "target_features" (after last) "\00"))"#;

    fn custom<'a>(module: &'a [u8], name: &str) -> Option<&'a [u8]> {
        let found = sections(module).unwrap();
        found.iter().find(|section| section.kind == Kind::Custom(name)).map(|found| found.content)
    }

    fn code(module: &[u8]) -> Vec<&[u8]> {
        let found = sections(module).unwrap();
        let kept = found.iter().filter(|section| !matches!(section.kind, Kind::Custom(_)));
        kept.map(|section| section.whole).collect()
    }

    #[test]
    fn all_but_names_stays_and_the_module_is_valid() {
        let module = wat::parse_str(MODULE).unwrap();
        let shortened = shorten(&module).unwrap();
        Validator::new().validate_all(&shortened).unwrap();
        assert_eq!(code(&shortened), code(&module));
        assert_eq!(custom(&shortened, "softplug.manifest"), Some(&b"{\"abi\":\"1.0\"}"[..]));
        assert!(custom(&module, "producers").is_some());
        assert_eq!(custom(&shortened, "producers"), None);
        assert_eq!(custom(&shortened, "target_features"), None);
    }

    #[test]
    fn only_function_names_are_kept_and_an_independent_reader_finds_them() {
        let shortened = shorten(&wat::parse_str(MODULE).unwrap()).unwrap();
        let mut functions = Vec::new();
        for payload in Parser::new(0).parse_all(&shortened) {
            let Payload::CustomSection(section) = payload.unwrap() else { continue };
            let KnownCustom::Name(names) = section.as_known() else { continue };
            for names in names {
                let Name::Function(names) = names.unwrap() else { panic!("a subsection too many") };
                functions.extend(names.into_iter().map(|naming| naming.unwrap()));
            }
        }
        let functions: Vec<_> = functions.iter().map(|n| (n.index, n.name)).collect();
        // The decoder is the ABI's.
        assert_eq!(functions, [(1, "memset"), (2, "take")]);
    }

    #[test]
    fn a_second_time_changes_nothing() {
        let once = shorten(&wat::parse_str(MODULE).unwrap()).unwrap();
        assert_eq!(shorten(&once), Some(once));
    }

    #[test]
    fn what_is_cut_off_is_refused() {
        let module = wat::parse_str(MODULE).unwrap();
        let whole = sections(&module).unwrap();
        let mut ends: Vec<_> = whole.iter().map(|section| section.whole.len()).collect();
        for at in 1..ends.len() {
            ends[at] += ends[at - 1];
        }
        for length in 0..module.len() {
            let between = length == HEADER.len() || ends.contains(&(length.wrapping_sub(8)));
            assert_eq!(shorten(&module[..length]).is_some(), between, "{length} bytes");
        }
    }

    #[test]
    fn names_are_a_type_and_a_method_or_a_function() {
        let cases = [
            ("softplug_v1_step", "softplug_v1_step"),
            ("_ZN12softplug_abi5event5Event6decode17hb4bc8954a4770745E", "Event::decode"),
            (
                "_ZN15softplug_plugin7machine16Machine$LT$C$GT$4step17hd67c0ad2aa5b5e19E",
                "Machine::step",
            ),
            ("_ZN15softplug_plugin7machine6handle17h95471a01271ea5abE", "handle"),
            (
                "_ZN75_$LT$xon_xoff..XonXoff$u20$as$u20$softplug_plugin..converter..Converter$GT$8received17h8709b7db1cea3ee5E",
                "XonXoff::received",
            ),
            (
                "_ZN8xon_xoff8settings1_96_$LT$impl$u20$softplug_plugin..settings..SettingSet$u20$for$u20$xon_xoff..settings..Settings$GT$3set17hb76cbd651b58dda5E",
                "Settings::set",
            ),
            (
                "_ZN60_$LT$T$u20$as$u20$softplug_plugin..settings..SettingType$GT$10from_value17h1242bcc812a8813cE",
                "SettingType::from_value",
            ),
            (
                "_ZN4core5slice29_$LT$impl$u20$$u5b$T$u5d$$GT$8contains17h15429114f410a47cE",
                "[T]::contains",
            ),
            (
                "_ZN4core4iter6traits8iterator8Iterator3any5check28_$u7b$$u7b$closure$u7d$$u7d$17h0cb7f5948bc9dfb4E",
                "check::{}",
            ),
            ("_RNvNtCsi7xvmJkqgFG_17compiler_builtins3mem6memcpy", "memcpy"),
            ("_RNvCsfLfy6EI15iL_7___rustc17rust_begin_unwind", "rust_begin_unwind"),
        ];
        for (symbol, expected) in cases {
            assert_eq!(short(symbol), expected, "{symbol}");
        }
    }

    #[test]
    fn arrows_and_brackets_are_no_separators() {
        assert_eq!(short("a::B<fn(c::D) -> e::F>::g::<h::I>"), "B::g");
        assert_eq!(short("a::B<fn(c::D) -> e::F>::g"), "B::g");
        assert_eq!(short("a::B::<c::D>::g"), "B::g");
        assert_eq!(short("<[a::B; 4] as c::D>::e"), "[a::B; 4]::e");
        assert_eq!(short(""), "");
        assert_eq!(short("{closure}"), "{closure}");
    }
}
