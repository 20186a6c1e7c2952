//! What JavaScript sees: [`Page`]'s calls under names of their own, over the one page of the module.

// An exported name could clash with another library's; this module is linked with none. Nothing else here is unsafe:
// JavaScript reads and writes memory on its own account, between calls.
#![allow(unsafe_code)]

use std::cell::RefCell;

use crate::page::{Buffer, Page};

thread_local! {
    static PAGE: RefCell<Page> = RefCell::default();
}

fn on_page<T>(call: impl FnOnce(&mut Page) -> T) -> T {
    PAGE.with_borrow_mut(call)
}

fn of_buffer(number: u32, ask: impl FnOnce(&Page, Buffer) -> u32) -> u32 {
    on_page(|page| Buffer::numbered(number).map_or(0, |buffer| ask(page, buffer)))
}

#[unsafe(no_mangle)]
extern "C" fn address(buffer: u32) -> u32 {
    of_buffer(buffer, |page, buffer| page.address(buffer) as u32)
}

#[unsafe(no_mangle)]
extern "C" fn length(buffer: u32) -> u32 {
    of_buffer(buffer, |page, buffer| page.length(buffer) as u32)
}

#[unsafe(no_mangle)]
extern "C" fn resize_bytes_in(length: u32) {
    on_page(|page| page.resize_bytes_in(length as usize));
}

#[unsafe(no_mangle)]
extern "C" fn halve_clay() {
    on_page(Page::halve_clay);
}

#[unsafe(no_mangle)]
extern "C" fn take_in_bricks() -> u32 {
    on_page(Page::take_in_bricks)
}

#[unsafe(no_mangle)]
extern "C" fn mark_all_bricks() {
    on_page(Page::mark_all_bricks);
}

#[unsafe(no_mangle)]
extern "C" fn describe_clay() {
    on_page(Page::describe_clay);
}

#[unsafe(no_mangle)]
extern "C" fn mesh_next_brick() -> u32 {
    on_page(Page::mesh_next_brick)
}
