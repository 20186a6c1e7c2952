"""Asks exact arithmetic about loops that touch: the unit circle, the negative real axis, or the axis with a pole or a
zero.

    python exact_loops.py PATH_TO_analyse_loops [--loops 25] [--seed 2003]

Coefficients are whole numbers, or halves of them and so on, and every product fits a double. So a curve touches where
it should, and not nearly so, and fractions decide: which roots there are, by Sturm's chains; of which multiplicity,
by common divisors. No tolerance decides here whether a curve meets anything; mpmath takes the values at the roots
with 40 digits.

What is compared, for each of so many loops of each kind:

    verdict           Routh's table                                         equal
    small gain        peak of |N|^2/|D|^2 over its critical points          1e-6, or none for a pole on the axis
    least distance    least of |C|^2/|D|^2 over its critical points         1e-6, or 0 for a closed-loop pole on the axis
    gain margins      real roots of Im(N conj D), limits at both ends       1e-5, and none where there is none
    phase margin      real roots of |N|^2 - |D|^2 above zero                1e-5, and none where there is none
    delay margins     real roots of |A|^2 - |B|^2 above zero                1e-5, and unbounded where there is none

A root of even multiplicity is a contact as well: there the margin reaches -1. A root at zero or at infinity is none,
but for a delayed part as large as the rest at infinite frequency, which bears no delay."""

import argparse
import json
import random
import sys
from fractions import Fraction

import mpmath

from python_control import ask

TOLERANCE = 1e-5
PEAK_TOLERANCE = 1e-6
mpmath.mp.dps = 40


def main():
    arguments = parse_arguments()
    chance = random.Random(arguments.seed)
    loops = [(name, make(chance)) for name, make in KINDS.items() for _ in range(arguments.loops)]
    answers = ask(arguments.analyse_loops, [loop for _, loop in loops])
    counts = {}
    differences = []
    for (name, loop), answer in zip(loops, answers):
        for what in compare(loop, answer, counts):
            differences.append(f"{name}: {what}\n  {json.dumps(loop)}")
    print("\n".join(differences[:10]))
    summary = ", ".join(f"{count} {name}" for name, count in sorted(counts.items()))
    print(f"exact arithmetic: {len(loops)} loops, {len(differences)} differences; {summary}")
    if differences:
        sys.exit(1)
    if arguments.loops >= 25:
        missing = [name for name in LEAST if counts.get(name, 0) < LEAST[name]]
        if missing:
            sys.exit(f"too few cases of: {', '.join(missing)}")


# Each must be met at least this often, or the comparison compares too little.
LEAST = {
    "stable": 40,
    "no peak": 40,
    "no phase margin": 20,
    "phase margin": 40,
    "gain margin": 40,
    "no gain margin": 40,
    "unbounded delay of position_force": 20,
    "finite delay of position_force": 20,
    "unbounded delay of force_exchange": 20,
    "finite delay of force_exchange": 5,
    "touched circle": 20,
    "touched axis": 20,
    "zero or pole for a crossing": 20,
}


def parse_arguments():
    parser = argparse.ArgumentParser(description="Compares loop analyses with exact arithmetic.")
    parser.add_argument("analyse_loops", help="the built example of teleclay-control")
    parser.add_argument("--loops", type=int, default=25, help="of each kind")
    parser.add_argument("--seed", type=int, default=2003)
    return parser.parse_args()


# Polynomials: lists of fractions, lowest power first.


def trimmed(p):
    p = list(p)
    while len(p) > 1 and p[-1] == 0:
        p.pop()
    return p


def plus(p, q, factor=1):
    length = max(len(p), len(q))
    p, q = p + [0] * (length - len(p)), q + [0] * (length - len(q))
    return trimmed([a + factor * b for a, b in zip(p, q)])


def times(*factors):
    product = [Fraction(1)]
    for factor in factors:
        longer = [Fraction(0)] * (len(product) + len(factor) - 1)
        for i, a in enumerate(product):
            for k, b in enumerate(factor):
                longer[i + k] += a * b
        product = longer
    return trimmed(product)


def is_zero(p):
    return all(c == 0 for c in p)


