//! Sizes, and numbers that do not fit.

use super::{HOLD, parse_body, with_body};
use crate::{FrontMatter, ParseErrorKind, Trace, limits};

fn kind(body: &str) -> ParseErrorKind {
    parse_body(body).unwrap_err().kind
}

#[test]
fn long_files_lines_and_many_lines() {
    let long = format!("{HOLD}{}", "#\n".repeat(limits::FILE_BYTES / 2));
    assert_eq!(Trace::parse(&long).unwrap_err().kind, ParseErrorKind::FileTooLong);
    let many = format!("{HOLD}{}", "#\n".repeat(limits::LINES));
    let error = Trace::parse(&many).unwrap_err();
    assert_eq!(
        (error.kind, error.line as usize),
        (ParseErrorKind::TooManyLines, limits::LINES + 1)
    );
    let wide = format!(". 1.0 ;{}\n", "x".repeat(limits::LINE_BYTES));
    let error = parse_body(&wide).unwrap_err();
    assert_eq!(error.kind, ParseErrorKind::LineTooLong);
    assert!(error.source_line.len() <= 80 && error.report("x").len() < 400);
}

/// A body that is its own canonical form, of exactly so many bytes.
fn comments(bytes: usize) -> String {
    const LINE: usize = 1_024;
    let whole = format!("#{}\n", "x".repeat(LINE - 2));
    // A comment has at least two bytes; the last one takes what is left.
    let lines = (bytes - 2) / LINE;
    format!("{}#{}\n", whole.repeat(lines), "x".repeat(bytes - lines * LINE - 2))
}

#[test]
fn the_last_byte_and_line_that_fit_do() {
    let front = with_body(". 1.000000\n");
    let full = format!("{front}{}", comments(limits::FILE_BYTES - front.len()));
    assert_eq!(full.len(), limits::FILE_BYTES);
    assert!(Trace::parse(&full).is_ok());
    assert_eq!(Trace::parse(&format!("{full}\n")).unwrap_err().kind, ParseErrorKind::FileTooLong);
    // The front matter alone, with what may stand behind it.
    assert!(FrontMatter::parse(&full).is_ok());
    let over = format!("{full}\n\n");
    for long in [&over[..over.len() - 1], &over] {
        assert_eq!(FrontMatter::parse(long).unwrap_err().kind, ParseErrorKind::FileTooLong);
    }
    let lines = front.lines().count();
    let many = format!("{front}{}", "#\n".repeat(limits::LINES - lines));
    assert!(Trace::parse(&many).is_ok());
    assert_eq!(Trace::parse(&format!("{many}#\n")).unwrap_err().kind, ParseErrorKind::TooManyLines);
}

#[test]
fn the_longest_line_that_fits_does() {
    // In alternatives a comment stands two spaces deep.
    for (spare, fits) in [(3, true), (2, false)] {
        let comment = format!("#{}\n. 1.0\n", "x".repeat(limits::LINE_BYTES - spare));
        assert_eq!(parse_body(&comment).is_ok(), fits, "{spare}");
    }
    // A tab is two bytes in the canonical form, which keeps 256 for indent and annotation.
    let room = limits::LINE_BYTES - 256 - "? 0.000000 send 1 \"\"".len();
    for (tabs, letters, fits) in [(room / 2, room % 2, true), (room / 2, room % 2 + 1, false)] {
        let text = format!("{}{}", "\t".repeat(tabs), "A".repeat(letters));
        let body = format!("? 0.0 send 1 \"{text}\"\n");
        assert_eq!(parse_body(&body).is_ok(), fits, "{tabs} and {letters}");
    }
}

#[test]
fn spaces_at_the_end_count_for_the_line_and_not_for_what_it_says() {
    for (spaces, fits) in [(limits::LINE_BYTES, true), (limits::LINE_BYTES + 1, false)] {
        let body = format!("{}\n. 1.0\n", " ".repeat(spaces));
        assert_eq!(parse_body(&body).is_ok(), fits, "{spaces}");
    }
}

#[test]
fn a_line_must_fit_in_its_canonical_form_too() {
    // Four bytes of text for each that is no letter.
    let dashes = |count: usize| format!("> 0.0 \"{}\"\n", "\u{2014}".repeat(count));
    let fits = parse_body(&dashes(5_000)).unwrap();
    assert_eq!(Trace::parse(&fits.format()), Ok(fits));
    assert_eq!(kind(&dashes(6_000)), ParseErrorKind::LineTooLong);
    let config = format!("config: a={}\n", "\u{2014}".repeat(6_000));
    let text = HOLD.replace("config: ", &format!("{config}xx: "));
    assert_eq!(Trace::parse(&text).unwrap_err().kind, ParseErrorKind::LineTooLong);
    assert_eq!(
        kind(&format!("#{}\n", "x".repeat(limits::LINE_BYTES - 1))),
        ParseErrorKind::LineTooLong
    );
}

