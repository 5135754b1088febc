"""Contacts of a whisker from its hub signals, Resight against what can be built from SciPy, on the same samples in one run; prints
Markdown tables.

Without --data the samples are made here: a steel wire of 1.0 mm (and one that tapers from 1.2 to 0.4 mm), 250 mm long, turns about its
clamp over a cylinder of 25 mm radius, with and without friction. The truth is integrated from the contact back to the hub by SciPy (DOP853,
1e-13) inside a root finder, so nobody's contact solver has a part in it. With --data FOLDER the samples are those of data sets: a folder a
set, with meta.json, measured_clean.csv, measured_noisy.csv and truth.csv. The noise of samples made here is that of a load cell with
steps of 1/320 N and 1/64 N·mm: Gaussian of one step, then rounded; the seed is fixed. The errors with noise are of contacts between clamp and tip,
where every contender claims to hold.

The contenders of one sample:
- SciPy `solve_ivp` from the hub until the moment vanishes, DOP853 at 1e-11 and RK45 at 1e-6: the published method of profile sensing.
- the closed form of the uniform whisker by `scipy.special` (ellipkinc, ellipeinc).
- Resight: closed form and integration, called from a small program of its own on the same loads.
Of a sweep with noise, the errors of samples with at least 0.1 N also for
- the torque-only estimator of Solomon and Hartmann (2010), restated: first the distance from torque and angle 3 degrees after the touch, then
  step by step along the whisker's own direction to where the torque agrees; the moment and the direction of a deflected cantilever by angle as
  cubic fits to the elastica. It is told the touch angle, and it assumes no friction and a hub that only turns.
"""

import argparse
import csv
import json
import subprocess
import time
from pathlib import Path

import numpy as np
import scipy
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve
from scipy.special import ellipeinc, ellipkinc

LENGTH_M, YOUNG_PA = 0.25, 200e9
RADIUS_M, DISTANCE_M = 0.025, 0.15
FORCE_STEP_N, TORQUE_STEP_N_M = 1 / 320, 1 / 64e3
SEED, ROUNDS, LEAST_FORCE_N = 20041, 3, 0.1


def stiffness(diameter_m):
    return YOUNG_PA * np.pi * (diameter_m / 2) ** 4 / 4


class Whisker:
    def __init__(self, length_m, ei_n_m2, taper):
        self.length_m, self.ei_n_m2, self.taper = length_m, ei_n_m2, taper

    def ei(self, s):
        return self.ei_n_m2 * (1 - self.taper * s / self.length_m) ** 4


# ---- the truth: from the contact back to the hub


