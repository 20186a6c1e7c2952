//! What JavaScript sees: [`Hand`]'s calls under names of their own, over the one hand of the module.

// An exported name could clash with another library's; this module is linked with none. Nothing else here is unsafe:
// JavaScript reads and writes memory on its own account, between calls.
#![allow(unsafe_code)]

use std::cell::RefCell;

use crate::hand::{Buffer, Hand};

thread_local! {
    static HAND: RefCell<Hand> = RefCell::default();
}

fn on_hand<T>(call: impl FnOnce(&mut Hand) -> T) -> T {
    HAND.with_borrow_mut(call)
}

fn of_buffer(number: u32, ask: impl FnOnce(&Hand, Buffer) -> u32) -> u32 {
    on_hand(|hand| Buffer::numbered(number).map_or(0, |buffer| ask(hand, buffer)))
}

#[unsafe(no_mangle)]
extern "C" fn address(buffer: u32) -> u32 {
    of_buffer(buffer, |hand, buffer| hand.address(buffer) as u32)
}

#[unsafe(no_mangle)]
extern "C" fn length(buffer: u32) -> u32 {
    of_buffer(buffer, |hand, buffer| hand.length(buffer) as u32)
}

#[unsafe(no_mangle)]
extern "C" fn resize_bytes_in(length: u32) {
    on_hand(|hand| hand.resize_bytes_in(length as usize));
}

#[unsafe(no_mangle)]
extern "C" fn begin(now_ms: f64, rate_hz: f64, motion: f64) -> u32 {
    on_hand(|hand| hand.begin(now_ms, rate_hz, motion))
}

#[unsafe(no_mangle)]
extern "C" fn renew(now_ms: f64) -> u32 {
    on_hand(|hand| hand.renew(now_ms))
}

#[unsafe(no_mangle)]
extern "C" fn take_parameters() -> u32 {
    on_hand(Hand::take_parameters)
}

#[unsafe(no_mangle)]
extern "C" fn begin_snapshot() -> u32 {
    on_hand(Hand::begin_snapshot)
}

#[unsafe(no_mangle)]
extern "C" fn take_in_bricks() -> u32 {
    on_hand(Hand::take_in_bricks)
}

#[unsafe(no_mangle)]
extern "C" fn finish_snapshot() -> u32 {
    on_hand(Hand::finish_snapshot)
}

#[unsafe(no_mangle)]
extern "C" fn tell(now_ms: f64, at_ms: f64, x_m: f64, y_m: f64, z_m: f64) {
    on_hand(|hand| hand.tell(now_ms, at_ms, [x_m, y_m, z_m]));
}

#[unsafe(no_mangle)]
extern "C" fn hear(now_ms: f64) -> u32 {
    on_hand(|hand| hand.hear(now_ms))
}

#[unsafe(no_mangle)]
extern "C" fn lose_peer(now_ms: f64) {
    on_hand(|hand| hand.lose_peer(now_ms));
}

#[unsafe(no_mangle)]
extern "C" fn hold() {
    on_hand(Hand::hold);
}

#[unsafe(no_mangle)]
extern "C" fn release() {
    on_hand(Hand::release);
}

#[unsafe(no_mangle)]
extern "C" fn clutch() {
    on_hand(Hand::clutch);
}

#[unsafe(no_mangle)]
extern "C" fn lock_axes(which: u32) {
    on_hand(|hand| hand.lock_axes(which));
}

#[unsafe(no_mangle)]
extern "C" fn set_motion(motion: f64) -> u32 {
    on_hand(|hand| hand.set_motion(motion))
}

#[unsafe(no_mangle)]
extern "C" fn leave() {
    on_hand(Hand::leave);
}

#[unsafe(no_mangle)]
extern "C" fn advance(now_ms: f64) -> u32 {
    on_hand(|hand| hand.advance(now_ms))
}

#[unsafe(no_mangle)]
extern "C" fn tidy() {
    on_hand(Hand::tidy);
}

#[unsafe(no_mangle)]
extern "C" fn look() {
    on_hand(Hand::look);
}

#[unsafe(no_mangle)]
extern "C" fn due() -> f64 {
    on_hand(|hand| hand.due_ms())
}
