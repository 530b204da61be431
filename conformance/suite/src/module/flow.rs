//! How a function's code flows: blocks without a branch, and the branches between them.

use wasmparser::{BinaryReaderError, FunctionBody, Operator};

/// A function's code.
#[derive(Debug, Default)]
pub(crate) struct Flow {
    /// In the order of the file; the first is where the function begins.
    pub(crate) blocks: Vec<Block>,
    /// In the order of the file.
    pub(crate) branches: Vec<Branch>,
}

/// Instructions of which all are executed if the first one is.
#[derive(Debug)]
pub(crate) struct Block {
    /// Where its first instruction stands in the module.
    pub(crate) at: usize,
    /// Functions that it calls.
    pub(crate) calls: Vec<u32>,
    /// It calls through a table.
    pub(crate) calls_table: bool,
    pub(crate) end: End,
}

/// How a block ends.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum End {
    Trap,
    Return,
    /// In the block of this number, whatever happens.
    Block(usize),
    /// In one of the ways of the branch of this number.
    Branch(usize),
}

/// An instruction that goes one way or another.
#[derive(Debug)]
pub(crate) struct Branch {
    /// Where it stands in the module.
    pub(crate) at: usize,
    pub(crate) kind: BranchKind,
    /// The block to which it belongs.
    pub(crate) block: usize,
    pub(crate) ways: Vec<Way>,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum BranchKind {
    If,
    BrIf,
    BrTable,
}

/// Where a way of a branch leads to.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Way {
    Block(usize),
    /// Out of the function.
    Return,
}

impl Flow {
    pub(crate) fn of(body: &FunctionBody<'_>) -> Result<Self, BinaryReaderError> {
        let mut walk = Walk::default();
        let mut operators = body.get_operators_reader()?;
        walk.enter(Kind::Function);
        walk.begin(operators.original_position());
        while !operators.eof() {
            let (operator, at) = operators.read_with_offset()?;
            walk.take(&operator, at, operators.original_position());
        }
        Ok(walk.finish())
    }
}

/// A place that may not be known yet.
#[derive(Copy, Clone, Debug)]
enum To {
    Block(usize),
    Label(usize),
    Return,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Kind {
    Function,
    Block,
    Loop,
    If { otherwise: usize },
    Else,
}

/// A structured instruction that is not over.
#[derive(Debug)]
struct Frame {
    kind: Kind,
    label: usize,
    /// It can be entered.
    is_live: bool,
    /// Something goes to its end.
    is_left: bool,
}

#[derive(Debug, Default)]
struct Walk {
    frames: Vec<Frame>,
    /// The block to which a label belongs, once it is there.
    labels: Vec<Option<usize>>,
    /// The block that is being read; none where nothing can be executed.
    block: Option<usize>,
    blocks: Vec<(usize, Vec<u32>, bool)>,
    ends: Vec<Option<Ending>>,
    branches: Vec<(usize, BranchKind, usize, Vec<To>)>,
}

#[derive(Copy, Clone, Debug)]
enum Ending {
    Trap,
    To(To),
    Branch(usize),
}

impl Walk {
    fn take(&mut self, operator: &Operator<'_>, at: usize, end: usize) {
        match operator {
            Operator::Block { .. } => self.enter(Kind::Block),
            Operator::Loop { .. } => {
                self.enter(Kind::Loop);
                if self.block.is_some() {
                    let block = self.begin(end);
                    let label = self.frames.last().map_or(0, |frame| frame.label);
                    self.labels[label] = Some(block);
                }
            }
            Operator::If { .. } => self.enter_if(at, end),
            Operator::Else => self.turn(end),
            Operator::End => self.leave(end),
            Operator::Br { relative_depth } => {
                let to = self.target(*relative_depth);
                self.stop(Ending::To(to));
            }
            Operator::BrIf { relative_depth } => {
                let to = self.target(*relative_depth);
                if let Some(branch) = self.branch(at, BranchKind::BrIf, vec![to]) {
                    self.stop(Ending::Branch(branch));
                    let next = self.begin(end);
                    self.branches[branch].3.push(To::Block(next));
                }
            }
            Operator::BrTable { targets } => {
                let depths = targets.targets().filter_map(Result::ok).chain([targets.default()]);
                let depths: Vec<u32> = depths.collect();
                let ways = depths.into_iter().map(|depth| self.target(depth)).collect();
                if let Some(branch) = self.branch(at, BranchKind::BrTable, ways) {
                    self.stop(Ending::Branch(branch));
                }
            }
            Operator::Return => self.stop(Ending::To(To::Return)),
            Operator::Unreachable => self.stop(Ending::Trap),
            Operator::Call { function_index } => {
                if let Some(block) = self.block {
                    self.blocks[block].1.push(*function_index);
                }
            }
            Operator::CallIndirect { .. } => {
                if let Some(block) = self.block {
                    self.blocks[block].2 = true;
                }
            }
            _ => {}
        }
    }

