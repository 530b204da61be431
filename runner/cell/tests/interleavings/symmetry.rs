//! States that differ only in which channel, mark or axis has which name are one.

use std::hash::{DefaultHasher, Hash, Hasher};

use softplug_cell::{AxisId, Cell, ChannelId, Word};

use crate::graph::Alphabet;

/// A state without names: the least of the forms that it has under all orders of channels and axes,
/// marks being numbered as they come.
pub(crate) fn key(cell: &Cell, alphabet: &Alphabet) -> u128 {
    let mut least: Option<Vec<u16>> = None;
    for axes in orders(alphabet.axes) {
        let mut channels: Vec<(Vec<u16>, u8)> =
            (0..alphabet.channels).map(|one| (rough(cell, ChannelId(one), &axes), one)).collect();
        channels.sort();
        for order in orders_among_equals(&channels) {
            let form = form(cell, &order, &axes);
            if least.as_ref().is_none_or(|least| form < *least) {
                least = Some(form);
            }
        }
    }
    let form = least.expect("there is an order");
    let hash = |salt: u64| {
        let mut hasher = DefaultHasher::new();
        (salt, &form).hash(&mut hasher);
        u128::from(hasher.finish())
    };
    hash(1) << 64 | hash(2)
}

/// What of a channel does not depend on the names of others.
fn rough(cell: &Cell, channel: ChannelId, axes: &[u8]) -> Vec<u16> {
    let mut rough = vec![u16::from(cell.runs(channel)), u16::from(cell.waits(channel))];
    if let Some((Word::Wait { with, .. }, _)) = cell.channel(channel).waits {
        rough.push(with.len() as u16);
    }
    for axis in axes {
        let (owner, queue) = cell.axis(AxisId(*axis));
        rough.push(u16::from(owner == Some(channel)));
        rough.push(queue.iter().position(|one| *one == channel).map_or(99, |at| at as u16));
    }
    rough
}

fn form(cell: &Cell, order: &[u8], axes: &[u8]) -> Vec<u16> {
    let place =
        |one: ChannelId| order.iter().position(|other| *other == one.0).unwrap_or(90) as u16;
    let mut marks: Vec<u32> = Vec::new();
    let mut form = vec![u16::from(cell.is_stopped())];
    for one in order {
        let view = cell.channel(ChannelId(*one));
        form.push(u16::from(view.program.is_some()));
        form.push(view.deprived.len() as u16);
        match view.waits {
            Some((Word::Wait { mark, with }, _)) => {
                let at = marks.iter().position(|known| known == mark).unwrap_or_else(|| {
                    marks.push(*mark);
                    marks.len() - 1
                });
                let mut members = 0;
                for one in with.iter() {
                    members |= 1 << place(one);
                }
                form.extend([1, at as u16, members]);
            }
            Some((Word::Get { axis, .. }, _)) => {
                let at = axes.iter().position(|other| *other == axis.0).unwrap_or(9);
                form.extend([2, at as u16]);
            }
            _ => form.push(0),
        }
    }
    for axis in axes {
        let (owner, queue) = cell.axis(AxisId(*axis));
        form.push(owner.map_or(99, place));
        form.extend(queue.into_iter().map(place));
        form.push(98);
    }
    form
}

fn orders(count: u8) -> Vec<Vec<u8>> {
    permuted(&(0..count).collect::<Vec<u8>>())
}

/// All orders of channels in which those that look alike change places.
fn orders_among_equals(channels: &[(Vec<u16>, u8)]) -> Vec<Vec<u8>> {
    let mut orders = vec![Vec::new()];
    for alike in channels.chunk_by(|one, other| one.0 == other.0) {
        let alike: Vec<u8> = alike.iter().map(|(_, one)| *one).collect();
        let ways = permuted(&alike);
        orders = orders
            .iter()
            .flat_map(|order: &Vec<u8>| ways.iter().map(|way| [&order[..], way].concat()))
            .collect();
    }
    orders
}

fn permuted(of: &[u8]) -> Vec<Vec<u8>> {
    if of.len() < 2 {
        return vec![of.to_vec()];
    }
    let mut all = Vec::new();
    for (at, first) in of.iter().enumerate() {
        let rest: Vec<u8> = [&of[..at], &of[at + 1..]].concat();
        all.extend(permuted(&rest).into_iter().map(|rest| [&[*first], &rest[..]].concat()));
    }
    all
}
