//! A gateway with simulated machines, and its API.

use std::fmt::Write as _;
use std::fs;
use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;
use softplug_service::gateway::{self, Running};
use softplug_service::http::{self, Limits, Options, Role, Server};
use softplug_service::library::Library;
use softplug_service::view::StopHow;
use softplug_service::{Config, Gateway};
use tempfile::TempDir;
use ureq::http::Response;
use ureq::{Agent, Body};

/// How long something that must come may take on a busy machine.
const PATIENCE: Duration = Duration::from_mins(1);

/// A gateway, its API, and a token of each role.
pub(crate) struct Bench {
    pub(crate) gateway: Gateway,
    pub(crate) server: Option<Server>,
    pub(crate) operator: String,
    pub(crate) admin: String,
    pub(crate) viewer: String,
    running: Option<Running>,
    agent: Agent,
    folder: TempDir,
}

/// What an answer was.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) status: u16,
    pub(crate) kind: String,
    pub(crate) body: Vec<u8>,
}

impl Answer {
    #[track_caller]
    pub(crate) fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }

    #[track_caller]
    pub(crate) fn with(self, status: u16) -> Self {
        let text = String::from_utf8_lossy(&self.body);
        assert_eq!(self.status, status, "{text}");
        if status >= 400 {
            assert_eq!(self.kind, "application/problem+json", "{text}");
            let problem = self.json();
            assert_eq!(problem["status"], status);
            assert!(problem["detail"].as_str().is_some_and(|detail| !detail.is_empty()));
        }
        self
    }
}

impl Bench {
    pub(crate) fn new() -> Self {
        // Tests ask faster than people.
        Self::with(|options| {
            options.limits.requests_per_second = 100_000;
            options.limits.burst = 100_000;
        })
    }

    /// One whose options are changed first.
    pub(crate) fn with(change: impl FnOnce(&mut Options)) -> Self {
        Self::made_of(CONFIGURATION, change, |_| {})
    }

    /// One with these links instead of the usual ones.
    pub(crate) fn with_links(links: &str) -> Self {
        Self::with_links_and(links, |_| {})
    }

    /// One with these links, and what `prepare` puts into its folder.
    pub(crate) fn with_links_and(links: &str, prepare: impl FnOnce(&Path)) -> Self {
        let (head, _) = CONFIGURATION.split_once("[[link]]").unwrap();
        Self::made_of(
            &format!("{head}{links}"),
            |options| {
                options.limits.requests_per_second = 100_000;
                options.limits.burst = 100_000;
            },
            prepare,
        )
    }

    /// One with a bus, on which three units hang that nobody has switched on yet.
    pub(crate) fn with_bus() -> Self {
        let unit = |number: u16| {
            format!(
                "[[link]]\nname = \"mill-{number}\"\nport = \"unit://127.0.0.1:{number}/mill\"\n\
                 plugin = \"xon-xoff\"\nbus = \"hall\"\n"
            )
        };
        let bus = "[[bus]]\nname = \"hall\"\nrate = 250_000\nefficiency = 0.4\nswitch = \"2ms\"\n";
        Self::with_links(&format!("{bus}{}", (1..=3).map(unit).collect::<String>()))
    }

    /// One with all that a gateway may have: a bus with a unit, a cell, and links of both protocols.
    pub(crate) fn with_bus_and_cell() -> Self {
        let link = |name: &str, protocol: &str| {
            format!(
                "[[link]]\nname = \"{name}\"\ngroup = \"Hall 1\"\nport = \"simulate:{protocol}\"\n\
                 plugin = \"{protocol}\"\nline = \"9600 8N1\"\n"
            )
        };
        let links =
            [link("lathe-1", "xon-xoff"), link("lathe-2", "xon-xoff"), link("press-3", "r3964")];
        Self::with_links(&format!(
            "{}[[link]]\nname = \"mill-4\"\nport = \"unit://127.0.0.1:4/mill\"\nplugin = \"xon-xoff\"\n\
             bus = \"hall\"\n[[bus]]\nname = \"hall\"\nrate = 250_000\nefficiency = 0.4\nswitch = \"2ms\"\n\
             [[cell]]\nname = \"shafts\"\nchannels = [\"lathe-1\", \"lathe-2\"]\naxes = [\"GANTRY\"]\n\
             groups = {{ LATHES = [\"lathe-1\", \"lathe-2\"] }}\n",
            links.concat()
        ))
    }

    /// One with two lathes and a loader in a cell.
    pub(crate) fn with_cell() -> Self {
        let link = |name: &str| {
            format!(
                "[[link]]\nname = \"{name}\"\nport = \"simulate:xon-xoff\"\n\
                 plugin = \"xon-xoff\"\nline = \"9600 8N1\"\n"
            )
        };
        let links: String = ["loader", "lathe-1", "lathe-2"].map(link).concat();
        let cell = "[[cell]]\nname = \"shafts\"\nchannels = [\"loader\", \"lathe-1\", \"lathe-2\"]\n\
                    axes = [\"GANTRY\"]\ngroups = { LATHES = [\"lathe-1\", \"lathe-2\"] }\n";
        Self::with_links(&format!("{links}{cell}"))
    }

