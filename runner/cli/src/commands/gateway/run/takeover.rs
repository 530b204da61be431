//! Another command in the place of this one, in the same process: devices stay open meanwhile, so
//! that nothing is lost of what comes.
//!
//! Their descriptors travel in a socket that is the new command's standard input. It opens them by
//! their names as ever; then it lets the socket go, and with it what was kept.

use std::fs::File;
use std::io::{self, IoSlice};
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use rustix::cmsg_space;
use rustix::net::{SendAncillaryBuffer, SendAncillaryMessage, SendFlags, sendmsg};
use softplug_service::Gateway;
use softplug_service::view::LinkState;

/// Says that standard input is such a socket.
const MARK: &str = "SOFTPLUG_TAKES_OVER";
/// Most descriptors of one message.
const MOST: usize = 253;
/// A device that cannot be opened for so long need not be kept.
const PATIENCE: Duration = Duration::from_secs(10);
const LOOK: Duration = Duration::from_millis(50);

/// Goes on as the command that stands there now; comes back only with why it cannot be.
pub(super) fn replace(executable: &Path, kept: &[OwnedFd]) -> io::Error {
    match carry(kept) {
        Ok(carrier) => Command::new(executable)
            .args(std::env::args_os().skip(1))
            .env(MARK, "1")
            .stdin(carrier)
            .exec(),
        Err(error) => error,
    }
}

/// A socket that holds them.
fn carry(kept: &[OwnedFd]) -> io::Result<OwnedFd> {
    let (from, to) = UnixStream::pair()?;
    for some in kept.chunks(MOST) {
        let some: Vec<BorrowedFd<'_>> = some.iter().map(AsFd::as_fd).collect();
        let mut space = [MaybeUninit::uninit(); cmsg_space!(ScmRights(MOST))];
        let mut message = SendAncillaryBuffer::new(&mut space);
        message.push(SendAncillaryMessage::ScmRights(&some));
        sendmsg(&from, &[IoSlice::new(b".")], &mut message, SendFlags::empty())?;
    }
    Ok(to.into())
}

/// Lets go of what the command before has kept open, once it is open here.
pub(super) fn let_go(gateway: Gateway) {
    if std::env::var_os(MARK).is_none() {
        return;
    }
    let wait = move || {
        let begin = Instant::now();
        let opens = || {
            let links = gateway.links().unwrap_or_default();
            links.iter().any(|link| link.state == LinkState::Opening)
        };
        while begin.elapsed() < PATIENCE && opens() {
            thread::sleep(LOOK);
        }
        let done = File::open("/dev/null").and_then(|null| Ok(rustix::stdio::dup2_stdin(null)?));
        if let Err(error) = done {
            tracing::warn!(%error, "devices stay open beyond their links");
        }
    };
    if let Err(error) = thread::Builder::new().name("takeover".to_owned()).spawn(wait) {
        tracing::warn!(%error, "devices stay open beyond their links");
    }
}
