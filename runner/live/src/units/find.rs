//! Which units there are on a CAN bus.

use std::io;
use std::time::{Duration, Instant};

use mio::{Events, Interest, Poll, Token};
use softplug_abi::Micros;
use softplug_unit_protocol::{Identity, Role, Session};
use softplug_unit_uplink::{CanAddress, CanEnd, CanUplink, Outbox, Uplink};

use super::ServerSession;
use crate::clock::Clock;

/// What a full interface does not take is offered again after this span.
const AGAIN: Duration = Duration::from_millis(20);

/// Calls each number on the bus of a CAN interface, and returns those that answer within `span`, in
/// order: also units that another gateway drives. `identity` is a random number.
///
/// ```no_run
/// use softplug_live::units::units_on_can;
/// use std::time::Duration;
///
/// for unit in units_on_can("can0", 0x1234, Duration::from_secs(3))? {
///     println!("{unit}");
/// }
/// # Ok::<(), std::io::Error>(())
/// ```
///
/// # Errors
/// There is no such interface, it is down, or the kernel has no ISO-TP.
pub fn units_on_can(interface: &str, identity: u64, span: Duration) -> io::Result<Vec<CanAddress>> {
    let mut poll = Poll::new()?;
    let clock = Clock::start();
    let addresses = (1..=u8::MAX).filter_map(|node| CanAddress::new(interface, node).ok());
    let called = addresses.enumerate().map(|(number, address)| {
        let mut uplink = CanUplink::open(&address, CanEnd::Gateway).map(Uplink::Can)?;
        let both = Interest::READABLE | Interest::WRITABLE;
        poll.registry().register(&mut uplink, Token(number), both)?;
        let mut session: Box<ServerSession> =
            Box::new(Session::new(Role::Server, Identity(identity)));
        session.call(clock.now());
        Ok(Called { address, uplink, session, has_answered: false })
    });
    let mut called = called.collect::<io::Result<Vec<_>>>()?;
    let mut events = Events::with_capacity(64);
    let begin = Instant::now();
    while begin.elapsed() < span {
        for one in &mut called {
            one.turn(clock.now())?;
        }
        if let Err(error) = poll.poll(&mut events, Some(AGAIN))
            && error.kind() != io::ErrorKind::Interrupted
        {
            return Err(error);
        }
    }
    Ok(called.into_iter().filter(|one| one.has_answered).map(|one| one.address).collect())
}

struct Called {
    address: CanAddress,
    uplink: Uplink,
    session: Box<ServerSession>,
    has_answered: bool,
}

impl Called {
    fn turn(&mut self, now: Micros) -> io::Result<()> {
        let closed = |closed| io::Error::other(format!("{closed}"));
        while !self.has_answered
            && let Some(frame) = self.uplink.receive().map_err(closed)?
        {
            // Whatever it says: somebody is there.
            let _ = self.session.receive(now, frame);
            self.has_answered = self.session.poll().is_some();
        }
        if self.has_answered {
            self.session.end();
            return Ok(());
        }
        self.session.handle_timeout(now);
        self.uplink.speak(&mut self.session, &mut Outbox::default(), now).map_err(closed)
    }
}
