"""The squared-exponential kernel and its form given zeros at the reference, for NumPy and JAX arrays alike."""

from __future__ import annotations

from typing import Any

__all__ = ["pinned_squared_exponential", "squared_exponential"]

SEPARATE = 40.0


def squared_exponential(score: Any) -> Any:
    """Return exp(-score^2 / 2)."""
    exponent = -0.5 * score**2
    return exponent.__array_namespace__().exp(exponent)


def pinned_squared_exponential(one: Any, other: Any, derivatives: int) -> Any:
    """Return the squared exponential of scores, given that the process (and its derivative) are zero at zero.

    It is the product of both with zero, times exp(one other) without the first terms of its series, where that
    exponent is large, what is left out is less than rounding.
    """
    product = one * other
    arrays = product.__array_namespace__()
    near = arrays.minimum(product, SEPARATE)
    rest = arrays.expm1(near) - (near if derivatives else 0.0)
    apart = rest * arrays.exp(-0.5 * (one**2 + other**2))
    return arrays.where(product < SEPARATE, apart, squared_exponential(one - other))
