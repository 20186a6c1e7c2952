"""Computes every reference figure of the Rust tests a second time, with other methods, and compares.

    python references.py ROOT [--write]

ROOT is the checkout. Figures stand in tests/reference/*.json of the crates; each case holds its inputs beside its outputs, and
only inputs are used here. With --write the outputs of a file that differs are replaced by the ones computed here.

    robot       arms as intersections of two circles in the plane of the arm; the Jacobian by differences of a forward solution
                found by Newton's method; singular values by mpmath: 40 digits throughout
    loops       poles and margins by mpmath's polynomial roots, 60 digits; every margin is a root of a polynomial in the frequency
    plants      zero-order hold by the matrix exponential, Tustin's rule by substitution, 40 digits
    experiment  the equations of hand, handle and clay without clay, voxels or ticks, by scipy's ninth-order integrator

Exits with 0 when everything agrees.
"""

import argparse
import json
import pathlib
import sys

import mpmath as mp
import numpy as np
from scipy.integrate import solve_ivp

# What the digits of the files themselves allow.
JOINT_TOLERANCE_RAD = 1e-11
JACOBIAN_TOLERANCE = 1e-9
STEP_TOLERANCE = 1e-11
POLE_TOLERANCE = 1e-9
MARGIN_TOLERANCE = 1e-7
EXPERIMENT_TOLERANCE = 1e-6


def main():
    parser = argparse.ArgumentParser(description="Recomputes the reference figures of the Rust tests.")
    parser.add_argument("root", type=pathlib.Path)
    parser.add_argument("--write", action="store_true", help="replace outputs in the files that differ")
    arguments = parser.parse_args()
    files = {
        "crates/kinematics/tests/reference/cases.json": robot,
        "crates/control/tests/reference/loops.json": loops,
        "crates/control/tests/reference/plants.json": plants,
        "crates/sim/tests/reference/cutting.json": experiments,
    }
    wrong = 0
    for name, recompute in files.items():
        path = arguments.root / name
        cases = json.loads(path.read_text())
        differences = Differences()
        recompute(cases, differences)
        if arguments.write and differences.found:
            path.write_text(one_line_a_case(cases))
        for difference in differences.found[:10]:
            print(f"{name}: {difference}")
        print(f"{name}: {differences.compared} figures computed again, {len(differences.found)} differ")
        wrong += len(differences.found)
        if differences.compared == 0:
            sys.exit(f"{name} holds nothing to compare")
    if wrong and not arguments.write:
        sys.exit(1)


class Differences:
    """Compares what a case says with what was computed, and makes the case say that."""

    def __init__(self):
        self.compared = 0
        self.found = []

    def number(self, holder, key, computed, tolerance, what):
        said, self.compared = holder[key], self.compared + 1
        computed = None if computed is None else float(computed)
        is_alike = said is None and computed is None
        if said is not None and computed is not None:
            is_alike = abs(said - computed) <= tolerance * max(1e-3, abs(computed))
        if not is_alike:
            self.found.append(f"{what}: {said}, computed {computed}")
        holder[key] = computed

    def verdict(self, holder, key, computed, what):
        self.compared += 1
        if holder[key] != computed:
            self.found.append(f"{what}: {holder[key]}, computed {computed}")
        holder[key] = computed

    def pair(self, holder, key, computed, tolerance, what):
        self.compared += 1
        if abs(mp.mpc(*holder[key]) - computed) > tolerance * (1 + abs(computed)):
            self.found.append(f"{what}: {holder[key]}, computed {computed}")
        holder[key] = [float(computed.real), float(computed.imag)]


def one_line_a_case(cases):
    return "[\n" + ",\n".join(json.dumps(case) for case in cases) + "\n]\n"


# The robot.


def robot(sets, differences):
    mp.mp.dps = 40
    for a_set in sets:
        arms = Robot(a_set["geometry"])
        for case in a_set["reachable"]:
            position = [mp.mpf(x) for x in case["position_m"]]
            angles = [arms.angles(arm, position) for arm in range(3)]
            for branch, joints in enumerate(case["joints_rad"]):
                for arm in range(3):
                    # Branches count like binary numbers, +1 first, the third arm fastest.
                    is_minus = branch >> (2 - arm) & 1
                    wanted = angles[arm][is_minus]
                    said = mp.mpf(joints[arm])
                    turned = wanted + 2 * mp.pi * mp.nint((said - wanted) / (2 * mp.pi))
                    differences.number(joints, arm, turned, JOINT_TOLERANCE_RAD, f"{position} branch {branch}")
            first = [angles[arm][0] for arm in range(3)]
            jacobian = arms.jacobian(first, position)
            for row in range(3):
                for column in range(3):
                    what = f"{position} jacobian {row} {column}"
                    differences.number(case["jacobian"][row], column, jacobian[row, column], JACOBIAN_TOLERANCE, what)
            singular = mp.svd_r(jacobian, compute_uv=False)
            condition = max(singular) / min(singular)
            differences.number(case, "condition_number", condition, JACOBIAN_TOLERANCE, f"{position} condition")
        for position in a_set["unreachable_m"]:
            reached = all(arms.angles(arm, [mp.mpf(x) for x in position]) for arm in range(3))
            differences.verdict({"reached": False}, "reached", reached, f"{position}")


