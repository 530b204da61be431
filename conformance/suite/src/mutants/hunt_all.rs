//! Runs all mutants of some catalogues on several threads.

use super::{Catalogue, Hunt, Mutant, PatchError, hunt, wake};
use crate::script::{self, Script};
use crate::{Case, Sandboxed};
use softplug_host::{EngineKind, Host, HostOptions, LoadError};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::{fs, io, thread};

/// A mutant cannot be run.
///
/// ```
/// use softplug_conformance::mutants::{Catalogue, HuntError, subject};
/// use std::path::Path;
///
/// let text = r#"
/// profile = "xon-xoff"
/// plugin = "xon-xoff"
///
/// [[mutant]]
/// id = "xon-xoff.tx.obey-xoff/ignored"
/// text = "XOFF means nothing"
/// "#;
/// let catalogue = Catalogue::parse(Path::new("xon-xoff.toml"), text)?;
/// let error = subject(Path::new("none"), &catalogue.mutants[0]).unwrap_err();
/// assert!(matches!(error, HuntError::Io { .. }));
/// assert!(error.to_string().ends_with("; build it with `cargo xtask mutants`"));
/// # Ok::<(), softplug_conformance::FileError>(())
/// ```
#[derive(Debug, thiserror::Error)]
pub enum HuntError {
    /// Its module cannot be read.
    #[error("cannot read {}: {source}; build it with `cargo xtask mutants`", path.display())]
    Io {
        /// The module.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// Its module does not hold mutants.
    #[error("{}: {source}", path.display())]
    Patch {
        /// The module.
        path: PathBuf,
        /// Why.
        source: PatchError,
    },
    /// Its module is no plug-in.
    #[error("\"{mutant}\" cannot be loaded: {source}")]
    Load {
        /// The mutant.
        mutant: String,
        /// Why.
        source: Box<LoadError>,
    },
}

/// Hunts every mutant of the catalogues that `wanted` names, in modules called
/// `PLUGIN.wasm` in a folder. `progress` is told of each one as it is done, in any
/// order; the result depends on neither threads nor time.
///
/// ```
/// use softplug_conformance::mutants::{Catalogue, hunt_all};
/// use softplug_conformance::Case;
/// use softplug_trace::Trace;
/// use std::path::Path;
///
/// # let folder = tempfile::tempdir()?;
/// # let echo = std::fs::read_to_string("../../fixtures/abi/echo.wat")?;
/// # let marker = "(data (i32.const 512) \"softplug-mutant:\\00\\00\\00\\00\\00\\00\\00\\00\")";
/// # let wasm = wat::parse_str(echo.replace("(global $room", &format!("{marker} (global $room")))?;
/// # std::fs::write(folder.path().join("echo.wasm"), wasm)?;
/// # let text = "\
/// # id: echo.tx.upper-case
/// # title: A letter is sent back in upper case
/// # profile: echo
/// # clauses: echo.tx.upper-case
/// # level: must
/// # line: 9600 8N1 depth=1 reaction=0
/// # since: 1
/// # origin: hand-written
/// # ---
/// # < 0.000000 61
/// # > 0.000000 41
/// # ";
/// # let catalogue = r#"
/// # profile = "echo"
/// # plugin = "echo"
/// # [[mutant]]
/// # id = "echo.tx.upper-case/lower"
/// # text = "Letters are sent back as they are"
/// # "#;
/// // A catalogue of one mutant, a folder with the module, and a case that must notice.
/// let catalogue = Catalogue::parse(Path::new("echo.toml"), catalogue)?;
/// let cases = [Case::new("echo.tx.upper-case.spt", Trace::parse(text)?)];
/// let (all, quietly) = (|_: &_| true, |_: &_, _: &_| {});
/// let hunts = hunt_all(&[catalogue], all, folder.path(), &cases, 2, &quietly)?;
/// let kill = hunts["echo.tx.upper-case/lower"].kill.as_ref().expect("the case notices");
/// assert_eq!((kill.run.as_str(), kill.cites), ("echo.tx.upper-case/uncut", true));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The first mutant that cannot be run.
pub fn hunt_all(
    catalogues: &[Catalogue],
    wanted: impl Fn(&Mutant) -> bool,
    modules: &Path,
    cases: &[Case],
    threads: usize,
    progress: &(dyn Fn(&Mutant, &Hunt) + Sync),
) -> Result<BTreeMap<String, Hunt>, HuntError> {
    let orders: Vec<(&Catalogue, &Mutant)> = catalogues
        .iter()
        .flat_map(|catalogue| catalogue.mutants.iter().map(move |mutant| (catalogue, mutant)))
        .filter(|(_, mutant)| wanted(mutant))
        .collect();
    let scripts = script::all();
    let next = AtomicUsize::new(0);
    let done = Mutex::new(BTreeMap::new());
    let work = || -> Result<(), HuntError> {
        while let Some((catalogue, mutant)) = orders.get(next.fetch_add(1, Ordering::Relaxed)) {
            let subject = subject(modules, mutant)?;
            let of_profile: Vec<&Case> =
                cases.iter().filter(|case| case.trace.front.profile == catalogue.profile).collect();
            let scripts: Vec<&Script> =
                scripts.iter().filter(|script| script.profile == catalogue.profile).collect();
            let hunt = hunt(&subject, mutant, &of_profile, &scripts);
            progress(mutant, &hunt);
            done.lock().expect("no other thread panicked").insert(mutant.id.clone(), hunt);
        }
        Ok(())
    };
    thread::scope(|scope| {
        let workers: Vec<_> = (0..threads.max(1)).map(|_| scope.spawn(work)).collect();
        workers.into_iter().try_for_each(|worker| {
            worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    })?;
    Ok(done.into_inner().expect("no thread panicked"))
}

/// The plug-in with this mutant active.
///
/// The example of [`HuntError`] shows a module that is not there; with one, the
/// plug-in is what [`hunt`] takes.
///
/// # Errors
/// The module cannot be read, holds no mutants, or is no plug-in.
pub fn subject(modules: &Path, mutant: &Mutant) -> Result<Sandboxed, HuntError> {
    let path = modules.join(format!("{}.wasm", mutant.plugin));
    let module = fs::read(&path).map_err(|source| HuntError::Io { path: path.clone(), source })?;
    let woken = wake(&module, &mutant.id).map_err(|source| HuntError::Patch { path, source })?;
    let load = |source| HuntError::Load { mutant: mutant.id.clone(), source: Box::new(source) };
    // Most mutants are noticed after a few short runs: compiling would take longer.
    let options = HostOptions { engine: EngineKind::Wasmi, ..HostOptions::default() };
    let host = Host::new(options).map_err(load)?;
    Ok(Sandboxed::new(host.load_bytes(&woken).map_err(load)?))
}
