"""Seeds of random draws: those that every generator takes and every file holds."""

from __future__ import annotations

from numbers import Integral

from tissuq.errors import InputError

__all__ = ["MAX_SEED", "check_seed"]

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
