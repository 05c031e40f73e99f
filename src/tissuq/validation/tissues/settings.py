"""What a benchmark on real tissue runs over: which tests are predicted from which, and by what fits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from pydantic import Field, field_validator

from tissuq.experiments.experiment import Experiment
from tissuq.mechanics import material_named
from tissuq.model.discrepancy import discrepancy_named
from tissuq.model.tolerances import AS_TESTED, SPECIMEN, TISSUE
from tissuq.studies.campaign_settings import TissueOptions
from tissuq.studies.settings import there_is

__all__ = [
    "END_SHARE",
    "ESTIMAND_OF_PROTOCOL",
    "PROTOCOLS",
    "RIVALS",
    "Split",
    "TissueSettings",
]

END_SHARE = 0.3
"""Share of the range of a test, farthest from the reference, that is predicted from the rest of it."""
MIN_FITTED = 4
"""Smallest number of measurements of a part of a test that is fitted or predicted."""


class Split(NamedTuple):
    """Tests that are fitted, and a test that is predicted from them."""

    fitted: tuple[Experiment, ...]
    predicted: Experiment


def _each_test(tests: Sequence[Experiment]) -> Iterator[Split]:
    """Predict each test from all others of its set."""
    for index, test in enumerate(tests):
        if len(tests) > 1:
            yield Split((*tests[:index], *tests[index + 1 :]), test)


def _each_mode(tests: Sequence[Experiment]) -> Iterator[Split]:
    """Predict each test from all tests of one other mode."""
    modes = dict.fromkeys(test.mode for test in tests)
    for test in tests:
        for mode in modes:
            if mode != test.mode:
                yield Split(tuple(fitted for fitted in tests if fitted.mode == mode), test)


def _each_protocol_of_a_specimen(tests: Sequence[Experiment]) -> Iterator[Split]:
    """Predict each test of a specimen from the other tests of the same specimen."""
    for specimen in dict.fromkeys(test.specimen for test in tests if test.specimen):
        yield from _each_test([test for test in tests if test.specimen == specimen])


def _each_end(tests: Sequence[Experiment]) -> Iterator[Split]:
    """Predict the end of each test, where it is farthest from the reference, from the rest of it."""
    for test in tests:
        strain = np.abs((test.stretch - test.mode.reference).reshape(len(test), -1)).max(axis=1)
        yield from _parts(test, strain > (1 - END_SHARE) * strain.max())


def _each_half(tests: Sequence[Experiment]) -> Iterator[Split]:
    """Predict every second measurement of each test from the others."""
    for test in tests:
        yield from _parts(test, np.arange(len(test)) % 2 == 1)


def _parts(test: Experiment, is_predicted: np.ndarray) -> Iterator[Split]:
    if min(np.count_nonzero(is_predicted), np.count_nonzero(~is_predicted)) >= MIN_FITTED:
        yield Split((test.where(~is_predicted),), test.where(is_predicted))


PROTOCOLS: Mapping[str, Callable[[Sequence[Experiment]], Iterator[Split]]] = MappingProxyType(
    {
        "tests": _each_test,
        "modes": _each_mode,
        "specimens": _each_protocol_of_a_specimen,
        "ends": _each_end,
        "halves": _each_half,
    }
)
"""How the tests of a set become fitted and predicted ones, by name."""
ESTIMAND_OF_PROTOCOL: Mapping[str, str] = MappingProxyType(
    {"tests": TISSUE, "modes": TISSUE, "specimens": SPECIMEN, "ends": AS_TESTED, "halves": AS_TESTED}
)
"""What the intervals of a fit must be of, so that they hold for what is predicted."""


RIVALS = {"embedded": {"discrepancy": "none", "noise_sd": "proportional"}}
"""What is fitted under names that are no discrepancy.

Embedded: the stiffness of the law is random, anew at every measurement. So the stress of a law that is linear in its
stiffness has an independent error in proportion to it, as with proportional noise: the independent normal form of
Sargsyan, Huan & Najm (2019, arXiv:1801.06768), which Andres Arcones et al. (2026, Data-Centric Engineering) extend.
"""


class TissueSettings(TissueOptions):
    """Everything that a benchmark on real tissue depends on, but for the data themselves.

    Attributes
    ----------
    folder : str, optional
        Of the data sets (`tissuq.validation.tissues.read_corpus`); without it those of the package.
    sets : tuple of str
        Names of the sets that are taken; all, where there are none.
    protocols : tuple of str
        Which tests are predicted from which (`PROTOCOLS`).
    formulations : tuple of str
        Discrepancies of the fits, or ``"embedded"`` (`RIVALS`).
    material : str
    tolerances : dict of str to float, optional
        Standard deviations of errors of the tests (`tissuq.Tolerances`, stresses in MPa); without it those of what is
        predicted (`ESTIMAND_OF_PROTOCOL`): of the tissue for a new test, of the specimen for a test of the same one,
        none for a part of the same test.
    points : int
        Number of measurements at most that are taken from a test, evenly along it.
    predictions : int
        Number of predictions at most for each set and protocol, evenly among all.
    """

    points: int = Field(30, ge=4, le=10_000)

    @field_validator("protocols")
    @classmethod
    def _known_protocols(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            if name not in PROTOCOLS:
                raise ValueError(f"there is no protocol '{name}'; choose from {', '.join(PROTOCOLS)}")
        return names

    _known_formulations = field_validator("formulations")(
        there_is(lambda name: RIVALS.get(name) or discrepancy_named(name))
    )
    _known_material = field_validator("material")(there_is(material_named))

    @field_validator("protocols", "formulations")
    @classmethod
    def _present_once(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if not names or len(set(names)) < len(names):
            raise ValueError("give one or more names, each once")
        return names
