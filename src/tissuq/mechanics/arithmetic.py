"""Functions for strain energies that NumPy (real and complex) and JAX arrays both pass through."""

from __future__ import annotations

from math import nan
from typing import Any

import numpy as np


def library(value: Any) -> Any:
    """Return the library that an array belongs to: NumPy for plain numbers."""
    return value.__array_namespace__() if hasattr(value, "__array_namespace__") else np


def log(value: Any) -> Any:
    """Return the natural logarithm."""
    return library(value).log(value)


def exp(value: Any) -> Any:
    """Return the exponential."""
    return library(value).exp(value)


def expm1(value: Any) -> Any:
    """Return exp(value) - 1 with the digits of small values."""
    return library(value).expm1(value)


def sqrt(value: Any) -> Any:
    """Return the square root."""
    return library(value).sqrt(value)


def cos(value: Any) -> Any:
    """Return the cosine."""
    return library(value).cos(value)


def sin(value: Any) -> Any:
    """Return the sine."""
    return library(value).sin(value)


def positive_part(value: Any) -> Any:
    """Return the value where its real part is positive, and zero (with its derivatives) elsewhere."""
    return library(value).where(value.real > 0, value, 0.0)


def log_left(ratio: Any) -> Any:
    """Return log(1 - ratio), and not a number (with all its derivatives) where nothing is left.

    A logarithm by itself has a finite derivative beyond the pole, and a material that has locked would have a stress.
    """
    arrays = library(ratio)
    return arrays.log1p(-ratio * arrays.where(ratio.real < 1, 1.0, nan))
