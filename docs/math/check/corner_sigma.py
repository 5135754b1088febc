"""Checks docs/math/corner_sigma.md. Exits nonzero when an equation does not hold."""

import numpy as np
import sympy as sp


def zero(expression, name):
    assert sp.simplify(expression) == 0, name
    print(f"ok  {name}")


# (1): a Gaussian's variance C more of blur adds half of C times the second derivative (heat equation), to first order.
u, s, c = sp.symbols("u s c", positive=True)
edge = sp.erf(u / sp.sqrt(2 * (s**2 + c)))
zero(sp.diff(edge, c).subs(c, 0) - sp.diff(edge.subs(c, 0), u, 2) / 2, "(1) excess of the blur")
m = sp.symbols("m")
T = sp.Function("T")
zero(sp.diff(T(u * (1 + m)), m).subs(m, 0).doit() - u * sp.diff(T(u), u), "(1) departure of the map")

# (3): sum of squared slopes of an edge from -1 to 1 times g.
g, sigma, length = sp.symbols("g sigma L", positive=True)
slope = sp.diff(g * sp.erf(u / (sp.sqrt(2) * s)), u)
information = 2 * sp.integrate(slope**2, (u, 0, sp.oo)) * length / sigma**2
zero(1 / information - 2 * sp.sqrt(sp.pi) * s * sigma**2 / ((2 * g) ** 2 * length), "(3) bound of an edge")

# (4): sums over all squares weigh pairs by the triangle.
b = 3
for du in range(5):
    count = sum(1 for k in range(-10, 10) if k <= 0 < k + b and k <= du < k + b)
    assert count == max(0, b - du)
print("ok  (4) weights of pairs")


def x_corner(blur, half):
    """An X of two edges at 81 degrees, blurred, as values on whole pixels, with room for slopes."""
    over, reach = 8, half + 2
    grid = (np.arange((2 * reach + 1) * over + 8 * over) + 0.5) / over - reach - 4.5
    x, y = np.meshgrid(grid - 0.2, grid + 0.3)
    ink = np.sign(np.cos(0.4) * x + np.sin(0.4) * y) * np.sign(-np.sin(0.55) * x + np.cos(0.55) * y)
    steps = np.arange(-4 * over, 4 * over + 1) / over
    kernel = np.exp(-0.5 * (steps / blur) ** 2)
    kernel = np.convolve(kernel / kernel.sum(), np.ones(over) / over)
    for axis in (0, 1):
        ink = np.apply_along_axis(lambda line: np.convolve(line, kernel, "same"), axis, ink)
    first = 4 * over + over // 2
    return ink[first::over, first::over][: 2 * reach + 1, : 2 * reach + 1]


def rows(blur, half):
    t = x_corner(blur, half)
    du, dv = (np.roll(t, -1, 1) - np.roll(t, 1, 1)) / 2, (np.roll(t, -1, 0) - np.roll(t, 1, 0)) / 2
    uu, vv = np.roll(t, -1, 1) + np.roll(t, 1, 1) - 2 * t, np.roll(t, -1, 0) + np.roll(t, 1, 0) - 2 * t
    uv = (np.roll(du, -1, 0) - np.roll(du, 1, 0)) / 2
    place = np.arange(t.shape[0]) - half - 2
    x, y = np.meshgrid(place - 0.2, place + 0.3)
    all_rows = np.stack([np.ones_like(t), t, -du, -dv, uu, uv, vv, du * x, du * y, dv * x, dv * y], -1)
    return all_rows[2:-2, 2:-2].reshape(-1, 11)


def normal(design, noise_share2):
    prior = np.zeros(11)
    prior[4:7], prior[7:] = noise_share2, noise_share2 / 0.01
    return design.T @ design + np.diag(prior)


def pairs(width, b):
    """How often each pixel lies in a square or in the one opposite to it, of every square that touches the window."""
    for i in range(width + b - 1):
        for j in range(width + b - 1):
            held = np.zeros((width + 2 * b - 2,) * 2)
            held[i : i + b, j : j + b] = 1
            inside = held[b - 1 : b - 1 + width, b - 1 : b - 1 + width]
            yield (inside + inside[::-1, ::-1]).ravel()


# (4a): the slopes of an even print are odd, so an even residual pulls in opposite directions.
x, y = sp.symbols("x y")
even = sp.Function("E")(x**2, x * y, y**2)
for along in (x, y):
    slope = sp.diff(even, along)
    zero(slope.subs({x: -x, y: -y}, simultaneous=True).doit() + slope, "(4a) slopes of an even print are odd")

# (5), (6): what white noise shows.
worst = 0.0
for half in (3, 4, 5, 7):
    for blur, b in ((0.5, 3), (1.1, 3), (1.6, 5), (3.0, 7)):
        design, width = rows(blur, half), 2 * half + 1
        inverse = np.linalg.inv(normal(design, 4e-4))
        c = design @ inverse[:, 2:4]
        taken = 2 * inverse - inverse @ design.T @ design @ inverse
        expected = 0.0
        for held in pairs(width, b):
            mixed = (c * held[:, None]).T @ design
            expected += (c**2 * held[:, None] ** 2).sum() - np.trace(mixed @ taken @ mixed.T)
        share = b / width
        ratio = 0.5 * expected / b**2 / np.trace(inverse[2:4, 2:4]) * (1 + 1.5 * share + 1.4 * share**2)
        worst = max(worst, abs(ratio - 1))
assert worst < 0.15, worst
print(f"ok  (6) within {100 * worst:.0f} %")

# (2), (4), (5) by drawing: the mean of V and the variance of the shift.
rng, half, b = np.random.default_rng(4), 5, 3
design, width, g, sigma = rows(0.8, half), 11, 100.0, 4.0
inverse = np.linalg.inv(normal(design, (sigma / g) ** 2))
held_by = np.array(list(pairs(width, b)))
shifts, shown = [], []
for _ in range(1500):
    image = 30.0 + g * design[:, 1] + sigma * rng.standard_normal(len(design))
    x = inverse @ design.T @ image
    pulls = (design @ inverse[:, 2:4]) * (image - design @ x)[:, None] / x[1]
    shifts.append(x[2:4] / x[1])
    shown.append(0.5 * ((held_by @ pulls) ** 2).sum() / b**2)
stated = sigma**2 / g**2 * np.trace(inverse[2:4, 2:4])
share = b / width
drawn = (np.mean(np.square(shifts), 0)).sum()
assert abs(drawn / stated - 1) < 0.08, (drawn, stated)
assert abs(np.mean(shown) * (1 + 1.5 * share + 1.4 * share**2) / stated - 1) < 0.15
print("ok  (2), (4) by drawing")