    /// One with a simulated lathe that takes every feed pulse.
    pub(crate) fn with_lathe() -> Self {
        let link = "[[link]]\nname = \"lathe-1\"\nport = \"simulate:pulse-lathe\"\n\
                    line = \"40000 8N1\"\nplugin = \"pulse-lathe\"\ndepth = 400\n\
                    settings = { input = \"iso\" }\n";
        Self::with_links_and(link, |folder| {
            let library = Library::open(&folder.join("plugins")).unwrap();
            library.add(&fs::read(plugins().join("pulse-lathe.wasm")).unwrap()).unwrap();
        })
    }

    /// One into whose folder something was put before it starts.
    pub(crate) fn prepared(change: impl FnOnce(&mut Options), prepare: impl FnOnce(&Path)) -> Self {
        Self::made_of(CONFIGURATION, change, prepare)
    }

    fn made_of(
        configuration: &str,
        change: impl FnOnce(&mut Options),
        prepare: impl FnOnce(&Path),
    ) -> Self {
        let folder = tempfile::tempdir().unwrap();
        prepare(folder.path());
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("programs")).unwrap();
        let library = Library::open(&path("plugins")).unwrap();
        for plugin in ["xon-xoff.wasm", "r3964.wasm"] {
            library.add(&fs::read(plugins().join(plugin)).unwrap()).unwrap();
        }
        fs::write(path("gateway.toml"), configuration).unwrap();
        let (operator, first) = http::new_token("operator", Role::Operator).unwrap();
        let (admin, second) = http::new_token("admin", Role::Admin).unwrap();
        let (viewer, third) = http::new_token("screen", Role::Viewer).unwrap();
        fs::write(path("tokens.toml"), first.text() + &second.text() + &third.text()).unwrap();

