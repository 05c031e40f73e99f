"""Discrepancies in the strain energy, single, summed and averaged: they leave the initial shear modulus alone."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tissuq.discrepancy.blocks import (
    Coordinates,
    EnergyBlock,
    HenckyBlock,
    LogBlock,
    SecondInvariantBlock,
    SplineBlock,
    TaylorBlock,
    ValanisLandelBlock,
    ZeroModulusBlock,
)
from tissuq.discrepancy.discrepancy import Discrepancy
from tissuq.errors import ModelError
from tissuq.experiments.modes import Path
from tissuq.mechanics.path import invariant_rates, invariants, log_stretches
from tissuq.parameters import Parameter
from tissuq.priors import HalfCauchy

__all__ = [
    "Auto",
    "AutoBalanced",
    "AutoSharp",
    "EnergyDiscrepancy",
    "EnergySum",
    "Member",
    "energy_sum",
    "side_by_side",
]

FloatArray = NDArray[np.float64]

AMPLITUDES = tuple(
    Parameter(symbol, f"amplitude of the {place} energy", "modulus", (0.0, float("inf")), False, HalfCauchy(1.0))
    for symbol, place in (("c1", "first"), ("c2", "second"))
)
SOURCE = "tissuq (energy discrepancy)"


class Sum(NamedTuple):
    """Blocks in the order of the amplitudes, None where there is none with that amplitude, and the prior odds."""

    blocks: tuple[EnergyBlock | None, ...]
    odds: float = 1.0


@dataclass(frozen=True)
class Member:
    """A sum of at most two blocks, each at one of its length scales, as measured over a range of stretches.

    ``places`` says for each block which of the amplitudes is its own; ``probability`` is the member's before data.
    """

    blocks: tuple[EnergyBlock, ...]
    places: tuple[int, ...]
    lengths: tuple[float, ...]
    reaches: tuple[tuple[float, float], ...]
    probability: float

    @property
    def name(self) -> str:
        """The blocks' names, joined."""
        return "+".join(block.name for block in self.blocks) or "none"

    def stress_features(self, mode: Path, stretch: FloatArray) -> list[FloatArray]:
        """Return the engineering stresses (n, r) of each block's terms."""
        parts = zip(self.blocks, self.reaches, self.lengths, strict=True)
        return [block.stress_features(mode, stretch, reach, length) for block, reach, length in parts]

    def stress_variances(self, mode: Path, stretch: FloatArray) -> list[FloatArray]:
        """Return the variance (n,) of the stress of each block at unit amplitude."""
        parts = zip(self.blocks, self.reaches, self.lengths, strict=True)
        return [block.stress_variance(mode, stretch, reach, length) for block, reach, length in parts]

    def wide_features(self, mode: Path, stretch: FloatArray) -> list[tuple[FloatArray, int]]:
        """Return of each block the stresses (n, q) of its terms at any stretches, and how many of them serve the data.

        The latter come first and are the `stress_features`; the others are what beyond the data nothing is known of.
        """
        (first, second), (logs, rates) = invariant_rates(mode, stretch), log_stretches(mode, stretch)
        at = Coordinates(*invariants(mode, stretch), logs.ravel())
        return [
            (
                own.first * first[:, None]
                + own.second * second[:, None]
                + np.einsum("nkq,nk->nq", own.logarithm.reshape(*logs.shape, -1), rates),
                count,
            )
            for own, count in self.slopes(at)
        ]

    def slopes(self, at: Coordinates) -> list[tuple[Coordinates, int]]:
        """Return of each block the slopes of its terms, as `EnergyBlock.slopes`, and how many serve the data."""
        parts = zip(self.blocks, self.reaches, self.lengths, strict=True)
        return [(block.slopes(at, reach, length), block.count(reach, length)) for block, reach, length in parts]


def side_by_side(features: list[FloatArray], count: int) -> FloatArray:
    """Return the terms of all blocks of a member in one array (n, q) for n = ``count`` stretches; it may have none."""
    return np.hstack([np.zeros((count, 0)), *features])


@dataclass(frozen=True)
class EnergyDiscrepancy(Discrepancy):
    """A random strain energy of zero energy, stress and modulus at the reference, averaged over some sums of blocks.

    Every length scale of a sum's blocks has the same prior probability; the posterior is the mixture that the evidence
    weights. Each block has an amplitude, half-Cauchy with the data's pilot modulus as its scale.
    """

    source = SOURCE
    is_energy = True
    caution = (
        "The initial shear modulus is the material's own; its other parameters (such as C20) share their meaning with "
        "the discrepancy. It covers an error of the material, not of the test: a wrong area or gauge length scales all."
    )
    sums: ClassVar[tuple[Sum, ...]]

    def members(self, mode: Path, stretch: FloatArray) -> list[Member]:
        """Return every sum of blocks at every combination of their length scales, over the range of stretches (n,)."""
        found, total = [], sum(each.odds for each in self.sums)
        for every, odds in self.sums:
            places = tuple(place for place, block in enumerate(every) if block is not None)
            blocks = tuple(block for block in every if block is not None)
            reaches = tuple(block.reach(mode, stretch) for block in blocks)
            choices = list(product(*(block.lengths for block in blocks)))
            probability = odds / total / len(choices)
            found += [Member(blocks, places, lengths, reaches, probability) for lengths in choices]
        return found


