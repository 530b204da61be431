//! A shop of two hundred links, and people who work with its page.

use std::fmt::Write as _;
use std::path::PathBuf;

use softplug_service::library::Library;

use crate::common::bench::Bench;
use crate::gateway::plugins::fragile;
use crate::page::browser::Browser;
use crate::page::machine::Machine;
use crate::page::picture::Picture;

/// Links of the shop.
pub(super) const LINKS: usize = 200;
/// What a step may take at most, from the start page on.
const MOST_CLICKS: u32 = 3;

/// The shop with its page.
pub(super) struct Shop {
    pub(super) bench: Bench,
    pub(super) browser: Browser,
    /// Behind `lathe-001`.
    pub(super) lathe: Machine,
    /// Behind `press-002`, whose plug-in does not bear every letter.
    pub(super) press: Machine,
    /// Since the start page.
    clicks: u32,
    pictures: Option<PathBuf>,
}

impl Shop {
    pub(super) fn open() -> Self {
        let (lathe, press) = (Machine::start(), Machine::start());
        let mut links = format!(
            "[[link]]\nname = \"lathe-001\"\ngroup = \"Hall 1\"\nport = \"{}\"\n\
             line = \"19200 8N1\"\nplugin = \"xon-xoff\"\n\
             settings = {{ preset = \"tape\", quiet-time = 300, end-quiet = 50 }}\n\
             [[link]]\nname = \"press-002\"\ngroup = \"Hall 1\"\nport = \"{}\"\n\
             line = \"921600 8N1\"\nplugin = \"fragile\"\nprobation = {{ span = \"0s\" }}\n",
            lathe.port, press.port
        );
        for number in 3..=LINKS {
            let hall = 1 + (number - 1) * 4 / LINKS;
            let _ = write!(
                links,
                "[[link]]\nname = \"mill-{number:03}\"\ngroup = \"Hall {hall}\"\n\
                 port = \"simulate:xon-xoff\"\nline = \"1200 8N1\"\nplugin = \"xon-xoff\"\n"
            );
        }
        let bench = Bench::with_links_and(&links, |folder| {
            let library = Library::open(&folder.join("plugins")).unwrap();
            library.add(&fragile("1.0.0", None)).unwrap();
        });
        let browser = Browser::open();
        let pictures = std::env::var_os("SOFTPLUG_PICTURES").map(PathBuf::from);
        Self { bench, browser, lathe, press, clicks: 0, pictures }
    }

    /// Somebody sits down at the page.
    pub(super) fn sign_in(&mut self, token: &str, (width, height): (u32, u32)) {
        self.browser.size(width, height);
        self.browser.value("location.hash = '#/links'");
        if self.browser.value("document.querySelector('#leave')?.checkVisibility()") == true {
            self.browser.click("#leave", "Sign out");
        } else {
            self.browser.go(&self.bench.url("/"));
        }
        self.browser.until("document.activeElement?.name === 'token'");
        self.browser.type_text(token);
        self.browser.click("button", "Sign in");
        self.browser.until("document.querySelectorAll('.dense .row').length === 200");
    }

    /// What somebody does, from the start page on.
    #[track_caller]
    pub(super) fn step(&mut self, what: &str, act: impl FnOnce(&mut Self)) {
        self.browser.value("location.hash = '#/links'");
        self.browser.until("document.querySelectorAll('.dense .row').length === 200");
        self.clicks = 0;
        act(self);
        assert!(self.clicks <= MOST_CLICKS, "{what} takes {} clicks", self.clicks);
        self.fits();
        assert_eq!(self.browser.complaints, Vec::<String>::new(), "{what}");
    }

    #[track_caller]
    pub(super) fn click(&mut self, kind: &str, text: &str) {
        self.clicks += 1;
        self.browser.click(kind, text);
    }

    #[track_caller]
    pub(super) fn pick(&mut self, name: &str, value: &str) {
        self.clicks += 1;
        self.browser.pick(name, value);
    }

    /// Types into the field where something is looked for.
    pub(super) fn find(&mut self, text: &str) {
        self.browser.value("document.querySelector('main input[type=search]').focus()");
        self.browser.type_text(text);
    }

    /// Finds a link by its name, and goes to its page.
    #[track_caller]
    pub(super) fn go_to(&mut self, link: &str) {
        self.find(link);
        self.browser.until("document.querySelectorAll('.dense .row').length === 1");
        self.click(".dense .name a", link);
        self.browser.until(&format!("document.querySelector('main h1')?.textContent === '{link}'"));
    }

    /// Nothing is wider than the window.
    #[track_caller]
    fn fits(&mut self) {
        assert!(self.browser.overhang() <= 0, "the page is wider than its window");
    }

    /// Keeps what is seen for the book, where it is asked for.
    pub(super) fn keep_picture(&mut self, name: &str) {
        let picture = self.browser.screenshot();
        assert!(Picture::read(&picture).colours() > 10, "{name} shows nothing");
        if let Some(folder) = &self.pictures {
            let file = folder.join(format!("{name}.png"));
            std::fs::write(file, Picture::read(&picture).small()).unwrap();
        }
    }
}