#[test]
fn a_file_must_fit_in_its_canonical_form_too() {
    let text = with_body(&"< 0.0 11 11 11 11 11 11 11\n".repeat(400_000));
    assert!(text.len() < limits::FILE_BYTES);
    assert_eq!(Trace::parse(&text).unwrap_err().kind, ParseErrorKind::FileTooLong);
}

#[test]
fn generators_have_a_limit_each_and_together() {
    let most = limits::ITEM_BYTES;
    assert!(matches!(
        kind(&format!("? 0.0 send 1 gen:nc(1,{})\n", most + 1)),
        ParseErrorKind::OutOfRange { high, .. } if high == most
    ));
    let items = limits::GENERATED_BYTES / most;
    let all = format!("? 0.0 send 1 gen:nc(1,{most})\n").repeat(items as usize);
    assert!(items > 1 && parse_body(&all).is_ok());
    assert_eq!(kind(&format!("{all}? 0.0 send 1 gen:nc(1,1)\n")), ParseErrorKind::TooMuchGenerated);
}

#[test]
fn numbers_that_do_not_fit() {
    let huge = "9".repeat(1_000);
    for body in [
        format!(". {huge}.0\n"),
        ". 1000000000.0\n".to_owned(),
        format!("? 0.0 pause {huge}\n"),
        "? 0.0 pause 4294967296\n".to_owned(),
        "? 0.0 pause 0\n".to_owned(),
        "= 0.0 done 1 sent=18446744073709551616\n".to_owned(),
        "? 0.0 room transmit=0\n".to_owned(),
        "! 0.0 lineerror parity span=4294967296\n".to_owned(),
        "> 0.0 break 10000001\n".to_owned(),
        "> 0.0 break 0\n".to_owned(),
        format!("? 0.0 send 1 gen:nc({huge},1)\n"),
        "= 0.0 check 1 echo line=0\n".to_owned(),
    ] {
        assert!(matches!(kind(&body), ParseErrorKind::OutOfRange { .. }), "{body}");
    }
    for body in [
        "= 0.0 fail 1 echo status=10000\n",
        "= 0.0 fail 1 echo status=\n",
        "= 0.0 fail 1 echo status=-1\n",
        "= 0.0 fail 1 echo status=+1\n",
        "= 0.0 fail 1 echo status=0001F\n",
        "= 0.0 check 1 echo line=x\n",
        "= 0.0 check 1 echo line=+1\n",
        "= 0.0 check 1 echo line=\n",
    ] {
        assert!(matches!(kind(body), ParseErrorKind::Expected(_)), "{body}");
    }
}

#[test]
fn alternatives_do_not_explode() {
    let block = "{ alt p.c\n|\n  = 0.0 done 1\n}\n";
    assert_eq!(parse_body(&format!(". 0.0\n{}", block.repeat(6))).unwrap().variants().len(), 64);
    assert_eq!(kind(&format!(". 0.0\n{}", block.repeat(7))), ParseErrorKind::TooManyVariants);
    let wide = format!(". 0.0\n{{ alt p.c\n{}}}\n", "|\n".repeat(64));
    assert_eq!(kind(&wide), ParseErrorKind::TooManyVariants);
}

#[test]
fn names_have_a_limit() {
    let name = "a".repeat(limits::NAME_BYTES);
    assert!(parse_body(&format!("= 0.0 request 1 {name} {name}=1\n")).is_ok());
    assert!(parse_body(&format!("= 0.0 request 1 {name}a\n")).is_err());
    assert!(parse_body(&format!("= 0.0 request 1 x {name}a=1\n")).is_err());
    let title = HOLD.replace("XOFF stops", &"é".repeat(limits::TITLE_CHARACTERS));
    assert!(matches!(Trace::parse(&title).unwrap_err().kind, ParseErrorKind::OutOfRange { .. }));
    let title = |characters: usize| {
        let title = "é".repeat(characters);
        Trace::parse(&HOLD.replace("XOFF stops the sender, XON lets it go on", &title))
    };
    assert!(title(limits::TITLE_CHARACTERS).is_ok());
    assert!(title(limits::TITLE_CHARACTERS + 1).is_err());
    let origin = |device: &str| {
        Trace::parse(&HOLD.replace("hand-written", &format!("recorded({device}, 2026-03-01, t)")))
    };
    assert!(origin(&name).is_ok());
    assert!(origin(&format!("{name}a")).is_err());
    assert!(origin(" ").is_err());
}

#[test]
fn the_longest_configuration_that_fits_does() {
    // Without the space after the colon, which the canonical form puts there.
    let config = |bytes: usize| {
        let value = "x".repeat(bytes - "config: a=".len());
        let text = HOLD.replace("config: ", &format!("config:a={value}\nxx: "));
        text.lines()
            .filter(|line| !line.starts_with("xx"))
            .fold(String::new(), |text, line| text + line + "\n")
    };
    let full = Trace::parse(&config(limits::LINE_BYTES)).unwrap();
    assert_eq!(Trace::parse(&full.format()), Ok(full));
    let over = Trace::parse(&config(limits::LINE_BYTES + 1)).unwrap_err();
    assert_eq!(over.kind, ParseErrorKind::LineTooLong);
}
