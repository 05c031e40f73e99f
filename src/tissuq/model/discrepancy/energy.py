"""Discrepancies in the strain energy, single, summed and averaged; and every discrepancy by its name."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import reduce
from itertools import product
from typing import ClassVar, NamedTuple, Self

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import States
from tissuq.mechanics.material import Material
from tissuq.mechanics.rays import Range
from tissuq.model.discrepancy.blocks import (
    Coordinates,
    DirectionBlock,
    EnergyBlock,
    HenckyBlock,
    LogBlock,
    SecondInvariantBlock,
    SmallStrainBlock,
    SplineBlock,
    TaylorBlock,
    ValanisLandelBlock,
    ZeroModulusBlock,
)
from tissuq.model.discrepancy.discrepancy import Discrepancy
from tissuq.parameters.parameter import Parameter
from tissuq.parameters.priors import HalfCauchy
from tissuq.registry import find, variants

AMPLITUDES = tuple(
    Parameter(symbol, f"amplitude of the {index} energy", "modulus", (0.0, float("inf")), False, HalfCauchy(1.0))
    for symbol, index in (("c1", "first"), ("c2", "second"))
)
MEMBERS_OF_SKETCH = 12
"""Members, about, of what stands for all."""
SOURCE = "tissuq (energy discrepancy)"


class Sum(NamedTuple):
    """Blocks in the order of the amplitudes, None where there is none with that amplitude, and the prior odds."""

    blocks: tuple[EnergyBlock | None, ...]
    odds: float = 1.0


@dataclass(frozen=True)
class Member:
    """A sum of at most two blocks, each at one of its length scales, as measured over a range of stretches.

    ``amplitude_indices`` are those of the blocks' amplitudes; ``probability`` is the prior one of the member.
    """

    blocks: tuple[EnergyBlock, ...]
    amplitude_indices: tuple[int, ...]
    lengths: tuple[float, ...]
    reaches: tuple[tuple[float, float], ...]
    probability: float

    @property
    def name(self) -> str:
        """The blocks' names, joined."""
        return "+".join(block.name for block in self.blocks) or "none"

    @property
    def scaled_blocks(self) -> list[tuple[EnergyBlock, tuple[float, float], float]]:
        """Each block with its reach and its length scale."""
        return list(zip(self.blocks, self.reaches, self.lengths, strict=True))

    @property
    def is_isotropic(self) -> bool:
        """Whether all its blocks are."""
        return all(block.is_isotropic for block in self.blocks)

    @property
    def limits(self) -> Range:
        """Between which states the data speak of its blocks."""
        return reduce(Range.within, (block.limits(reach) for block, reach, _ in self.scaled_blocks), Range())

    def stress_features(self, states: States) -> list[FloatArray]:
        """Return the engineering stresses (n, r) of each block's terms."""
        return [block.stress_features(states, reach, length) for block, reach, length in self.scaled_blocks]

    def slopes(self, coordinates: Coordinates) -> list[Coordinates]:
        """Return of each block the slopes of its terms, as `EnergyBlock.slopes`."""
        return [block.slopes(coordinates, reach, length) for block, reach, length in self.scaled_blocks]


def side_by_side(features: list[FloatArray], count: int) -> FloatArray:
    """Return the terms of all blocks of a member in one array (n, q) for n = ``count`` states; it may have none."""
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
        "the discrepancy."
    )
    sums: ClassVar[tuple[Sum, ...]]

    @property
    def sketch(self) -> Discrepancy:
        return Sketch(self)

    def members(self, states: States) -> list[Member]:
        """Return every sum of blocks at every combination of their length scales, over the range of states (n,)."""
        members, total = [], sum(energy_sum.odds for energy_sum in self.sums)
        for blocks_by_amplitude, odds in self.sums:
            amplitude_indices = tuple(index for index, block in enumerate(blocks_by_amplitude) if block is not None)
            blocks = tuple(block for block in blocks_by_amplitude if block is not None)
            reaches = tuple(block.reach(states) for block in blocks)
            choices = list(product(*(block.lengths for block in blocks)))
            probability = odds / total / len(choices)
            members += [Member(blocks, amplitude_indices, lengths, reaches, probability) for lengths in choices]
        return members


