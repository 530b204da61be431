//! What of a module was executed.

use super::flow::{BranchKind, End, Flow, Way};
use super::instrument::{Layout, bits_of, instrumented};
use super::source::Source;
use crate::run::subject::{Fuel, Sandboxed, Subject, SubjectError};
use softplug_abi::limits::FUEL_PER_EVENT;
use softplug_abi::manifest::Manifest;
use softplug_abi::{Event, Instance, Micros, Output};
use softplug_explore::Marked;
use softplug_host::{Host, Inspection, Plugin, Session, SessionFault};
use softplug_report::{Coverage, Place};
use std::sync::{Arc, Mutex};
use wasmparser::{ElementItems, ExternalKind, Parser, Payload};

/// Marking what is executed costs fuel that is not the plug-in's own.
pub(crate) const MEASURING_FUEL: u64 = 16 * FUEL_PER_EVENT;

/// A module whose executed places are found out.
///
/// ```no_run
/// use softplug_conformance::Places;
///
/// let module = std::fs::read("target/plugins/xon-xoff.wasm")?;
/// let places = Places::of(&module)?;
/// let marked = places.marked(&module)?;
/// assert!(marked.wasm.len() > module.len());
/// // Nothing was executed yet.
/// assert_eq!(places.coverage(&module, &[]).branches.executed, 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Places {
    flows: Vec<Flow>,
    layout: Layout,
    /// Functions that are exported.
    exported: Vec<u32>,
    /// Functions in a table.
    in_table: Vec<u32>,
    names: Vec<(u32, String)>,
}

/// Which places were executed.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct Executed(Vec<u64>);

impl Executed {
    fn has(&self, bit: usize) -> bool {
        self.0.get(bit / 64).is_some_and(|word| word >> (bit % 64) & 1 == 1)
    }

    pub(crate) fn of(words: Vec<u64>) -> Self {
        Self(words)
    }

    /// The words of the marks.
    pub(crate) fn words(&self) -> &[u64] {
        &self.0
    }

    fn add_word(&mut self, word: usize, bits: u64) {
        if self.0.len() <= word {
            self.0.resize(word + 1, 0);
        }
        self.0[word] |= bits;
    }

    pub(crate) fn add(&mut self, other: &Self) {
        for (word, bits) in other.0.iter().enumerate() {
            self.add_word(word, *bits);
        }
    }
}

/// A place of a plug-in that no run has executed though it can be.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Unexecuted {
    pub(crate) function: u32,
    pub(crate) name: Option<String>,
    pub(crate) at: usize,
    pub(crate) what: &'static str,
}

/// How much of a module was executed. What can never be executed, and what does nothing
/// but trap, does not count.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct Share {
    pub(crate) functions: (u32, u32),
    pub(crate) ways: (u32, u32),
    pub(crate) unexecuted: Vec<Unexecuted>,
}