    fn label(&mut self) -> usize {
        self.labels.push(None);
        self.labels.len() - 1
    }

    fn enter(&mut self, kind: Kind) {
        let label = self.label();
        let is_live = self.block.is_some();
        self.frames.push(Frame { kind, label, is_live, is_left: false });
    }

    fn enter_if(&mut self, at: usize, end: usize) {
        let otherwise = self.label();
        self.enter(Kind::If { otherwise });
        if let Some(branch) = self.branch(at, BranchKind::If, Vec::new()) {
            self.stop(Ending::Branch(branch));
            let then = self.begin(end);
            self.branches[branch].3 = vec![To::Block(then), To::Label(otherwise)];
        }
    }

    /// At `else`.
    fn turn(&mut self, end: usize) {
        let is_open = self.block.is_some();
        let Some(frame) = self.frames.last_mut() else { return };
        let Kind::If { otherwise } = frame.kind else { return };
        frame.kind = Kind::Else;
        frame.is_left |= is_open;
        let (label, is_live) = (frame.label, frame.is_live);
        self.stop(Ending::To(To::Label(label)));
        if is_live {
            self.labels[otherwise] = Some(self.begin(end));
        }
    }

    /// At `end`.
    fn leave(&mut self, end: usize) {
        let Some(frame) = self.frames.pop() else { return };
        match frame.kind {
            Kind::Function => self.stop(Ending::To(To::Return)),
            // What goes to its label goes to its beginning.
            Kind::Loop => {}
            Kind::Block | Kind::Else if !frame.is_left => {}
            Kind::If { otherwise } if frame.is_live => {
                let block = self.begin(end);
                self.labels[otherwise] = Some(block);
                self.labels[frame.label] = Some(block);
            }
            Kind::Block | Kind::Else | Kind::If { .. } => {
                if frame.is_left || self.block.is_some() {
                    self.labels[frame.label] = Some(self.begin(end));
                }
            }
        }
    }

    /// Where a branch goes that leaves so many frames.
    fn target(&mut self, depth: u32) -> To {
        let is_executed = self.block.is_some();
        let place = self.frames.len().checked_sub(depth as usize + 1);
        let Some(frame) = place.and_then(|place| self.frames.get_mut(place)) else {
            return To::Return;
        };
        frame.is_left |= is_executed;
        match frame.kind {
            Kind::Function => To::Return,
            _ => To::Label(frame.label),
        }
    }

    /// Its number; none where it is never executed.
    fn branch(&mut self, at: usize, kind: BranchKind, ways: Vec<To>) -> Option<usize> {
        self.branches.push((at, kind, self.block?, ways));
        Some(self.branches.len() - 1)
    }

    /// A new block, entered by the one before it if that is still open.
    fn begin(&mut self, at: usize) -> usize {
        let block = self.blocks.len();
        self.stop(Ending::To(To::Block(block)));
        self.blocks.push((at, Vec::new(), false));
        self.ends.push(None);
        self.block = Some(block);
        block
    }

    fn stop(&mut self, ending: Ending) {
        if let Some(block) = self.block.take() {
            self.ends[block] = Some(ending);
        }
    }

