//! Chromium without a window, driven over its DevTools.

use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde_json::{Value, json};
use tempfile::TempDir;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

/// How long something that must come may take on a busy machine.
const PATIENCE: Duration = Duration::from_mins(1);

/// A browser with one page.
pub(crate) struct Browser {
    process: Child,
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    last: u64,
    /// What the page complained of.
    pub(crate) complaints: Vec<String>,
    _folder: TempDir,
}

impl Browser {
    pub(crate) fn open() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut process = Command::new("chromium")
            .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run"])
            .args(["--disable-background-networking", "--disable-component-update"])
            .args(["--disable-extensions", "--hide-scrollbars", "--remote-debugging-port=0"])
            .arg(format!("--user-data-dir={}", folder.path().display()))
            .arg("about:blank")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("chromium is there");
        let mut said = BufReader::new(process.stderr.take().unwrap()).lines();
        let address = said
            .find_map(|line| Some(line.unwrap().split_once("listening on ws://")?.1.to_owned()))
            .expect("chromium says where it listens");
        // It must be able to go on speaking.
        std::thread::spawn(move || said.for_each(drop));
        let host = address.split('/').next().unwrap().to_owned();
        let target: Value = ureq::put(format!("http://{host}/json/new?about:blank"))
            .send_empty()
            .unwrap()
            .body_mut()
            .read_json()
            .unwrap();
        let url = target["webSocketDebuggerUrl"].as_str().unwrap();
        let stream = TcpStream::connect(host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let (socket, _) =
            tungstenite::client(url, MaybeTlsStream::Plain(stream)).expect("a socket");
        let complaints = Vec::new();
        let mut browser = Self { process, socket, last: 0, complaints, _folder: folder };
        for domain in ["Page", "Runtime", "Log", "DOM"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        browser
    }

    /// Calls a method of DevTools and gives its result.
    pub(crate) fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.last += 1;
        let id = self.last;
        let mut call = json!({ "id": id, "method": method });
        call["params"] = parameters;
        self.socket.send(Message::text(call.to_string())).unwrap();
        loop {
            let Message::Text(text) = self.socket.read().expect("chromium answers") else {
                continue;
            };
            let mut message: Value = serde_json::from_str(&text).unwrap();
            if message["id"] == id {
                assert!(message["error"].is_null(), "{method}: {}", message["error"]);
                return message["result"].take();
            }
            self.heed(&message["method"], &message["params"]);
        }
    }

    fn heed(&mut self, event: &Value, parameters: &Value) {
        match event.as_str() {
            Some("Runtime.exceptionThrown") => {
                let details = &parameters["exceptionDetails"];
                self.complaints.push(details["exception"]["description"].to_string());
            }
            Some("Log.entryAdded") if parameters["entry"]["level"] == "error" => {
                self.complaints.push(parameters["entry"]["text"].to_string());
            }
            _ => {}
        }
    }

    pub(crate) fn go(&mut self, url: &str) {
        self.call("Page.navigate", json!({ "url": url }));
    }

    /// A window of this size; narrow ones are phones.
    pub(crate) fn size(&mut self, width: u32, height: u32) {
        let is_phone = width < 600;
        let metrics = json!({
            "width": width, "height": height, "deviceScaleFactor": 1, "mobile": is_phone,
        });
        self.call("Emulation.setDeviceMetricsOverride", metrics);
    }

    /// The value of an expression in the page.
    pub(crate) fn value(&mut self, expression: &str) -> Value {
        let how = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let mut answer = self.call("Runtime.evaluate", how);
        let details = &answer["exceptionDetails"];
        assert!(details.is_null(), "{expression}: {details}");
        answer["result"]["value"].take()
    }

