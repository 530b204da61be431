//! A page of the book: its blocks of code, links, anchors and the command lines in its text.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag, TagEnd};

/// The root of the repository.
pub(crate) fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// A page as it is written.
pub(crate) struct Page {
    /// Its path below the repository's root: `docs/abi.md`.
    pub(crate) path: String,
    pub(crate) blocks: Vec<Block>,
    pub(crate) links: Vec<Link>,
    /// Where links can lead to within it.
    pub(crate) anchors: Vec<String>,
    /// Code in the running text, with its line.
    pub(crate) codes: Vec<(usize, String)>,
    /// What is quoted, with its line.
    pub(crate) quotes: Vec<(usize, String)>,
}

/// A block of code.
pub(crate) struct Block {
    /// The line of the page on which its content begins, from 1.
    pub(crate) line: usize,
    pub(crate) language: String,
    /// What stands behind the language: `file=gateway.toml`, `stays`, `needs-machine`.
    pub(crate) marks: Vec<String>,
    pub(crate) text: String,
}

impl Block {
    pub(crate) fn has(&self, mark: &str) -> bool {
        self.marks.iter().any(|is| is == mark)
    }

    /// The value of `name=value`.
    pub(crate) fn value(&self, name: &str) -> Option<&str> {
        self.marks.iter().find_map(|mark| mark.strip_prefix(name)?.strip_prefix('='))
    }

    /// Why it cannot run here: what stands behind `needs-`.
    pub(crate) fn lacks(&self) -> Option<&str> {
        self.marks.iter().find_map(|mark| mark.strip_prefix("needs-"))
    }
}

/// A link or picture.
pub(crate) struct Link {
    pub(crate) line: usize,
    pub(crate) target: String,
}

impl Page {
    /// Reads a page of the repository.
    pub(crate) fn read(path: &str) -> Self {
        let text = fs::read_to_string(repository().join(path))
            .unwrap_or_else(|error| panic!("{path}: {error}"));
        Self::parse(path, &text)
    }

    fn parse(path: &str, text: &str) -> Self {
        let ends: Vec<usize> = text.match_indices('\n').map(|(at, _)| at).collect();
        let line = |offset: usize| ends.partition_point(|end| *end < offset) + 1;
        let mut page = Self {
            path: path.to_owned(),
            blocks: Vec::new(),
            links: Vec::new(),
            anchors: Vec::new(),
            codes: Vec::new(),
            quotes: Vec::new(),
        };
        let mut heading: Option<String> = None;
        let mut block: Option<Block> = None;
        let mut is_quoted = false;
        let mut taken = BTreeMap::new();
        let parser = Parser::new_ext(text, Options::ENABLE_TABLES).into_offset_iter();
        for (event, range) in parser {
            match event {
                Event::Start(Tag::CodeBlock(kind)) => {
                    let info = match &kind {
                        CodeBlockKind::Fenced(info) => info.as_ref(),
                        CodeBlockKind::Indented => "indented",
                    };
                    let mut marks = info.split(',').map(|mark| mark.trim().to_owned());
                    block = Some(Block {
                        line: line(range.start) + 1,
                        language: marks.next().unwrap_or_default(),
                        marks: marks.collect(),
                        text: String::new(),
                    });
                }
                Event::End(TagEnd::CodeBlock) => page.blocks.extend(block.take()),
                Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
                Event::End(TagEnd::Heading(_)) => {
                    let anchor = anchor(&heading.take().unwrap_or_default());
                    let count: &mut usize = taken.entry(anchor.clone()).or_default();
                    page.anchors.push(match *count {
                        0 => anchor,
                        again => format!("{anchor}-{again}"),
                    });
                    *count += 1;
                }
                Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                    page.links.push(Link { line: line(range.start), target: dest_url.into() });
                }
                Event::Start(Tag::BlockQuote(_)) => {
                    is_quoted = true;
                    page.quotes.push((line(range.start), String::new()));
                }
                Event::End(TagEnd::BlockQuote(_)) => is_quoted = false,
                Event::Text(text) => match (&mut block, &mut heading, page.quotes.last_mut()) {
                    (Some(block), ..) => block.text += &text,
                    (None, Some(heading), _) => *heading += &text,
                    (None, None, Some((_, quote))) if is_quoted => *quote += &text,
                    (None, None, _) => {}
                },
                Event::Code(code) => {
                    if let Some(heading) = &mut heading {
                        *heading += &code;
                    }
                    if let (true, Some((_, quote))) = (is_quoted, page.quotes.last_mut()) {
                        write!(quote, "`{code}`").unwrap();
                    }
                    page.codes.push((line(range.start), code.into()));
                }
                _ => {}
            }
        }
        page
    }
}

/// The anchor of a heading, as GitHub and mdBook make it.
fn anchor(heading: &str) -> String {
    let is_kept = |c: &char| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_');
    heading.to_lowercase().chars().filter(is_kept).map(|c| if c == ' ' { '-' } else { c }).collect()
}

#[test]
fn a_page_is_taken_apart() {
    let page = Page::parse(
        "p.md",
        "# A `b`: c!\n\n[x](y.md#z) and `softplug demo`\n\n```toml,file=a.toml,needs-x\nk = 1\n```\n\n## d\n## d\n",
    );
    assert_eq!(page.anchors, ["a-b-c", "d", "d-1"]);
    assert_eq!((page.links[0].line, page.links[0].target.as_str()), (3, "y.md#z"));
    assert_eq!(page.codes[1], (3, "softplug demo".to_owned()));
    let block = &page.blocks[0];
    assert_eq!((block.line, block.language.as_str(), block.text.as_str()), (6, "toml", "k = 1\n"));
    assert_eq!((block.value("file"), block.lacks()), (Some("a.toml"), Some("x")));
}