class Robot:
    def __init__(self, geometry):
        self.base, self.platform = mp.mpf(geometry["base_radius_m"]), mp.mpf(geometry["platform_radius_m"])
        self.upper, self.lower = mp.mpf(geometry["upper_link_m"]), mp.mpf(geometry["lower_link_m"])
        self.directions = []
        for degrees in geometry["arm_angles_deg"]:
            angle = mp.radians(mp.mpf(degrees))
            self.directions.append((mp.cos(angle), mp.sin(angle)))

    def angles(self, arm, position):
        """Both angles of an arm, the one turned further from the line between shoulder and hip first; None out of reach."""
        cosine, sine = self.directions[arm]
        out = position[0] * cosine + position[1] * sine + self.platform - self.base
        aside = position[1] * cosine - position[0] * sine
        up = position[2]
        # The sphere around the hip cuts the arm's plane in a circle.
        circle_squared = self.lower**2 - aside**2
        apart = mp.hypot(out, up)
        if circle_squared < 0 or apart == 0:
            return None
        along = (apart**2 + self.upper**2 - circle_squared) / (2 * apart)
        if abs(along) > self.upper:
            return None
        line, turn = mp.atan2(up, out), mp.acos(along / self.upper)
        return line + turn, line - turn

    def forward(self, joints, near):
        def gaps(x, y, z):
            found = []
            for (cosine, sine), joint in zip(self.directions, joints):
                reach = self.base - self.platform + self.upper * mp.cos(joint)
                centre = (reach * cosine, reach * sine, self.upper * mp.sin(joint))
                found.append((x - centre[0]) ** 2 + (y - centre[1]) ** 2 + (z - centre[2]) ** 2 - self.lower**2)
            return found

        return mp.findroot(gaps, near, tol=1e-60)

    def jacobian(self, joints, position):
        step = mp.mpf("1e-12")
        columns = []
        for arm in range(3):
            ends = []
            for sign in (1, -1):
                moved = list(joints)
                moved[arm] += sign * step
                ends.append(self.forward(moved, position))
            columns.append((ends[0] - ends[1]) / (2 * step))
        return mp.matrix([[columns[c][r] for c in range(3)] for r in range(3)])


# Loops.


def loops(cases, differences):
    mp.mp.dps = 60
    for number, case in enumerate(cases):
        loop = Loop(case)
        for row in case["compensators"]:
            for place, value in enumerate(loop.compensators(mp.mpf(row[0])), start=1):
                differences.pair(row, place, value, 1e-12, f"loop {number} compensator {place} at {row[0]}")
        poles = roots(loop.characteristic)
        poles.sort(key=lambda pole: (float(pole.real), float(pole.imag)))
        if len(poles) != len(case["closed_loop_poles"]):
            differences.found.append(f"loop {number}: {len(poles)} poles")
            continue
        for place, pole in enumerate(poles):
            differences.pair(case["closed_loop_poles"], place, pole, POLE_TOLERANCE, f"loop {number} pole")
        is_stable = all(pole.real < 0 for pole in poles)
        differences.verdict(case, "stable_without_delay", is_stable, f"loop {number} verdict")
        differences.verdict(case, "small_gain_holds", loop.small_gain_holds(), f"loop {number} small gain")
        nearest = loop.least_distance()
        differences.number(case, "nyquist_min_distance", nearest, MARGIN_TOLERANCE, f"loop {number} distance")
        margins = (None, None)
        if is_stable:
            prompt = add(loop.denominator, loop.arm)
            with_clay = add(loop.denominator, loop.clay)
            exchange = delay_margin(multiply(with_clay, prompt), negative(multiply(loop.clay, loop.arm)))
            margins = (exchange, delay_margin(prompt, loop.clay))
        for name, margin in zip(("force_exchange", "position_force"), margins):
            key = f"delay_margin_{name}_s"
            differences.number(case, key, margin, MARGIN_TOLERANCE, f"loop {number} {name}")


