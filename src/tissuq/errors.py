"""The exceptions that tissuq raises on purpose; every message says what, where and what to do."""

from __future__ import annotations


class TissuqError(Exception):
    """The family: catch this to catch everything that tissuq raises on purpose."""


class InputError(TissuqError):
    """What the user gave (a file, a column, an option, an array) cannot be used."""


class ModelError(TissuqError):
    """The parts of a model do not fit each other, the data, or the asked route of inference."""


class ConvergenceError(TissuqError):
    """A numerical method could not reach its tolerance."""
