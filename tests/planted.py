"""Simulated tests with one thing planted in each, and how often it is found: `python tests/planted.py [COUNT]`."""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import tissuq as tq

Array = NDArray[np.float64]
Curve = tuple[Array, Array]


def tension(stretch: Array) -> Array:
    """Return the stress of a neo-Hookean material."""
    return stretch - stretch**-2


def invariant(stretch: Array) -> Array:
    """Return I1 - 3."""
    return stretch**2 + 2 / stretch - 3


def share(values: Array) -> Array:
    """Return sizes over the largest."""
    return np.abs(values) / np.abs(values).max()


LAWS: dict[str, Callable[[Array, np.random.Generator], Array]] = {
    "straight": lambda x, r: x - 1,
    "neo-Hookean": lambda x, r: tension(x),
    "Mooney-Rivlin": lambda x, r: tension(x) * (1 + r.uniform(0.2, 3) / x),
    "Yeoh": lambda x, r: tension(x) * (1 + r.uniform(0.5, 6) * invariant(x)),
    "Ogden": lambda x, r: (lambda a: (x ** (a - 1) - x ** (-a / 2 - 1)) / a)(r.choice([-1, 1]) * r.uniform(4, 14)),
    "softening": lambda x, r: np.sign(x - 1) * -np.expm1(-r.uniform(1, 4) * share(x - 1)),
    "Gent": lambda x, r: tension(x) / (1 - share(invariant(x)) / r.uniform(1.05, 1.6)),
}
STIFFENING: dict[str, Callable[[Array, np.random.Generator], Array]] = {
    "exponential, 1 to 4": lambda x, r: np.sign(x - 1) * np.expm1(r.uniform(1, 4) * share(x - 1)),
    "exponential, 4 to 6": lambda x, r: np.sign(x - 1) * np.expm1(r.uniform(4, 6) * share(x - 1)),
    "Demiray": lambda x, r: tension(x) * np.exp(r.uniform(0.5, 3.5) * share(invariant(x))),
    "fibres": lambda x, r: (
        lambda e: np.sign(x - 1) * (r.uniform(0.02, 0.2) * share(tension(x)) + e * np.exp(2 * e**2))
    )(share(x**2 - 1)),
    "power": lambda x, r: np.sign(x - 1) * (r.uniform(0.03, 0.2) * share(x - 1) + share(x - 1) ** r.uniform(2, 4)),
}
"""J-shaped: the slope at the start is 2 to 50 % of the mean one."""
ROWS, NOISES = (40, 100, 201, 1000), (0.0, 1e-3, 3e-3, 1e-2, 2e-2)


class Planting:
    """Random tests of one law: a branch of loading, with what is planted in it."""

    def __init__(self, random: np.random.Generator, law: str, noise: float | None = None) -> None:
        self.random, self.count = random, int(random.choice(ROWS))
        self.noise = float(random.choice(NOISES)) if noise is None else noise
        self.range = float(random.choice([1, -1]) * random.uniform(0.1, 0.45))
        self._law, self._seed = (LAWS | STIFFENING)[law], int(random.integers(1 << 30))

    def of(self, way: Array) -> Array:
        """Return the stress over the largest at shares of the way, without noise."""
        steps = np.linspace(0, 1, 2001)
        stress = self._law(1 + self.range * steps, np.random.default_rng(self._seed))
        return np.interp(way, steps, stress / np.abs(stress).max())

    def noisy(self, stress: Array) -> Array:
        """Return stresses with noise."""
        return stress + self.noise * self.random.standard_normal(len(stress))

    @property
    def way(self) -> Array:
        """Even shares of the way."""
        return np.linspace(0, 1, self.count)

    def stretch(self, way: Array) -> Array:
        """Return the stretches at shares of the way."""
        return 1 + self.range * way

    def clean(self) -> Curve:
        """A branch."""
        return self.stretch(self.way), self.noisy(self.of(self.way))

    def cycles(self) -> Curve:
        """Triangles or waves with hysteresis."""
        phase = np.linspace(0, int(self.random.integers(1, 4)), max(2 * self.count, 80))
        is_wave, loss = self.random.random() < 0.5, self.random.uniform(0, 0.3)
        way = (1 - np.cos(2 * np.pi * phase)) / 2 if is_wave else 1 - np.abs(2 * (phase % 1) - 1)
        is_back = phase % 1 > 0.5
        stress = self.of(way)
        return self.stretch(way), self.noisy(np.where(is_back, stress * (1 - loss * (1 - way)), stress))

    def slack(self, share_of_way: float) -> Curve:
        """No load over the first share of the way."""
        taut = np.maximum(self.way - share_of_way, 0) / (1 - share_of_way)
        return self.stretch(self.way), self.noisy(self.of(taut))

    def rupture(self) -> Curve:
        """The specimen tears at once, slowly, or by a half."""
        more = max(4, int(self.count * self.random.uniform(0.05, 0.4)))
        left, rows = {0: (0.02, 1), 1: (0.1, more / 2), 2: (0.5, 1)}[int(self.random.integers(3))]
        after = 1 - (1 - left) * np.clip(np.arange(1, more + 1) / rows, 0, 1)
        way = np.concatenate([self.way, 1 + np.arange(1, more + 1) / self.count])
        return self.stretch(way), self.noisy(np.concatenate([self.of(self.way), self.of(np.ones(1)) * after]))

    def hold(self) -> Curve:
        """A hold at the end, in which the stress relaxes by 12 to 50 %."""
        rows, loss = max(12, int(self.count * self.random.uniform(0.2, 2))), self.random.uniform(0.12, 0.5)
        relaxing = self.of(np.ones(1)) * (1 - loss * -np.expm1(-np.linspace(0, 5, rows)))
        way = np.concatenate([self.way, np.ones(rows)])
        return self.stretch(way), self.noisy(np.concatenate([self.of(self.way), relaxing]))

    def slip(self) -> Curve:
        """Once to three times the grips let 3 to 10 % of the largest stress go, eight times the noise at least."""
        stress, places = self.of(self.way), np.sort(self.random.uniform(0.6, 0.9, int(self.random.integers(1, 4))))
        for place in places:
            fall = max(self.random.uniform(0.03, 0.1), 8 * self.noise)
            size = np.abs(stress[int(place * self.count)])
            stress = stress - np.sign(stress[-1]) * (self.way > place) * min(fall, 0.8 * size)
        return self.stretch(self.way), self.noisy(stress)

    def saturation(self) -> Curve:
        """The load cell reads no more than 70 to 93 % of what is there, so that eight rows or more are as large."""
        stress = self.noisy(self.of(self.way))
        limit = min(self.random.uniform(0.7, 0.93), np.sort(np.abs(stress))[-8])
        return self.stretch(self.way), np.clip(stress, -limit, limit)

    def resolution(self) -> Curve:
        """Loads in steps of 1 to 5 % of the largest."""
        step = self.random.uniform(0.01, 0.05)
        return self.stretch(self.way), step * np.rint(self.noisy(self.of(self.way)) / step)

    def stairs(self) -> Curve:
        """Positions in steps that two to eight rows share."""
        step = self.random.uniform(2, 8) / self.count
        return self.stretch(step * np.rint(self.way / step)), self.noisy(self.of(self.way))

    def outlier(self) -> Curve:
        """One to three rows off by 10 to 60 % of the largest stress, or ten times the noise."""
        stretch, stress = self.clean()
        rows = self.random.choice(np.arange(3, self.count - 3, 5), int(self.random.integers(1, 4)), replace=False)
        size = np.maximum(self.random.uniform(0.1, 0.6, len(rows)), 10 * self.noise)
        stress[rows] += self.random.choice([-1, 1], len(rows)) * size
        return stretch, stress

    def drift(self) -> Curve:
        """The zero of the load drifts by 5 to 15 % over a cycle or more."""
        stretch, stress = self.cycles()
        drift = (
            np.sign(stress[np.argmax(np.abs(stress))])
            * self.random.choice([-1, 1])
            * max(self.random.uniform(0.05, 0.15), 5 * self.noise)
        )
        return stretch, stress + drift * np.linspace(0, 1, len(stress))