def hub_of(whisker, theta, force, s, friction, centre, radius):
    """Hub place and angle (3), and load in the world, of a whisker that touches the cylinder with its direction `theta` there."""
    t, n = np.array([np.cos(theta), np.sin(theta)]), np.array([-np.sin(theta), np.cos(theta)])
    f = force * (np.cos(friction) * n + np.sin(friction) * t)
    x_c = centre + radius * n

    def back(sigma, v):
        moment = (x_c[0] - v[0]) * f[1] - (x_c[1] - v[1]) * f[0]
        return [-np.cos(v[2]), -np.sin(v[2]), -moment / whisker.ei(s - sigma)]

    hub = solve_ivp(back, (0, s), [*x_c, theta], method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    return hub, f, x_c


def sweep(whisker, friction, step_deg=1.0):
    """Rows (hub_angle, fx, fy, mz in hub axes; x, y in the world; s; theta) while the whisker turns about the origin."""
    centre = np.array([DISTANCE_M, 0.0])
    touch = np.arcsin(RADIUS_M / DISTANCE_M)
    s = np.sqrt(DISTANCE_M**2 - RADIUS_M**2)
    rows, guess = [], np.array([touch, 3 * np.radians(step_deg) * whisker.ei(s / 2) / s**2, s])
    scale = np.array([1.0, guess[1], LENGTH_M])
    before = guess / scale
    for i in range(1, 90):
        angle = touch - np.radians(step_deg) * i

        def miss(u):
            hub = hub_of(whisker, *(u * scale), friction, centre, RADIUS_M)[0]
            return [hub[0] / LENGTH_M, hub[1] / LENGTH_M, hub[2] - angle]

        start = 2 * rows[-1][0] - rows[-2][0] if len(rows) > 1 else before
        u, _, found, _ = fsolve(miss, start, xtol=1e-13, full_output=True)
        theta, force, s = u * scale
        if np.abs(miss(u)).max() > 1e-10 or s > 0.98 * LENGTH_M or force <= 0:
            break
        _, f, x_c = hub_of(whisker, theta, force, s, friction, centre, RADIUS_M)
        c, d = np.cos(angle), np.sin(angle)
        load = c * f[0] + d * f[1], -d * f[0] + c * f[1], x_c[0] * f[1] - x_c[1] * f[0]
        rows.append((u, [angle, *load, *x_c, s, theta]))
    return np.array([row for _, row in rows]), touch


# ---- the contenders: a load (fx, fy, mz) to (x, y) in hub axes


def integrated(whisker, method, rtol):
    def contact(load):
        fx, fy, mz = load

        def flow(s, v):
            return [np.cos(v[2]), np.sin(v[2]), (mz - (v[0] * fy - v[1] * fx)) / whisker.ei(s)]

        def moment(_, v):
            return mz - (v[0] * fy - v[1] * fx)

        moment.terminal = True
        end = whisker.length_m * (1.2 if whisker.taper == 0 else min(1.2, 0.98 / whisker.taper))
        atol = rtol * whisker.length_m * 0.1
        out = solve_ivp(flow, (0, end), [0.0, 0.0, 0.0], method=method, rtol=rtol, atol=atol, events=moment)
        return out.y_events[0][0][:2] if len(out.t_events[0]) else None

    return contact


def closed_form(whisker):
    def contact(load):
        side = -1.0 if load[2] < 0 else 1.0
        fx, fy, mz = load[0], side * load[1], side * load[2]
        force, lam = np.hypot(fx, fy), np.sqrt(np.hypot(fx, fy) / whisker.ei_n_m2)
        beta, c = np.arctan2(fy, -fx), mz / (2 * np.sqrt(whisker.ei_n_m2 * force))
        g = np.sin(beta / 2)
        k2 = c * c + g * g
        if k2 >= 1:
            return None
        # The differences of complete and incomplete integrals by their addition theorem: nothing cancels.
        psi = np.arctan2(c, np.sqrt(1 - k2) * g)
        u = ellipkinc(psi, k2)
        w = ellipeinc(psi, k2) - np.sqrt(k2) * g * np.sin(psi)
        a, b = (2 * w - u) / lam, mz / force
        return np.array([-a * fx + b * fy, side * (-a * fy - b * fx)]) / force

    return contact


def timed(contact, loads):
    """Contacts (n, 2), NaN where there is none, and the median over loads of the fastest of some rounds, µs of the thread's CPU time."""
    out, best = np.full((len(loads), 2), np.nan), np.full(len(loads), np.inf)
    for _ in range(ROUNDS):
        for i, load in enumerate(loads):
            start = time.thread_time_ns()
            x = contact(load)
            best[i] = min(best[i], time.thread_time_ns() - start)
            if x is not None:
                out[i] = x
    return out, np.median(best) / 1e3


def resight(program, whisker, method, loads):
    """The same of our program, and the cost with derivatives."""
    text = "\n".join(",".join(repr(float(v)) for v in load) for load in loads)
    arguments = [program, repr(whisker.length_m), repr(whisker.ei_n_m2), repr(whisker.taper), method]
    lines = subprocess.run(arguments, input=text, capture_output=True, text=True, check=True).stdout.splitlines()
    costs = [float(line.split(",")[1]) / 1e3 for line in lines if line.startswith("#")]
    fields = [line.split(",")[:2] for line in lines if not line.startswith("#")]
    return np.array([[float(v) if v else np.nan for v in row] for row in fields]), *costs


# ---- the torque-only estimator


def cantilever_fits():
    """M r/EI and the angle between whisker and chord at the contact, cubic in the angle between clamp and chord; frictionless."""
    angles, moments, turns = [], [], []
    whisker = Whisker(1.0, 1.0, 0.0)
    for bend in np.radians(np.linspace(1, 75, 60)):
        # Frictionless at the contact: H = 0, so the load of unit arc is one number; found by the bend.
        def load_of(scale):
            mz = np.sqrt(2.0 * scale * np.sin(bend))
            return -(mz**2) / 2, np.sqrt(max(scale**2 - mz**4 / 4, 0.0)), mz

        x = closed_form(whisker)(load_of(1.0))
        r, angle = np.hypot(*x), np.arctan2(x[1], x[0])
        angles.append(angle), moments.append(load_of(1.0)[2] * r), turns.append(bend - angle)
    odd = np.array(angles)[:, None] ** [1, 2, 3]
    return [np.linalg.lstsq(odd, np.array(v), rcond=None)[0] for v in (moments, turns)]


def torque_only(whisker, angles, moments, touch, sign):
    """Contacts (n, 2) of a sweep about the origin in the world, NaN before 3 degrees; `sign` is the side of the object."""
    of_moment, of_turn = cantilever_fits()
    cubic = lambda fit, a: fit @ np.array([a, a**2, a**3])
    out, x, t = np.full((len(angles), 2), np.nan), None, None
    for i, (angle, moment) in enumerate(zip(angles, np.abs(moments))):
        bend = sign * (touch - angle)
        if bend < np.radians(3) or moment <= 0:
            continue

        def excess(slip, x, t):
            at = x + slip * t
            deflected = sign * (np.arctan2(at[1], at[0]) - angle)
            return whisker.ei_n_m2 * cubic(of_moment, deflected) / np.hypot(*at) - moment

        if x is None:
            r = whisker.ei_n_m2 * cubic(of_moment, bend) / moment
            x = r * np.array([np.cos(touch), np.sin(touch)])
        else:
            slips = np.linspace(-0.02, 0.02, 81)
            values = np.array([excess(slip, x, t) for slip in slips])
            crossings = np.flatnonzero(values[:-1] * values[1:] <= 0)
            if len(crossings):
                nearest = crossings[np.argmin(np.abs(slips[crossings]))]
                x = x + brentq(excess, slips[nearest], slips[nearest + 1], args=(x, t)) * t
        out[i] = x
        deflected = sign * (np.arctan2(x[1], x[0]) - angle)
        direction = angle + sign * (deflected + cubic(of_turn, deflected))
        t = np.array([np.cos(direction), np.sin(direction)])
    return out


# ---- samples


class Samples:
    """Loads (n, 3) in hub axes, contacts (n, 2) in hub axes and the world, hub poses (n, 3: angle, x, y)."""

    def __init__(self, name, whisker, hubs, clean, noisy, truth, sweeps, touch=None, sign=1.0):
        self.name, self.whisker, self.hubs, self.clean, self.noisy, self.truth = name, whisker, hubs, clean, noisy, truth
        self.sweeps, self.touch, self.sign = sweeps, touch, sign
        self.exact_hubs, self.at_tip = hubs, np.zeros(len(truth), dtype=bool)

    def in_hub(self):
        return np.array([turned(x - hub[1:], -hub[0]) for x, hub in zip(self.truth, self.exact_hubs)])

    def in_world(self, contacts):
        return np.array([turned(x, hub[0]) + hub[1:] for x, hub in zip(contacts, self.hubs)])


def turned(x, angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * x[0] - s * x[1], s * x[0] + c * x[1]])


