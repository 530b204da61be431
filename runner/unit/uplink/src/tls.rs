//! TLS 1.3 between a gateway and a unit, each of which knows the other's public key: raw keys (RFC 7250), no
//! certificates, no names, no clock.

use std::fmt;
use std::io::{self, Read as _, Write as _};
use std::net::{IpAddr, Ipv4Addr};
use std::sync::Arc;

use mio::net::TcpStream;
use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::client::{AlwaysResolvesClientRawPublicKeys, Resumption};
use rustls::crypto::{CryptoProvider, ring, verify_tls13_signature_with_raw_key};
use rustls::pki_types::{CertificateDer, ServerName, SubjectPublicKeyInfoDer, UnixTime};
use rustls::server::danger::{ClientCertVerified, ClientCertVerifier};
use rustls::server::{AlwaysResolvesServerRawPublicKeys, NoServerSessionStorage};
use rustls::sign::CertifiedKey;
use rustls::version::TLS13;
use rustls::{
    AlertDescription, CertificateError, ClientConfig, ClientConnection, Connection,
    DigitallySignedStruct, DistinguishedName, Error, InvalidMessage, OtherError, PeerIncompatible,
    ServerConfig, ServerConnection, SignatureScheme,
};
use thiserror::Error;

use crate::closed::Closed;
use crate::keys::{TlsPrivateKey, TlsPublicKey};

/// Bytes of a record, at most. It is of use only when all of it has come: on a slow network no frame is to
/// wait for many that are behind it.
const RECORD: usize = 4_096;

/// Of one end: its own key, and those of which the other side must have one.
///
/// ```
/// use softplug_unit_uplink::{TlsKeys, TlsPrivateKey};
///
/// let folder = tempfile::tempdir()?;
/// let unit = TlsPrivateKey::make(&folder.path().join("unit.key"))?;
/// let gateway = TlsPrivateKey::make(&folder.path().join("gateway.key"))?;
/// let keys = TlsKeys::of_unit(&unit, &[gateway.public()]);
/// assert_eq!(keys.own(), unit.public());
/// assert_ne!(keys, TlsKeys::of_gateway(&gateway, &[unit.public()]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct TlsKeys {
    pinned: Arc<Pinned>,
    end: End,
}

#[derive(Clone)]
enum End {
    Gateway(Arc<ClientConfig>),
    Unit(Arc<ServerConfig>),
}

impl TlsKeys {
    /// Of a gateway, which calls units with one of these keys.
    pub fn of_gateway(own: &TlsPrivateKey, units: &[TlsPublicKey]) -> Self {
        let (provider, pinned) = (provider(), Pinned::new(own, units));
        let mut config = ClientConfig::builder_with_provider(Arc::new(provider))
            .with_protocol_versions(&[&TLS13])
            .expect("the provider has suites of TLS 1.3")
            .dangerous()
            .with_custom_certificate_verifier(Arc::clone(&pinned) as Arc<dyn ServerCertVerifier>)
            .with_client_cert_resolver(Arc::new(AlwaysResolvesClientRawPublicKeys::new(raw(own))));
        config.resumption = Resumption::disabled();
        config.max_fragment_size = Some(RECORD);
        config.enable_sni = false;
        Self { pinned, end: End::Gateway(Arc::new(config)) }
    }

    /// Of a unit, which is called by gateways with one of these keys.
    pub fn of_unit(own: &TlsPrivateKey, gateways: &[TlsPublicKey]) -> Self {
        let (provider, pinned) = (provider(), Pinned::new(own, gateways));
        let mut config = ServerConfig::builder_with_provider(Arc::new(provider))
            .with_protocol_versions(&[&TLS13])
            .expect("the provider has suites of TLS 1.3")
            .with_client_cert_verifier(Arc::clone(&pinned) as Arc<dyn ClientCertVerifier>)
            .with_cert_resolver(Arc::new(AlwaysResolvesServerRawPublicKeys::new(raw(own))));
        config.session_storage = Arc::new(NoServerSessionStorage {});
        config.send_tls13_tickets = 0;
        config.max_fragment_size = Some(RECORD);
        Self { pinned, end: End::Unit(Arc::new(config)) }
    }

