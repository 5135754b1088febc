"""Checks equations (51) and (52) of section 7 of monitor.md: the mean square of a block, and what it does to a likelihood ratio.

Run: python3 docs/math/check/monitor_rig_noise.py
"""

import math
import random

random.seed(52)


def block_mean_square(errors, length, runs):
    """Mean of c²/d of a known constant, unit variances: c the sum of a block, d its length."""
    total = 0.0
    for _ in range(runs):
        draw = errors(length)
        total += sum(draw) ** 2 / length
    return total / runs


def white(length):
    return [random.gauss(0, 1) for _ in range(length)]


def correlated(share, time):
    kept = math.exp(-1 / time)

    def draw(length):
        b, out = random.gauss(0, 1), []
        for _ in range(length):
            b = kept * b + math.sqrt(1 - kept**2) * random.gauss(0, 1)
            out.append(math.sqrt(1 - share) * random.gauss(0, 1) + math.sqrt(share) * b)
        return out

    return draw


def exact(share, time, length):
    """1 + 2 share Σ (1 − l/T) e^(−l/τ)."""
    kept = math.exp(-1 / time)
    return 1 + 2 * share * sum((1 - lag / length) * kept**lag for lag in range(1, length))


for share, time, length in [(0.0, 1.0, 16), (0.3, 10.0, 4), (0.3, 10.0, 64), (0.7, 60.0, 256)]:
    runs = 4000
    draw = white if share == 0 else correlated(share, time)
    seen, wanted = block_mean_square(draw, length, runs), exact(share, time, length)
    # c²/d is f² times χ² of one degree of freedom: its standard deviation is √2 f².
    assert abs(seen - wanted) < 5 * wanted * math.sqrt(2 / runs), (share, time, length, seen, wanted)
    print(f"ok  f² of {share}, {time} s, {length} moments: {seen:.2f}, exactly {wanted:.2f}")

# The exponent of (23) beside errors f² times as large is f² times too large: divided by f² it has its mean again.
for factor in (1.0, 3.0, 9.0):
    scores = [math.sqrt(factor) * random.gauss(0, 1) for _ in range(40_000)]
    mean = sum(0.5 * c * c for c in scores) / len(scores) / factor
    assert abs(mean - 0.5) < 5 * math.sqrt(0.5 / len(scores)), (factor, mean)
print("ok  exponents divided by f²")

# (51): the fixed point of the recursion is the scale by which χ² is too large.
scale, n = 1.0, 12
for i in range(1, 20_001):
    chi2 = 4.0 * sum(random.gauss(0, 1) ** 2 for _ in range(n)) / scale
    cut = min(chi2, n + 6 * math.sqrt(2 * n))
    scale *= 1 + (cut / n - 1) / (min(i, 200) + 20)
assert abs(scale / 4.0 - 1) < 0.12, scale
print(f"ok  s² follows a variance four times as large: {scale:.2f}")
