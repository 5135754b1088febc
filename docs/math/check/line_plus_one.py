"""Checks docs/math/line_plus_one.md: symbolically, and on exact views at 50 digits. Needs SymPy."""

import random

import sympy as sp
from mpmath import det, eigsy, matrix, mp, mpf, norm, qr, sqrt

mp.dps = 50
random.seed(3)
TINY = mpf(10) ** -40

# (2): the adjugate of the sum of b b^T is the sum of (bi x bj)(bi x bj)^T.
b = [sp.Matrix(sp.symbols(f"b{i}_1:4")) for i in range(3)]
total = sum((x * x.T for x in b), sp.zeros(3, 3))
pairs = [b[i].cross(b[j]) for i, j in ((0, 1), (1, 2), (0, 2))]
assert sp.expand(total.adjugate() - sum((n * n.T for n in pairs), sp.zeros(3, 3))) == sp.zeros(3, 3)

# (3), (4): the null vector of the two conditions.
a, c, pa, qa, pc, qc, depth, m, e = sp.symbols("a c p_a q_a p_c q_c depth m e")
rows = sp.Matrix([[qa, a * qa, -a * pa], [qc, c * qc, -c * pc]])
null = rows.row(0).cross(rows.row(1))
stated = [a * c * (pa * qc - pc * qa), c * qa * pc - a * pa * qc, qa * qc * (c - a)]
assert all(sp.expand(x - y) == 0 for x, y in zip(null, stated))
for length, p, q in ((a, pa, qa), (c, pc, qc)):
    condition = (depth + length * m) * q - length * e * p
    assert sp.expand(condition - (sp.Matrix([q, length * q, -length * p]).dot(sp.Matrix([depth, m, e])))) == 0

# (11): the mirrored rotation fixes the plane's points up to the sign along the sight; its determinant is 1.
v, n, x = (sp.Matrix(sp.symbols(f"{s}1:4", real=True)) for s in "vnx")
mirror = lambda u: sp.eye(3) - 2 * u * u.T / u.dot(u)
assert sp.simplify(mirror(v).det() + 1) == 0
in_plane = x - n * n.dot(x) / n.dot(n)
assert sp.simplify(mirror(n) * in_plane - in_plane) == sp.zeros(3, 1)
assert sp.simplify((mirror(v) * x - x) + 2 * v * v.dot(x) / v.dot(v)) == sp.zeros(3, 1)


def rand(n, size=1):
    return matrix([mpf(random.uniform(-size, size)) for _ in range(n)])


def dot(x, y):
    return (x.T * y)[0]


def cross(x, y):
    return matrix([x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]])


def unit(x):
    return x / norm(x)


def rotation():
    q, _ = qr(matrix([[mpf(random.gauss(0, 1)) for _ in range(3)] for _ in range(3)]))
    return q * det(q)


def plane_normal(rays):
    ab, bc, ac = cross(rays[0], rays[1]), cross(rays[1], rays[2]), cross(rays[0], rays[2])
    return unit(ab * dot(ab, ac) + bc * dot(bc, ac) + ac * dot(ac, ac))


def candidates(rays, l_a, l_c, g, rho):
    """Section 2 and 3; poses as (r1, r2, place of B)."""
    n = plane_normal(rays)
    m = unit(rays[1] - n * dot(n, rays[1]))
    e = cross(n, m)
    p_a, q_a, p_c, q_c = dot(rays[0], m), dot(rays[0], e), dot(rays[2], m), dot(rays[2], e)
    dep, am, ae = l_a * l_c * (p_a * q_c - p_c * q_a), l_c * q_a * p_c - l_a * p_a * q_c, q_a * q_c * (l_c - l_a)
    s = mp.sign(dep) / sqrt(am**2 + ae**2)
    place, r1 = m * (dep * s), m * (am * s) + e * (ae * s)
    foot, d = place + r1 * g, rays[3]
    miss = norm(cross(d, foot))
    spread = sqrt(max(rho**2 - miss**2, mpf(0)))
    found = []
    for depth in (dot(d, foot) + spread, dot(d, foot) - spread):
        across = d * depth - foot
        across = across - r1 * dot(r1, across)
        found.append((r1, unit(across), place, depth))
    return found, foot