    /// The key by which the other side knows this one.
    pub fn own(&self) -> TlsPublicKey {
        self.pinned.own
    }

    fn connection(&self) -> Result<Connection, Error> {
        Ok(match &self.end {
            End::Gateway(config) => {
                // There is one for each connection, and nobody reads it.
                let name = ServerName::from(IpAddr::V4(Ipv4Addr::UNSPECIFIED));
                Connection::Client(ClientConnection::new(Arc::clone(config), name)?)
            }
            End::Unit(config) => Connection::Server(ServerConnection::new(Arc::clone(config))?),
        })
    }
}

impl PartialEq for TlsKeys {
    fn eq(&self, other: &Self) -> bool {
        let same_end = matches!(self.end, End::Gateway(_)) == matches!(other.end, End::Gateway(_));
        same_end && self.pinned == other.pinned
    }
}

impl Eq for TlsKeys {}

impl fmt::Debug for TlsKeys {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.pinned.fmt(f)
    }
}

/// Why TLS with the other side came to nothing.
#[derive(Debug, Error)]
pub enum TlsError {
    /// It has another key.
    #[error("the other side has the key {got}, and not {expected}")]
    OtherKey {
        /// What it has.
        got: TlsPublicKey,
        /// What is expected; several, with commas.
        expected: String,
    },
    /// It has a key or a certificate of another kind.
    #[error("the other side has no Ed25519 key of its own, and {expected} is expected")]
    NoKey {
        /// What is expected; several, with commas.
        expected: String,
    },
    /// It expects another key of this side.
    #[error("the other side does not know this side's key {own}")]
    Unknown {
        /// What this side has.
        own: TlsPublicKey,
    },
    /// It speaks in the clear.
    #[error("the other side speaks without TLS")]
    Plain,
    /// It wants TLS, and this side has no keys for it.
    #[error("the other side speaks TLS, and no key is configured for it here")]
    Wanted,
    /// It went away in the middle of the handshake.
    #[error("the other side closed the connection in the handshake of TLS: it may know no TLS")]
    Left,
    /// It did not come to an end of the handshake.
    #[error("the handshake of TLS has not come to an end in time")]
    Slow,
    /// Anything else.
    #[error("TLS failed: {0}")]
    Failed(Error),
}

/// How a connection of which TLS is not known yet looks if the other side speaks it: a record with a
/// handshake or an alert.
pub(crate) fn is_tls(came: &[u8]) -> bool {
    matches!(came, [0x15 | 0x16, 3, ..])
}

/// A connection with TLS on it.
pub(crate) struct TlsStream {
    stream: TcpStream,
    /// Boxed: it is large beside a connection in the clear.
    connection: Box<Connection>,
    pinned: Arc<Pinned>,
    has_failed: bool,
}

impl TlsStream {
    pub(crate) fn new(stream: TcpStream, keys: &TlsKeys) -> Result<Self, Closed> {
        let connection = Box::new(keys.connection().map_err(TlsError::Failed)?);
        Ok(Self { stream, connection, pinned: Arc::clone(&keys.pinned), has_failed: false })
    }

    pub(crate) fn is_handshaking(&self) -> bool {
        self.connection.is_handshaking()
    }

    /// The key that the other side has shown.
    pub(crate) fn other(&self) -> Option<TlsPublicKey> {
        let shown = self.connection.peer_certificates()?.first()?;
        TlsPublicKey::from_der(shown)
    }

    pub(crate) fn stream(&self) -> &TcpStream {
        &self.stream
    }

    pub(crate) fn stream_mut(&mut self) -> &mut TcpStream {
        &mut self.stream
    }