class _Single(EnergyDiscrepancy):
    """One block, whose name and formula it has."""

    parameters = AMPLITUDES[:1]

    def __init_subclass__(cls, block: EnergyBlock | None = None) -> None:
        super().__init_subclass__()
        if block is not None:
            cls.name, cls.formula, cls.sums = block.name, block.formula, (Sum((block,)),)


class Taylor(_Single, block=TaylorBlock()):
    """An infinite Yeoh: independent normal Taylor coefficients in I1 - 3."""


class Logarithmic(_Single, block=LogBlock()):
    """A process in log(I1 - 2): fast change near the reference."""


class SmallStrain(_Single, block=SmallStrainBlock()):
    """A process in the logarithm of I1 - 3: softening, or fibres that take up load, at small strains."""


class Spline(_Single, block=SplineBlock()):
    """An integrated Wiener process in I1 - 3."""


class ZeroModulus(_Single, block=ZeroModulusBlock()):
    """The Mooney-Rivlin term without its initial modulus."""


class SecondInvariant(_Single, block=SecondInvariantBlock()):
    """An infinite series in I2 - 3, its initial modulus taken out by I1."""


class Hencky(_Single, block=HenckyBlock()):
    """A separable function of the principal stretches: an infinite Ogden."""


class ValanisLandel(_Single, block=ValanisLandelBlock()):
    """A separable function of the principal stretches."""


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


