//! The short form of `cargo xtask soak`.

use std::time::Duration;

use teleclay_tests::soak::run;

#[test]
fn twenty_seconds_with_slow_watchers_leave_memory_as_it_was() {
    let report = run(Duration::from_secs(5), Duration::from_secs(20), |_| {}).unwrap();
    println!("{report}");
    report.judge().unwrap();
}