    /// What has come, in the clear; `None`: not before the stream is readable again.
    pub(crate) fn read(&mut self, to: &mut [u8]) -> Result<Option<usize>, Closed> {
        loop {
            match self.connection.reader().read(to) {
                Ok(0) => return Err(Closed::ByPeer),
                Ok(count) => return Ok(Some(count)),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                Err(error) => return Err(error.into()),
            }
            if !self.take()? {
                return Ok(None);
            }
        }
    }

    /// Goes on with the handshake as far as there is something to read. Whether it is done.
    pub(crate) fn shake_hands(&mut self) -> Result<bool, Closed> {
        self.flush()?;
        while self.is_handshaking() && self.take()? {}
        Ok(!self.is_handshaking())
    }

    /// Takes up what the stream has; `false`: nothing.
    fn take(&mut self) -> Result<bool, Closed> {
        match self.connection.read_tls(&mut self.stream) {
            Ok(0) => return Err(self.left()),
            Ok(_) => {}
            Err(error) if is_for_later(&error) => return Ok(false),
            Err(error) => return Err(self.broken(error)),
        }
        self.process()?;
        self.flush()?;
        Ok(true)
    }

    fn process(&mut self) -> Result<(), Closed> {
        if let Err(error) = self.connection.process_new_packets() {
            self.has_failed = true;
            // What is wrong is told to the other side, if it listens.
            let _ = self.connection.write_tls(&mut self.stream);
            return Err(self.pinned.blame(error).into());
        }
        Ok(())
    }

    /// Encrypts as much as fits, all of it in as few records as can be, and sends it. How much of it was
    /// taken: nothing while the handshake is under way, or while something else still waits.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> Result<usize, Closed> {
        if !self.flush()? || self.is_handshaking() {
            return Ok(0);
        }
        let count = self.connection.writer().write(bytes)?;
        self.flush()?;
        Ok(count)
    }

    /// Sends what is encrypted. `false`: some of it still waits.
    pub(crate) fn flush(&mut self) -> Result<bool, Closed> {
        while self.connection.wants_write() {
            match self.connection.write_tls(&mut self.stream) {
                Ok(0) => return Err(self.left()),
                Ok(_) => {}
                Err(error) if is_for_later(&error) => return Ok(false),
                Err(error) => return Err(self.broken(error)),
            }
        }
        Ok(true)
    }

    fn left(&self) -> Closed {
        if self.is_handshaking() { TlsError::Left.into() } else { Closed::ByPeer }
    }

    fn broken(&mut self, error: io::Error) -> Closed {
        use io::ErrorKind::{BrokenPipe, ConnectionReset};
        if !matches!(error.kind(), ConnectionReset | BrokenPipe) {
            return error.into();
        }
        // What it said before it went, and nobody has read yet, says more.
        if let Ok(1..) = self.connection.read_tls(&mut self.stream)
            && let Err(closed) = self.process()
        {
            return closed;
        }
        self.left()
    }
}

/// Says that this is the end, as far as that leaves at once.
impl Drop for TlsStream {
    fn drop(&mut self) {
        if !self.has_failed {
            self.connection.send_close_notify();
            let _ = self.connection.write_tls(&mut self.stream);
        }
    }
}

impl fmt::Debug for TlsStream {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TlsStream").field("stream", &self.stream).finish_non_exhaustive()
    }
}

