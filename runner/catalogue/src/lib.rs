//! What is known of machines: how each is spoken to over a serial line.
//!
//! A [`Machine`] names a plug-in with its settings, the line, what a person sets at the control, and
//! where each fact is from. Some are [known](Catalogue::known); a folder of files of the same form
//! [adds](Catalogue::add_folder) others, or takes the place of one.
//!
//! ```
//! use softplug_catalogue::Catalogue;
//!
//! let catalogue = Catalogue::known();
//! let machine = catalogue.find("haas-vf").expect("it is known");
//! assert_eq!((&*machine.plugin, machine.line.as_deref()), ("xon-xoff", Some("9600 7E2")));
//! assert!(!machine.sources.is_empty());
//! ```
//!
//! A [`Notation`] is a way in which a program says its name in its text; [`Notations`] are those of a
//! machine, or all that are known.

mod catalogue;
mod error;
mod limits;
mod machine;
mod names;

pub use catalogue::Catalogue;
pub use error::{FolderError, MachineError, NotationError};
pub use limits::{MOST_FILE_BYTES, MOST_TEXT};
pub use machine::{AtControl, Flow, Machine, ProgramNames, Remark, Source};
pub use names::{HEAD_BYTES, KNOWN_NOTATIONS, Notation, Notations, is_same_program};
