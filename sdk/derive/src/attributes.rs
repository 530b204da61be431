//! What stands in `#[state(…)]`.

use syn::meta::ParseNestedMeta;
use syn::{Attribute, Expr, ExprPath, LitInt, Result};

/// The attribute of a field.
#[derive(Default)]
pub(crate) struct OfField {
    /// It is no part of the state.
    pub(crate) skip: bool,
    /// The first format that has it.
    pub(crate) since: Option<LitInt>,
    /// The range of its values.
    pub(crate) within: Option<Expr>,
}

impl OfField {
    pub(crate) fn read(attributes: &[Attribute]) -> Result<Self> {
        let mut own = Self::default();
        each(attributes, |entry| {
            if entry.path.is_ident("skip") {
                own.skip = true;
            } else if entry.path.is_ident("since") {
                own.since = Some(entry.value()?.parse()?);
            } else if entry.path.is_ident("within") {
                own.within = Some(entry.value()?.parse()?);
            } else {
                return Err(entry.error("a field has `skip`, `since = FORMAT` or `within = RANGE`"));
            }
            Ok(())
        })?;
        Ok(own)
    }
}

/// The function that says whether a structure is sound.
pub(crate) fn check(attributes: &[Attribute]) -> Result<Option<ExprPath>> {
    let mut check = None;
    each(attributes, |entry| {
        if !entry.path.is_ident("check") {
            return Err(entry.error("a structure has `check = FUNCTION`"));
        }
        check = Some(entry.value()?.parse()?);
        Ok(())
    })?;
    Ok(check)
}

/// The byte of a variant.
pub(crate) fn code(attributes: &[Attribute]) -> Result<Option<u8>> {
    let mut code = None;
    each(attributes, |entry| {
        if !entry.path.is_ident("code") {
            return Err(entry.error("a variant has `code = NUMBER`"));
        }
        let number: LitInt = entry.value()?.parse()?;
        code = Some(number.base10_parse()?);
        Ok(())
    })?;
    Ok(code)
}

/// Nothing may stand here.
pub(crate) fn none(attributes: &[Attribute]) -> Result<()> {
    each(attributes, |entry| Err(entry.error("an enum has no attribute; its variants have `code`")))
}

fn each(
    attributes: &[Attribute],
    mut take: impl FnMut(&ParseNestedMeta<'_>) -> Result<()>,
) -> Result<()> {
    let own = attributes.iter().filter(|attribute| attribute.path().is_ident("state"));
    for attribute in own {
        attribute.parse_nested_meta(|entry| take(&entry))?;
    }
    Ok(())
}
