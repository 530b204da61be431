//! The web page: plain files, built into the program.

/// A file of the page.
#[derive(Debug)]
pub(crate) struct File {
    /// Where it is asked for.
    pub(crate) path: &'static str,
    /// Its media type.
    pub(crate) kind: &'static str,
    /// What is in it.
    pub(crate) text: &'static str,
}

const SCRIPT: &str = "text/javascript; charset=utf-8";

macro_rules! script {
    ($name:literal) => {
        File {
            path: concat!("/page/", $name),
            kind: SCRIPT,
            text: include_str!(concat!("files/", $name)),
        }
    };
}

/// All of them.
pub(crate) const FILES: &[File] = &[
    File { path: "/", kind: "text/html; charset=utf-8", text: include_str!("files/index.html") },
    File {
        path: "/page/style.css",
        kind: "text/css; charset=utf-8",
        text: include_str!("files/style.css"),
    },
    File {
        path: "/page/program.css",
        kind: "text/css; charset=utf-8",
        text: include_str!("files/program.css"),
    },
    File { path: "/page/icon.svg", kind: "image/svg+xml", text: include_str!("files/icon.svg") },
    script!("address.js"),
    script!("api.js"),
    script!("app.js"),
    script!("bulk.js"),
    script!("buses.js"),
    script!("card.js"),
    script!("cells.js"),
    script!("chart.js"),
    script!("check.js"),
    script!("compare.js"),
    script!("differences.js"),
    script!("dom.js"),
    script!("filters.js"),
    script!("gcode.js"),
    script!("history.js"),
    script!("jobs.js"),
    script!("journal.js"),
    script!("lines.js"),
    script!("link.js"),
    script!("links.js"),
    script!("listing.js"),
    script!("message.js"),
    script!("overview.js"),
    script!("plugins.js"),
    script!("program.js"),
    script!("programs.js"),
    script!("quarantine.js"),
    script!("reading.js"),
    script!("rows.js"),
    script!("sequence.js"),
    script!("signs.js"),
    script!("state.js"),
    script!("store.js"),
    script!("text.js"),
    script!("toolpath.js"),
    script!("visible.js"),
    script!("wall.js"),
    script!("way.js"),
];
