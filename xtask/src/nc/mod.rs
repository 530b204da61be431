//! Generated NC programs: of any size, alike for the same seed.

mod check;
mod macros;
mod milling;
mod random;
mod short_blocks;
mod tape;
mod turning;

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::ValueEnum;

use self::random::Random;
use self::tape::Tape;

/// What a generated program machines.
#[derive(Copy, Clone, PartialEq, Eq, Debug, ValueEnum)]
pub(crate) enum Kind {
    /// A 3-D surface, finished line by line with a ball-nose cutter.
    Surfacing,
    /// Hole patterns with G81, G83, G73 and G84.
    Drilling,
    /// Turned parts with G71, G70, grooves and threads.
    Turning,
    /// Macro variables, WHILE, IF and GOTO.
    Macro,
    /// Blocks of a few characters.
    ShortBlocks,
}

/// A program of at least so many bytes can be generated.
const LEAST_BYTES: usize = 1_000;

/// A program cannot be generated.
#[derive(Debug, thiserror::Error)]
pub(crate) enum NcError {
    #[error("a program of {bytes} bytes is too short: ask for {LEAST_BYTES} or more")]
    TooShort { bytes: usize },
    #[error("{}: {cause}", path.display())]
    File { path: PathBuf, cause: io::Error },
    #[error("the generated program is unsound, which is a fault of the generator: {0}")]
    Unsound(#[from] check::Unsound),
}

/// Writes a program of exactly `bytes` bytes to `out`, or to standard output
/// where that is `-`.
pub(crate) fn write(out: &Path, kind: Kind, bytes: usize, seed: u64) -> Result<(), NcError> {
    let program = generate(kind, bytes, seed)?;
    check::check(&program)?;
    let written = if out == Path::new("-") {
        io::stdout().write_all(&program)
    } else {
        fs::write(out, &program)
    };
    written.map_err(|cause| NcError::File { path: out.to_owned(), cause })
}

/// A program of exactly `bytes` bytes, from `%` to `%`, with LF at line ends.
pub(crate) fn generate(kind: Kind, bytes: usize, seed: u64) -> Result<Vec<u8>, NcError> {
    if bytes < LEAST_BYTES {
        return Err(NcError::TooShort { bytes });
    }
    let mut tape = Tape::new(bytes);
    let random = &mut Random::new(seed);
    match kind {
        Kind::Surfacing => milling::surfacing(&mut tape, random),
        Kind::Drilling => milling::drilling(&mut tape, random),
        Kind::Turning => turning::turning(&mut tape, random),
        Kind::Macro => macros::macros(&mut tape, random),
        Kind::ShortBlocks => short_blocks::short_blocks(&mut tape, random),
    }
    Ok(tape.finish())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fixtures() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/nc")
    }

    #[test]
    fn every_kind_is_sound_and_of_the_size_asked_for() {
        for &kind in Kind::value_variants() {
            for bytes in [1_000, 1_001, 1_002, 1_003, 4_567, 100_000] {
                for seed in 0..5 {
                    let program = generate(kind, bytes, seed).unwrap();
                    assert_eq!(program.len(), bytes, "{kind:?}");
                    if let Err(error) = check::check(&program) {
                        panic!("{kind:?} of {bytes} bytes, seed {seed}: {error}");
                    }
                }
            }
        }
        assert!(generate(Kind::Macro, 999, 1).is_err());
    }

    #[test]
    fn a_seed_names_a_program() {
        for &kind in Kind::value_variants() {
            let program = |seed| generate(kind, 5_000, seed).unwrap();
            assert_eq!(program(7), program(7));
            assert_ne!(program(7), program(8), "{kind:?}");
        }
    }

    #[test]
    fn short_blocks_are_short() {
        let program = generate(Kind::ShortBlocks, 10_000, 3).unwrap();
        let blocks = program.split(|&byte| byte == b'\n').count();
        assert!(10_000 / blocks <= 6, "{blocks} blocks");
    }

    #[test]
    fn the_fixtures_are_sound_and_listed_with_their_size() {
        let readme = fs::read_to_string(fixtures().join("README.md")).unwrap();
        let mut total = 0;
        let mut programs = 0;
        for entry in fs::read_dir(fixtures()).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|extension| extension != "nc") {
                continue;
            }
            let program = fs::read(&path).unwrap();
            if let Err(error) = check::check(&program) {
                panic!("{}: {error}", path.display());
            }
            let name = path.file_name().unwrap().to_str().unwrap();
            let row = format!("| `{name}` | {} |", program.len());
            assert!(readme.contains(&row), "the README has no row that starts `{row}`");
            total += program.len();
            programs += 1;
        }
        let rows = readme.lines().filter(|line| line.starts_with("| `")).count();
        assert_eq!(programs, rows, "the README lists other programs than there are");
        assert!(total <= 200_000, "{total} bytes are too much for the repository");
    }

    #[test]
    fn the_surfacing_fixture_is_what_the_generator_writes() {
        let fixture = fs::read(fixtures().join("surfacing.nc")).unwrap();
        assert_eq!(fixture, generate(Kind::Surfacing, 40_000, 1).unwrap());
    }
}