def worst_ray(candidate, rays, layout, g, rho):
    r1, r2, place, _ = candidate
    points = [place + r1 * t for t in layout] + [place + r1 * g + r2 * rho]
    return max(norm(cross(unit(x), r)) for x, r in zip(points, rays))


def scene(on_critical_plane):
    while True:
        R = rotation()
        r1, r2 = R[:, 0], R[:, 1]
        place = matrix([mpf(random.uniform(-1, 1)), mpf(random.uniform(-1, 1)), mpf(random.uniform(3, 6))])
        l_a, l_c, rho = -mpf(random.uniform(0.3, 1)), mpf(random.uniform(0.3, 1)), mpf(random.uniform(0.4, 1))
        # The camera centre is the origin: it lies in the plane through D perpendicular to r1 when r1 . D = 0.
        g = -dot(r1, place) if on_critical_plane else mpf(random.uniform(-1, 1))
        points = [place + r1 * l_a, place, place + r1 * l_c, place + r1 * g + r2 * rho]
        if all(x[2] > 0.5 for x in points):
            return (r1, r2, place), [unit(x) for x in points], [l_a, mpf(0), l_c], g, rho, points[3]


both_fit = 0
for i in range(200):
    critical = i % 2 == 1
    truth, rays, layout, g, rho, D = scene(critical)
    found, foot = candidates(rays, layout[0], layout[2], g, rho)
    errors = [norm(f[0] - truth[0]) + norm(f[1] - truth[1]) + norm(f[2] - truth[2]) for f in found]
    assert min(errors) < TINY, errors
    # (8): the false root misses exactly by (lambda' - lambda) r1.d; theorem: zero on the critical plane, nowhere else.
    true, false = (found[0], found[1]) if errors[0] < errors[1] else (found[1], found[0])
    r1, d = truth[0], rays[3]
    assert abs(dot(r1, d * false[3] - foot) - (false[3] - true[3]) * dot(r1, d)) < TINY
    if false[3] > 0:
        fits = worst_ray(false, rays, layout, g, rho) < TINY
        assert fits == critical
        both_fit += fits
        # Its place is the mirror image of D in the plane of the line and the perpendicular to it and to d.
        if critical:
            assert abs(norm(d * false[3] - foot) - rho) < TINY and abs(dot(r1, d)) < TINY
            assert max(errors) > mpf(10) ** -6
assert both_fit > 30

# (8): to first order in r1.d, the camera 1e-15 m beside the critical plane.
for _ in range(20):
    truth, rays, layout, g, rho, D = scene(True)
    r1, r2, place = truth
    g += mpf(10) ** -15
    rays[3] = unit(place + r1 * g + r2 * rho)
    found, foot = candidates(rays, layout[0], layout[2], g, rho)
    found.sort(key=lambda f: norm(f[1] - r2))
    true, false = found
    if false[3] > 0:
        seen = norm(cross(unit(foot + false[1] * rho), rays[3]))
        stated = abs((false[3] - true[3]) * dot(r1, rays[3])) / false[3]
        assert abs(seen / stated - 1) < mpf(10) ** -9

# (2): one step of power iteration shrinks the start's error by the noise squared.
for noise in (mpf(10) ** -3, mpf(10) ** -5):
    for _ in range(10):
        _, rays, *_ = scene(False)
        rays = [unit(r + rand(3, noise)) for r in rays[:3]]
        spread = sum((r * r.T for r in rays), matrix(3, 3))
        _, vectors = eigsy(spread)
        least, ours = vectors[:, 0], plane_normal(rays)
        start = unit(cross(rays[0], rays[2]))
        sine = norm(cross(least, ours))
        assert sine < 3000 * noise**2 * norm(cross(least, start)) + TINY, (noise, sine)

print("line_plus_one.md: all equations hold; the false root fits exactly on the critical plane and nowhere else")
