//! The recorded hand in another loop.

mod rigs;

use std::time::Duration;

use rigs::{File, Recorded, line};
use teleclay_proto::Scheme;
use teleclay_replay::felt::{Hand, Question};
use teleclay_replay::verify::verify;
use teleclay_session::Lines;

fn recorded(scheme: Scheme) -> Vec<u8> {
    let mut recorded = Recorded::alone(scheme, line(0, 0.0, 0.0));
    recorded.rig.run_for(Duration::from_secs(6));
    recorded.finish().0
}

/// In the loop in which it was recorded, the hand feels what it felt; over a delay of a satellite it does not.
#[test]
fn the_same_loop_feels_the_same_and_another_does_not() {
    let file = recorded(Scheme::ForceExchange);
    let hand = Hand::read(&file, Some(1)).unwrap();
    let same = hand.feel(&Question::default(), None::<File>).unwrap();
    assert!(0.1 < same.then.rms_n, "{same:?}");
    assert!(same.force_nrmse.unwrap() < 0.1, "{same:?}");
    assert!(same.position_rmse_m < 1e-3, "{same:?}");
    let satellite = line(270, 0.0, 0.0);
    let question = Question {
        scheme: Some(Scheme::Wave),
        lines: Some(Lines {
            up: satellite,
            up_seed: 1,
            down: satellite,
            down_seed: 2,
        }),
        ..Question::default()
    };
    let far = hand.feel(&question, None::<File>).unwrap();
    assert!(
        2.0 * same.force_nrmse.unwrap() < far.force_nrmse.unwrap(),
        "{far:?}"
    );
}

/// What is written of it is a recording like any other.
#[test]
fn it_writes_a_recording() {
    let hand = Hand::read(&recorded(Scheme::PositionForce), None).unwrap();
    let file = File::default();
    let question = Question {
        scheme: Some(Scheme::Replica),
        ..Question::default()
    };
    hand.feel(&question, Some(file.clone())).unwrap();
    let verdict = verify(&file.bytes()).unwrap();
    assert!(verdict.is_good(), "{:?}", verdict.difference);
    assert!(5000 < verdict.ticks, "{}", verdict.ticks);
}