pub(crate) fn is_for_later(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

/// Which keys there are.
#[derive(PartialEq, Eq, Debug)]
struct Pinned {
    own: TlsPublicKey,
    others: Box<[TlsPublicKey]>,
}

/// The other side has none of the keys that it may have.
#[derive(Debug, Error)]
#[error("another key")]
struct OtherKey(Option<TlsPublicKey>);

impl Pinned {
    fn new(own: &TlsPrivateKey, others: &[TlsPublicKey]) -> Arc<Self> {
        Arc::new(Self { own: own.public(), others: others.into() })
    }

    fn knows(&self, key: &CertificateDer<'_>) -> Result<(), Error> {
        let key = TlsPublicKey::from_der(key);
        if key.is_some_and(|key| self.others.contains(&key)) {
            return Ok(());
        }
        let other = OtherError(Arc::new(OtherKey(key)));
        Err(Error::InvalidCertificate(CertificateError::Other(other)))
    }

    /// What an error says of keys.
    fn blame(&self, error: Error) -> TlsError {
        let expected = || {
            let keys: Vec<String> = self.others.iter().map(TlsPublicKey::to_string).collect();
            keys.join(", ")
        };
        match error {
            Error::InvalidCertificate(CertificateError::Other(other)) => {
                match other.0.downcast_ref() {
                    Some(OtherKey(Some(got))) => {
                        TlsError::OtherKey { got: *got, expected: expected() }
                    }
                    _ => TlsError::NoKey { expected: expected() },
                }
            }
            Error::NoCertificatesPresented
            | Error::PeerIncompatible(
                PeerIncompatible::IncorrectCertificateTypeExtension
                | PeerIncompatible::UnsolicitedCertificateTypeExtension,
            ) => TlsError::NoKey { expected: expected() },
            Error::AlertReceived(
                AlertDescription::CertificateUnknown | AlertDescription::CertificateRequired,
            ) => TlsError::Unknown { own: self.own },
            Error::InvalidMessage(
                InvalidMessage::InvalidContentType
                | InvalidMessage::UnknownProtocolVersion
                | InvalidMessage::MessageTooLarge
                | InvalidMessage::InvalidEmptyPayload,
            ) => TlsError::Plain,
            error => TlsError::Failed(error),
        }
    }

    fn verify(
        message: &[u8],
        key: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        let key = SubjectPublicKeyInfoDer::from(key.as_ref());
        let algorithms = ring::default_provider().signature_verification_algorithms;
        verify_tls13_signature_with_raw_key(message, &key, signed, &algorithms)
    }
}

impl ServerCertVerifier for Pinned {
    fn verify_server_cert(
        &self,
        key: &CertificateDer<'_>,
        _: &[CertificateDer<'_>],
        _: &ServerName<'_>,
        _: &[u8],
        _: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        self.knows(key).map(|()| ServerCertVerified::assertion())
    }

    fn verify_tls12_signature(
        &self,
        _: &[u8],
        _: &CertificateDer<'_>,
        _: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        Err(PeerIncompatible::Tls12NotOffered.into())
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        key: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        Self::verify(message, key, signed)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        vec![SignatureScheme::ED25519]
    }

    fn requires_raw_public_keys(&self) -> bool {
        true
    }
}

impl ClientCertVerifier for Pinned {
    fn root_hint_subjects(&self) -> &[DistinguishedName] {
        &[]
    }

    fn verify_client_cert(
        &self,
        key: &CertificateDer<'_>,
        _: &[CertificateDer<'_>],
        _: UnixTime,
    ) -> Result<ClientCertVerified, Error> {
        self.knows(key).map(|()| ClientCertVerified::assertion())
    }

    fn verify_tls12_signature(
        &self,
        _: &[u8],
        _: &CertificateDer<'_>,
        _: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        Err(PeerIncompatible::Tls12NotOffered.into())
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        key: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        Self::verify(message, key, signed)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        vec![SignatureScheme::ED25519]
    }

    fn requires_raw_public_keys(&self) -> bool {
        true
    }
}

fn provider() -> CryptoProvider {
    ring::default_provider()
}

/// A key as both ends show it: in the place of a certificate.
fn raw(own: &TlsPrivateKey) -> Arc<CertifiedKey> {
    let public = CertificateDer::from(own.public().der().to_vec());
    Arc::new(CertifiedKey::new(vec![public], own.signs()))
}