    /// Waits until the expression is true.
    #[track_caller]
    pub(crate) fn until(&mut self, expression: &str) {
        let began = Instant::now();
        while self.value(&format!("Boolean({expression})")) != true {
            if began.elapsed() > PATIENCE {
                let text = self.value("document.body.innerText");
                panic!("never true: {expression}\n{}", text.as_str().unwrap_or_default());
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Waits for a text on the page.
    #[track_caller]
    pub(crate) fn sees(&mut self, text: &str) {
        let text = Value::from(text);
        self.until(&format!("document.body.innerText.includes({text})"));
    }

    /// Clicks, where it is shown, on the first element of this kind with this text.
    #[track_caller]
    pub(crate) fn click(&mut self, kind: &str, text: &str) {
        let find = format!(
            "[...document.querySelectorAll({})].find((of) => of.textContent.trim() === {} \
             && of.checkVisibility())",
            Value::from(kind),
            Value::from(text)
        );
        self.until(&find);
        let place = format!(
            "(() => {{ const of = {find}; of.scrollIntoView({{ block: 'center' }}); \
             const {{ x, y, width, height }} = of.getBoundingClientRect(); \
             return [x + width / 2, y + height / 2]; }})()"
        );
        let place = self.settled(&place);
        for what in ["mousePressed", "mouseReleased"] {
            let event = json!({
                "type": what, "x": place[0], "y": place[1], "button": "left", "clickCount": 1,
            });
            self.call("Input.dispatchMouseEvent", event);
        }
    }

    /// The expression's value once it stays: what is above may still come or go.
    fn settled(&mut self, expression: &str) -> Value {
        let mut value = self.value(expression);
        loop {
            std::thread::sleep(Duration::from_millis(50));
            let now = self.value(expression);
            if now == value {
                return value;
            }
            value = now;
        }
    }

    /// Whether such an element with this text is to be seen.
    pub(crate) fn shows(&mut self, kind: &str, text: &str) -> bool {
        let is = format!(
            "[...document.querySelectorAll({})].some((of) => of.textContent.trim() === {} && of.checkVisibility())",
            Value::from(kind),
            Value::from(text)
        );
        self.value(&is) == true
    }

    /// Types into what has the focus.
    pub(crate) fn type_text(&mut self, text: &str) {
        self.call("Input.insertText", json!({ "text": text }));
    }

    /// Presses a key: Tab, Enter, Space or ArrowDown.
    pub(crate) fn press(&mut self, key: &str) {
        let (code, text) = match key {
            "Tab" => (9, None),
            "Enter" => (13, Some("\r")),
            "Space" => (32, Some(" ")),
            "ArrowDown" => (40, None),
            other => panic!("no key {other}"),
        };
        let name = if key == "Space" { " " } else { key };
        for what in ["keyDown", "keyUp"] {
            let mut event = json!({
                "type": what, "key": name, "code": key, "windowsVirtualKeyCode": code,
            });
            if let (Some(text), "keyDown") = (text, what) {
                event["text"] = text.into();
            }
            self.call("Input.dispatchKeyEvent", event);
        }
    }

    /// Goes on with the Tab key until what has the focus has this text or name.
    #[track_caller]
    pub(crate) fn tab_to(&mut self, text: &str) {
        let focused = "((of) => (of?.tagName !== 'SELECT' && of?.innerText || of?.name || of?.ariaLabel || '').trim())\
             (document.activeElement)";
        for _ in 0..100 {
            self.press("Tab");
            if self.value(focused) == text {
                return;
            }
        }
        panic!("the Tab key does not lead to \"{text}\"");
    }

    /// Gives files to the file input of this name.
    pub(crate) fn choose(&mut self, name: &str, files: &[PathBuf]) {
        let selector = format!("input[name={name}]");
        self.until(&format!("document.querySelector({})", Value::from(selector.as_str())));
        let document = self.call("DOM.getDocument", json!({}));
        let root = &document["root"]["nodeId"];
        let found = self.call("DOM.querySelector", json!({ "nodeId": root, "selector": selector }));
        let files: Vec<_> = files.iter().map(|file| file.to_str().unwrap()).collect();
        let node = &found["nodeId"];
        self.call("DOM.setFileInputFiles", json!({ "nodeId": node, "files": files }));
    }

    /// Light or dark, as the system would have it.
    pub(crate) fn prefer(&mut self, scheme: &str) {
        let features = json!([{ "name": "prefers-color-scheme", "value": scheme }]);
        self.call("Emulation.setEmulatedMedia", json!({ "features": features }));
    }

    /// Chooses of the select of this name.
    #[track_caller]
    pub(crate) fn pick(&mut self, name: &str, value: &str) {
        let select = format!("document.querySelector('select[name=\"{name}\"]')");
        let value = Value::from(value);
        let find = format!(
            "{select} && [...{select}.options].find((one) => one.value === {value} \
             || one.textContent.startsWith({value}))"
        );
        self.until(&format!("{find} && {select}.checkVisibility()"));
        self.value(&format!(
            "(() => {{ const one = {find}; {select}.value = one.value; \
             {select}.dispatchEvent(new Event('change', {{ bubbles: true }})); }})()"
        ));
    }

    /// What is seen, as a PNG file.
    pub(crate) fn screenshot(&mut self) -> Vec<u8> {
        let answer = self.call("Page.captureScreenshot", json!({ "format": "png" }));
        BASE64.decode(answer["data"].as_str().unwrap()).unwrap()
    }

    /// How much wider the page is than its window.
    pub(crate) fn overhang(&mut self) -> i64 {
        let overhang = self.value("document.documentElement.scrollWidth - innerWidth");
        overhang.as_i64().unwrap()
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
