//! Prints every digest as native code works it out, a name and sixteen hexadecimal digits a line. `run.mjs` prints the
//! same lines as WebAssembly does.
#![allow(clippy::print_stdout)] // a program's output

use teleclay_golden::DIGESTS;

fn main() {
    for (name, digest) in DIGESTS {
        println!("{name} {:016x}", digest());
    }
}
