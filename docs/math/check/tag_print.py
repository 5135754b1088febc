"""Checks docs/math/tag_print.md. Exits nonzero when an equation does not hold."""

import mpmath as mp
import numpy as np
import sympy as sp

# (1), (2): one crossing of two lines through a correlated Gaussian, by the series and by the bivariate normal distribution.
for rho, bar in ((0.0, 1e-6), (0.3, 2e-3), (-0.5, 1.2e-2)):
    for a, b in ((0.3, -0.4), (1.2, 0.7), (-2.0, 0.1)):
        series = rho * (1 + rho * (0.5 * a * b + rho / 6 * (a * a - 1) * (b * b - 1)))
        closed = mp.ncdf(a) * mp.ncdf(b) + mp.npdf(a) * mp.npdf(b) * series
        under = lambda x: mp.npdf(x) * mp.ncdf((b - rho * x) / mp.sqrt(1 - rho * rho))
        assert abs(closed - mp.quad(under, [-mp.inf, a])) < bar, (rho, a, b)
print("ok  (2) tetrachoric series")

rng = np.random.default_rng(3)
gradients = rng.normal(size=(2, 2))
blur = np.array([[1.3, 0.4], [0.4, 0.8]])
samples = rng.multivariate_normal([0, 0], blur, 400_000) @ gradients.T
assert np.allclose(np.cov(samples.T), gradients @ blur @ gradients.T, rtol=0.02, atol=0.02)
print("ok  (1) blur in the coordinates of the plane")

# (3): a Gaussian's derivative by its covariance.
u, v, uu, uv, vv = sp.symbols("u v uu uv vv")
det = uu * vv - uv**2
density = sp.exp(-(vv * u**2 - 2 * uv * u * v + uu * v**2) / (2 * det)) / (2 * sp.pi * sp.sqrt(det))
for c, d in ((uu, sp.diff(density, u, 2) / 2), (uv, sp.diff(density, u, v)), (vv, sp.diff(density, v, 2) / 2)):
    at = {u: sp.Rational(1, 3), v: sp.Rational(-2, 5), uu: sp.Rational(6, 5), uv: sp.Rational(1, 4), vv: sp.Rational(4, 5)}
    assert sp.N((sp.diff(density, c) - d).subs(at), 30) < 1e-20
print("ok  (3) derivatives by the blur")

# (4): homographies and the displacements that vanish at the corners are all quadratic displacements of the unit square.
s, t = np.meshgrid(np.linspace(0, 1, 7), np.linspace(0, 1, 7))
s, t = s.ravel(), t.ravel()
zero, one = np.zeros_like(s), np.ones_like(s)
affine = [(f, zero) for f in (one, s, t)] + [(zero, f) for f in (one, s, t)]
perspective = [(s * s, s * t), (s * t, t * t)]
bows = [(t * (1 - t), zero), (zero, s * (1 - s)), (s * (1 - s), zero), (zero, t * (1 - t))]
ours = np.array([np.concatenate(f) for f in affine + perspective + bows])
quadratic = np.array([np.concatenate(f) for m in (one, s, t, s * s, s * t, t * t) for f in ((m, zero), (zero, m))])
rank = np.linalg.matrix_rank
assert rank(ours) == rank(quadratic) == rank(np.vstack([ours, quadratic])) == 12
print("ok  (4) all quadratic displacements")
