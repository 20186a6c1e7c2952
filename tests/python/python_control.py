"""Asks python-control about random loops, and compares what the project's own analysis says about them.

    python python_control.py PATH_TO_analyse_loops [--loops 200] [--seed 2003]

The analysis is the example `analyse_loops` of teleclay-control: one JSON loop a line in, one JSON answer a line out. A loop is

    L = P (T_h + rho T_t),    P = G_h C_h1,    rho = A_h1 / |A_h2|,    T_t = B s + K

What is compared, for stable and unstable loops alike:

    verdict                      poles of 1 / (1 + L)                         always equal
    poles                        the same, as python-control finds them       1e-4
    gain and phase margins       control.stability_margins                    1e-3
    least distance from -1       |1 + L(jw)|, minimised by scipy              1e-3
    delay margins, stable loops  real roots of |A(jw)|^2 = |B(jw)|^2          1e-3

The last two stand on numpy and scipy: python-control has no margin for a delay in one part of a loop.
Exits with 0 when everything agrees, with 1 and the loops at fault when something does not.
"""

import argparse
import json
import random
import subprocess
import sys
import warnings

import control
import numpy as np
from scipy.optimize import minimize_scalar

TOLERANCE = 1e-3
POLE_TOLERANCE = 1e-4
# Seconds that the analysis may take for all loops. It needs about a tenth of one.
ANALYSIS_TIMEOUT_S = 120
# A pole this near to the axis, against its own size, decides nothing: another loop is drawn.
ON_THE_AXIS = 1e-6
# Each kind of case must be among the loops at least this often, or the comparison compares too little.
LEAST = {
    "stable": 40,
    "unstable": 40,
    "gain_increase": 40,
    "phase": 40,
    "delay_position_force": 20,
    "delay_force_exchange": 5,
}
MOST_SHOWN = 10


def main():
    arguments = parse_arguments()
    warnings.filterwarnings("ignore", module="control")
    chance = random.Random(arguments.seed)
    loops = [comparable_loop(chance) for _ in range(arguments.loops)]
    answers = ask(arguments.analyse_loops, loops)

    counts = dict.fromkeys(LEAST, 0)
    differences = []
    for number, (loop, answer) in enumerate(zip(loops, answers)):
        for what in compare(loop, answer, counts):
            differences.append((number, what, loop))

    for number, what, loop in differences[:MOST_SHOWN]:
        print(f"loop {number}: {what}\n  {json.dumps(loop)}")
    summary = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in counts.items())
    print(f"python-control {control.__version__}: {len(loops)} loops, {len(differences)} differences; {summary}")
    if arguments.loops >= 200:
        missing = [name for name, least in LEAST.items() if counts[name] < least]
        if missing:
            sys.exit(f"too few cases of: {', '.join(missing)}")
    if differences:
        sys.exit(1)


def parse_arguments():
    parser = argparse.ArgumentParser(description="Compares loop analyses with python-control.")
    parser.add_argument("analyse_loops", help="the built example of teleclay-control")
    parser.add_argument("--loops", type=int, default=200)
    parser.add_argument("--seed", type=int, default=2003)
    return parser.parse_args()


# Loops.


def comparable_loop(chance):
    """A random loop none of whose poles lies on the axis as far as rounding can tell."""
    while True:
        loop = random_loop(chance)
        _, denominator, _, _, loop_numerator = polynomials(loop)
        poles = np.roots(np.polyadd(denominator, loop_numerator))
        if np.all(np.abs(poles.real) > ON_THE_AXIS * np.abs(poles)):
            return loop


def random_loop(chance):
    may_be_unstable = chance.random() < 0.25
    order = chance.randint(1, 4)
    admittance = chance.choice(["mass", "filter", "spring"])
    mass, damping = 10 ** chance.uniform(-1.5, 1), 10 ** chance.uniform(-0.5, 2)
    if admittance == "mass":
        c_h1 = fraction([1.0], [mass, damping, 0.0])
    elif admittance == "filter":
        c_h1 = fraction([10 ** chance.uniform(-3, 0)], random_factors(chance, 2, False))
    else:
        c_h1 = fraction([1.0], [mass, damping, 10 ** chance.uniform(0, 3)])
    return {
        "g_h": fraction(
            random_factors(chance, chance.randint(0, order - 1), may_be_unstable),
            random_factors(chance, order, may_be_unstable),
        ),
        "t_h": [0.25 * chance.random(), 2 * chance.random(), 6 * chance.random()],
        "c_h1": c_h1,
        "g_t": fraction([1.0], [0.5, 20.0, 0.0]),
        "position_ratio": chance.choice([0.5, 1, 2]),
        "force_ratio": chance.choice([-1, -2, -0.5]),
        "clay_damping_n_s_per_m": chance.choice([0, chance.uniform(0, 80)]),
        "clay_stiffness_n_per_m": chance.choice([0, chance.uniform(0, 300)]),
    }