def made():
    rng = np.random.default_rng(SEED)
    steps = np.array([FORCE_STEP_N, FORCE_STEP_N, TORQUE_STEP_N_M])
    wire, cone = Whisker(LENGTH_M, stiffness(1.0e-3), 0.0), Whisker(LENGTH_M, stiffness(1.2e-3), 2 / 3)
    for name, whisker, mu in [("wire", wire, 0.0), ("wire, friction 0.3", wire, 0.3), ("taper", cone, 0.0)]:
        rows, touch = sweep(whisker, np.arctan(mu))
        clean = rows[:, 1:4]
        noisy = np.round((clean + steps * rng.standard_normal(clean.shape)) / steps) * steps
        hubs = np.column_stack([rows[:, 0], np.zeros((len(rows), 2))])
        yield Samples(name, whisker, hubs, clean, noisy, rows[:, 4:6], np.zeros(len(rows)), touch)


def recorded(folder):
    for meta_path in sorted(Path(folder).glob("*/meta.json")):
        meta = json.loads(meta_path.read_text())["whisker"]
        taper = 1 - meta["diameter_tip_m"] / meta["diameter_base_m"]
        whisker = Whisker(meta["length_m"], meta["EI_base_Nm2"], taper)
        clean, noisy, truth = (
            list(csv.DictReader(open(meta_path.parent / f"{name}.csv"))) for name in ("measured_clean", "measured_noisy", "truth")
        )
        touching = [i for i, row in enumerate(truth) if row["contact"] == "1"]
        take = lambda rows, keys: np.array([[float(rows[i][key]) for key in keys] for i in touching])
        sweeps = take(truth, ["sweep"])[:, 0]
        hubs = take(noisy, ["hub_angle", "hub_x", "hub_y"])
        loads = [take(rows, ["fx", "fy", "mz"]) for rows in (clean, noisy)]
        touch = touch_angle(json.loads((meta_path.parent / "object_truth.json").read_text()))
        one = Samples(meta_path.parent.name, whisker, hubs, *loads, take(truth, ["x", "y"]), sweeps, touch)
        one.exact_hubs = take(clean, ["hub_angle", "hub_x", "hub_y"])
        one.at_tip = np.array([truth[i]["mode"].startswith("tip") for i in touching])
        yield one


