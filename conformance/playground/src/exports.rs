//! What the page calls: a request is put into the buffer, an answer is read out of it.
#![allow(unsafe_code)]
// Exporting a function under its own name is `unsafe` because two of one name would clash. These
// are the only ones, and no pointer is followed here: the page reads and writes the module's
// memory from outside.

use crate::Playground;
use std::cell::RefCell;

thread_local! {
    static PLAYGROUND: RefCell<Playground> = RefCell::new(Playground::new());
    static BUFFER: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// Makes the buffer `length` bytes long and returns its address.
#[unsafe(no_mangle)]
pub extern "C" fn playground_buffer(length: usize) -> usize {
    BUFFER.with_borrow_mut(|buffer| {
        buffer.clear();
        buffer.resize(length, 0);
        buffer.as_ptr() as usize
    })
}

/// Answers the request in the buffer; returns the length of the answer, which is now there.
#[unsafe(no_mangle)]
pub extern "C" fn playground_answer() -> usize {
    let request = BUFFER.take();
    let answer = PLAYGROUND.with_borrow_mut(|playground| playground.answer(&request));
    let length = answer.len();
    BUFFER.set(answer);
    length
}

/// The buffer's address.
#[unsafe(no_mangle)]
pub extern "C" fn playground_address() -> usize {
    BUFFER.with_borrow(|buffer| buffer.as_ptr() as usize)
}