def random_factors(chance, order, may_be_unstable):
    """A polynomial that is 1 at the origin, from first and second order factors between 0.03 and 300 rad/s."""
    polynomial = np.array([1.0])
    while order > 0:
        if order >= 2 and chance.random() < 0.6:
            omega, ratio = 10 ** chance.uniform(-1, 2.5), 10 ** chance.uniform(-2, 0.3)
            if may_be_unstable and chance.random() < 0.3:
                ratio = -ratio
            factor = [1 / omega**2, 2 * ratio / omega, 1]
        else:
            omega = 10 ** chance.uniform(-1.5, 2.5)
            if may_be_unstable and chance.random() < 0.2:
                omega = -omega
            factor = [1 / omega, 1]
        polynomial = np.polymul(polynomial, factor)
        order -= len(factor) - 1
    return list(polynomial)


def fraction(numerator, denominator):
    return {"numerator": numerator, "denominator": denominator}


def polynomials(loop):
    """Numerator and denominator of P, then the numerators of H, E and L over that denominator."""
    parts = [(loop[name]["numerator"], loop[name]["denominator"]) for name in ("g_h", "c_h1")]
    numerator = np.polymul(parts[0][0], parts[1][0])
    denominator = np.polymul(parts[0][1], parts[1][1])
    rho = loop["position_ratio"] / -loop["force_ratio"]
    clay = [loop["clay_damping_n_s_per_m"], loop["clay_stiffness_n_per_m"]]
    arm_numerator = np.polymul(numerator, loop["t_h"])
    clay_numerator = np.polymul(numerator, clay) * rho
    return numerator, denominator, arm_numerator, clay_numerator, np.polyadd(arm_numerator, clay_numerator)


def ask(program, loops):
    lines = "\n".join(json.dumps(loop) for loop in loops)
    try:
        process = subprocess.run(
            [program], input=lines, text=True, capture_output=True, timeout=ANALYSIS_TIMEOUT_S, check=True
        )
    except FileNotFoundError:
        sys.exit(f"{program} is not there: cargo build --release --workspace --example analyse_loops")
    except subprocess.TimeoutExpired:
        sys.exit(f"{program} did not end within {ANALYSIS_TIMEOUT_S} s")
    except subprocess.CalledProcessError as error:
        sys.exit(f"{program} failed with {error.returncode}: {error.stderr.strip()}")
    answers = [json.loads(line) for line in process.stdout.splitlines()]
    if len(answers) != len(loops):
        sys.exit(f"{len(loops)} loops asked, {len(answers)} answered: {process.stderr.strip()}")
    return answers


# Comparison.


def compare(loop, answer, counts):
    """Yields what differs, in words; adds what was compared to the counts."""
    if "error" in answer:
        yield f"refused: {answer['error']}"
        return
    _, denominator, arm, clay, loop_numerator = polynomials(loop)
    loop_gain = control.tf(loop_numerator, denominator)

    poles = control.feedback(1, loop_gain).poles()
    is_stable = bool(np.all(poles.real < 0))
    counts["stable" if is_stable else "unstable"] += 1
    if is_stable != answer["stable_without_delay"]:
        yield f"verdict: stable is {answer['stable_without_delay']}, python-control finds poles {poles}"
    yield from compare_poles(poles, answer["closed_loop_poles"])

    least = least_distance(loop_numerator, denominator)
    yield from compare_value("distance", answer["nyquist_min_distance"], least)
    yield from compare_margins(loop_gain, answer, counts)
    if is_stable:
        yield from compare_delays(denominator, arm, clay, answer, counts)


