//! Who may do what: bearer tokens, of which only digests are kept.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant, SystemTime};

use data_encoding::HEXLOWER;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use subtle::{Choice, ConditionallySelectable, ConstantTimeEq};
use utoipa::ToSchema;

/// A tokens file is larger than this only by mistake.
const MOST_BYTES: u64 = 1024 * 1024;
/// The file is looked at again when as much has passed.
const FRESH: Duration = Duration::from_secs(1);
/// What every token begins with, so that it is known when it turns up where it should not.
const PREFIX: &str = "softplug_";

/// What the holder of a token may do.
#[derive(
    Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Debug, Hash, Serialize, Deserialize, ToSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// See everything and change nothing: for a screen in the shop.
    Viewer,
    /// See everything; programs, jobs, and bringing a link back to work.
    Operator,
    /// Plug-ins, swaps, deleting and the configuration too.
    Admin,
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Viewer => "viewer",
            Self::Operator => "operator",
            Self::Admin => "admin",
        })
    }
}

/// One entry of the tokens file.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Whose it is, for people.
    pub name: String,
    /// What its holder may do.
    pub role: Role,
    /// SHA-256 of the token's text, in hex.
    pub sha256: String,
}

impl Entry {
    /// As it stands in the file.
    pub fn text(&self) -> String {
        let quoted = toml::Value::String(self.name.clone());
        let Self { role, sha256, .. } = self;
        format!("[[token]]\nname = {quoted}\nrole = \"{role}\"\nsha256 = \"{sha256}\"\n")
    }
}

/// Makes a new token: its text, which is shown once, and the entry for the file.
///
/// # Errors
/// The system gives no random bytes.
pub fn new_token(name: &str, role: Role) -> io::Result<(String, Entry)> {
    let mut random = [0; 32];
    File::open("/dev/urandom")?.read_exact(&mut random)?;
    let text = format!("{PREFIX}{}", HEXLOWER.encode(&random));
    let sha256 = HEXLOWER.encode(&Sha256::digest(&text));
    Ok((text, Entry { name: name.to_owned(), role, sha256 }))
}

/// Why a tokens file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TokensError {
    /// It cannot be read.
    #[error("the tokens file {} cannot be read: {error}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        error: io::Error,
    },
    /// It is not what it should be.
    #[error("the tokens file {} is not right: {reason}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        reason: String,
    },
    /// Others may write into it.
    #[error("everybody may write into the tokens file {}; `chmod o-w` it", path.display())]
    Open {
        /// The file.
        path: PathBuf,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    #[serde(default)]
    token: Vec<Entry>,
}

/// The tokens that are let in, read again when their file changes.
#[derive(Debug)]
pub struct Tokens {
    path: Option<PathBuf>,
    known: Mutex<Known>,
}

#[derive(Debug, Default)]
struct Known {
    digests: Vec<([u8; 32], Role)>,
    seen: Option<Seen>,
    looked: Option<Instant>,
}

/// What another file, or the same for others to write, would not have: when it was written, its length and its mode.
type Seen = (SystemTime, u64, u32);

impl Tokens {
    /// Those in the file; without one there are none.
    ///
    /// # Errors
    /// The file cannot be used.
    pub fn read(path: Option<&Path>) -> Result<Self, TokensError> {
        let mut known = Known::default();
        if let Some(path) = path {
            known.digests = read(path)?;
            known.seen = seen(path).ok();
            known.looked = Some(Instant::now());
        }
        Ok(Self { path: path.map(Path::to_owned), known: Mutex::new(known) })
    }

    /// Whether there are any.
    pub fn is_empty(&self) -> bool {
        self.known.lock().is_ok_and(|known| known.digests.is_empty())
    }

    /// The role of whoever holds this token. Takes as long for every token of a length.
    pub fn role(&self, token: &str) -> Option<Role> {
        let digest: [u8; 32] = Sha256::digest(token).into();
        let mut known = self.known.lock().ok()?;
        if let Some(path) = &self.path {
            known.refresh(path);
        }
        let mut found = 0_u8;
        for (known, role) in &known.digests {
            let this: Choice = known.ct_eq(&digest);
            found.conditional_assign(&(1 + *role as u8), this);
        }
        match found {
            0 => None,
            1 => Some(Role::Viewer),
            2 => Some(Role::Operator),
            _ => Some(Role::Admin),
        }
    }
}

impl Known {
    /// A file that is being written keeps what was in it before; one that is gone lets nobody in.
    fn refresh(&mut self, path: &Path) {
        if self.looked.is_some_and(|looked| looked.elapsed() < FRESH) {
            return;
        }
        self.looked = Some(Instant::now());
        let now = seen(path).ok();
        if now.is_some() && now == self.seen {
            return;
        }
        self.seen = now;
        match read(path) {
            Ok(digests) => self.digests = digests,
            Err(error) => {
                tracing::error!("{error}");
                let TokensError::Malformed { .. } = error else {
                    self.digests.clear();
                    return;
                };
            }
        }
    }
}

fn seen(path: &Path) -> io::Result<Seen> {
    let metadata = fs::metadata(path)?;
    Ok((metadata.modified()?, metadata.len(), mode(&metadata)))
}

