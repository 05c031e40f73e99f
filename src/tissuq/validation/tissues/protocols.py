"""Which tests are fitted and which are predicted from them: the protocols of the benchmark."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from tissuq.experiments.experiment import Experiment
from tissuq.model.tolerances import AS_TESTED, SPECIMEN, TISSUE

__all__ = ["END_SHARE", "ESTIMAND_OF_PROTOCOL", "PROTOCOLS", "Split"]

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