PLANTED: dict[str, tuple[str, Callable[[Planting], Curve]]] = {
    "slack over a quarter": ("slack", lambda planting: planting.slack(0.25)),
    "rupture": ("rupture", Planting.rupture),
    "hold": ("hold or rupture", Planting.hold),
    "slips": ("slip or rupture", Planting.slip),
    "saturation": ("saturation", Planting.saturation),
    "coarse loads": ("resolution", Planting.resolution),
    "coarse positions": ("resolution", Planting.stairs),
    "outliers": ("outlier", Planting.outlier),
    "drift": ("drift", Planting.drift),
}
"""What is planted: the kind of region that should be found, and the test."""
ALIKE = "slip or rupture", "hold or rupture"
"""Kinds between which the strength or the speed of a fall decides."""
CLEAN: dict[str, Callable[[Planting], Curve]] = {"branch": Planting.clean, "cycles": Planting.cycles}


def kinds_found(curve: Curve, folder: Path) -> set[str]:
    """Return the kinds of regions that are found in a file of a curve."""
    path = folder / "test.csv"
    rows = [f"{stretch:.6f},{stress:.6f}\n" for stretch, stress in zip(*map(np.ndarray.tolist, curve), strict=True)]
    path.write_text("stretch,stress [kPa]\n" + "".join(rows))
    return {region.kind for region in tq.inspect(path).reading.tested[0].regions}


def rates(name: str, count: int, seed: int, laws: list[str], noise: float | None = None) -> Counter[str]:
    """Return in how many of so many tests each kind is found."""
    random, found = np.random.default_rng(seed), Counter[str]()
    make = CLEAN[name] if name in CLEAN else PLANTED[name][1]
    with tempfile.TemporaryDirectory() as folder:
        for number in range(count):
            planting = Planting(random, laws[number % len(laws)], noise)
            kinds = kinds_found(make(planting), Path(folder))
            kinds |= {pair for pair in ALIKE if kinds.intersection(pair.split(" or "))}
            found.update([*kinds, *["any"] * bool(kinds)])
    return found


def main(count: int) -> None:
    """Print a table of rates."""
    for group, laws in (("laws", list(LAWS)), ("J-shaped laws", list(STIFFENING))):
        print(f"{group}, {count} of each")
        for name in CLEAN:
            found = rates(name, count, 1, laws)
            print(f"  clean {name:22} false alarms {found['any'] / count:6.1%}   {besides(found)}", flush=True)
        for name, (kind, _) in PLANTED.items():
            found = rates(name, count, 2, laws)
            print(f"  {name:28} found {found[kind] / count:6.1%}        besides {besides(found, kind)}", flush=True)


def besides(found: Counter[str], kind: str = "") -> dict[str, int]:
    """Return how many of other kinds were found."""
    return {other: number for other, number in found.items() if other not in {"any", *ALIKE, *kind.split(" or ")}}


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
