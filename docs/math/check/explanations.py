"""Checks docs/math/explanations.md: probabilities (1), evidence of a parameter (2), its limit (3) and expectation. Needs NumPy, SymPy."""

import numpy as np
import sympy as sp

# (1): odds against the input as stated, whose own are 1.
o = sp.symbols("o1:4", positive=True)
p = [odds / (1 + sum(o)) for odds in o]
assert sp.simplify(sum(p) + 1 / (1 + sum(o)) - 1) == 0
assert all(sp.simplify(pk / (1 - sum(p)) - ok) == 0 for pk, ok in zip(p, o))

# (2): integrating N(x; θ, C) N(θ; 0, P) over θ gives N(x; 0, C + P), and the posterior mean P/(C + P) x.
x, t = sp.symbols("x theta", real=True)
c, q = sp.symbols("C P", positive=True)
normal = lambda at, variance: sp.exp(-(at**2) / (2 * variance)) / sp.sqrt(2 * sp.pi * variance)
joint = normal(x - t, c) * normal(t, q)
evidence = sp.integrate(joint, (t, -sp.oo, sp.oo))
assert sp.simplify(evidence / normal(x, c + q)) == 1
mean = sp.integrate(t * joint, (t, -sp.oo, sp.oo)) / evidence
assert sp.simplify(mean - q / (c + q) * x) == 0

# (3): for many degrees of freedom the logarithm of the normal density, but for a constant.
nu, d2 = sp.symbols("nu d2", positive=True)
for n in (1, 3, 4):
    assert sp.limit(-(nu + n) / 2 * sp.log(1 + d2 / nu), nu, sp.oo) == -d2 / 2

# (3) is Student's t: integrating the normal density over a variance of ν degrees of freedom.
s = sp.symbols("s", positive=True)
for n, dof in ((1, 8), (3, 9), (4, 12)):
    weight = s ** sp.Rational(dof + n - 2, 2) * sp.exp(-s * (dof + d2) / 2)
    density = sp.integrate(weight, (s, 0, sp.oo))
    ratio = density / (1 + d2 / dof) ** (-sp.Rational(dof + n, 2))
    assert sp.simplify(sp.diff(sp.simplify(ratio), d2)) == 0, (n, dof)

# (4): the posterior mean in four dimensions, by sampling.
random = np.random.default_rng(3)
root = random.normal(size=(4, 4))
C, P = root @ root.T, np.diag([0.5, 1.0, 2.0, 0.3])
theta = random.multivariate_normal(np.zeros(4), P, 400_000)
seen = theta + random.multivariate_normal(np.zeros(4), C, 400_000)
gain = np.linalg.lstsq(seen, theta, rcond=None)[0].T
assert np.allclose(gain, P @ np.linalg.inv(C + P), atol=0.01)
print("explanations: ok")
