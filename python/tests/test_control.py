"""Plants, loops and walls against numpy, scipy and each other."""

import numpy as np
import pytest
from scipy import signal

from teleclay import control, sim
from teleclay.control import PAPER


def test_a_response_is_the_quotient_of_two_polynomials():
    omega_rad_s = np.geomspace(0.1, 1000, 50).reshape(5, 10)
    found = control.frequency_response(PAPER["g_h"], omega_rad_s)
    s = 1j * omega_rad_s
    wanted = np.polyval(PAPER["g_h"]["numerator"], s) / np.polyval(PAPER["g_h"]["denominator"], s)
    np.testing.assert_allclose(found, wanted, rtol=1e-12)
    assert np.isnan(control.frequency_response(PAPER["c_h1"], 0.0))


@pytest.mark.parametrize(("ours", "theirs"), [("zoh", "zoh"), ("tustin", "bilinear")])
def test_a_sampled_plant_answers_as_scipys(random, ours, theirs):
    push = random.normal(size=400)
    for name in ("g_h", "g_h_y", "c_h1", "g_t"):
        plant = PAPER[name]
        numerator, denominator, _ = signal.cont2discrete((plant["numerator"], plant["denominator"]), 1e-3, theirs)
        wanted = signal.lfilter(np.ravel(numerator), denominator, push)
        found = control.respond(plant, push, 1e-3, ours)
        np.testing.assert_allclose(found, wanted, atol=1e-7 * np.abs(wanted).max())


def test_the_poles_are_the_roots_of_the_loop_written_out():
    loop = control.paper_loop(clay_damping_n_s_per_m=60.0, clay_stiffness_n_per_m=5.0)
    found = control.analyse(**loop)
    c_h1, g_h, t_h = loop["c_h1"], loop["g_h"], loop["t_h"]
    numerator = np.polymul(c_h1["numerator"], g_h["numerator"])
    denominator = np.polymul(c_h1["denominator"], g_h["denominator"])
    resists = np.polyadd(t_h, [60.0, 5.0])
    wanted = np.sort_complex(np.roots(np.polyadd(denominator, np.polymul(numerator, resists))))
    np.testing.assert_allclose(np.sort_complex(found["closed_loop_poles"]), wanted, rtol=1e-6)
    assert found["stable_without_delay"] == bool((wanted.real < 0).all())
    assert found["nyquist"]["value"].dtype == np.complex128
    assert np.abs(1 + found["nyquist"]["value"]).min() >= found["nyquist_min_distance"] * (1 - 1e-9)


def test_the_map_turns_unstable_at_the_margin():
    loop = control.paper_loop()
    clays = np.array([20.0, 60.0, 100.0])
    margins = control.stability_map(loop, clays, [0.0], "position_force").delay_margin_s
    assert np.isfinite(margins).all() and (0 < margins).all()
    for clay, margin in zip(clays, margins):
        found = control.stability_map(loop, [clay], margin * np.array([0.5, 0.99, 1.01, 1.5]), "position_force")
        assert found.is_stable.tolist() == [[True, True, False, False]]
        assert (0 < found.frequency_hz[0, 2:]).all()


def test_what_grows_solves_the_equation():
    loop = control.paper_loop()
    found = control.stability_map(loop, [60.0], [0.3], "position_force")
    s = found.rate_per_s[0, 0] + 2j * np.pi * found.frequency_hz[0, 0]
    admittance = np.polyval(loop["c_h1"]["numerator"], s) / np.polyval(loop["c_h1"]["denominator"], s)
    servo = np.polyval(loop["g_h"]["numerator"], s) / np.polyval(loop["g_h"]["denominator"], s)
    hand, clay = servo * admittance * np.polyval(loop["t_h"], s), servo * admittance * 60.0 * s
    assert abs(1 + hand + clay * np.exp(-0.3 * s)) < 1e-6


def test_a_wall_in_a_run_turns_unstable_where_theory_says():
    theory = control.critical_stiffness(1.0, 10.0, [0.005, 0.05])
    for rtt_s, wanted in zip([0.005, 0.05], theory):
        found = sim.measured_critical_stiffness(1.0, 10.0, rtt_s, between_n_per_m=(wanted / 3, wanted * 3))
        assert abs(found / wanted - 1) < 0.01
    np.testing.assert_allclose(control.passive_stiffness(10.0, [0.0, 4.0]), [20000.0, 12000.0])


def test_a_tuned_handle_is_stable_at_its_round_trip():
    plants = {name: PAPER[name] for name in ("g_h", "t_h", "g_t", "position_ratio", "force_ratio")}
    answer = control.tune(
        **plants, clay_damping_n_s_per_m=[0, 60], clay_stiffness_n_per_m=[0, 10], scheme="position_force", round_trip_s=0.05,
        distance=0.4, heaviest_n_s_per_m=500,
    )  # fmt: skip
    loop = control.paper_loop(c_h1=control.admittance(answer["mass_kg"], answer["damping_n_s_per_m"]))
    assert control.stability_map(loop, [0.0, 30.0, 60.0], [0.05], "position_force").is_stable.all()


def test_what_is_no_loop_is_refused_in_the_theorys_words():
    with pytest.raises(ValueError, match="force_ratio"):
        control.analyse(**control.paper_loop(force_ratio=1.0))
    with pytest.raises(ValueError, match="scheme"):
        control.stability_map(control.paper_loop(), [1.0], [0.1], "wave")
    with pytest.raises(ValueError, match="not JSON compliant|Out of range"):
        control.analyse(**control.paper_loop(clay_damping_n_s_per_m=np.nan))
