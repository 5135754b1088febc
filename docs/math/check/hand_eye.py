"""Checks docs/math/hand_eye.md: eqs. (1)-(9), (13), (14), (16), (18)-(22), (25), (27), (32), (33), (36) at 40 digits, and crates/core/tests/hand_eye_tables/opencv.txt: noisy problems
with the answers of OpenCV's calibrateHandEye and calibrateRobotWorldHandEye.

OpenCV 5.0 has no Python binding of the two. python hand_eye.py --table prints the table with OpenCV 4; without it the committed problems
are made anew, and the committed answers are held to Park and Martin's method written out here (and to OpenCV itself where it has it).
"""

import pathlib
import random
import sys

import cv2
import mpmath as mp
import numpy as np

mp.mp.dps = 40
TABLE = pathlib.Path(__file__).resolve().parents[3] / "crates/core/tests/hand_eye_tables/opencv.txt"


def hat(x):
    return mp.matrix([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])


def matrix(rows, cols, scale=1):
    return mp.matrix(rows, cols).apply(lambda _: mp.mpf(random.gauss(0, 1)) * scale)


def exp(xi):
    m = mp.zeros(4)
    m[:3, :3] = hat(xi[:3])
    for i in range(3):
        m[i, 3] = xi[3 + i]
    return mp.expm(m, method="taylor")


def shift(c):
    m = mp.eye(4)
    for i in range(3):
        m[i, 3] = c[i]
    return m


def adjoint(m):
    r, t = m[:3, :3], m[:3, 3]
    out = mp.zeros(6)
    out[:3, :3], out[3:, 3:], out[3:, :3] = r, r, hat(t) * r
    return out


