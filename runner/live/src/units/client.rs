//! A unit that is asked and given a plug-in by hand: one connection that waits.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::net::ToSocketAddrs;
use std::time::{Duration, Instant};

use mio::{Events, Interest, Poll, Token};
use softplug_unit_protocol::{
    Digest, Encode, Identity, KEPT_SETTINGS, MessageError, Messages, RefuseReason, Role, Session,
    SessionEvent, SlotState, ToServer, ToUnit,
};
use softplug_unit_uplink::{
    CanEnd, CanUplink, Closed, Outbox, TcpUplink, TlsError, TlsKeys, Uplink,
};
use thiserror::Error;

use super::headway::Headway;
use super::{ServerSession, UnitPlace, UnitPlugin, longest_fields, pairs, piece};
use crate::clock::Clock;
use crate::text::plain_text;

/// Why a unit cannot be asked, or does not do it.
#[derive(Debug, Error)]
pub enum UnitClientError {
    /// Its name leads nowhere, or the connection failed.
    #[error("{unit}: {source}")]
    Io {
        /// The unit.
        unit: String,
        /// What the system says.
        source: io::Error,
    },
    /// The connection ended.
    #[error("{unit}: {source}")]
    Closed {
        /// The unit.
        unit: String,
        /// How.
        source: Closed,
    },
    /// Nothing came in time.
    #[error(
        "{unit} does not answer: see that a unit runs there, and that no other gateway drives it"
    )]
    Silent {
        /// The unit.
        unit: String,
    },
    /// Another gateway has a session with it.
    #[error("{unit} is driven by another gateway: ask that one, or stop it")]
    Busy {
        /// The unit.
        unit: String,
    },
    /// What it answers is no message.
    #[error(
        "{unit} answers with what is no message of the unit protocol, and is at fault: {reason}"
    )]
    NoMessage {
        /// The unit.
        unit: String,
        /// What is wrong with it.
        reason: MessageError,
    },
    /// It answers, and what it is asked for makes no headway.
    #[error("{unit} answers and goes no further with {what}: it is at fault, or its memory is")]
    Stuck {
        /// The unit.
        unit: String,
        /// What it was asked for.
        what: &'static str,
    },
    /// It speaks another version of the protocol.
    #[error("{unit} speaks another version of the unit protocol")]
    Version {
        /// The unit.
        unit: String,
    },
    /// It has no such link.
    #[error("{unit} has no link \"{link}\"; it has {known}")]
    NoLink {
        /// The unit.
        unit: String,
        /// What was asked for.
        link: String,
        /// What there is.
        known: String,
    },
    /// It has several links, and none was named.
    #[error("{unit} has several links; name one of them: {known}")]
    WhichLink {
        /// The unit.
        unit: String,
        /// What there is.
        known: String,
    },
    /// It does not take the plug-in.
    #[error("{unit} does not take the plug-in: {why}")]
    NotTaken {
        /// The unit.
        unit: String,
        /// Why, as it says.
        why: String,
    },
    /// It has the plug-in, and does not run it.
    #[error("{unit} has the plug-in and does not run it: {why}")]
    NotRun {
        /// The unit.
        unit: String,
        /// Why, as it says.
        why: String,
    },
}

/// Why a unit does not run what is in its memory.
#[derive(Debug, Error)]
enum NotRun {
    #[error("its settings have {bytes} bytes; {most} are the most")]
    Settings { bytes: usize, most: usize },
    /// As it says.
    #[error("{0}")]
    Refused(String),
    #[error("it has ended by a fault: {0}")]
    Fault(String),
}

/// Nothing over CAN says that a session is over: a unit that is driven may be free after this span,
/// in which nobody was heard.
const OVER: Duration = Duration::from_secs(4);
/// How long is waited for what becomes of a plug-in that has begun to run.
const SETTLING: Duration = Duration::from_secs(3);