class Loop:
    def __init__(self, case):
        exact = lambda part: [mp.mpf(x) for x in part]
        self.parts = {name: tuple(map(exact, case[name])) for name in ("g_h", "c_h1", "g_t")}
        numerator = multiply(self.parts["g_h"][0], self.parts["c_h1"][0])
        self.denominator = multiply(self.parts["g_h"][1], self.parts["c_h1"][1])
        self.position_ratio, self.force_ratio = mp.mpf(case["position_ratio"]), mp.mpf(case["force_ratio"])
        rho = self.position_ratio / -self.force_ratio
        clay = exact([case["clay_damping_n_s_per_m"], case["clay_stiffness_n_per_m"]])
        self.arm = multiply(numerator, exact(case["t_h"]))
        self.clay = [rho * x for x in multiply(numerator, clay)]
        self.gain = add(self.arm, self.clay)
        self.characteristic = add(self.denominator, self.gain)

    def compensators(self, omega):
        """C_h1, C_t1, C_h2, C_t2 from what they are for: a tool that follows, and a handle held by the force ratio."""
        s = mp.mpc(0, omega)
        g_h, c_h1, g_t = (mp.polyval(self.parts[n][0], s) / mp.polyval(self.parts[n][1], s) for n in self.parts)
        # y_h = g_h (c_h1 f_h - c_t1 f_t) is zero under f_t = A_h2 f_h.
        c_t1 = c_h1 / self.force_ratio
        # y_t = g_t (-c_h2 f_h + c_t2 f_t) is A_h1 y_h for f_h alone and for f_t alone.
        return c_h1, c_t1, -self.position_ratio * g_h * c_h1 / g_t, -self.position_ratio * g_h * c_t1 / g_t

    def small_gain_holds(self):
        gain, whole = squared(self.gain), squared(self.denominator)
        below = add(whole, negative(gain))
        # |L| < 1 everywhere: |D|^2 - |N|^2 keeps its sign, which it has at infinity and at rest.
        ends = [trimmed(below)[0] > 0, mp.polyval(below, mp.mpf(0)) > 0]
        return all(ends) and not positive_roots(below)

    def least_distance(self):
        above, below = squared(self.characteristic), squared(self.denominator)
        slope = add(multiply(derivative(above), below), negative(multiply(above, derivative(below))))
        at = lambda omega: mp.sqrt(abs(mp.polyval(above, omega) / mp.polyval(below, omega)))
        found = [at(omega) for omega in positive_roots(slope) if mp.polyval(below, omega) != 0]
        high = trimmed(above)[0] / trimmed(below)[0] if len(trimmed(above)) == len(trimmed(below)) else None
        if high is not None:
            found.append(mp.sqrt(high))
        if mp.polyval(below, mp.mpf(0)) != 0:
            found.append(at(mp.mpf(0)))
        return min(found)


def delay_margin(prompt, delayed):
    """Least delay with a root of prompt(s) + delayed(s) exp(-s d) on the axis; None when there is none."""
    if not any(delayed):
        return None
    delays = []
    for omega in positive_roots(add(squared(prompt), negative(squared(delayed)))):
        s = mp.mpc(0, omega)
        turn = mp.arg(-mp.polyval(delayed, s) / mp.polyval(prompt, s))
        delays.append(turn % (2 * mp.pi) / omega)
    return min(delays, default=None)


def squared(polynomial):
    """|p(j w)|^2 as a polynomial in w."""
    degree = len(polynomial) - 1
    turned = [mp.mpc(0, 1) ** (degree - place) * c for place, c in enumerate(polynomial)]
    real, imaginary = [c.real for c in turned], [c.imag for c in turned]
    return add(multiply(real, real), multiply(imaginary, imaginary))


def positive_roots(polynomial):
    limit = mp.mpf(10) ** -25
    found = roots(polynomial)
    return [root.real for root in found if abs(root.imag) < limit * abs(root) and root.real > limit]


def roots(polynomial):
    polynomial = trimmed(polynomial)
    at_rest = 0
    while polynomial[-1] == 0:
        polynomial, at_rest = polynomial[:-1], at_rest + 1
    found = mp.polyroots(polynomial, maxsteps=2000, extraprec=400) if len(polynomial) > 1 else []
    return [mp.mpc(root) for root in found] + [mp.mpc(0)] * at_rest


def trimmed(polynomial):
    largest = max(abs(c) for c in polynomial)
    first = next(place for place, c in enumerate(polynomial) if abs(c) > largest * mp.mpf(10) ** -50)
    return list(polynomial[first:])


def multiply(a, b):
    product = [mp.mpf(0)] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            product[i + j] += x * y
    return product


def add(a, b):
    length = max(len(a), len(b))
    a, b = ([mp.mpf(0)] * (length - len(p)) + list(p) for p in (a, b))
    return [x + y for x, y in zip(a, b)]


def negative(a):
    return [-x for x in a]


def derivative(a):
    degree = len(a) - 1
    return [c * (degree - place) for place, c in enumerate(a[:-1])] or [mp.mpf(0)]


# Plants.

