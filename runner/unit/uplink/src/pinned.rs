//! The keys of one end, as TLS 1.3 asks for them: raw ones (RFC 7250), no certificates, no names, no clock.

use std::fmt;
use std::net::{IpAddr, Ipv4Addr};
use std::sync::Arc;

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

use crate::closed::TlsError;
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
    pub(crate) pinned: Arc<Pinned>,
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

    pub(crate) fn connection(&self) -> Result<Connection, Error> {
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

/// Which keys there are.
#[derive(PartialEq, Eq, Debug)]
pub(crate) struct Pinned {
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
    pub(crate) fn blame(&self, error: Error) -> TlsError {
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