/// What a unit is and has.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct UnitSurvey {
    /// Its name.
    pub name: String,
    /// Its serial number.
    pub serial: u64,
    /// Its links, in the order of its configuration.
    pub links: Vec<UnitLinkSurvey>,
}

/// A link of a unit.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct UnitLinkSurvey {
    /// Its name.
    pub name: String,
    /// Its port is open.
    pub is_up: bool,
    /// SHA-256 of the plug-in that runs, if one does.
    pub runs: Option<Digest>,
    /// A job is under way, or its end is not noted yet.
    pub has_job: bool,
    /// Its slots, A and B.
    pub slots: [UnitSlotSurvey; 2],
    /// Why its plug-in does not run, or why there is none, as the unit says.
    pub trouble: Option<String>,
}

/// A slot of a link.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct UnitSlotSurvey {
    /// What it holds.
    pub state: SlotState,
    /// The plug-in's length in bytes.
    pub length: u32,
    /// SHA-256 of it.
    pub digest: Digest,
    /// How often the slot was erased …
    pub erased: u32,
    /// … and how often it may be.
    pub erasable: u32,
}

const EMPTY: UnitSlotSurvey =
    UnitSlotSurvey { state: SlotState::Empty, length: 0, digest: [0; 32], erased: 0, erasable: 0 };

/// What was made of a message.
enum Heard<T> {
    /// It is what was waited for.
    Found(T),
    /// What is waited for comes nearer.
    Headway,
    /// It says nothing of it.
    Nothing,
    /// It was said too often.
    Enough,
}

/// A session with a unit that nobody else drives.
///
/// ```no_run
/// use softplug_live::units::UnitClient;
/// use std::time::Duration;
///
/// let mut client = UnitClient::connect(&"10.0.0.17:7640".parse()?, None, 0x1234, Duration::from_secs(5))?;
/// for link in client.survey()?.links {
///     println!("{}: {}", link.name, if link.is_up { "up" } else { "down" });
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct UnitClient {
    unit: String,
    poll: Poll,
    uplink: Uplink,
    session: Box<ServerSession>,
    outbox: Outbox,
    clock: Clock,
    patience: Duration,
    /// When it was first said that somebody else drives the unit.
    busy_since: Option<Instant>,
}

impl UnitClient {
    /// Connects to a unit, over TCP with TLS where there are keys, and begins a session. `identity` is a
    /// random number; nothing is waited for longer than `patience`.
    ///
    /// # Errors
    /// It is not there, or somebody else drives it.
    pub fn connect(
        place: &UnitPlace,
        tls: Option<&TlsKeys>,
        identity: u64,
        patience: Duration,
    ) -> Result<Self, UnitClientError> {
        let unit = plain_text(&place.to_string());
        let failed = |source| UnitClientError::Io { unit: unit.clone(), source };
        let poll = Poll::new().map_err(failed)?;
        let mut uplink = open(place, tls).map_err(|closed| match closed {
            Closed::Io(source) => failed(source),
            source => UnitClientError::Closed { unit: unit.clone(), source },
        })?;
        let both = Interest::READABLE | Interest::WRITABLE;
        poll.registry().register(&mut uplink, Token(0), both).map_err(failed)?;
        let clock = Clock::start();
        let mut session = Box::new(Session::new(Role::Server, Identity(identity)));
        session.call(clock.now());
        let outbox = Outbox::default();
        let mut client =
            Self { unit, poll, uplink, session, outbox, clock, patience, busy_since: None };
        client.wait("a session", |client, _| {
            if client.session.is_up() { Heard::Found(()) } else { Heard::Nothing }
        })?;
        client.outbox.begin(client.session.longest_message());
        Ok(client)
    }