def compare_poles(wanted, got):
    wanted = np.sort_complex(wanted)
    got = np.sort_complex(np.array([complex(*pole) for pole in got]))
    if len(wanted) != len(got):
        yield f"{len(got)} poles, python-control finds {len(wanted)}"
    elif np.max(np.abs(wanted - got) / (1e-3 + np.abs(wanted))) > POLE_TOLERANCE:
        yield f"poles {got}, python-control finds {wanted}"


def compare_margins(loop_gain, answer, counts):
    gains, phases, *_ = control.stability_margins(loop_gain, returnall=True)
    gains = [gain for gain in gains if np.isfinite(gain) and gain > 0]
    increases = [gain for gain in gains if gain >= 1]
    decreases = [gain for gain in gains if gain < 1]
    counts["gain_increase"] += bool(increases)
    counts["phase"] += len(phases) > 0

    def factor(name):
        return answer[name] and answer[name]["factor"]

    yield from compare_value("gain margin upwards", factor("gain_increase"), min(increases, default=None))
    yield from compare_value("gain margin downwards", factor("gain_decrease"), max(decreases, default=None))
    phase = answer["phase_margin_rad"]
    wanted = np.deg2rad(np.min(np.abs(phases))) if len(phases) else None
    yield from compare_value("phase margin", None if phase is None else abs(phase), wanted)


def compare_delays(denominator, arm, clay, answer, counts):
    with_arm, with_clay = np.polyadd(denominator, arm), np.polyadd(denominator, clay)
    wanted = delay_margin(with_arm, clay)
    counts["delay_position_force"] += wanted is not None
    got = answer["delay_margin_position_force_s"]
    yield from compare_value("delay margin of position-force", got, wanted)
    # The two copies of the admittance must be stable by themselves, an integrator aside.
    own = np.roots(np.trim_zeros(denominator, "b"))
    if np.all(own.real < 0):
        wanted = delay_margin(np.polymul(with_clay, with_arm), -np.polymul(clay, arm))
        counts["delay_force_exchange"] += wanted is not None
        got = answer["delay_margin_force_exchange_s"]
        yield from compare_value("delay margin of force exchange", got, wanted)


def compare_value(name, got, wanted):
    if got is None and wanted is None:
        return
    if got is None or wanted is None or abs(got - wanted) > TOLERANCE * abs(wanted):
        yield f"{name} {got}, wanted {wanted}"


def least_distance(loop_numerator, denominator):
    """The least |1 + L(jw)|: the deep dips of a dense grid, each followed to its bottom."""

    def distance(exponent):
        s = 1j * 10.0**exponent
        return np.abs(1 + np.polyval(loop_numerator, s) / np.polyval(denominator, s))

    grid = np.linspace(-5, 6, 20_001)
    values = distance(grid)
    is_dip = (values[1:-1] < values[:-2]) & (values[1:-1] <= values[2:])
    dips = 1 + np.flatnonzero(is_dip & (values[1:-1] <= 1.5 * values.min()))
    bottoms = [
        minimize_scalar(distance, bounds=(grid[dip - 1], grid[dip + 1]), method="bounded", options={"xatol": 1e-10}).fun
        for dip in dips
    ]
    least = min([values[0], values[-1], *bottoms])
    # A loop that dies out ends at distance 1.
    dies_out = len(np.trim_zeros(loop_numerator, "f")) < len(denominator)
    return min(least, 1.0) if dies_out else least


def delay_margin(prompt, delayed):
    """Least delay d with a root of prompt(s) + delayed(s) exp(-s d) on the axis; None when there is none."""
    if not np.any(delayed):
        return None
    difference = np.polysub(squared_magnitude(prompt), squared_magnitude(delayed))
    best = None
    for root in np.roots(difference):
        if abs(root.imag) > 1e-6 * abs(root) or root.real <= 1e-9:
            continue
        s = 1j * root.real
        ratio = np.polyval(delayed, s) / np.polyval(prompt, s)
        if abs(abs(ratio) - 1) > 1e-6:
            continue
        delay = (np.angle(-ratio) % (2 * np.pi)) / root.real
        best = delay if best is None else min(best, delay)
    return best


def squared_magnitude(polynomial):
    """|p(j w)|^2 as a polynomial in w."""
    degree = len(polynomial) - 1
    turned = np.array([1j ** (degree - place) * c for place, c in enumerate(polynomial)])
    return np.polyadd(np.polymul(turned.real, turned.real), np.polymul(turned.imag, turned.imag))


if __name__ == "__main__":
    main()
