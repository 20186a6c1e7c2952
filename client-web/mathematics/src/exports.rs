//! What JavaScript sees: [`Mathematics`]'s calls under names of their own, over the one of the module.

// An exported name could clash with another library's; this module is linked with none. Nothing else here is unsafe:
// JavaScript reads and writes memory on its own account, between calls.
#![allow(unsafe_code)]

use std::cell::RefCell;

use crate::calls::{Buffer, Mathematics};

thread_local! {
    static MATHEMATICS: RefCell<Mathematics> = RefCell::default();
}

fn on_mathematics<T>(call: impl FnOnce(&mut Mathematics) -> T) -> T {
    MATHEMATICS.with_borrow_mut(call)
}

fn of_buffer(number: u32, ask: impl FnOnce(&Mathematics, Buffer) -> u32) -> u32 {
    on_mathematics(|it| Buffer::numbered(number).map_or(0, |buffer| ask(it, buffer)))
}

#[unsafe(no_mangle)]
extern "C" fn address(buffer: u32) -> u32 {
    of_buffer(buffer, |it, buffer| it.address(buffer) as u32)
}

#[unsafe(no_mangle)]
extern "C" fn length(buffer: u32) -> u32 {
    of_buffer(buffer, |it, buffer| it.length(buffer) as u32)
}

#[unsafe(no_mangle)]
extern "C" fn resize_numbers_in(length: u32) {
    on_mathematics(|it| it.resize_numbers_in(length as usize));
}

#[unsafe(no_mangle)]
extern "C" fn set_loop() -> u32 {
    on_mathematics(Mathematics::set_loop)
}

#[unsafe(no_mangle)]
extern "C" fn find_outlook(scheme: u32, round_trip_s: f64) -> u32 {
    on_mathematics(|it| it.find_outlook(scheme, round_trip_s))
}

#[unsafe(no_mangle)]
extern "C" fn find_curve(scheme: u32, round_trip_s: f64) -> u32 {
    on_mathematics(|it| it.find_curve(scheme, round_trip_s))
}

#[unsafe(no_mangle)]
extern "C" fn find_arms() -> u32 {
    on_mathematics(Mathematics::find_arms)
}
