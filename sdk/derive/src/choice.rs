//! The state of an enum without fields: one byte.

use proc_macro2::TokenStream;
use quote::quote;
use syn::{DataEnum, DeriveInput, Error, Fields, Result};

use crate::attributes;

pub(crate) fn implement(input: &DeriveInput, data: &DataEnum) -> Result<TokenStream> {
    let name = &input.ident;
    attributes::none(&input.attrs)?;
    let (generics, arguments, bounds) = input.generics.split_for_impl();
    let mut codes: Vec<u8> = Vec::new();
    let mut names = Vec::new();
    for variant in &data.variants {
        if !matches!(variant.fields, Fields::Unit) {
            return Err(Error::new_spanned(
                variant,
                "a variant of a state has no fields: keep them in a structure beside the enum",
            ));
        }
        let next = codes.last().map_or(Some(0), |code| code.checked_add(1));
        let code = match attributes::code(&variant.attrs)? {
            Some(code) => code,
            None => next.ok_or_else(|| Error::new_spanned(variant, "a code is 0 to 255"))?,
        };
        if codes.contains(&code) {
            let text = format!("another variant has the code {code}");
            return Err(Error::new_spanned(variant, text));
        }
        codes.push(code);
        names.push(&variant.ident);
    }
    if names.is_empty() {
        return Err(Error::new_spanned(input, "an enum without variants has no state"));
    }
    Ok(quote! {
        impl #generics ::softplug_plugin::State for #name #arguments #bounds {
            fn save(&self, state: &mut ::softplug_plugin::StateWriter<'_>) {
                state.u8(match self {
                    #(Self::#names => #codes,)*
                });
            }

            fn restore(&mut self, state: &mut ::softplug_plugin::StateReader<'_>) {
                *self = match state.u8() {
                    #(#codes => Self::#names,)*
                    _ => return state.refuse(),
                };
            }
        }
    })
}