class _Single(EnergyDiscrepancy):
    """One block."""

    parameters = AMPLITUDES[:1]


class Taylor(_Single):
    """An infinite Yeoh: independent normal Taylor coefficients in I1 - 3."""

    name = TaylorBlock.name
    formula = TaylorBlock.formula
    sums = (Sum((TaylorBlock(),)),)


class Logarithmic(_Single):
    """A process in log(I1 - 2): fast change near the reference."""

    name = LogBlock.name
    formula = LogBlock.formula
    sums = (Sum((LogBlock(),)),)


class Spline(_Single):
    """An integrated Wiener process in I1 - 3."""

    name = SplineBlock.name
    formula = SplineBlock.formula
    sums = (Sum((SplineBlock(),)),)


class ZeroModulus(_Single):
    """The Mooney-Rivlin term without its initial modulus."""

    name = ZeroModulusBlock.name
    formula = ZeroModulusBlock.formula
    sums = (Sum((ZeroModulusBlock(),)),)


class SecondInvariant(_Single):
    """An infinite series in I2 - 3, its initial modulus taken out by I1."""

    name = SecondInvariantBlock.name
    formula = SecondInvariantBlock.formula
    sums = (Sum((SecondInvariantBlock(),)),)


class Hencky(_Single):
    """A separable function of the principal stretches: an infinite Ogden."""

    name = HenckyBlock.name
    formula = HenckyBlock.formula
    sums = (Sum((HenckyBlock(),)),)


class ValanisLandel(_Single):
    """A separable function of the principal stretches."""

    name = ValanisLandelBlock.name
    formula = ValanisLandelBlock.formula
    sums = (Sum((ValanisLandelBlock(),)),)


@dataclass(frozen=True)
class EnergySum(EnergyDiscrepancy):
    """The sum of two blocks."""

    blocks: tuple[EnergyBlock, ...] = ()

    parameters = AMPLITUDES

    @property
    def sums(self) -> tuple[Sum, ...]:  # type: ignore[override]  # of the object, not the class
        """The one sum."""
        return (Sum(self.blocks),)

    @property
    def name(self) -> str:  # type: ignore[override]
        """The blocks' names, joined."""
        return "+".join(block.name for block in self.blocks)

    @property
    def formula(self) -> str:  # type: ignore[override]
        """The blocks' formulas, joined."""
        return "; and ".join(block.formula for block in self.blocks)


FIRST, SECOND = (TaylorBlock(), LogBlock()), (SecondInvariantBlock(), HenckyBlock())
PAIRS = tuple(Sum(pair) for pair in product(FIRST, SECOND))
SINGLES: tuple[tuple[EnergyBlock | None, ...], ...] = (
    *((block, None) for block in FIRST),
    *((None, block) for block in SECOND),
)


class Auto(EnergyDiscrepancy):
    """The evidence decides: the average of {taylor, log} + {second-invariant, hencky}, and of their single blocks.

    A single block has a quarter of the prior odds of a sum.
    """

    name = "auto"
    formula = "average of {taylor, log} + {second-invariant, hencky} and, at a quarter of their odds, each one alone"
    parameters = AMPLITUDES
    sums = (*PAIRS, *(Sum(blocks, 0.25) for blocks in SINGLES))


class AutoBalanced(EnergyDiscrepancy):
    """The average of the same at equal odds: narrower, and more often wrong."""

    name = "auto-balanced"
    formula = "average of the sums and single blocks of auto at equal odds"
    parameters = AMPLITUDES
    sums = (*PAIRS, *map(Sum, SINGLES))


class AutoSharp(EnergyDiscrepancy):
    """The average of the same, and of no discrepancy: narrowest, and wrong where a small discrepancy hides in noise."""

    name = "auto-sharp"
    formula = "average of auto-balanced and no discrepancy"
    parameters = AMPLITUDES
    sums = (*AutoBalanced.sums, Sum(()))


def energy_sum(names: str) -> EnergySum | None:
    """Return the sum of two blocks named with a plus sign between them, or None when these are other names."""
    others = (SplineBlock(), ZeroModulusBlock(), ValanisLandelBlock())
    known = {block.name: block for block in (*FIRST, *SECOND, *others)}
    parts = [part.strip() for part in names.split("+")]
    if len(parts) < 2 or not any(part in known for part in parts):
        return None
    unknown = [part for part in parts if part not in known]
    if unknown or len(parts) > 2 or len(set(parts)) < 2:
        raise ModelError(
            f"discrepancy '{names}': a sum has two different ones of the energies {', '.join(known)}"
            + (f"; '{unknown[0]}' is none of them." if unknown else ".")
        )
    return EnergySum(tuple(known[part] for part in parts))