def derivative(p):
    return trimmed([k * c for k, c in enumerate(p)][1:] or [Fraction(0)])


def divide(p, q):
    p, quotient = list(p), [Fraction(0)] * max(1, len(p) - len(q) + 1)
    while len(p) >= len(q) and not is_zero(p):
        factor = p[-1] / q[-1]
        shift = len(p) - len(q)
        quotient[shift] = factor
        for k, c in enumerate(q):
            p[k + shift] -= factor * c
        p.pop()
    return trimmed(quotient), trimmed(p or [Fraction(0)])


def common_divisor(p, q):
    while not is_zero(q):
        p, q = q, divide(p, q)[1]
    return [c / p[-1] for c in p]


def at(p, x):
    value = 0
    for c in reversed(p):
        value = value * x + c
    return value


def parts(p):
    """p(j w) = even(w^2) + j w odd(w^2)."""
    signed = [c * (-1) ** (k // 2) for k, c in enumerate(p)]
    return trimmed(signed[0::2] or [Fraction(0)]), trimmed(signed[1::2] or [Fraction(0)])


X = [Fraction(0), Fraction(1)]


def squared(p):
    """|p(j w)|^2 in x = w^2."""
    even, odd = parts(p)
    return plus(times(even, even), times(X, odd, odd))


def imaginary(p, q):
    """Im(p(j w) conj q(j w)) / w in x = w^2."""
    (a, b), (c, d) = parts(p), parts(q)
    return plus(times(b, c), times(a, d), -1)


def positive_roots(p):
    """Every root above zero of p, each once, as mpmath numbers of full precision."""
    while len(p) > 1 and p[0] == 0:
        p = p[1:]
    if len(p) < 2:
        return []
    p = divide(p, common_divisor(p, derivative(p)))[0]
    chain = [p, derivative(p)]
    while len(chain[-1]) > 1:
        chain.append([-c for c in divide(chain[-2], chain[-1])[1]])

    def changes(x):
        signs = [value > 0 for value in (at(q, x) for q in chain) if value != 0]
        return sum(a != b for a, b in zip(signs, signs[1:]))

    high = 1 + max(abs(c / p[-1]) for c in p)
    found, stretches = [], [(Fraction(0), high, changes(Fraction(0)), changes(high))]
    while stretches:
        low, high, at_low, at_high = stretches.pop()
        if at_low == at_high:
            continue
        if at_low - at_high == 1 and low > 0:
            found.append(refined(p, low, high))
            continue
        middle = (low + high) / 2
        at_middle = changes(middle)
        stretches += [(low, middle, at_low, at_middle), (middle, high, at_middle, at_high)]
    return sorted(found)


def refined(p, low, high):
    """The one root in (low, high], which is simple."""
    if at(p, high) == 0:
        return exact(high)
    rises = at(p, high) > 0
    while high - low > low * Fraction(1, 10**45):
        middle = (low + high) / 2
        # Short fractions keep this quick.
        middle = min(max(middle.limit_denominator(2**170), low), high)
        if middle in (low, high):
            break
        if at(p, middle) == 0:
            return exact(middle)
        if (at(p, middle) > 0) == rises:
            high = middle
        else:
            low = middle
    return exact((low + high) / 2)


def exact(x):
    return mpmath.mpf(x.numerator) / x.denominator


def value(p, omega):
    s = mpmath.mpc(0, omega)
    return at([exact(Fraction(c)) for c in p], s)


def multiplicity_at(p, x):
    """How often x, known to many digits, is a root of p above zero; by the roots of the divisors that p shares with its derivatives."""
    count = 0
    while len(p) > 1 and any(abs(root - x) < mpmath.mpf(10) ** -25 * x for root in positive_roots(p)):
        count += 1
        p = common_divisor(p, derivative(p))
    return count


def is_stable(p):
    """Routh's table, every number of which must have one sign."""
    p = list(reversed(p))
    upper, lower = p[0::2], p[1::2]
    if len(p) == 1:
        return True
    sign = upper[0] > 0
    while lower:
        if lower[0] == 0 or (lower[0] > 0) != sign:
            return False
        ratio = upper[0] / lower[0]
        lower_padded = lower + [Fraction(0)] * (len(upper) - len(lower))
        upper, lower = lower, [a - ratio * b for a, b in zip(upper[1:], lower_padded[1:])]
    return True


# Loops.


def whole(chance, low=1, high=9):
    return chance.randint(low, high)


def swing(chance):
    omega = whole(chance, 1, 6)
    return [Fraction(omega * omega), Fraction(0), Fraction(1)]


def damped(chance, sign=1):
    omega = whole(chance, 1, 6)
    return [Fraction(omega * omega), Fraction(sign * whole(chance, 1, 9)), Fraction(1)]


def mirrored(p):
    return [c * (-1) ** k for k, c in enumerate(p)]


def butterworth(chance):
    """Orders 1 and 3, whose coefficients are whole: |p|^2 = a^2n + w^2n."""
    a = Fraction(2 ** chance.randint(-2, 4))
    return [a, Fraction(1)] if chance.random() < 0.5 else [a**3, 2 * a**2, 2 * a, Fraction(1)]


def through_clay(chance, numerator, denominator):
    """L = numerator / denominator, the numerator's gain shared between C_h1 and the clay."""
    share = Fraction(2 ** chance.randint(-6, 6))
    turn = damped(chance) if chance.random() < 0.5 else [Fraction(1)]
    return loop(
        g_h=(numerator, denominator),
        c_h1=(times([share], mirrored(turn)), turn),
        t_h=[Fraction(0)],
        clay=[1 / share, Fraction(0)],
    )


def loop(g_h, c_h1, t_h, clay=(0, 0)):
    def listed(p):
        floats = [float(c) for c in reversed(p)]
        assert all(Fraction(x) == c for x, c in zip(floats, reversed(p)))
        return floats

    def fraction(pair):
        return {"numerator": listed(pair[0]), "denominator": listed(pair[1])}

    stiffness, damping = clay
    return {
        "g_h": fraction(g_h),
        "t_h": listed(t_h),
        "c_h1": fraction(c_h1),
        "g_t": {"numerator": [1], "denominator": [1]},
        "position_ratio": 1,
        "force_ratio": -1,
        "clay_damping_n_s_per_m": float(damping),
        "clay_stiffness_n_per_m": float(stiffness),
    }


def low_pass(chance):
    p = butterworth(chance)
    return through_clay(chance, [p[0]], p)


def high_pass(chance):
    p = butterworth(chance)
    return through_clay(chance, [Fraction(0)] * (len(p) - 1) + [p[-1]], p)


def band_pass(chance):
    p = damped(chance)
    return through_clay(chance, [Fraction(0), p[1]], p)


def above_1(chance):
    """A low-pass of a gain a little above 1: it crosses, and not where the one of gain 1 touches."""
    p = butterworth(chance)
    return through_clay(chance, [p[0] * (1 + Fraction(1, 2 ** chance.randint(1, 20)))], p)


def real_touch(chance):
    """k / (s (s² + c²)² + e(s²)) with e below zero at j c: the curve touches the negative real axis there."""
    c = Fraction(whole(chance, 1, 3))
    square = [c * c, Fraction(0), Fraction(1)]
    odd = times(X, square, square)
    even = [Fraction(whole(chance)), Fraction(0), Fraction(whole(chance, 10, 20))]
    gain = Fraction(2 ** chance.randint(-3, 9))
    return loop(([gain], plus(odd, even)), ([Fraction(1)], [Fraction(1)]), [Fraction(1)])


def on_the_axis(chance):
    """Poles and zeros on the axis, simple and double, in C_h1, G_h and the arm, some of them in two parts at once."""
    shared = swing(chance)
    above, below = [Fraction(1)], [Fraction(1)]
    for _ in range(chance.randint(0, 2)):
        above = times(above, swing(chance))
    for _ in range(chance.randint(0, 2)):
        below = times(below, shared if chance.random() < 0.3 else swing(chance))
    arm = times(damped(chance), shared) if chance.random() < 0.4 else damped(chance)
    servo = times(damped(chance), [Fraction(whole(chance)), Fraction(1)])
    lag = times([Fraction(whole(chance)), Fraction(1)], [Fraction(0), Fraction(1)] if chance.random() < 0.3 else [Fraction(1)])
    gain = Fraction(2 ** chance.randint(-6, 6))
    return loop((times([gain], above), servo), ([Fraction(whole(chance))], times(below, lag)), arm)


def of_any_kind(chance):
    factors = [damped(chance), [Fraction(whole(chance)), Fraction(1)], damped(chance)]
    gain = Fraction(2 ** chance.randint(-3, 6))
    return loop(
        (times([gain], damped(chance, chance.choice([1, -1]))), times(*factors)),
        ([Fraction(1)], [Fraction(0), Fraction(whole(chance)), Fraction(1)]),
        [Fraction(whole(chance)), Fraction(whole(chance))],
        (Fraction(whole(chance)), Fraction(whole(chance, 0, 9))),
    )


def two_returns(chance):
    """A servo with a mild resonance and an admittance without an integrator, of which arm and clay both return much."""
    omega = whole(chance, 4, 8)
    servo = [Fraction(omega * omega), Fraction(whole(chance, 3, 9)), Fraction(1)]
    admittance = [Fraction(whole(chance, 16, 64)), Fraction(whole(chance, 8, 20)), Fraction(1)]
    return loop(
        ([Fraction(omega * omega)], servo),
        ([Fraction(whole(chance, 8, 32))], admittance),
        [Fraction(whole(chance)), Fraction(whole(chance, 0, 4)), Fraction(1, 4)],
        (Fraction(whole(chance)), Fraction(whole(chance, 0, 4))),
    )


KINDS = {
    "a low-pass of gain 1": low_pass,
    "a high-pass of gain 1": high_pass,
    "a band-pass of gain 1": band_pass,
    "a low-pass of gain above 1": above_1,
    "a curve that touches the negative axis": real_touch,
    "poles and zeros on the axis": on_the_axis,
    "arm and clay behind a filter": two_returns,
    "any loop": of_any_kind,
}


# Comparison.


def compare(loop, answer, counts):
    if "error" in answer:
        yield f"refused: {answer['error']}"
        return

    def seen(name):
        counts[name] = counts.get(name, 0) + 1

    def polynomial(descending):
        return trimmed([Fraction(c) for c in reversed(descending)])

    above = times(polynomial(loop["g_h"]["numerator"]), polynomial(loop["c_h1"]["numerator"]))
    d = times(polynomial(loop["g_h"]["denominator"]), polynomial(loop["c_h1"]["denominator"]))
    n_h = times(above, polynomial(loop["t_h"]))
    n_e = times(above, polynomial([loop["clay_damping_n_s_per_m"], loop["clay_stiffness_n_per_m"]]))
    n = plus(n_h, n_e)
    c = plus(d, n)
    stable = is_stable(c)
    seen("stable" if stable else "not stable")
    if stable != answer["stable_without_delay"]:
        yield f"stable is {answer['stable_without_delay']}, Routh's table says {stable}"

    # The curve knows no mode that two parts hide from each other on the axis.
    shared = common_divisor(n, d)
    hidden = common_divisor(shared, mirrored(shared))
    curve_n, curve_d, curve_c = (divide(p, hidden)[0] for p in (n, d, c))

    peak = extreme(curve_n, curve_d, max)
    if peak is None:
        seen("no peak")
    yield from compare_value("small gain", answer["small_gain_peak"], peak, PEAK_TOLERANCE)
    least = extreme(curve_c, curve_d, min)
    yield from compare_value("least distance", answer["nyquist_min_distance"], least, PEAK_TOLERANCE)
    yield from compare_gains(curve_n, curve_d, answer, seen)

    phases = []
    for x in positive_roots(plus(squared(curve_n), squared(curve_d), -1)):
        omega = mpmath.sqrt(x)
        gain = value(curve_n, omega) / value(curve_d, omega)
        phases.append(abs(mpmath.arg(-gain)))
        if multiplicity_at(plus(squared(curve_n), squared(curve_d), -1), x) % 2 == 0:
            seen("touched circle")
    seen("phase margin" if phases else "no phase margin")
    got = answer["phase_margin_rad"]
    yield from compare_value("phase margin", None if got is None else abs(got), min(phases, default=None))
    if stable:
        yield from compare_delay("position_force", plus(d, n_h), n_e, answer, seen)
        # The two copies of the admittance must be stable by themselves, an integrator aside.
        own = d[1:] if d[0] == 0 else d
        if is_stable(own):
            prompt = times(plus(d, n_e), plus(d, n_h))
            yield from compare_delay("force_exchange", prompt, times([Fraction(-1)], n_e, n_h), answer, seen)


def extreme(p, q, choose):
    """Extreme of |p/q| along the axis, limits included; None when it is unbounded."""
    above, below = squared(p), squared(q)
    shared = common_divisor(above, below)
    above, below = divide(above, shared)[0], divide(below, shared)[0]
    if choose is max and (below[0] == 0 or len(above) > len(below) or positive_roots(below)):
        return None
    slope = plus(times(derivative(above), below), times(above, derivative(below)), -1)
    above_mp, below_mp = [exact(k) for k in above], [exact(k) for k in below]
    stops = [x for x in positive_roots(slope) if abs(at(below_mp, x)) > mpmath.mpf(10) ** -25]
    values = [at(above_mp, x) / at(below_mp, x) for x in stops]
    if below[0] != 0:
        values.append(exact(above[0] / below[0]))
    if len(above) <= len(below):
        values.append(exact(above[-1] / below[-1]) if len(above) == len(below) else mpmath.mpf(0))
    return mpmath.sqrt(abs(choose(values)))


def compare_gains(n, d, answer, seen):
    phase = imaginary(n, d)
    if is_zero(phase):
        return
    factors = []
    for x in positive_roots(phase):
        omega = mpmath.sqrt(x)
        top, bottom = value(n, omega), value(d, omega)
        if min(abs(top), abs(bottom)) < mpmath.mpf(10) ** -20:
            seen("zero or pole for a crossing")
            continue
        gain = top / bottom
        if gain.real < 0:
            factors.append(-1 / gain.real)
            if multiplicity_at(phase, x) % 2 == 0:
                seen("touched axis")
    orders = [next(k for k, c in enumerate(p) if c != 0) for p in (n, d)]
    limits = []
    if orders[0] == orders[1]:
        limits.append(exact(n[orders[0]] / d[orders[1]]))
    if len(n) == len(d):
        limits.append(exact(n[-1] / d[-1]))
    factors += [-1 / limit for limit in limits if limit < 0]
    seen("gain margin" if factors else "no gain margin")
    for name, wanted in (
        ("gain_increase", min([f for f in factors if f >= 1], default=None)),
        ("gain_decrease", max([f for f in factors if f < 1], default=None)),
    ):
        yield from compare_value(name, answer[name] and answer[name]["factor"], wanted)


def compare_delay(scheme, prompt, delayed, answer, seen):
    got = answer[f"delay_margin_{scheme}_s"]
    wanted = []
    if not is_zero(delayed):
        if len(delayed) > len(prompt) or (len(delayed) == len(prompt) and abs(delayed[-1]) >= abs(prompt[-1])):
            wanted.append(mpmath.mpf(0))
        for x in positive_roots(plus(squared(prompt), squared(delayed), -1)):
            omega = mpmath.sqrt(x)
            turn = mpmath.arg(-value(delayed, omega) / value(prompt, omega))
            wanted.append((turn + (2 * mpmath.pi if turn < 0 else 0)) / omega)
    seen(f"finite delay of {scheme}" if wanted else f"unbounded delay of {scheme}")
    yield from compare_value(f"delay margin of {scheme}", got, min(wanted, default=None))


def compare_value(name, got, wanted, tolerance=TOLERANCE):
    if got is None and wanted is None:
        return
    if got is None or wanted is None or abs(got - wanted) > tolerance * abs(wanted):
        yield f"{name} {got}, wanted {wanted if wanted is None else mpmath.nstr(wanted, 12)}"


if __name__ == "__main__":
    main()