SERVOS = {
    "G_hx": (["18", "1"], ["0.005", "0.4", "18", "1"]),
    "G_hy": (["8", "1"], ["0.002", "0.17", "8", "1"]),
}


def plants(cases, differences):
    mp.mp.dps = 40
    for case in cases:
        numerator, denominator = ([mp.mpf(c) for c in part] for part in SERVOS[case["plant"]])
        sample = hold if case["method"] == "zoh" else tustin
        response = sample(numerator, denominator, mp.mpf(case["dt_s"]), max(case["k"]) + 1)
        for place, k in enumerate(case["k"]):
            what = f"{case['plant']} {case['method']} {case['dt_s']} s, sample {k}"
            differences.number(case["y"], place, response[k], STEP_TOLERANCE, what)


def hold(numerator, denominator, dt, count):
    """Step response under zero-order hold, from the matrix exponential of plant and input together."""
    order = len(denominator) - 1
    b = [mp.mpf(0)] * (order - len(numerator)) + list(numerator)
    system = mp.zeros(order + 1)
    for row in range(order - 1):
        system[row, row + 1] = 1
    for column in range(order):
        system[order - 1, column] = -denominator[order - column] / denominator[0]
    system[order - 1, order] = 1 / denominator[0]
    step = mp.expm(system * dt)
    state, response = mp.zeros(order + 1, 1), []
    state[order] = 1
    for _ in range(count):
        response.append(mp.fsum(b[order - 1 - i] * state[i] for i in range(order)))
        state = step * state
    return response


def tustin(numerator, denominator, dt, count):
    """Step response of G(2 (z - 1) / (dt (z + 1))), as a difference equation."""
    order = len(denominator) - 1
    in_z = []
    for polynomial in ([mp.mpf(0)] * (order + 1 - len(numerator)) + list(numerator), denominator):
        total = [mp.mpf(0)]
        for place, c in enumerate(polynomial):
            power = order - place
            term = [c * (2 / dt) ** power]
            for _ in range(power):
                term = multiply(term, [1, -1])
            for _ in range(order - power):
                term = multiply(term, [1, 1])
            total = add(total, term)
        in_z.append(total)
    b, a = in_z
    response = []
    for k in range(count):
        drive = mp.fsum(b[i] for i in range(order + 1) if i <= k)
        memory = mp.fsum(a[i] * response[k - i] for i in range(1, order + 1) if i <= k)
        response.append((drive - memory) / a[0])
    return response


# The experiment.


def experiments(cases, differences):
    for number, case in enumerate(cases):
        velocities, duration = cut(case)
        for place, velocity in enumerate(velocities):
            what = f"experiment {number} range {place}"
            differences.number(case["velocity_m_s"], place, velocity, EXPERIMENT_TOLERANCE, what)
        differences.number(case, "duration_s", duration, EXPERIMENT_TOLERANCE, f"experiment {number} duration")


def cut(case):
    """Mean velocity over the last quarter of each range, and the time to the last edge.

    C_h1 turns the hand's force less the clay's into a commanded position; the servo (35) follows it; the clay damps the tool.
    """
    mass, damping = case["virtual_mass_kg"], case["virtual_damping_n_s_per_m"]
    rho = case["position_ratio"] / -case["force_ratio"]
    numerator, denominator = ([float(c) for c in part] for part in SERVOS["G_hx"])

    def position(x):
        return numerator[1] * x[2] + numerator[0] * x[3]

    def velocity(x):
        return numerator[1] * x[3] + numerator[0] * x[4]

    def rates(clay):
        def rate(_, x):
            force = case["hand_force_n"] - rho * clay * velocity(x)
            jerk = (x[0] - denominator[3] * x[2] - denominator[2] * x[3] - denominator[1] * x[4]) / denominator[0]
            return [x[1], (force - damping * x[1]) / mass, x[3], x[4], jerk]

        return rate

    # Commanded position and its velocity, then the servo's chain of integrators; all from the first edge.
    x, time, velocities = np.zeros(5), 0.0, []
    start = case["edges_m"][0]
    for clay, end, begin in zip(case["clay_damping_n_s_per_m"], case["edges_m"][1:], case["edges_m"]):
        reached = []
        for target in (begin + 0.75 * (end - begin), end):

            def passed(_, x, target=target):
                return position(x) - (target - start)

            passed.terminal, passed.direction = True, 1
            run = solve_ivp(rates(clay), (time, time + 200), x, "DOP853", events=passed, rtol=1e-12, atol=1e-15)
            if run.status != 1:
                sys.exit(f"the handle does not reach {target} m")
            time, x = run.t_events[0][0], run.y_events[0][0]
            reached.append(time)
        velocities.append(0.25 * (end - begin) / (reached[1] - reached[0]))
    return velocities, time


if __name__ == "__main__":
    main()
