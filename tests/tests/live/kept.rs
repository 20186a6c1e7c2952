//! What outlives the process of a server: sessions, settings, clay, history.

use teleclay_tests::kills;

#[test]
fn three_kills_of_a_server_lose_no_cut_of_two_hands() {
    let report = kills::run(3, 1, |_, _| {}).unwrap();
    println!("{report}");
}
