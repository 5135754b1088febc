"""Proves the equations of monitor.md, section 7: a rig whose target is carried about.

Run: python3 docs/math/check/monitor_rig.py
"""

import random

import mpmath as mp
from se3 import adjoint, exp, small_log

mp.mp.dps = 50
random.seed(7)
TINY = mp.mpf(10) ** -38


def close(name, a, b, tolerance=TINY):
    error = mp.norm(a - b, mp.inf) / max(1, mp.norm(a, mp.inf)) if hasattr(a, "rows") else abs(a - b) / max(1, abs(a))
    assert error < tolerance, (name, error)
    print(f"ok  {name}")


def vector(n, scale=1):
    return mp.matrix([mp.mpf(random.gauss(0, 1)) * scale for _ in range(n)])


def positive(n):
    root = mp.matrix(n, n)
    for i in range(n):
        for j in range(n):
            root[i, j] = mp.mpf(random.gauss(0, 1))
    return root * root.T + mp.eye(n) / 10


def trace(m):
    return sum(m[i, i] for i in range(m.rows))


def take(m, rows, columns):
    return mp.matrix([[m[i, j] for j in columns] for i in rows])


# (18): the camera moved by α, the target's place was taken wrongly by β; what is left is of second order.
place, target = exp(vector(6)), exp(vector(6))
for scale in (mp.mpf(10) ** -8, mp.mpf(10) ** -12):
    alpha, beta = vector(6, scale), vector(6, scale)
    seen = mp.inverse(exp(alpha)) * place * exp(beta) * target
    y = small_log(place * target * mp.inverse(seen))
    close(f"(18) at {mp.nstr(scale, 1)}", (alpha - adjoint(place) * beta) / scale, y / scale, 100 * scale)

# (19): carried into the rig frame β is common, so that differences are free of it.
places = [exp(vector(6)) for _ in range(4)]
alphas, beta = [vector(6) for _ in places], vector(6)
z = [mp.inverse(adjoint(c)) * (a - adjoint(c) * beta) for c, a in zip(places, alphas)]
free = [mp.inverse(adjoint(c)) * a for c, a in zip(places, alphas)]
for c in range(1, 4):
    close(f"(19) camera {c}", z[c] - z[0], free[c] - free[0])

# Differences with another camera are a regular map of these (one coordinate stands for six): likelihoods agree.
variances = [mp.mpf(random.uniform(0.5, 2)) for _ in range(4)]
values = vector(4)


def differences(reference):
    others = [c for c in range(4) if c != reference]
    d = mp.matrix([values[c] - values[reference] for c in others])
    noise = mp.diag([variances[c] for c in others]) + variances[reference] * mp.ones(3)
    return (d.T * mp.inverse(noise) * d)[0], mp.det(noise)


for reference in range(1, 4):
    close(f"(19) χ² with camera {reference} as reference", differences(0)[0], differences(reference)[0])
    close(f"(19) determinant with camera {reference} as reference", differences(0)[1], differences(reference)[1])

# (22), (23): the average of the likelihood ratio over δ ~ N(0, Γ), here over one coordinate by quadrature.
c1, d1, gamma = mp.mpf("1.3"), mp.mpf("2.1"), mp.mpf("0.7")
ratio = lambda delta: mp.exp(c1 * delta - d1 * delta**2 / 2) * mp.npdf(delta, 0, mp.sqrt(gamma))
average = mp.quad(ratio, [-mp.inf, -3, 0, 3, mp.inf])
close("(23)", average, mp.exp(c1**2 / (d1 + 1 / gamma) / 2) / mp.sqrt(1 + gamma * d1), mp.mpf(10) ** -30)

# (25): what a set leaves is twice the loss of log-likelihood against all being free.
d, c = positive(6), vector(6)
inside = [1, 2, 4]
best_all = mp.inverse(d) * c
best_set = mp.matrix(6, 1)
for i, value in zip(inside, mp.inverse(take(d, inside, inside)) * mp.matrix([c[i] for i in inside])):
    best_set[i] = value
loglik = lambda delta: (c.T * delta)[0] - (delta.T * d * delta)[0] / 2
c_s = mp.matrix([c[i] for i in inside])
chi2 = (c.T * mp.inverse(d) * c)[0] - (c_s.T * mp.inverse(take(d, inside, inside)) * c_s)[0]
close("(25)", chi2, 2 * (loglik(best_all) - loglik(best_set)))
for i in inside:
    nudged = best_set.copy()
    nudged[i] += mp.mpf(10) ** -10
    assert loglik(nudged) < loglik(best_set)

# (26), (27): with the true s² the expectation of vᵀP⁻¹v is s² ρ, so that the ratio's expectation is s².
covariances, scales = [positive(6) for _ in range(3)], [mp.mpf(s) for s in ("1.5", "0.7", "2.2")]
weights = [mp.inverse(s * p) for s, p in zip(scales, covariances)]
together = mp.inverse(weights[0] + weights[1] + weights[2])
for k, (p, s, w) in enumerate(zip(covariances, scales, weights)):
    # v_k = z_k − z̄ is linear in the independent sights: its covariance is summed up from theirs.
    cov_v = mp.zeros(6)
    for j, (pj, sj, wj) in enumerate(zip(covariances, scales, weights)):
        by_sight = (mp.eye(6) if j == k else mp.zeros(6)) - together * wj
        cov_v += by_sight * (sj * pj) * by_sight.T
    rho = 6 - trace(together * w)
    close(f"(26), (27) sight {k}", trace(mp.inverse(p) * cov_v), s * rho)

# (28): a part λ that is forgotten as e^(−Δ/τ) and a white rest κ give correlation q after one moment.
s2, q, tau, step = mp.mpf("1.7"), mp.mpf("0.35"), mp.mpf("2.0"), mp.mpf("0.2")
lam = s2 * q * mp.exp(step / tau)
close("(28) correlation of neighbours", lam * mp.exp(-step / tau) / s2, q)
print("all equations of section 7 hold")
