//! `#[derive(State)]` for `softplug-plugin`, which passes it on: use it from there. What it does and
//! which attributes it has stands at the trait `softplug_plugin::State`.

mod attributes;
mod choice;
mod fields;

use proc_macro::TokenStream;
use syn::{Data, DeriveInput, Error};

/// Saves each field in the order in which they are declared, and takes them back in place. Fields of
/// a structure: `#[state(skip)]` leaves one out, `#[state(since = 2)]` takes it from states of format 2
/// on, `#[state(within = 0..=9)]` refuses other values. The structure: `#[state(check = Self::is_sound)]`
/// asks a function when all was read. Variants of an enum without fields are one byte, their place
/// or `#[state(code = 7)]`.
#[proc_macro_derive(State, attributes(state))]
pub fn derive_state(input: TokenStream) -> TokenStream {
    let input = syn::parse_macro_input!(input as DeriveInput);
    let made = match &input.data {
        Data::Struct(data) => fields::implement(&input, &data.fields),
        Data::Enum(data) => choice::implement(&input, data),
        Data::Union(data) => Err(Error::new(
            data.union_token.span,
            "a union has no state that can be told: use a struct or an enum",
        )),
    };
    made.unwrap_or_else(Error::into_compile_error).into()
}