    /// Asks what it is and has.
    ///
    /// # Errors
    /// It does not answer.
    pub fn survey(&mut self) -> Result<UnitSurvey, UnitClientError> {
        self.outbox.push(&ToUnit::Query {}, false);
        let mut survey = UnitSurvey::default();
        let (mut slots, mut count) = (vec![[EMPTY; 2]; 256], None);
        let mut links: BTreeMap<u8, UnitLinkSurvey> = BTreeMap::new();
        let mut told = BTreeSet::new();
        self.wait("saying what it is", |_, message| {
            let is_news = match message {
                Some(&ToServer::Unit { links, serial, name }) => {
                    (survey.serial, survey.name) = (serial, plain_text(name));
                    count.replace(usize::from(links)).is_none()
                }
                Some(&ToServer::Slot { link, slot, state, length, digest, erased, erasable }) => {
                    if let Some(place) = slots[usize::from(link)].get_mut(usize::from(slot)) {
                        *place = UnitSlotSurvey { state, length, digest, erased, erasable };
                    }
                    false
                }
                Some(&ToServer::Link { link, is_up, digest, job, name, .. }) => {
                    let found = UnitLinkSurvey {
                        name: plain_text(name),
                        is_up,
                        runs: (digest != [0; 32]).then_some(digest),
                        has_job: job != 0,
                        slots: slots[usize::from(link)],
                        trouble: None,
                    };
                    links.insert(link, found).is_none()
                }
                Some(&ToServer::Fault { link, what }) => {
                    if let Some(link) = links.get_mut(&link) {
                        link.trouble = Some(plain_text(what));
                    }
                    false
                }
                // What a plug-in says is no trouble of its own.
                Some(&ToServer::Note { link, text, .. }) => {
                    if let Some(link) = links.get_mut(&link).filter(|link| link.runs.is_none()) {
                        link.trouble = Some(plain_text(text));
                    }
                    false
                }
                Some(&ToServer::Told { link }) => told.insert(link),
                _ => false,
            };
            let is_whole = count == Some(told.len()) && count == Some(links.len());
            match (is_whole, is_news) {
                (true, _) => Heard::Found(()),
                (false, true) => Heard::Headway,
                (false, false) => Heard::Nothing,
            }
        })?;
        survey.links = links.into_values().collect();
        Ok(survey)
    }

    /// Downloads a plug-in for a link, if it is not there, and has it run; without settings, with those
    /// that the link has. `progress` is told how
    /// many bytes are in the unit's memory. Returns whether anything was downloaded.
    ///
    /// # Errors
    /// There is no such link, or the unit does not take the plug-in, or does not run it.
    pub fn flash(
        &mut self,
        link: Option<&str>,
        plugin: &UnitPlugin,
        mut progress: impl FnMut(u32),
    ) -> Result<bool, UnitClientError> {
        let survey = self.survey()?;
        let number = match link {
            Some(link) => survey.links.iter().position(|one| one.name == link),
            None => (survey.links.len() == 1).then_some(0),
        };
        let number = number.ok_or_else(|| {
            let (unit, link) = (self.unit.clone(), link.map(str::to_owned));
            let names: Vec<&str> = survey.links.iter().map(|link| &*link.name).collect();
            let known = names.join(", ");
            match link {
                Some(link) => UnitClientError::NoLink { unit, link, known },
                None => UnitClientError::WhichLink { unit, known },
            }
        })?;
        let link = number as u8;
        let UnitPlugin { module, digest, signature, .. } = plugin;
        let holds = |slot: &UnitSlotSurvey| {
            use SlotState::{Confirmed, OnTrial, Written};
            slot.digest == *digest && matches!(slot.state, Written | OnTrial | Confirmed)
        };
        let is_there = survey.links[number].slots.iter().any(holds);
        if is_there && self.open(link, plugin)?.is_ok() {
            return Ok(false);
        }
        // It is not there, or what is there cannot run: a signature may be wanted by now.
        let signature = signature.as_deref().unwrap_or_default();
        let length = module.len() as u32;
        if signature.len() > piece(&self.outbox) {
            return Err(self.not_taken("it takes no message as long as a signature".to_owned()));
        }
        self.outbox.push(&ToUnit::Download { link, length, digest: *digest, signature }, false);
        let mut headway = Headway::default();
        let whole = self.wait("the download", |client, message| match message {
            Some(&ToServer::Downloaded { until, .. }) => {
                headway.take(until);
                if headway.is_none() {
                    return Heard::Enough;
                }
                progress(until);
                let rest = module.get(until as usize..).unwrap_or_default();
                let next: &dyn Encode = if rest.is_empty() {
                    &ToUnit::Install { link }
                } else {
                    let bytes = &rest[..rest.len().min(piece(&client.outbox))];
                    &ToUnit::Piece { link, at: until, bytes }
                };
                client.outbox.push(&next, false);
                if headway.is_some() { Heard::Headway } else { Heard::Nothing }
            }
            Some(&ToServer::Installed { .. }) => Heard::Found(Ok(())),
            Some(&ToServer::NotInstalled { why, .. }) => {
                Heard::Found(Err(client.not_taken(plain_text(why))))
            }
            _ => Heard::Nothing,
        })?;
        whole?;
        let opened = self.open(link, plugin)?;
        opened.map_err(|error| UnitClientError::NotRun {
            unit: self.unit.clone(),
            why: error.to_string(),
        })?;
        Ok(true)
    }

