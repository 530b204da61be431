//! What compiling a function costs, estimated while it is validated.
//!
//! Bytes say little about that: a compiler carries every value that is alive across every place
//! where control flow parts or meets, and does some things for each pair of such places. So a
//! function has a weight, in units of about a microsecond, made up as docs/abi.md says. The
//! numbers were fitted to measured times of modules that a search had found.

use super::LintError;
use super::bounds::at_most;
use softplug_abi::limits::{FUNCTION_WEIGHT, LOCALS, MODULE_WEIGHT, NESTING};
use wasmparser::{FuncValidator, FunctionBody, Operator, Result, ValidatorResources, WasmFeatures};

/// Of a function, whatever it does.
const FUNCTION: u64 = 300;
/// Of a local or parameter.
const LOCAL: u64 = 2;
/// Of most operators.
const PLAIN: u64 = 2;
/// Reads or writes memory.
const ACCESS: u64 = 4;
/// Counts bits, or takes one of two.
const LONGER: u64 = 6;
/// Divides integers, makes integers of floats, calls: each has checks around it. As with floats,
/// what is alive across it has to make room for it.
const CHECKED: u64 = 20;
/// Floats: each result is made canonical.
const FLOAT: u64 = 50;
/// Two values alive across one join weigh one.
const LIVE: u64 = 2;
/// Pairs of joins of one function that weigh one.
const PAIRS: u64 = 32;

/// Weighs the functions of one module.
#[derive(Default)]
pub(super) struct Scales {
    module: u64,
}

/// Why a function is not taken.
pub(super) enum Unfit {
    Invalid(wasmparser::Error),
    Lint(LintError),
}

impl From<wasmparser::Error> for Unfit {
    fn from(error: wasmparser::Error) -> Self {
        Self::Invalid(error)
    }
}

impl From<LintError> for Unfit {
    fn from(error: LintError) -> Self {
        Self::Lint(error)
    }
}

impl Scales {
    /// Validates a function and adds its weight. Stops where it becomes too heavy.
    pub(super) fn take(
        &mut self,
        validator: &mut FuncValidator<ValidatorResources>,
        body: &FunctionBody<'_>,
        features: WasmFeatures,
    ) -> Result<(), Unfit> {
        let mut reader = body.get_binary_reader();
        validator.read_locals(&mut reader)?;
        reader.set_features(features);
        let locals = u64::from(validator.len_locals());
        at_most("parameters and locals of a function", locals, LOCALS)?;
        let mut function = FUNCTION + LOCAL * locals;
        let mut joins = 0;
        while !reader.eof() {
            let at = reader.original_position();
            let operator = reader.peek_operator(&validator.visitor(at))?;
            let more = joins_of(&operator);
            joins += more;
            // Blocks around are carried along too, loops above all.
            let alive = locals
                + u64::from(validator.operand_stack_height())
                + u64::from(validator.control_stack_height()).saturating_sub(1);
            let own = weight(&operator);
            function += own + more * alive / LIVE;
            if own >= CHECKED {
                function += alive;
            }
            let together = function + joins * joins / PAIRS;
            if together > FUNCTION_WEIGHT {
                return Err(LintError::HeavyFunction { at, function: validator.index() }.into());
            }
            if self.module + together > MODULE_WEIGHT {
                return Err(LintError::HeavyModule.into());
            }
            reader.visit_operator(&mut validator.visitor(at))??;
            // The function itself is a block too.
            let nesting = u64::from(validator.control_stack_height()).saturating_sub(1);
            at_most("blocks within blocks", nesting, NESTING)?;
        }
        reader.finish_expression(&validator.visitor(reader.original_position()))?;
        self.module += function + joins * joins / PAIRS;
        Ok(())
    }

    /// Of all functions so far.
    pub(super) fn module(&self) -> u64 {
        self.module
    }
}

/// Places where control flow parts or meets; those that take more of a compiler count twice.
fn joins_of(operator: &Operator<'_>) -> u64 {
    use Operator as O;
    match operator {
        O::Loop { .. } | O::CallIndirect { .. } | O::MemoryGrow { .. } => 2,
        O::Block { .. }
        | O::If { .. }
        | O::Else
        | O::Br { .. }
        | O::BrIf { .. }
        | O::Return
        | O::Call { .. }
        | O::Unreachable => 1,
        O::BrTable { targets } => 1 + u64::from(targets.len()),
        _ => 0,
    }
}

#[expect(clippy::match_same_arms, reason = "a table: a line for each kind of instruction")]
fn weight(operator: &Operator<'_>) -> u64 {
    use Operator as O;
    match operator {
        O::I32DivS | O::I32DivU | O::I32RemS | O::I32RemU => CHECKED,
        O::I64DivS | O::I64DivU | O::I64RemS | O::I64RemU => CHECKED,
        O::I32TruncF32S | O::I32TruncF32U | O::I32TruncF64S | O::I32TruncF64U => CHECKED,
        O::I64TruncF32S | O::I64TruncF32U | O::I64TruncF64S | O::I64TruncF64U => CHECKED,
        O::Call { .. } | O::CallIndirect { .. } | O::MemoryGrow { .. } => CHECKED,
        O::F32Ceil | O::F32Floor | O::F32Trunc | O::F32Nearest | O::F32Sqrt => FLOAT,
        O::F64Ceil | O::F64Floor | O::F64Trunc | O::F64Nearest | O::F64Sqrt => FLOAT,
        O::F32Add | O::F32Sub | O::F32Mul | O::F32Div | O::F32Min | O::F32Max => FLOAT,
        O::F64Add | O::F64Sub | O::F64Mul | O::F64Div | O::F64Min | O::F64Max => FLOAT,
        O::F32DemoteF64 | O::F64PromoteF32 => FLOAT,
        O::F32ConvertI64U | O::F64ConvertI64U => CHECKED,
        O::I32Load { .. } | O::I64Load { .. } | O::F32Load { .. } | O::F64Load { .. } => ACCESS,
        O::I32Load8S { .. } | O::I32Load8U { .. } => ACCESS,
        O::I32Load16S { .. } | O::I32Load16U { .. } => ACCESS,
        O::I64Load8S { .. } | O::I64Load8U { .. } => ACCESS,
        O::I64Load16S { .. } | O::I64Load16U { .. } => ACCESS,
        O::I64Load32S { .. } | O::I64Load32U { .. } => ACCESS,
        O::I32Store { .. } | O::I64Store { .. } | O::F32Store { .. } | O::F64Store { .. } => ACCESS,
        O::I32Store8 { .. } | O::I32Store16 { .. } => ACCESS,
        O::I64Store8 { .. } | O::I64Store16 { .. } | O::I64Store32 { .. } => ACCESS,
        O::GlobalGet { .. } | O::GlobalSet { .. } => ACCESS,
        O::Select | O::I32Popcnt | O::I64Popcnt => LONGER,
        O::I32Clz | O::I32Ctz | O::I64Clz | O::I64Ctz => LONGER,
        _ => PLAIN,
    }
}