/// Why it cannot be found out what of a module is executed.
///
/// ```
/// use softplug_conformance::{MeasureError, Places};
///
/// assert!(matches!(Places::of(b"no module").unwrap_err(), MeasureError::Parser(_)));
/// ```
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// The module cannot be read.
    #[error("{0}")]
    Parser(#[from] wasmparser::BinaryReaderError),
    /// It cannot be written with its marks.
    #[error("{0}")]
    Writer(#[from] wasm_encoder::reencode::Error),
    /// With its marks it does not load.
    #[error("{0}")]
    Host(#[from] softplug_host::LoadError),
}

impl Places {
    /// Looks for them.
    ///
    /// # Errors
    /// The module cannot be read.
    ///
    /// The example of [`Places`] shows it.
    pub fn of(module: &[u8]) -> Result<Self, MeasureError> {
        let (mut flows, mut exported) = (Vec::new(), Vec::new());
        let (mut in_table, mut names, mut names_of_exports) = (Vec::new(), Vec::new(), Vec::new());
        for payload in Parser::new(0).parse_all(module) {
            match payload? {
                Payload::CodeSectionEntry(body) => flows.push(Flow::of(&body)?),
                Payload::ExportSection(section) => {
                    for export in section {
                        let export = export?;
                        names_of_exports.push(export.name);
                        if export.kind == ExternalKind::Func {
                            exported.push(export.index);
                        }
                    }
                }
                Payload::ElementSection(section) => {
                    for element in section {
                        if let ElementItems::Functions(functions) = element?.items {
                            in_table.extend(functions.into_iter().filter_map(Result::ok));
                        }
                    }
                }
                Payload::CustomSection(section) => {
                    if let wasmparser::KnownCustom::Name(section) = section.as_known() {
                        names.extend(function_names(section));
                    }
                }
                _ => {}
            }
        }
        let mut layout = Layout::of(&flows);
        layout.avoid(&names_of_exports);
        Ok(Self { flows, layout, exported, in_table, names })
    }

    /// The plug-in, made so that it says what it executes.
    pub(crate) fn watch(
        &self,
        host: &Host,
        module: &[u8],
        inspection: &Inspection,
    ) -> Result<Watcher, MeasureError> {
        let Marked { wasm, globals, .. } = self.marked(module)?;
        let plugin = host.load_instrumented(inspection, &wasm)?;
        Ok(Watcher { plugin, words: globals.into(), executed: Arc::default() })
    }

    /// The module, made so that it marks what it executes.
    ///
    /// # Errors
    /// It cannot be written.
    ///
    /// The example of [`Places`] shows it.
    pub fn marked(&self, module: &[u8]) -> Result<Marked, MeasureError> {
        let wasm = instrumented(module, &self.flows, &self.layout)?;
        let globals = (0..self.layout.words()).map(|word| self.layout.name_of(word)).collect();
        Ok(Marked { wasm, globals, fuel: MEASURING_FUEL })
    }

    /// How much was executed where a [marked](Self::marked) module has set these marks.
    ///
    /// The example of [`Places`] shows it.
    pub fn coverage(&self, module: &[u8], marks: &[u64]) -> Coverage {
        let share = self.share(&Executed::of(marks.to_vec()));
        let part = |(executed, of)| softplug_report::Executed { executed, of };
        let source = Source::of(module);
        let place = |place: Unexecuted| Place {
            function: place.function,
            name: place.name,
            at: place.at as u64,
            source: source.as_ref().and_then(|source| source.line(place.at)),
            what: place.what.to_owned(),
        };
        Coverage {
            functions: part(share.functions),
            branches: part(share.ways),
            places: share.unexecuted.into_iter().map(place).collect(),
        }
    }

    /// Whether the instruction at this place of the module was executed.
    pub(crate) fn is_executed(&self, executed: &Executed, function: u32, at: usize) -> bool {
        let number = function as usize;
        let block = self.flows[number].blocks.iter().rposition(|block| block.at <= at);
        block.is_some_and(|block| executed.has(self.layout.blocks[number][block]))
    }

    /// How much was executed.
    pub(crate) fn share(&self, executed: &Executed) -> Share {
        let returning = self.returning();
        let called = self.called();
        let mut share = Share::default();
        for (number, flow) in self.flows.iter().enumerate() {
            if !called[number] || returning[number].first() != Some(&true) {
                continue;
            }
            let bits = &self.layout.blocks[number];
            share.functions.1 += 1;
            let is_entered = executed.has(bits[0]);
            if is_entered {
                share.functions.0 += 1;
            } else {
                share.add(self, number, flow.blocks[0].at, "the function is never called");
            }
            for (branch, first) in flow.branches.iter().zip(&self.layout.branches[number]) {
                if !returning[number][branch.block] {
                    continue;
                }
                let is_reached = executed.has(bits[branch.block]);
                for (what, ways) in branch_ways(branch.kind, &branch.ways) {
                    let only_traps = |way: &usize| match branch.ways[*way] {
                        Way::Block(block) => !returning[number][block],
                        Way::Return => false,
                    };
                    if ways.iter().all(only_traps) {
                        continue;
                    }
                    share.ways.1 += 1;
                    let bit = |way: &usize| first + (*way).min(bits_of(branch) - 1);
                    if ways.iter().any(|way| executed.has(bit(way))) {
                        share.ways.0 += 1;
                    } else if is_reached {
                        share.add(self, number, branch.at, what);
                    }
                }
            }
        }
        share
    }

    /// Of each function, of each block: whether the function can return from there. Where it
    /// cannot it traps, whatever happens: as behind a check that the compiler put there.
    fn returning(&self) -> Vec<Vec<bool>> {
        let none = |flow: &Flow| vec![false; flow.blocks.len()];
        let mut returning: Vec<Vec<bool>> = self.flows.iter().map(none).collect();
        loop {
            let mut has_changed = false;
            for (number, flow) in self.flows.iter().enumerate() {
                // From the end: most blocks lead to later ones.
                for (place, block) in flow.blocks.iter().enumerate().rev() {
                    let comes_back = |callee: &u32| {
                        let callee = returning.get(*callee as usize);
                        callee.and_then(|blocks| blocks.first()) != Some(&false)
                    };
                    let returns = |way: &Way| match way {
                        Way::Block(block) => returning[number][*block],
                        Way::Return => true,
                    };
                    let now = block.calls.iter().all(comes_back)
                        && match block.end {
                            End::Trap => false,
                            End::Return => true,
                            End::Block(next) => returning[number][next],
                            End::Branch(branch) => flow.branches[branch].ways.iter().any(returns),
                        };
                    has_changed |= now && !returning[number][place];
                    returning[number][place] |= now;
                }
            }
            if !has_changed {
                return returning;
            }
        }
    }

    /// Of each function, whether anything that can be called calls it.
    fn called(&self) -> Vec<bool> {
        let mut called = vec![false; self.flows.len()];
        let mut next = self.exported.clone();
        while let Some(function) = next.pop() {
            let Some(is_called) = called.get_mut(function as usize) else { continue };
            if std::mem::replace(is_called, true) {
                continue;
            }
            for block in &self.flows[function as usize].blocks {
                next.extend(&block.calls);
                if block.calls_table {
                    next.extend(&self.in_table);
                }
            }
        }
        called
    }
}

impl Share {
    fn add(&mut self, places: &Places, function: usize, at: usize, what: &'static str) {
        let function = function as u32;
        let name = places.names.iter().find(|(number, _)| *number == function);
        let name = name.map(|(_, name)| name.clone());
        self.unexecuted.push(Unexecuted { function, name, at, what });
    }
}

/// Ways that are told apart, each by its words and its numbers.
fn branch_ways(kind: BranchKind, ways: &[Way]) -> Vec<(&'static str, Vec<usize>)> {
    let two = |first, second| vec![(first, vec![0]), (second, vec![1])];
    match kind {
        BranchKind::If => two("the condition is never true", "the condition is never false"),
        BranchKind::BrIf => two("the branch is never taken", "the branch is always taken"),
        BranchKind::BrTable => {
            let mut all: Vec<(&'static str, Vec<usize>)> = Vec::new();
            for (number, way) in ways.iter().enumerate() {
                match all.iter_mut().find(|(_, numbers)| ways[numbers[0]] == *way) {
                    Some((_, numbers)) => numbers.push(number),
                    None => all.push(("a way of the table is never taken", vec![number])),
                }
            }
            all
        }
    }
}

fn function_names(section: wasmparser::NameSectionReader<'_>) -> Vec<(u32, String)> {
    let functions = section.into_iter().filter_map(|part| match part {
        Ok(wasmparser::Name::Function(names)) => Some(names),
        _ => None,
    });
    let named = functions.flat_map(|names| names.into_iter().filter_map(Result::ok));
    let printable = |name: &str| name.chars().filter(|c| !c.is_control()).take(120).collect();
    named.map(|naming| (naming.index, printable(naming.name))).collect()
}

/// A plug-in that says what it executes.
#[derive(Clone, Debug)]
pub(crate) struct Watcher {
    plugin: Plugin,
    words: Arc<[String]>,
    executed: Arc<Mutex<Executed>>,
}

impl Watcher {
    /// A watcher of its own for another thread: nothing was executed in it yet.
    pub(crate) fn another(&self) -> Self {
        Self { executed: Arc::default(), ..self.clone() }
    }

    /// What was executed since it was asked last.
    pub(crate) fn take(&self) -> Executed {
        self.executed.lock().map(|mut executed| std::mem::take(&mut *executed)).unwrap_or_default()
    }
}

impl Subject for Watcher {
    type Instance = WatchedSession;

    fn instantiate(&self) -> Result<WatchedSession, SubjectError> {
        let boxed = Box::<dyn std::error::Error + Send + Sync>::from;
        let session = self.plugin.instantiate().map_err(boxed)?;
        let (words, executed) = (Arc::clone(&self.words), Arc::clone(&self.executed));
        Ok(WatchedSession { session, words, executed })
    }

    fn manifest(&self) -> &Manifest {
        self.plugin.manifest()
    }

    fn label(&self) -> &str {
        &self.plugin.manifest().name
    }

    fn fuel(instance: &WatchedSession) -> Fuel {
        Sandboxed::fuel(&instance.session)
    }
}

/// One instance, which says at its end what it has executed.
pub(crate) struct WatchedSession {
    session: Session,
    words: Arc<[String]>,
    executed: Arc<Mutex<Executed>>,
}

impl Instance for WatchedSession {
    type Fault = SessionFault;

    fn input_capacity(&self) -> usize {
        self.session.input_capacity()
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, SessionFault> {
        self.session.step(event, now)
    }
}

impl Drop for WatchedSession {
    fn drop(&mut self) {
        let Ok(mut executed) = self.executed.lock() else { return };
        for (number, word) in self.words.iter().enumerate() {
            let bits = self.session.global(word).unwrap_or_default();
            executed.add_word(number, bits.cast_unsigned());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use softplug_abi::{LineParameters, Parity};
    use softplug_host::{HostOptions, lint};

    /// An echo that has room for one byte, opened and given events.
    fn executed(events: &[Event<'_>]) -> Share {
        let module = wat::parse_file("../../fixtures/abi/echo.wat").unwrap();
        let host = Host::new(HostOptions::default()).unwrap();
        let places = Places::of(&module).unwrap();
        let watcher = places.watch(&host, &module, &lint(&module).unwrap()).unwrap();
        let mut session = watcher.instantiate().unwrap();
        let line =
            LineParameters { baud: 9_600, data_bits: 8, parity: Parity::None, stop_half_bits: 2 };
        let (transmit_room, delivery_room) = (1, 1);
        let open = Event::Open { resumed: false, line, transmit_room, delivery_room };
        for event in [open].iter().chain(events) {
            session.step(event, Micros::ZERO).unwrap();
        }
        drop(session);
        let share = places.share(&watcher.take());
        assert_eq!(watcher.take(), Executed::default(), "it was taken");
        share
    }

    fn whats(share: &Share) -> Vec<&str> {
        share.unexecuted.iter().map(|place| place.what).collect()
    }

    #[test]
    fn functions_that_are_not_called_are_named_without_their_branches() {
        let share = executed(&[]);
        assert_eq!(share.functions, (2, 4));
        // Of the step: no event is unknown, all of them open, none gives room, none is received.
        let (no, yes) = ("the condition is never true", "the condition is never false");
        let uncalled = "the function is never called";
        assert_eq!(whats(&share), [no, yes, no, no, uncalled, uncalled]);
    }

    #[test]
    fn both_ways_of_a_branch_are_told_apart() {
        let share = executed(&[Event::Received(b"a"), Event::Received(b"b")]);
        assert_eq!(share.functions, (4, 4));
        assert_eq!(whats(&share), ["the condition is never true"; 2]);
        // The first byte finds room, the second one none.
        let all = executed(&[
            Event::Received(b"a"),
            Event::Received(b"b"),
            Event::TransmitRoom { grown: 1 },
        ]);
        assert_eq!(whats(&all), ["the condition is never true"]);
        assert_eq!((all.ways.0, all.ways.1), (share.ways.0 + 1, share.ways.1));
    }

    #[test]
    fn an_instruction_is_executed_with_its_block() {
        let module = wat::parse_file("../../fixtures/abi/echo.wat").unwrap();
        let places = Places::of(&module).unwrap();
        let bit = places.layout.blocks[1][0];
        let mut executed = Executed::default();
        executed.add_word(bit / 64, 1 << (bit % 64));
        let at = places.flows[1].blocks[0].at;
        assert!(places.is_executed(&executed, 1, at) && places.is_executed(&executed, 1, at + 2));
        assert!(!places.is_executed(&executed, 1, places.flows[1].blocks[1].at));
        assert!(!places.is_executed(&executed, 2, places.flows[2].blocks[0].at));
    }
}