    /// Has a link run what is in one of its slots; why it does not.
    fn open(
        &mut self,
        link: u8,
        plugin: &UnitPlugin,
    ) -> Result<Result<(), NotRun>, UnitClientError> {
        let settings = match &plugin.settings[..] {
            [] => KEPT_SETTINGS.to_vec(),
            settings => pairs(settings),
        };
        let most = longest_fields(&self.outbox);
        if settings.len() > most {
            return Ok(Err(NotRun::Settings { bytes: settings.len(), most }));
        }
        let wanted = plugin.digest;
        self.outbox.push(&ToUnit::Open { link, digest: wanted, settings: &settings }, false);
        let mut began: Option<Instant> = None;
        self.wait("running the plug-in", |_, message| match message {
            Some(&ToServer::Link { link: of, digest, is_up, .. })
                if of == link && digest == wanted =>
            {
                began.get_or_insert_with(Instant::now);
                if is_up { Heard::Found(Ok(())) } else { Heard::Headway }
            }
            Some(&ToServer::Refused { message: ToUnit::OPEN, link: of, why, .. }) if of == link => {
                Heard::Found(Err(NotRun::Refused(plain_text(why))))
            }
            Some(&ToServer::Fault { link: of, what }) if of == link && began.is_some() => {
                Heard::Found(Err(NotRun::Fault(plain_text(what))))
            }
            // Its port is the unit's matter: the plug-in runs as soon as that opens.
            Some(&(ToServer::Up { link: of } | ToServer::Down { link: of, .. }))
                if of == link && began.is_some() =>
            {
                Heard::Found(Ok(()))
            }
            _ if began.is_some_and(|began| began.elapsed() >= SETTLING) => Heard::Found(Ok(())),
            _ => Heard::Nothing,
        })
    }

    fn not_taken(&self, why: String) -> UnitClientError {
        UnitClientError::NotTaken { unit: self.unit.clone(), why }
    }