@dataclass(frozen=True)
class Sketch(EnergyDiscrepancy):
    """A few members of an energy discrepancy, evenly among all."""

    whole: EnergyDiscrepancy

    @property
    def name(self) -> str:  # type: ignore[override]  # of the object, not the class
        """That of the whole."""
        return self.whole.name

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """Those of the whole."""
        return self.whole.parameters

    def members(self, states: States) -> list[Member]:
        members = self.whole.members(states)
        sketch = members[:: 1 + len(members) // MEMBERS_OF_SKETCH]
        total = sum(member.probability for member in sketch)
        return [replace(member, probability=member.probability / total) for member in sketch]


FIRST_BLOCKS = {TaylorBlock(): 1.0, LogBlock(): 1.0, SmallStrainBlock(): 0.05}
"""Energies of I1 and their prior odds.

Where tests show what is at small strains, the evidence for it is larger by far more than these odds; where they do not,
it is not to widen the interval.
"""
SECOND_BLOCKS = SecondInvariantBlock(), HenckyBlock()
BLOCKS = (*FIRST_BLOCKS, *SECOND_BLOCKS, SplineBlock(), ZeroModulusBlock(), ValanisLandelBlock())
"""Every block that a sum of two may have."""
DISPERSIONS = 0.0, 0.2
"""Of structure tensors about a preferred direction."""


def _pairs(second_blocks: Iterable[EnergyBlock], odds: float = 1.0) -> tuple[Sum, ...]:
    """Return every energy of I1 with each of some others, such odds times those of the first."""
    pairs = product(FIRST_BLOCKS.items(), second_blocks)
    return tuple(Sum((block, second_block), odds * odds_of_block) for (block, odds_of_block), second_block in pairs)


def _pairs_and_singles(odds_of_single: float) -> tuple[Sum, ...]:
    """Return every sum of an energy of I1 and another, and each block alone at such odds."""
    singles = [Sum((block, None), odds_of_single * odds) for block, odds in FIRST_BLOCKS.items()]
    singles += [Sum((None, block), odds_of_single) for block in SECOND_BLOCKS]
    return (*_pairs(SECOND_BLOCKS), *singles)


@dataclass(frozen=True)
class _Average(EnergyDiscrepancy):
    """The average of some sums of blocks, at even odds with sums that have a preferred direction where tests show one.

    They do where each of them measured the stresses of two axes of a sheet: these are the axes of the direction.
    """

    has_direction: bool = False

    parameters = AMPLITUDES
    isotropic_sums: ClassVar[tuple[Sum, ...]]

    @property
    def sums(self) -> tuple[Sum, ...]:  # type: ignore[override]  # of the object, not the class
        """Those that are the same in all directions, and others."""
        if not self.has_direction:
            return self.isotropic_sums
        directions = [DirectionBlock(dispersion) for dispersion in DISPERSIONS]
        odds = sum(energy_sum.odds for energy_sum in self.isotropic_sums)
        return (*self.isotropic_sums, *_pairs(directions, odds / len(directions) / sum(FIRST_BLOCKS.values())))

    @property
    def of_contradictory_tests(self) -> Discrepancy | None:
        return None if self.has_direction else AutoFirst()

    def adapted_to(self, material: Material, experiment: Experiment) -> Self:
        return replace(self, has_direction=material.is_isotropic and experiment.shows_direction)


class Auto(_Average):
    """The evidence decides: the average of {taylor, log} + {second-invariant, hencky}, and of their single blocks.

    A single block has a quarter of the prior odds of a sum, `small-strain` in place of taylor and log a twentieth of
    theirs. Tests of two axes add {taylor, log, small-strain} + direction.
    """

    name = "auto"
    formula = (
        "average of {taylor, log, small-strain at a twentieth of their odds} + {second-invariant, hencky} and, at a "
        "quarter of the odds, each one alone; with tests of two axes also of the first + direction"
    )
    isotropic_sums = _pairs_and_singles(odds_of_single=0.25)


class AutoIsotropic(_Average):
    """`auto` without a preferred direction, whatever the tests: its draws are materials for other programs."""

    name = "auto-isotropic"
    formula = "auto without direction"
    isotropic_sums = Auto.isotropic_sums

    def adapted_to(self, material: Material, experiment: Experiment) -> Self:
        return self


class AutoFirst(EnergyDiscrepancy):
    """The average of `auto`'s energies of I1 alone: what it comes down to where tests contradict each other.

    That is where no stable energy reconciles them: then they differ by more than their stated spread.
    """

    name = "auto-first"
    formula = "average of taylor, log and, at a twentieth of their odds, small-strain"
    parameters = AMPLITUDES[:1]
    sums = tuple(Sum((block,), odds) for block, odds in FIRST_BLOCKS.items())


class AutoBalanced(_Average):
    """The average of the same at equal odds: narrower, and more often wrong."""

    name = "auto-balanced"
    formula = "average of the sums and single blocks of auto at equal odds"
    isotropic_sums = _pairs_and_singles(odds_of_single=1.0)


class AutoSharp(_Average):
    """The average of the same, and of no discrepancy: narrowest, and wrong where a small discrepancy hides in noise."""

    name = "auto-sharp"
    formula = "average of auto-balanced and no discrepancy"
    isotropic_sums = (*AutoBalanced.isotropic_sums, Sum(()))


def discrepancies() -> dict[str, type[Discrepancy]]:
    """Return every discrepancy by name, those with few parameters first."""
    return dict(sorted(variants(Discrepancy).items(), key=lambda item: len(item[1].parameters)))


def discrepancy_named(discrepancy: str | Discrepancy) -> Discrepancy:
    """Return the discrepancy of that name; a discrepancy is returned as it is.

    Raises
    ------
    ModelError
        When no discrepancy has that name, or it is neither a name nor a discrepancy.
    """
    if isinstance(discrepancy, Discrepancy):
        return discrepancy
    if not isinstance(discrepancy, str):
        raise ModelError(
            f"discrepancy must be a name, such as 'auto' or 'none', or an object of tissuq.Discrepancy, not "
            f"{discrepancy!r}."
        )
    return _energy_sum(discrepancy) or find(Discrepancy, "discrepancy", discrepancy, ModelError)()


def _energy_sum(names: str) -> EnergySum | None:
    """Return the sum of two blocks named with a plus sign between them, or None when these are other names."""
    blocks_by_name = {block.name: block for block in BLOCKS}
    block_names = [block_name.strip() for block_name in names.split("+")]
    if len(block_names) < 2 or not any(block_name in blocks_by_name for block_name in block_names):
        return None
    unknown = [block_name for block_name in block_names if block_name not in blocks_by_name]
    if unknown or len(block_names) > 2 or len(set(block_names)) < 2:
        raise ModelError(
            f"discrepancy '{names}': a sum has two different ones of the energies {', '.join(blocks_by_name)}"
            + (f"; '{unknown[0]}' is none of them." if unknown else ".")
        )
    return EnergySum(tuple(blocks_by_name[block_name] for block_name in block_names))
