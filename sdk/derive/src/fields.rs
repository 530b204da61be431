//! The state of a structure: its fields, one after the other.

use proc_macro2::TokenStream;
use quote::quote;
use syn::ext::IdentExt as _;
use syn::{DeriveInput, Error, Fields, Index, Member, Result, Type};

use crate::attributes::{self, OfField};

pub(crate) fn implement(input: &DeriveInput, fields: &Fields) -> Result<TokenStream> {
    let name = &input.ident;
    let (generics, arguments, bounds) = input.generics.split_for_impl();
    let mut names = name.to_string();
    let mut saves = Vec::new();
    let mut restores = Vec::new();
    // Whether the reader is at the field before, by the names of this structure.
    let mut is_counting = false;
    for (place, field) in fields.iter().enumerate() {
        let own = OfField::read(&field.attrs)?;
        if own.skip {
            continue;
        }
        let member = match &field.ident {
            Some(name) => Member::Named(name.clone()),
            None => Member::Unnamed(Index::from(place)),
        };
        names.push('\n');
        names.push_str(&match &field.ident {
            Some(field) => field.unraw().to_string(),
            None => place.to_string(),
        });
        let number = u8::try_from(saves.len() + 1).map_err(|_| {
            Error::new_spanned(name, "a structure of a state has at most 255 fields")
        })?;
        saves.push(quote! {
            ::softplug_plugin::State::save(&self.#member, state);
        });
        let range = own.within.map(|range| {
            quote! {
                if !(#range).contains(&self.#member) {
                    state.refuse();
                }
            }
        });
        let begin = if is_counting && own.since.is_none() {
            quote! { state.next_field(); }
        } else {
            quote! { state.field_of(NAMES, #number); }
        };
        is_counting = own.since.is_none() && is_plain(&field.ty);
        let restore = quote! {
            #begin
            ::softplug_plugin::State::restore(&mut self.#member, state);
            #range
        };
        restores.push(match own.since {
            Some(format) => quote! { if state.format() >= #format { #restore } },
            None => restore,
        });
    }
    let check = attributes::check(&input.attrs)?.map(|check| {
        quote! {
            state.field_of(NAMES, 0);
            if !#check(self) {
                state.refuse();
            }
        }
    });
    Ok(quote! {
        impl #generics ::softplug_plugin::State for #name #arguments #bounds {
            fn save(&self, state: &mut ::softplug_plugin::StateWriter<'_>) {
                #(#saves)*
            }

            fn restore(&mut self, state: &mut ::softplug_plugin::StateReader<'_>) {
                const NAMES: &&str = &#names;
                #(#restores)*
                #check
            }
        }
    })
}

/// Whether a type is surely no structure with fields of its own.
fn is_plain(of: &Type) -> bool {
    let Type::Path(of) = of else { return false };
    let last = of.path.segments.last();
    last.is_some_and(|last| {
        [
            "bool",
            "u8",
            "u16",
            "u32",
            "u64",
            "usize",
            "Option",
            "DeliveryId",
            "JobId",
            "MarkId",
            "RequestId",
        ]
        .iter()
        .any(|plain| last.ident == plain)
    })
}
