//! A real browser without a window, and what it makes of a page.

use std::collections::BTreeSet;
use std::io::{BufReader, Write};
use std::net::{SocketAddr, TcpListener};
use std::ops::Range;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use tempfile::TempDir;

/// Chromium with a folder of its own.
pub(crate) struct Browser {
    folder: TempDir,
}

impl Browser {
    pub(crate) fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    /// The page as a picture.
    pub(crate) fn screenshot(&self, page: &str, width: u32, height: u32) -> Picture {
        let picture = self.folder.path().join("page.png");
        let _ = std::fs::remove_file(&picture);
        let argument = format!("--screenshot={}", picture.display());
        self.run(page, &format!("{width},{height}"), &argument);
        Picture::read(&picture)
    }

    /// The page's elements after its scripts have run.
    pub(crate) fn dump(&self, page: &str, width: u32) -> String {
        self.run(page, &format!("{width},1600"), "--dump-dom")
    }

    /// How many sheets it takes.
    pub(crate) fn pages_on_paper(&self, page: &str) -> usize {
        let file = self.folder.path().join("page.pdf");
        let _ = std::fs::remove_file(&file);
        self.run(page, "1280,1600", &format!("--print-to-pdf={}", file.display()));
        let bytes = std::fs::read(&file).unwrap();
        // The tree of pages names each, the tree itself is one of `/Pages`.
        String::from_utf8_lossy(&bytes).matches("/Type /Page\n").count()
    }

    fn run(&self, page: &str, size: &str, argument: &str) -> String {
        let file = self.folder.path().join("page.html");
        std::fs::write(&file, page).unwrap();
        let output = Command::new("chromium")
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"])
            .args(["--disable-background-networking", "--disable-component-update"])
            .args(["--no-first-run", "--disable-extensions", "--force-device-scale-factor=1"])
            .args([
                "--virtual-time-budget=2000",
                "--timeout=60000",
                &format!("--window-size={size}"),
            ])
            .arg(format!("--user-data-dir={}", self.folder.path().join("profile").display()))
            .arg(argument)
            .arg(format!("file://{}", file.display()))
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }
}

/// Pixels of three or four bytes.
pub(crate) struct Picture {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pixels: Vec<[u8; 3]>,
}

impl Picture {
    fn read(file: &std::path::Path) -> Self {
        let file = BufReader::new(std::fs::File::open(file).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        assert_eq!(info.bit_depth, png::BitDepth::Eight);
        let samples = info.color_type.samples();
        let pixels = bytes[..info.buffer_size()].chunks_exact(samples);
        let pixels = pixels.map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
        Self { width: info.width, height: info.height, pixels }
    }

    pub(crate) fn colours(&self) -> usize {
        self.pixels.iter().collect::<BTreeSet<_>>().len()
    }

    /// Whether anything is drawn there: a pixel unlike the page's first one.
    pub(crate) fn has_ink(&self, columns: Range<u32>, mut rows: Range<u32>) -> bool {
        rows.any(|y| {
            columns.clone().any(|x| self.pixels[(y * self.width + x) as usize] != self.pixels[0])
        })
    }
}

/// A port of this machine that a page could fetch from; whoever asks gets an answer.
pub(crate) fn listen() -> (SocketAddr, Listener) {
    let socket = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = socket.local_addr().unwrap();
    let heard = Arc::new(AtomicBool::new(false));
    let listener = Listener(Arc::clone(&heard));
    std::thread::spawn(move || {
        for connection in socket.incoming() {
            heard.store(true, Ordering::SeqCst);
            let answer = "HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n";
            // Whoever has gone away meanwhile needs no answer.
            let _ = connection.and_then(|mut connection| connection.write_all(answer.as_bytes()));
        }
    });
    (address, listener)
}

pub(crate) struct Listener(Arc<AtomicBool>);

impl Listener {
    /// Whether anyone has connected.
    pub(crate) fn anything(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}