    /// Works until `find` finds something, which is called for each message and whenever the
    /// session has changed. Patience begins anew with each message that is headway.
    fn wait<T>(
        &mut self,
        what: &'static str,
        mut find: impl FnMut(&mut Self, Option<&ToServer<'_>>) -> Heard<T>,
    ) -> Result<T, UnitClientError> {
        let mut events = Events::with_capacity(4);
        let mut until = Instant::now() + self.patience;
        let mut answers = false;
        loop {
            while let Some(frame) = self.next_frame()? {
                let Ok(Some(payload)) = self.session.receive(self.clock.now(), &frame) else {
                    continue;
                };
                for message in Messages::<ToServer<'_>>::new(payload) {
                    let message = message.map_err(|reason| UnitClientError::NoMessage {
                        unit: self.unit.clone(),
                        reason,
                    })?;
                    answers = true;
                    match find(self, Some(&message)) {
                        Heard::Found(found) => {
                            self.speak()?;
                            return Ok(found);
                        }
                        Heard::Headway => until = Instant::now() + self.patience,
                        Heard::Nothing => {}
                        Heard::Enough => {
                            return Err(UnitClientError::Stuck { unit: self.unit.clone(), what });
                        }
                    }
                }
                // Somebody who never pauses is not heard for ever.
                if Instant::now() >= until {
                    break;
                }
            }
            self.session.handle_timeout(self.clock.now());
            self.look_at_session()?;
            if let Heard::Found(found) = find(self, None) {
                return Ok(found);
            }
            self.speak()?;
            let now = Instant::now();
            if now >= until {
                let unit = self.unit.clone();
                if self.uplink.is_handshaking() {
                    let source = Closed::Tls(TlsError::Slow);
                    return Err(UnitClientError::Closed { unit, source });
                }
                return Err(match self.busy_since {
                    Some(_) if !self.session.is_up() => UnitClientError::Busy { unit },
                    _ if answers => UnitClientError::Stuck { unit, what },
                    _ => UnitClientError::Silent { unit },
                });
            }
            let due = self
                .session
                .poll_timeout()
                .map(|at| Duration::from_micros((at - self.clock.now()).0.max(0) as u64));
            let patience = due.unwrap_or(self.patience).min(until - now);
            if let Err(source) = self.poll.poll(&mut events, Some(patience))
                && source.kind() != io::ErrorKind::Interrupted
            {
                return Err(UnitClientError::Io { unit: self.unit.clone(), source });
            }
        }
    }

    fn next_frame(&mut self) -> Result<Option<Vec<u8>>, UnitClientError> {
        match self.uplink.receive() {
            Ok(frame) => Ok(frame.map(<[u8]>::to_vec)),
            // A unit sends away whoever comes while it is driven.
            Err(closed) if closed.is_by_peer() && !self.session.is_up() => {
                Err(UnitClientError::Busy { unit: self.unit.clone() })
            }
            Err(source) => Err(UnitClientError::Closed { unit: self.unit.clone(), source }),
        }
    }

    fn look_at_session(&mut self) -> Result<(), UnitClientError> {
        let unit = self.unit.clone();
        match self.session.poll() {
            Some(SessionEvent::Refused(RefuseReason::Busy)) => {
                let since = *self.busy_since.get_or_insert_with(Instant::now);
                let is_over = matches!(self.uplink, Uplink::Tcp(_)) || since.elapsed() >= OVER;
                if is_over { Err(UnitClientError::Busy { unit }) } else { Ok(()) }
            }
            Some(SessionEvent::Refused(_)) => Err(UnitClientError::Version { unit }),
            Some(SessionEvent::Ended(_)) => Err(UnitClientError::Silent { unit }),
            Some(SessionEvent::Began { .. }) | None => Ok(()),
        }
    }

    fn speak(&mut self) -> Result<(), UnitClientError> {
        let unit = self.unit.clone();
        let now = self.clock.now();
        self.uplink
            .speak(&mut self.session, &mut self.outbox, now)
            .map_err(|source| UnitClientError::Closed { unit, source })
    }
}

fn open(unit: &UnitPlace, tls: Option<&TlsKeys>) -> Result<Uplink, Closed> {
    let (host, port) = match unit {
        UnitPlace::Tcp { host, port } => (host.as_str(), *port),
        UnitPlace::Can(address) => {
            return Ok(Uplink::Can(CanUplink::open(address, CanEnd::Gateway)?));
        }
    };
    let found = (host, port).to_socket_addrs()?.next();
    let address = found.ok_or_else(|| io::Error::from(io::ErrorKind::NotFound))?;
    TcpUplink::connect(address, tls).map(Uplink::Tcp)
}
