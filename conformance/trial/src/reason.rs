//! Why a job ends, in sentences.

use softplug_abi::Failure;
use softplug_abi::manifest::Manifest;

/// Of a job that does not end: there is no real partner in a trial.
pub const WAITS: &str = "the plug-in waits for something that only a real partner sends";

/// Why a job failed, in a sentence, with the protocol's own code if there is one.
///
/// ```
/// use softplug_abi::Failure;
/// use softplug_abi::manifest::Manifest;
/// use softplug_native::NativePlugin;
/// use softplug_trial::reason;
///
/// let manifest = Manifest::parse(NativePlugin::R3964.manifest().as_bytes())?;
/// let said = reason(&manifest, Failure::TooLong, 0x0517);
/// assert_eq!(said, "longer than the protocol or a setting allows ((05)17: too long)");
/// assert_eq!(reason(&manifest, Failure::Busy, 0xF123), "another job is under way (status F123)");
/// # Ok::<(), softplug_abi::manifest::ManifestError>(())
/// ```
pub fn reason(manifest: &Manifest, failure: Failure, status: u16) -> String {
    match (status, manifest.status(status)) {
        (0, _) => failure.text().to_owned(),
        // The plug-in says itself what is wrong with the job, and knows better.
        (_, Some(known)) if failure == Failure::BadJob => {
            format!("{} ({})", known.text, known.name)
        }
        (_, Some(known)) => format!("{} ({}: {})", failure.text(), known.name, known.text),
        (_, None) => format!("{} (status {status:04X})", failure.text()),
    }
}
