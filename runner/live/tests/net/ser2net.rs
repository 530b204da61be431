//! ser2net, as Debian has it, as a child of the test.

use std::fmt::Display;
use std::fs;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use tempfile::TempDir;

/// One connection of ser2net's, from an address of its own to a connector.
#[derive(Debug)]
pub(crate) struct Ser2net {
    folder: TempDir,
    child: Child,
    address: SocketAddr,
}

impl Ser2net {
    /// Serves RFC 2217, with the device or the other server behind it that the
    /// connector names.
    pub(crate) fn start(connector: impl Display) -> Self {
        Self::serve("telnet(rfc2217),tcp", connector, "")
    }

    pub(crate) fn serve(accepter: &str, connector: impl Display, options: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let address = free_address();
        let (host, port) = (address.ip(), address.port());
        let text = format!(
            "connection: &c\n  accepter: {accepter},{host},{port}\n  connector: {connector}\n{options}"
        );
        fs::write(folder.path().join("ser2net.yaml"), text).unwrap();
        let child = spawn(&folder, address);
        Self { folder, child, address }
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// As by `kill -9`.
    pub(crate) fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    pub(crate) fn start_again(&mut self) {
        self.child = spawn(&self.folder, self.address);
    }
}

impl Drop for Ser2net {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// An address that nobody has. It is kept only by the chance that nobody takes
/// it before ser2net does, because ser2net does not tell which port it got.
fn free_address() -> SocketAddr {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap()
}

fn spawn(folder: &TempDir, address: SocketAddr) -> Child {
    let mut child = Command::new("ser2net")
        .arg("-n")
        .arg("-c")
        .arg(folder.path().join("ser2net.yaml"))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let end = Instant::now() + Duration::from_secs(20);
    // It listens before it serves, so a connection is taken up; and this one has
    // to be gone before the next is let in.
    while TcpStream::connect(address).is_err() {
        assert!(child.try_wait().unwrap().is_none(), "ser2net has ended");
        assert!(Instant::now() < end, "ser2net does not listen");
        thread::sleep(Duration::from_millis(5));
    }
    child
}