def touch_angle(truth):
    """Of the last sweep, where it only turns: the torque-only estimator is told it."""
    last = truth["sweeps"][-1]
    if last["kind"] != "rotate":
        return None
    return np.radians(last["psi0_deg"] + (last["psi1_deg"] - last["psi0_deg"]) * last["t_touch"])


# ---- tables


def exact_table(samples, program):
    print("| samples | contenders | contacts | failures | worst error / L | µs a contact | with derivatives |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for one in samples:
        want = one.in_hub()
        whisker, rows = one.whisker, []
        for name, method, rtol in [("DOP853 1e-11", "DOP853", 1e-11), ("RK45 1e-6", "RK45", 1e-6)]:
            got, cost = timed(integrated(whisker, method, rtol), one.clean)
            rows.append((f"SciPy solve_ivp {name}", got, cost, None))
        if whisker.taper == 0:
            rows.append(("scipy.special closed form", *timed(closed_form(whisker), one.clean), None))
            rows.append(("Resight closed form", *resight(program, whisker, "closed", one.clean)))
        rows.append(("Resight integration", *resight(program, whisker, "integrate", one.clean)))
        for name, got, cost, full in rows:
            off = np.linalg.norm(got - want, axis=1) / whisker.length_m
            failures, cost_text = int(np.isnan(off).sum()), f"{cost:.3g}"
            full_text = f"{full:.3g}" if full else ""
            print(f"| {one.name} | {name} | {len(off)} | {failures} | {np.nanmax(off):.1e} | {cost_text} | {full_text} |")


def rms_mm(got, want):
    off = np.linalg.norm(got - want, axis=1) * 1e3
    off = off[np.isfinite(off)]
    return f"{np.sqrt(np.mean(off**2)):.3f} / {np.median(off):.3f} ({len(off)})" if len(off) else "none"


def noisy_table(samples, program):
    print("\nRoot mean square / median error, mm (samples answered), of sweeps about a fixed clamp, at least 0.1 N, not at the tip:\n")
    print("| samples | RK45 from the hub | Resight, sample by sample | torque only |")
    print("| --- | --- | --- | --- |")
    for one in samples:
        if one.touch is None or one.whisker.taper != 0:
            continue
        turning = one.sweeps == one.sweeps.max()
        enough = turning & ~one.at_tip & (np.hypot(*one.clean[:, :2].T) >= LEAST_FORCE_N)
        ours = one.in_world(resight(program, one.whisker, "closed", one.noisy)[0])
        scipys = np.full_like(ours, np.nan)
        contact = integrated(one.whisker, "RK45", 1e-6)
        for i in np.flatnonzero(enough):
            x = contact(one.noisy[i])
            scipys[i] = np.nan if x is None else turned(x, one.hubs[i, 0]) + one.hubs[i, 1:]
        place = one.hubs[turning][0, 1:]
        torques = np.full_like(ours, np.nan)
        torques[turning] = torque_only(one.whisker, one.hubs[turning, 0], one.noisy[turning, 2], one.touch, one.sign) + place
        columns = [rms_mm(x[enough], one.truth[enough]) for x in (scipys, ours, torques)]
        print(f"| {one.name} | " + " | ".join(columns) + " |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", help="the example bench_contact")
    parser.add_argument("--data", help="folder of data sets; without it the samples are made here")
    parser.add_argument("--folder", help="not used: nothing is written")
    arguments = parser.parse_args()
    samples = list(recorded(arguments.data) if arguments.data else made())
    print(f"SciPy {scipy.__version__}, NumPy {np.__version__}; one thread, fastest of {ROUNDS} rounds.\n")
    exact_table(samples, arguments.program)
    noisy_table(samples, arguments.program)


main()