#[cfg(unix)]
fn mode(metadata: &fs::Metadata) -> u32 {
    std::os::unix::fs::PermissionsExt::mode(&metadata.permissions())
}

#[cfg(not(unix))]
fn mode(_: &fs::Metadata) -> u32 {
    0
}

fn read(path: &Path) -> Result<Vec<([u8; 32], Role)>, TokensError> {
    let unreadable = |error| TokensError::Read { path: path.to_owned(), error };
    let malformed = |reason| TokensError::Malformed { path: path.to_owned(), reason };
    let mut file = File::open(path).map_err(unreadable)?;
    let metadata = file.metadata().map_err(unreadable)?;
    if mode(&metadata) & 0o002 != 0 {
        return Err(TokensError::Open { path: path.to_owned() });
    }
    if metadata.len() > MOST_BYTES {
        return Err(malformed(format!("it has {} bytes", metadata.len())));
    }
    let mut text = String::new();
    file.by_ref().take(MOST_BYTES).read_to_string(&mut text).map_err(unreadable)?;
    let document: Document = toml::from_str(&text)
        .map_err(|error| malformed(error.to_string().trim_end().to_owned()))?;
    let digest = |entry: Entry| {
        let digest = unhex(&entry.sha256).ok_or_else(|| {
            malformed(format!("sha256 of \"{}\" must be 64 hex digits", entry.name.escape_debug()))
        })?;
        Ok((digest, entry.role))
    };
    document.token.into_iter().map(digest).collect()
}

fn unhex(text: &str) -> Option<[u8; 32]> {
    let text: &[u8; 64] = text.as_bytes().try_into().ok()?;
    let mut bytes = [0; 32];
    for (byte, pair) in bytes.iter_mut().zip(text.chunks_exact(2)) {
        let digit = |c: u8| char::from(c).to_digit(16);
        *byte = (digit(pair[0])? * 16 + digit(pair[1])?) as u8;
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(folder: &Path, text: &str) -> PathBuf {
        let path = folder.join("tokens.toml");
        fs::write(&path, text).unwrap();
        path
    }

    #[test]
    fn a_new_token_is_let_in_and_nothing_near_it() {
        let folder = tempfile::tempdir().unwrap();
        let (operator, first) = new_token("hall 1 \"left\"", Role::Operator).unwrap();
        let (admin, second) = new_token("office", Role::Admin).unwrap();
        let path = written(folder.path(), &(first.text() + &second.text()));
        let tokens = Tokens::read(Some(&path)).unwrap();
        assert_eq!(tokens.role(&operator), Some(Role::Operator));
        assert_eq!(tokens.role(&admin), Some(Role::Admin));
        for wrong in ["", PREFIX, &operator[1..], &format!("{operator} "), &first.sha256] {
            assert_eq!(tokens.role(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn without_a_file_nobody_is_let_in() {
        let tokens = Tokens::read(None).unwrap();
        assert!(tokens.is_empty());
        assert_eq!(tokens.role(""), None);
    }

    #[test]
    fn a_changed_file_counts_a_broken_one_does_not_and_without_it_nobody_enters() {
        let folder = tempfile::tempdir().unwrap();
        let (old, entry) = new_token("old", Role::Operator).unwrap();
        let (new, other) = new_token("new one", Role::Admin).unwrap();
        let path = written(folder.path(), &entry.text());
        let tokens = Tokens::read(Some(&path)).unwrap();
        let later = || tokens.known.lock().unwrap().looked = None;
        written(folder.path(), &other.text());
        later();
        assert_eq!((tokens.role(&old), tokens.role(&new)), (None, Some(Role::Admin)));
        written(folder.path(), "[[token]]\nname = ");
        later();
        assert_eq!(tokens.role(&new), Some(Role::Admin));
        fs::remove_file(&path).unwrap();
        later();
        assert_eq!(tokens.role(&new), None);
    }

    #[test]
    fn files_that_cannot_be_used_say_why() {
        let folder = tempfile::tempdir().unwrap();
        let missing = Tokens::read(Some(&folder.path().join("none"))).unwrap_err();
        assert!(missing.to_string().contains("cannot be read"), "{missing}");
        for text in [
            "[[token]]\nname = 'a'\nrole = 'king'\nsha256 = ''",
            "[[token]]\nname = 'a'\nrole = 'admin'\nsha256 = '00'",
            "token = 1",
            "tokens = []",
        ] {
            let error = Tokens::read(Some(&written(folder.path(), text))).unwrap_err();
            assert!(error.to_string().contains("is not right"), "{error}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_everybody_may_write_is_refused() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path(), "");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o666)).unwrap();
        assert!(matches!(Tokens::read(Some(&path)), Err(TokensError::Open { .. })));

        // While it runs: refused as long as it is so, and let in again as soon as it is not.
        let (token, entry) = new_token("hall", Role::Viewer).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
        written(folder.path(), &entry.text());
        let tokens = Tokens::read(Some(&path)).unwrap();
        for (mode, role) in [(0o666, None), (0o600, Some(Role::Viewer)), (0o602, None)] {
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
            tokens.known.lock().unwrap().looked = None;
            assert_eq!(tokens.role(&token), role, "{mode:o}");
        }
    }
}
