"""Coverage of the mean modulus by fits of mean curves, with the standard errors of these, without, and as noise.

`python benchmarks/mean_curves.py` takes a few minutes. Specimens are neo-Hookean, with moduli that vary by 30 %
(log-normal), smooth errors of 3 % along each curve and noise.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import t

import tissuq as tq

MEANS, SPECIMENS = 150, (4, 8)
MODULUS, VARIATION, SMOOTH, NOISE = 0.05, 0.3, 0.03, 2e-4  # MPa, shares, MPa
STRETCH = np.linspace(1.0, 1.4, 31)
BASIS = 2 * (STRETCH - STRETCH**-2)
KNOTS = np.linspace(1.0, 1.4, 6)


def mean_curve(count: int, seed: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean stress of specimens and its standard errors, as the reader of files gives them."""
    random, curves = np.random.default_rng(seed), []
    for _ in range(count):
        modulus = MODULUS * np.exp(VARIATION * random.standard_normal() - VARIATION**2 / 2)
        along = 1 + SMOOTH * np.interp(STRETCH, KNOTS, random.standard_normal(len(KNOTS)))
        curves.append(modulus * BASIS * along + NOISE * random.standard_normal(len(STRETCH)))
    return np.mean(curves, axis=0), np.std(curves, axis=0, ddof=1) / count**0.5 * t.ppf(0.975, count - 1) / 1.96


def interval(stress: np.ndarray, error: np.ndarray | None) -> tuple[float, float]:
    """Return the interval of the modulus."""
    data = tq.Experiment("uniaxial", STRETCH, stress, standard_error=error)
    low, high = tq.fit(data, discrepancy="none").summary().loc["C10", ["hdi_low", "hdi_high"]]
    return low, high


def interval_of_noise(stress: np.ndarray, error: np.ndarray) -> tuple[float, float]:
    """Return that of least squares with the standard errors as independent noise of the points."""
    weight = np.maximum(error, 1e-5) ** -2
    precision = weight @ BASIS**2
    modulus, half = weight @ (BASIS * stress) / precision, 1.96 * precision**-0.5
    return modulus - half, modulus + half


def main() -> None:
    """Print in how many means each interval holds the modulus, and its half width."""
    for count in SPECIMENS:
        rows: dict[str, list[tuple[float, float]]] = {"with": [], "without": [], "as noise": []}
        for number in range(MEANS):
            stress, error = mean_curve(count, [count, number])
            rows["with"].append(interval(stress, error))
            rows["without"].append(interval(stress, None))
            rows["as noise"].append(interval_of_noise(stress, error))
        for name, ends in rows.items():
            low, high = np.array(ends).T
            held = ((low < MODULUS) & (high > MODULUS)).mean()
            print(f"{count} specimens, {name}: {held:.0%}, half width {np.mean(high - low) / 2 / MODULUS:.0%}")


if __name__ == "__main__":
    main()
