"""What arguments of many functions may be: seeds, switches, probabilities, priors, paths."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from numbers import Integral, Real
from pathlib import Path
from typing import Any

from tissuq.errors import InputError

MAX_SEED = 2**62


def check_seed(seed: object) -> None:
    """Refuse what is no seed.

    Raises
    ------
    InputError
        When it is not a whole number from 0 to `MAX_SEED`.
    """
    if not isinstance(seed, Integral) or not 0 <= int(seed) <= MAX_SEED:
        raise InputError(f"seed must be a whole number from 0 to {MAX_SEED}, not {seed!r}.")


def check_count(count: object, rule: str, least: int = 1) -> None:
    """Refuse what is no whole number, one or more unless another one is the least, with the rule that it breaks.

    Raises
    ------
    InputError
        When it is none.
    """
    if not isinstance(count, Integral) or isinstance(count, bool) or count < least:
        raise InputError(f"{rule}, not {count!r:.80}.")


def one_or_several(values: Any, kinds: type | tuple[type, ...], rule: str) -> list[Any]:
    """Return one value of some kinds, or several, as a list; an empty one where there is none.

    Raises
    ------
    InputError
        When one is of another kind, with the rule that it breaks.
    """
    is_one = isinstance(values, kinds) or not isinstance(values, Iterable)
    listed = [] if values is None else [values] if is_one else list(values)
    for value in listed:
        if not isinstance(value, kinds):
            raise InputError(f"{rule}, not {value!r:.80}.")
    return listed


def check_switches(**switches: object) -> None:
    """Refuse a name, such as ``"none"``, where it is asked whether: as every text it would be taken for yes.

    Raises
    ------
    InputError
        When one of them is neither True nor False.
    """
    for name, value in switches.items():
        if value not in (True, False):
            raise InputError(f"{name} must be True or False, not {value!r:.80}.")


def check_probability(prob: float) -> None:
    """Refuse a probability of an interval that is none, or of all or nothing.

    Raises
    ------
    InputError
        When it is not between 0 and 1.
    """
    if not isinstance(prob, Real) or not 0 < prob < 1:
        raise InputError(f"prob must be between 0 and 1, not {prob!r}.")


def check_priors(priors: object) -> None:
    """Refuse priors that are not by parameter.

    Raises
    ------
    InputError
        When they are no mapping.
    """
    if not isinstance(priors, Mapping):
        raise InputError(f"priors must be by parameter, such as {{'C10': tissuq.Uniform(0, 5)}}, not {priors!r}.")


def checked_path(path: object, what: str) -> Path:
    """Return the path of something saved, or refuse what is none.

    Raises
    ------
    InputError
        When it is neither text nor a path; the message says what is needed.
    """
    if not isinstance(path, str | os.PathLike):
        raise InputError(f"{what} is needed, not {path!r:.80}.")
    return Path(path)
