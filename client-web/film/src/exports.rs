//! What JavaScript sees: [`Film`]'s calls under names of their own, over the one film of the module.

// An exported name could clash with another library's; this module is linked with none. Nothing else here is unsafe:
// JavaScript reads and writes memory on its own account, between calls.
#![allow(unsafe_code)]

use std::cell::RefCell;

use crate::film::{Buffer, Film};

thread_local! {
    static FILM: RefCell<Film> = RefCell::default();
}

fn on_film<T>(call: impl FnOnce(&mut Film) -> T) -> T {
    FILM.with_borrow_mut(call)
}

fn of_buffer(number: u32, ask: impl FnOnce(&Film, Buffer) -> u32) -> u32 {
    on_film(|film| Buffer::numbered(number).map_or(0, |buffer| ask(film, buffer)))
}

#[unsafe(no_mangle)]
extern "C" fn address(buffer: u32) -> u32 {
    of_buffer(buffer, |film, buffer| film.address(buffer) as u32)
}

#[unsafe(no_mangle)]
extern "C" fn length(buffer: u32) -> u32 {
    of_buffer(buffer, |film, buffer| film.length(buffer) as u32)
}

#[unsafe(no_mangle)]
extern "C" fn resize_bytes_in(length: u32) {
    on_film(|film| film.resize_bytes_in(length as usize));
}

#[unsafe(no_mangle)]
extern "C" fn push() -> u32 {
    on_film(Film::push)
}

#[unsafe(no_mangle)]
extern "C" fn seek(at_s: f64) -> u32 {
    on_film(|film| film.seek(at_s))
}

#[unsafe(no_mangle)]
extern "C" fn give() -> u32 {
    on_film(Film::give)
}

#[unsafe(no_mangle)]
extern "C" fn tell_recording(first_mark: u32) {
    on_film(|film| film.tell_recording(first_mark));
}

#[unsafe(no_mangle)]
extern "C" fn tell_moment() {
    on_film(Film::tell_moment);
}

#[unsafe(no_mangle)]
extern "C" fn find_envelope(tool: u32, quantity: u32, from_s: f64, to_s: f64, count: u32) {
    on_film(|film| film.find_envelope(tool, quantity, from_s, to_s, count));
}

#[unsafe(no_mangle)]
extern "C" fn tell_clay() -> u32 {
    on_film(Film::tell_clay)
}

#[unsafe(no_mangle)]
extern "C" fn next_bricks() -> u32 {
    on_film(Film::next_bricks)
}