        let config = Config::read(&path("gateway.toml")).unwrap();
        let running = gateway::start(config).unwrap();
        let gateway = running.gateway().clone();
        let listen = SocketAddr::from(([127, 0, 0, 1], 0));
        let mut options = Options::new(listen, Some(path("tokens.toml")));
        options.limits = Limits { upload_bytes: 1_000_000, ..Limits::default() };
        change(&mut options);
        let server = http::serve(gateway.clone(), &options).unwrap();
        let agent = Agent::config_builder()
            .http_status_as_error(false)
            .proxy(None)
            // A refusal may close the connection, for what was not read of the request.
            .max_idle_connections(0)
            .build()
            .into();
        let running = Some(running);
        Self { gateway, server: Some(server), operator, admin, viewer, running, agent, folder }
    }

    /// The same plug-in under another version: its manifest says so.
    pub(crate) fn add_plugin_of_version(&self, version: &str) {
        let module = fs::read(plugins().join("xon-xoff.wasm")).unwrap();
        let own = format!("\"{}\"", env!("CARGO_PKG_VERSION"));
        let other = format!("\"{version}\"");
        assert_eq!(own.len(), other.len(), "the module's sections keep their lengths");
        let at: Vec<_> =
            module.windows(own.len()).enumerate().filter(|(_, is)| *is == own.as_bytes()).collect();
        assert!(!at.is_empty(), "the manifest names its version");
        let mut changed = module.clone();
        for (at, _) in at {
            changed[at..at + other.len()].copy_from_slice(other.as_bytes());
        }
        let kind = "application/wasm";
        self.ask_as("POST", "/plugins", &self.admin, kind, &changed).with(201);
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.server.as_ref().unwrap().address()
    }

    pub(crate) fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address())
    }

    /// Asks with a token, or without; the path is below `/api/v1`.
    pub(crate) fn ask(&self, method: &str, path: &str, token: &str, body: &[u8]) -> Answer {
        self.ask_as(method, path, token, "application/json", body)
    }

    pub(crate) fn ask_as(
        &self,
        method: &str,
        path: &str,
        token: &str,
        kind: &str,
        body: &[u8],
    ) -> Answer {
        let request = ureq::http::Request::builder()
            .method(method)
            .uri(self.url(&format!("/api/v1{path}")))
            .header("Authorization", format!("Bearer {token}"))
            .header("Content-Type", kind);
        let answer = if body.is_empty() && method == "GET" {
            self.agent.run(request.body(()).unwrap())
        } else {
            self.agent.run(request.body(body).unwrap())
        };
        read(answer.unwrap())
    }

    pub(crate) fn get(&self, path: &str) -> Answer {
        self.ask("GET", path, &self.operator, b"")
    }

    pub(crate) fn post(&self, path: &str, order: &Value) -> Answer {
        self.ask("POST", path, &self.admin, order.to_string().as_bytes())
    }

    pub(crate) fn upload(&self, name: &str, program: &[u8]) -> Answer {
        let path = format!("/programs/{name}");
        self.ask_as("PUT", &path, &self.operator, "application/octet-stream", program)
    }

    /// What is outside of the API.
    pub(crate) fn plain(&self, path: &str) -> Answer {
        read(self.agent.get(self.url(path)).call().unwrap())
    }

    /// A connection on which nothing has been said yet.
    pub(crate) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address()).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream
    }

    /// Says these bytes and gives all that is answered until the end.
    pub(crate) fn raw(&self, bytes: &[u8]) -> String {
        Self::say(self.connect(), bytes)
    }

    /// What is answered to these bytes, with nothing more to come: whoever waits for more need not.
    pub(crate) fn raw_and_gone(&self, bytes: &[u8]) -> String {
        let stream = self.connect();
        let other = stream.try_clone().unwrap();
        let saying = std::thread::spawn({
            let bytes = bytes.to_vec();
            move || {
                let mut other = other;
                let _ = other.write_all(&bytes);
                let _ = other.shutdown(Shutdown::Write);
            }
        });
        let answer = Self::say(stream, b"");
        saying.join().unwrap();
        answer
    }

    fn say(mut stream: TcpStream, bytes: &[u8]) -> String {
        // It may be closed before all was said.
        let _ = stream.write_all(bytes);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    /// A request with an operator's token, to be sent raw.
    pub(crate) fn request(&self, method: &str, path: &str, more: &str) -> String {
        format!(
            "{method} {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nAuthorization: Bearer {}\r\n{more}\r\n",
            self.operator
        )
    }

    /// Waits until a link is in a state.
    #[track_caller]
    pub(crate) fn until_link(&self, link: &str, state: &str) -> Value {
        self.until(&format!("/links/{}", link.replace(' ', "%20")), |view| view["state"] == state)
    }

    /// Waits until what is at the path is as it should be.
    #[track_caller]
    pub(crate) fn until(&self, path: &str, is: impl Fn(&Value) -> bool) -> Value {
        let began = Instant::now();
        loop {
            let view = self.get(path).with(200).json();
            if is(&view) {
                return view;
            }
            assert!(began.elapsed() < PATIENCE, "{path} stays {view:#}");
            sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        drop(self.server.take());
        self.gateway.stop(StopHow::Park);
        if let Some(running) = self.running.take() {
            running.wait();
        }
    }
}

fn read(mut answer: Response<Body>) -> Answer {
    let kind = answer.headers().get("content-type").map_or("", |kind| kind.to_str().unwrap());
    let kind = kind.to_owned();
    let status = answer.status().as_u16();
    let body = answer.body_mut().read_to_vec().unwrap();
    Answer { status, kind, body }
}

const CONFIGURATION: &str = r#"
[gateway]
state = "state"
library = "plugins"
programs = ["programs"]
watch = false

[http]
listen = "127.0.0.1:0"
tokens = "tokens.toml"

[[link]]
name = "lathe-1"
port = "simulate:xon-xoff"
line = "19200 8N1"
plugin = "xon-xoff"
buffer = { size = 4096, low = 1024, high = 3072, packet = 256 }

[[link]]
name = "mill 2"
port = "simulate:xon-xoff"
line = "9600 8N1"
plugin = "xon-xoff"

[[link]]
name = "press-3"
port = "simulate:r3964"
line = "9600 8N1"
plugin = "r3964"
"#;

/// A program of so many blocks.
pub(crate) fn blocks(count: u32) -> String {
    (1..=count).fold(String::new(), |mut text, n| {
        let _ = writeln!(text, "N{n} G01 X{n}");
        text
    })
}

/// The folder with the plug-ins: the one that SOFTPLUG_PLUGINS names, or one that is built here, so
/// that they are never older than their source.
pub(crate) fn plugins() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| match std::env::var_os("SOFTPLUG_PLUGINS") {
        Some(folder) if !folder.is_empty() => PathBuf::from(folder),
        _ => build(),
    })
}

/// An example has none of its own.
const TEMPORARY: &str = match option_env!("CARGO_TARGET_TMPDIR") {
    Some(folder) => folder,
    None => concat!(env!("CARGO_MANIFEST_DIR"), "/../../target/tmp"),
};

fn build() -> PathBuf {
    let target = Path::new(TEMPORARY).join("plugins-target");
    let built = Command::new(env!("CARGO"))
        .args(["build", "--quiet", "--profile", "plugin", "--target", "wasm32v1-none"])
        .args(["--lib", "-p", "softplug-xon-xoff", "-p", "softplug-r3964"])
        .args(["-p", "softplug-pulse-lathe"])
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
        .env("CARGO_TARGET_DIR", &target)
        .status()
        .unwrap();
    assert!(built.success(), "the plug-in cannot be built: `rustup target add wasm32v1-none`");
    let folder = Path::new(TEMPORARY).join("plugins");
    fs::create_dir_all(&folder).unwrap();
    for name in ["xon-xoff.wasm", "r3964.wasm", "pulse-lathe.wasm"] {
        let built = target.join("wasm32v1-none/plugin").join(name.replace('-', "_"));
        fs::copy(built, folder.join(name)).unwrap();
    }
    folder
}
