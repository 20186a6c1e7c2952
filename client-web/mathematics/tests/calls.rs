//! The calls of a page, as JavaScript makes them: by numbers and buffers.

use teleclay_mathematics::{Buffer, DONE, Mathematics, REFUSED};

fn ask(
    mathematics: &mut Mathematics,
    numbers: &[f64],
    call: impl FnOnce(&mut Mathematics) -> u32,
) -> u32 {
    mathematics.resize_numbers_in(numbers.len());
    mathematics.numbers_in().copy_from_slice(numbers);
    call(mathematics)
}

/// The paper's handle along x, (35) and (37), in clay of 20 N·s/m.
const LOOP: [f64; 22] = [
    2.0, 18.0, 1.0, 4.0, 0.005, 0.4, 18.0, 1.0, 1.0, 1.0, 3.0, 1.0, 10.0, 0.0, 3.0, 0.25, 2.0, 6.0,
    1.0, -1.0, 20.0, 0.0,
];

/// Its delay margin is 146.58 ms with position forward and force back, at 11.4 rad/s; with force exchange it has none.
#[test]
fn a_loop_is_calm_below_its_margin_and_grows_above_it() {
    let mut mathematics = Mathematics::default();
    assert_eq!(ask(&mut mathematics, &LOOP, Mathematics::set_loop), DONE);
    assert_eq!(mathematics.find_outlook(0, 0.146), DONE);
    let [peak, rate, ..] = mathematics
        .numbers()
        .try_into()
        .map(|found: [f64; 4]| found)
        .unwrap();
    assert!(1.0 < peak && rate.is_nan(), "{:?}", mathematics.numbers());
    assert_eq!(mathematics.find_outlook(0, 0.16), DONE);
    let [again, rate, frequency_hz, gain]: [f64; 4] = mathematics.numbers().try_into().unwrap();
    assert!((again - peak).abs() < 1e-12, "a delay only turns the gain");
    assert!(0.01 < rate && 1.0 < frequency_hz && frequency_hz < 5.0 && 1.0 < gain);
    assert_eq!(mathematics.find_outlook(1, 10.0), DONE);
    assert!(mathematics.numbers()[0] < 1.0 && mathematics.numbers()[1].is_nan());
}

/// At rest nothing of `E` is left and `H` is the arm's spring; far up the servo rolls off.
#[test]
fn a_curve_is_three_lists_of_one_length() {
    let mut mathematics = Mathematics::default();
    ask(&mut mathematics, &LOOP, Mathematics::set_loop);
    assert_eq!(mathematics.find_curve(0, 0.2), DONE);
    let numbers = mathematics.numbers();
    let [omega_rad_s, re, im] = [0, 1, 2].map(|list| {
        let length = numbers.len() / 3;
        &numbers[list * length..(list + 1) * length]
    });
    assert!(omega_rad_s.windows(2).all(|pair| pair[0] < pair[1]));
    let last = re.len() - 1;
    // E / (1 + H) is B_t s / 6 for the slowest swings: 20 j 0.01 / 6.
    assert!(
        re[0].abs() < 0.01 && (im[0] - 0.2 / 6.0).abs() < 0.001,
        "{}, {}",
        re[0],
        im[0]
    );
    assert!(re[last].hypot(im[last]) < 1e-3);
}

#[test]
fn numbers_that_describe_nothing_are_refused() {
    let mut mathematics = Mathematics::default();
    assert_eq!(mathematics.find_curve(0, 0.1), REFUSED);
    assert_eq!(mathematics.refusal(), "there is no loop to look at");
    for numbers in [
        &LOOP[..21],
        &[LOOP.as_slice(), &[0.0]].concat(),
        &[f64::NAN],
        &[1e300],
        &[],
    ] {
        assert_eq!(
            ask(&mut mathematics, numbers, Mathematics::set_loop),
            REFUSED,
            "{numbers:?}"
        );
    }
    let mut backwards = LOOP;
    backwards[19] = 1.0;
    assert_eq!(
        ask(&mut mathematics, &backwards, Mathematics::set_loop),
        REFUSED
    );
    assert!(
        mathematics.refusal().contains("force ratio"),
        "{}",
        mathematics.refusal()
    );
    assert_eq!(ask(&mut mathematics, &LOOP, Mathematics::set_loop), DONE);
    for round_trip_s in [-0.1, f64::NAN, f64::INFINITY] {
        assert_eq!(mathematics.find_outlook(0, round_trip_s), REFUSED);
    }
    assert_eq!(mathematics.find_outlook(2, 0.1), REFUSED);
    // A loop that is refused leaves the one before.
    ask(&mut mathematics, &[], Mathematics::set_loop);
    assert_eq!(mathematics.find_outlook(0, 0.1), DONE);
}

#[test]
fn arms_are_told_one_after_the_other_also_where_one_does_not_reach() {
    let mut mathematics = Mathematics::default();
    let robot = [0.12, 0.04, 0.1, 0.2, 0.0, 120.0, 240.0];
    let at = |position_m: [f64; 3]| [robot.as_slice(), &position_m, &[-1.0; 3]].concat();
    assert_eq!(
        ask(
            &mut mathematics,
            &at([0.0, 0.0, 0.17]),
            Mathematics::find_arms
        ),
        DONE
    );
    let arms = mathematics.numbers().as_chunks::<13>().0.to_vec();
    assert_eq!(arms.len(), 3);
    for (j, arm) in arms.iter().enumerate() {
        let [
            ex,
            ey,
            sx,
            sy,
            sz,
            wx,
            wy,
            wz,
            reaches,
            joint_rad,
            bx,
            by,
            bz,
        ] = *arm;
        let angle_rad = (120.0 * j as f64).to_radians();
        assert!((ex - angle_rad.cos()).hypot(ey - angle_rad.sin()) < 1e-12);
        assert!((sx - 0.12 * ex).hypot(sy - 0.12 * ey).hypot(sz) < 1e-12);
        assert!((wx - 0.04 * ex).hypot(wy - 0.04 * ey).hypot(wz - 0.17) < 1e-12);
        assert!(reaches > 0.5);
        // In the middle of its axis the robot bends alike on all sides, elbows outwards.
        assert!((joint_rad - arms[0][9]).abs() < 1e-12 && 0.12 < bx.hypot(by));
        assert!(((bx - wx).hypot(by - wy).hypot(bz - wz) - 0.2).abs() < 1e-12);
    }
    assert_eq!(
        ask(
            &mut mathematics,
            &at([0.3, 0.0, 0.1]),
            Mathematics::find_arms
        ),
        DONE
    );
    let reaches: Vec<f64> = mathematics
        .numbers()
        .iter()
        .skip(8)
        .step_by(13)
        .copied()
        .collect();
    assert_eq!(reaches, [1.0, 0.0, 0.0]);
    let mut flat = at([0.0, 0.0, 0.17]);
    flat[2] = 0.0;
    assert_eq!(
        ask(&mut mathematics, &flat, Mathematics::find_arms),
        REFUSED
    );
    assert!(
        mathematics.refusal().contains("upper_link_m"),
        "{}",
        mathematics.refusal()
    );
}

/// JavaScript numbers buffers as they stand here.
#[test]
fn buffers_have_the_numbers_that_javascript_gives_them() {
    let all = [Buffer::NumbersIn, Buffer::Numbers, Buffer::Refusal];
    for (number, buffer) in all.into_iter().enumerate() {
        assert_eq!(Buffer::numbered(number as u32), Some(buffer));
    }
    assert_eq!(Buffer::numbered(3), None);
}
