//! The heap: all RAM between the program's data and the stack.
//!
//! The unsafe code here hands that RAM, which nothing else uses, to the allocator, and keeps it to
//! one caller at a time: interrupt handlers never allocate.
#![allow(unsafe_code)]

use crate::figures::{Figure, set};
use core::alloc::{GlobalAlloc, Layout};
use core::cell::UnsafeCell;
use core::ptr::{self, NonNull};
use linked_list_allocator::Heap;

/// Bytes for the stack.
const STACK: usize = 24 * 1_024;
const RAM_START: usize = 0x2000_0000;
const RAM_END: usize = 0x2001_FFC0;

#[global_allocator]
static HEAP: Shared = Shared(UnsafeCell::new(Inner { heap: Heap::empty(), highest: 0 }));

struct Inner {
    heap: Heap,
    /// The end of the highest block that there ever was.
    highest: usize,
}

struct Shared(UnsafeCell<Inner>);

// SAFETY: there is one thread, and no interrupt handler allocates.
unsafe impl Sync for Shared {}

// SAFETY: the blocks are those of `linked_list_allocator`.
unsafe impl GlobalAlloc for Shared {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: one thread, and nothing below calls back.
        let inner = unsafe { &mut *self.0.get() };
        let Ok(block) = inner.heap.allocate_first_fit(layout) else { return ptr::null_mut() };
        let end = block.as_ptr() as usize + layout.size();
        if end > inner.highest {
            inner.highest = end;
            set(Figure::Heap, (end - inner.heap.bottom() as usize) as u32);
        }
        block.as_ptr()
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: one thread; the caller says that the block is one of ours, of this layout.
        unsafe {
            let inner = &mut *self.0.get();
            inner.heap.deallocate(NonNull::new_unchecked(block), layout);
        }
    }
}

/// Hands the allocator its RAM: to be called once, first of all. Bytes of static data, and where the stack
/// may reach to.
pub(crate) fn begin() -> (usize, usize) {
    unsafe extern "C" {
        static mut __sheap: u32;
    }
    let bottom = (&raw mut __sheap) as usize;
    let limit = RAM_END - STACK;
    // SAFETY: the linker puts nothing between `__sheap` and the stack, which begins at the end of RAM.
    unsafe { (*HEAP.0.get()).heap.init(bottom as *mut u8, limit - bottom) };
    (bottom - RAM_START, limit)
}