def half_turn(r):
    """Vector part of the quaternion with positive scalar, away from half a turn."""
    w = mp.sqrt(1 + r[0, 0] + r[1, 1] + r[2, 2]) / 2
    return mp.matrix([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / (4 * w)


def equations():
    random.seed(5)
    x, z = exp(matrix(6, 1)), exp(matrix(6, 1))
    h = [exp(matrix(6, 1, mp.mpf("0.5"))) for _ in range(3)]
    t = [x * m * z for m in h]
    # (2), (3)
    c = matrix(3, 1, 1000)
    assert mp.norm(x * (h[0] * shift(c)) * (shift(-c) * z) - t[0]) < 1e-30
    assert mp.norm((x * shift(c)) * (shift(-c) * h[0]) * z - t[0]) < 1e-30
    # (4) and c = R m
    cam, arm = t[1] * t[0] ** -1, h[1] * h[0] ** -1
    r, p = x[:3, :3], x[:3, 3]
    assert mp.norm(cam - x * arm * x**-1) < 1e-30
    assert mp.norm((cam[:3, :3] - mp.eye(3)) * p - (r * arm[:3, 3] - cam[:3, 3])) < 1e-30
    assert mp.norm(half_turn(cam[:3, :3]) - r * half_turn(arm[:3, :3])) < 1e-30
    # (5): the rotation is recovered from two pairs.
    pairs = [(t[i] * t[j] ** -1, h[i] * h[j] ** -1) for i, j in [(1, 0), (2, 0)]]
    s = mp.zeros(3)
    for a, b in pairs:
        s += half_turn(a[:3, :3]) * half_turn(b[:3, :3]).T
    u, _, v_t = mp.svd_r(s)
    fix = mp.diag([1, 1, mp.det(u) * mp.det(v_t)])
    assert mp.norm(u * fix * v_t - r) < 1e-18
    # (6)
    k = [a[:3, :3] - mp.eye(3) for a, _ in pairs]
    y = [r * b[:3, 3] - a[:3, 3] for a, b in pairs]
    normal, right = k[0].T * k[0] + k[1].T * k[1], k[0].T * y[0] + k[1].T * y[1]
    assert mp.norm(normal**-1 * right - p) < 1e-28
    # (7), (8), (9): turns about one axis a' of the carrier.
    axis_in_carrier = matrix(3, 1)
    axis_in_carrier /= mp.norm(axis_in_carrier)
    a = r * axis_in_carrier
    along = a * a.T
    phi = mp.mpf("0.7")
    first = ((mp.eye(3) - along) * mp.cos(phi) - hat(a) * mp.sin(phi) + along) * r
    assert mp.norm(first * axis_in_carrier - a) < 1e-30
    about = (mp.eye(3) - along) * mp.cos(phi) + hat(a) * mp.sin(phi) + along
    assert mp.norm(about - mp.expm(hat(a) * phi, method="taylor")) < 1e-30
    assert mp.norm(about * first - r) < 1e-30
    motion = exp(mp.matrix([*(axis_in_carrier * mp.mpf("0.9")), 0, 0, 0]))
    for i in range(3):
        motion[i, 3] = mp.mpf(i) - mp.mpf("0.3")
    cam = x * motion * x**-1
    s = first * motion[:3, 3]
    cross = mp.matrix([a[1] * s[2] - a[2] * s[1], a[2] * s[0] - a[0] * s[2], a[0] * s[1] - a[1] * s[0]])
    left = (cam[:3, :3] - mp.eye(3)) * p - mp.cos(phi) * (s - along * s) - mp.sin(phi) * cross
    assert mp.norm(left - (along * s - cam[:3, 3])) < 1e-28
    d = matrix(3, 1)
    d /= mp.norm(d)
    height = -(d.T * r.T * p)[0]
    across = p - a * (a.T * p)[0]
    missing = -(height + ((r * d).T * across)[0]) / ((r * d).T * a)[0]
    assert mp.norm(across + a * missing - p) < 1e-28
    # (12), (13): motions of X, Z and of the hand as motions of T; (16) the height's derivative.
    tiny = [matrix(6, 1, mp.mpf("1e-18")) for _ in range(3)]
    moved = (exp(tiny[0]) * x) * (exp(tiny[1]) * h[0]) * (exp(tiny[2]) * z) * t[0] ** -1
    total = tiny[0] + adjoint(x) * tiny[1] + adjoint(x * h[0]) * tiny[2]
    assert mp.norm(moved - exp(total)) < 1e-33
    moved = exp(tiny[0]) * x
    by_shift = -((moved[:3, :3] * d).T * moved[:3, 3])[0] - height
    assert abs(by_shift + ((r * d).T * tiny[0][3:])[0]) < 1e-33


def definite(n, scale=1):
    root = matrix(n, n, scale)
    return root * root.T + mp.eye(n) * scale**2


def elimination():
    """(14): the minimum over u, by solving for it."""
    s, n = definite(6), definite(6)
    g, m, delta = matrix(6, 1), matrix(6, 1), matrix(6, 1)
    inverse = s**-1
    u = (inverse + n) ** -1 * (g - inverse * (m - delta))
    e = m + u - delta
    least = (e.T * inverse * e - 2 * g.T * u + u.T * n * u)[0]
    share = (mp.eye(6) + n * s) ** -1
    weight = share * n
    chi2 = (-g.T * s * share * g + 2 * m.T * share * g + m.T * weight * m)[0]
    gradient = share * g + weight * m
    quadratic = chi2 - 2 * (gradient.T * delta)[0] + (delta.T * weight * delta)[0]
    assert abs(least - quadratic) < 1e-28


def variances():
    """(18): a turn about a point leaves it in place. (19)-(22): score by differences of the likelihood, information by P."""
    p, w = matrix(3, 1), matrix(3, 1)
    turned = hat(w) * p + hat(p) * w
    assert mp.norm(turned) < 1e-30
    rows, columns = 9, 3
    parts = [definite(rows) for _ in range(2)]
    own, d, r = definite(rows), matrix(rows, columns), matrix(rows, 1)
    theta = [mp.mpf("0.7"), mp.mpf("1.3")]

    def at(theta):
        v = own + parts[0] * theta[0] + parts[1] * theta[1]
        weight = v**-1
        m = d.T * weight * d
        phi = m**-1
        x = phi * d.T * weight * r
        likelihood = -(mp.log(mp.det(v)) + mp.log(mp.det(m)) + (r.T * weight * r - x.T * m * x)[0]) / 2
        return likelihood, weight, phi, r - d * x

    trace = lambda a: sum(a[i, i] for i in range(a.rows))
    _, weight, phi, e = at(theta)
    big = weight - weight * d * phi * d.T * weight
    assert mp.norm(big * r - weight * e) < 1e-28
    m = [d.T * weight * v * weight * d for v in parts]
    for k in range(2):
        score = ((e.T * weight * parts[k] * weight * e)[0] - trace(weight * parts[k]) + trace(phi * m[k])) / 2
        step = mp.mpf("1e-12")
        moved = lambda sign: at([t + (sign * step if i == k else 0) for i, t in enumerate(theta)])[0]
        assert abs((moved(1) - moved(-1)) / (2 * step) - score) < 1e-18
        for l in range(2):
            q = d.T * weight * parts[k] * weight * parts[l] * weight * d
            shorter = trace(weight * parts[k] * weight * parts[l]) / 2 - trace(phi * q) + trace(phi * m[k] * phi * m[l]) / 2
            assert abs(trace(big * parts[k] * big * parts[l]) / 2 - shorter) < 1e-26
        # (36): what (24) has of one kind alone is positive.
        q = d.T * weight * parts[k] * weight * parts[k] * weight * d
        mp.cholesky(2 * q - m[k] * phi * m[k])
    camera = phi * d.T * weight * own * weight * d * phi
    assert mp.norm(camera + phi * (m[0] * theta[0] + m[1] * theta[1]) * phi - phi) < 1e-26
    # (27): what the weights of an exact hand have of covariance when the noise is theta.
    weight = own**-1
    phi = (d.T * weight * d) ** -1
    estimator = phi * d.T * weight
    truth = own + parts[0] * theta[0] + parts[1] * theta[1]
    m = [d.T * weight * v * weight * d for v in parts]
    shorter = phi + phi * (m[0] * theta[0] + m[1] * theta[1]) * phi
    assert mp.norm(estimator * truth * estimator.T - shorter) < 1e-26
    # (25): a larger target moves the pose by its translation.
    pose, delta = exp(matrix(6, 1)), mp.mpf("1e-18")
    larger = pose.copy()
    for i in range(3):
        larger[i, 3] *= 1 + delta
    motion = mp.matrix([0, 0, 0, *(pose[:3, 3] * delta)])
    assert mp.norm(larger * pose**-1 - exp(motion)) < 1e-33


# OpenCV's answers to noisy problems, for the test that compares.

HAND_EYE = ["Tsai", "Park", "Horaud", "Andreff", "Daniilidis"]
ROBOT_WORLD = ["Shah", "Li"]
PROBLEMS, VIEWS = 60, 8
SIGMA_SEEN, SIGMA_HAND = (2e-3, 1.5e-3), (5e-4, 5e-4)


def neighbours():
    """(32): the covariance of what a block wants, of X alone with Z free, and the mean of Q. (33): evidence and mean by quadrature."""
    columns, sizes = 4, [5, 7, 6]
    blocks = [(matrix(n, columns), definite(n) ** -1) for n in sizes]
    phi = sum((d.T * w * d for d, w in blocks), mp.zeros(columns)) ** -1
    informations = [d.T * w * d for d, w in blocks]
    j = phi[:2, :2] ** -1 * phi[:2, :]
    whole = phi**-1
    assert mp.norm(j[:, 2:] + whole[:2, 2:] * whole[2:, 2:] ** -1) < 1e-26
    assert mp.norm(j * whole * j.T - phi[:2, :2] ** -1) < 1e-24
    trace = lambda a: sum(a[i, i] for i in range(a.rows))
    at, degrees = 0, 0
    for b, (d, w) in enumerate(blocks):
        # g_b = D_b' W_b e, e = r - D Phi D'W r, of independent r.
        factors = [(d.T * w if a == b else mp.zeros(columns, e.rows)) - informations[b] * phi * e.T * v for a, (e, v) in enumerate(blocks)]
        covariance = sum((f * v**-1 * f.T for f, (_, v) in zip(factors, blocks)), mp.zeros(columns))
        shorter = informations[b] - informations[b] * phi * informations[b]
        assert mp.norm(covariance - shorter) < 1e-24
        degrees += trace((j * informations[b] * j.T) ** -1 * j * shorter * j.T)
    # So many blocks with two numbers each, less the two that were fitted.
    assert 0 < degrees < 2 * len(sizes)
    chi2, d = mp.mpf(40), mp.mpf(12)
    gain = lambda q: mp.exp(chi2 / 2 * (1 - 1 / q)) * q ** (-d / 2)
    by = lambda f: mp.quad(lambda x: f(mp.exp(x)) / mp.log(10), [0, mp.log(10)])
    evidence = by(gain)
    mean = by(lambda q: q * gain(q)) / evidence
    # The values of the test in multiview/hand_eye/blocks.rs.
    assert abs(evidence / mp.mpf("388.498851939") - 1) < 1e-9 and abs(mean / mp.mpf("3.853423850866") - 1) < 1e-9


def numpy_exp(xi):
    m = np.eye(4)
    w, v = np.asarray(xi[:3], float), np.asarray(xi[3:], float)
    m[:3, :3] = cv2.Rodrigues(w)[0]
    m[:3, 3] = v
    return m


def noise(rng, sigmas):
    return numpy_exp(np.concatenate([rng.normal(0, sigmas[0], 3), rng.normal(0, sigmas[1], 3)]))


def problem(rng):
    x = numpy_exp(np.concatenate([rng.normal(0, 0.8, 3), rng.normal(0, 0.1, 3)]))
    z = numpy_exp(np.concatenate([rng.normal(0, 0.8, 3), rng.normal(0, 0.5, 3)]))
    seen, hand = [], []
    for _ in range(VIEWS):
        tilt = rng.uniform(-0.6, 0.6, 3)
        t = numpy_exp(np.concatenate([tilt, [rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), rng.uniform(0.5, 1.0)]]))
        base_from_hand = np.linalg.inv(np.linalg.inv(x) @ t @ np.linalg.inv(z))
        seen.append(noise(rng, SIGMA_SEEN) @ t)
        hand.append(noise(rng, SIGMA_HAND) @ base_from_hand)
    return x, z, seen, hand


def answers(seen, hand):
    """Every method's cam_from_hand."""
    r = lambda poses: [p[:3, :3] for p in poses]
    t = lambda poses: [p[:3, 3].reshape(3, 1) for p in poses]
    for name in HAND_EYE:
        method = getattr(cv2, f"CALIB_HAND_EYE_{name.upper()}")
        rotation, place = cv2.calibrateHandEye(r(hand), t(hand), r(seen), t(seen), method=method)
        m = np.eye(4)
        m[:3, :3], m[:3, 3] = rotation, place.ravel()
        yield name, np.linalg.inv(m)
    inverse = [np.linalg.inv(p) for p in hand]
    for name in ROBOT_WORLD:
        method = getattr(cv2, f"CALIB_ROBOT_WORLD_HAND_EYE_{name.upper()}")
        _, _, rotation, place = cv2.calibrateRobotWorldHandEye(r(seen), t(seen), r(inverse), t(inverse), method=method)
        m = np.eye(4)
        m[:3, :3], m[:3, 3] = rotation, place.ravel()
        yield name, m


def row(kind, number, pose):
    return f"{kind} {number} " + " ".join(f"{v:.7g}" for v in pose[:3, :].ravel())


def park_and_martin(seen, hand):
    """F. C. Park and B. J. Martin, "Robot sensor calibration: solving AX = XB on the Euclidean group", 1994."""
    pairs = [
        (np.linalg.inv(hand[j]) @ hand[i], seen[j] @ np.linalg.inv(seen[i]))
        for i in range(len(hand))
        for j in range(i + 1, len(hand))
    ]
    log = lambda m: cv2.Rodrigues(m[:3, :3])[0].ravel()
    m = sum(np.outer(log(b), log(a)) for a, b in pairs)
    values, vectors = np.linalg.eigh(m.T @ m)
    rotation = vectors @ np.diag(values**-0.5) @ vectors.T @ m.T
    left = np.concatenate([np.eye(3) - a[:3, :3] for a, _ in pairs])
    right = np.concatenate([a[:3, 3] - rotation @ b[:3, 3] for a, b in pairs])
    hand_from_cam = np.eye(4)
    hand_from_cam[:3, :3] = rotation
    hand_from_cam[:3, 3] = np.linalg.lstsq(left, right, rcond=None)[0]
    return np.linalg.inv(hand_from_cam)


def problems():
    rng = np.random.default_rng(7)
    return [problem(rng) for _ in range(PROBLEMS)]


def table(answers):
    lines = [
        f"# OpenCV {cv2.__version__}; 3x4 poses row by row; made by docs/math/check/hand_eye.py --table",
        f"# sigmas of seen {SIGMA_SEEN[0]} rad {SIGMA_SEEN[1]} m, of hand {SIGMA_HAND[0]} rad {SIGMA_HAND[1]} m",
    ]
    for number, (x, z, seen, hand) in enumerate(problems()):
        lines += [row("truth_x", number, x), row("truth_z", number, z)]
        lines += [row("seen", number, p) for p in seen] + [row("hand", number, p) for p in hand]
        lines += [row(name, number, pose) for name, pose in answers(seen, hand)]
    return lines


def check_table():
    """Numbers to 1e-6 (seven digits are written): OpenCV's Park inverts a square root where we take one, another processor rounds differently."""
    has_opencv = hasattr(cv2, "calibrateHandEye")
    ours = table(answers if has_opencv else lambda seen, hand: [("Park", park_and_martin(seen, hand))])
    committed = {}
    for line in TABLE.read_text().splitlines()[2:]:
        name, number, *values = line.split()
        committed.setdefault((name, number), []).append(np.array(values, float))
    for line in ours[2:]:
        name, number, *values = line.split()
        assert np.allclose(np.array(values, float), committed[name, number].pop(0), rtol=0, atol=1e-6), line
    left = {name for (name, _), rows in committed.items() if rows}
    assert left == (set() if has_opencv else {*HAND_EYE, *ROBOT_WORLD} - {"Park"}), left


if "--table" in sys.argv:
    print("\n".join(table(answers)))
else:
    equations()
    elimination()
    variances()
    neighbours()
    check_table()
    print("hand_eye.md: all equations hold; the table is OpenCV's")