    fn finish(self) -> Flow {
        let labels = &self.labels;
        let way = |to: &To| match *to {
            To::Block(block) => Way::Block(block),
            To::Label(label) => labels[label].map_or(Way::Return, Way::Block),
            To::Return => Way::Return,
        };
        let end = |ending: &Option<Ending>| match ending {
            Some(Ending::Trap) => End::Trap,
            Some(Ending::Branch(branch)) => End::Branch(*branch),
            Some(Ending::To(to)) => match way(to) {
                Way::Block(block) => End::Block(block),
                Way::Return => End::Return,
            },
            None => End::Return,
        };
        let blocks = self.blocks.into_iter().zip(&self.ends);
        let block = |((at, calls, calls_table), ending): (_, &_)| Block {
            at,
            calls,
            calls_table,
            end: end(ending),
        };
        let branch = |(at, kind, block, ways): &(usize, BranchKind, usize, Vec<To>)| Branch {
            at: *at,
            kind: *kind,
            block: *block,
            ways: ways.iter().map(way).collect(),
        };
        Flow {
            blocks: blocks.map(block).collect(),
            branches: self.branches.iter().map(branch).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wasmparser::{Parser, Payload};

    fn flow(body: &str) -> Flow {
        let text = format!("(module (memory 1 1) (func $f (param i32) (result i32) {body}))");
        let module = wat::parse_str(text).unwrap();
        let body = Parser::new(0).parse_all(&module).find_map(|payload| match payload.unwrap() {
            Payload::CodeSectionEntry(body) => Some(body),
            _ => None,
        });
        Flow::of(&body.unwrap()).unwrap()
    }

    #[test]
    fn code_without_a_branch_is_one_block() {
        let flow = flow("(i32.add (local.get 0) (call $f (i32.const 1)))");
        assert_eq!((flow.blocks.len(), flow.branches.len()), (1, 0));
        assert_eq!(flow.blocks[0].calls, [0]);
        assert_eq!(flow.blocks[0].end, End::Return);
    }

    #[test]
    fn an_if_has_two_ways_and_both_come_together() {
        let flow =
            flow("(if (result i32) (local.get 0) (then (i32.const 1)) (else (i32.const 2)))");
        assert_eq!(flow.branches[0].ways, [Way::Block(1), Way::Block(2)]);
        let ends: Vec<End> = flow.blocks.iter().map(|block| block.end).collect();
        assert_eq!(ends, [End::Branch(0), End::Block(3), End::Block(3), End::Return]);
    }

    #[test]
    fn an_if_without_else_goes_on_behind_it() {
        let flow = flow("(if (local.get 0) (then (unreachable))) (i32.const 2)");
        assert_eq!(flow.branches[0].ways, [Way::Block(1), Way::Block(2)]);
        assert_eq!(flow.blocks[1].end, End::Trap);
    }

    #[test]
    fn a_loop_is_entered_again_and_left_by_a_branch() {
        let flow = flow("(loop $l (br_if $l (local.get 0))) (i32.const 2)");
        assert_eq!(flow.blocks[0].end, End::Block(1));
        assert_eq!(flow.branches[0].ways, [Way::Block(1), Way::Block(2)]);
        assert_eq!(flow.blocks[2].end, End::Return);
    }

    #[test]
    fn a_table_leads_to_the_ends_of_blocks_and_out() {
        let flow = flow(
            "(block $a (block $b (br_table $b $a 2 (i32.const 7) (local.get 0))
             (drop)) (return (i32.const 1))) (i32.const 2)",
        );
        let ways = &flow.branches[0].ways;
        assert_eq!(ways[..], [Way::Block(1), Way::Block(2), Way::Return]);
    }

    #[test]
    fn what_stands_behind_a_branch_is_no_block() {
        let flow = flow(
            "(block $a (br $a) (if (i32.const 1) (then (br_if $a (i32.const 2))))) (i32.const 2)",
        );
        assert_eq!((flow.blocks.len(), flow.branches.len()), (2, 0));
    }
}
