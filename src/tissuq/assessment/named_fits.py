"""Fits by name, as people give them to be compared, averaged or drawn beneath one another."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from tissuq.errors import InputError


def named_fits(fits: Any) -> dict[str, Any]:
    """Return fits by name; those that come without are named by material and discrepancy.

    Parameters
    ----------
    fits : mapping of str to fit, iterable of fits, or a fit
        A fit is a posterior, or a saved one as a tree.

    Raises
    ------
    InputError
        When something is no fit.
    """
    is_one = hasattr(fits, "attrs") or isinstance(fits, str) or not isinstance(fits, Iterable)  # a tree is a mapping
    several = [fits] if is_one else fits
    pairs = several.items() if isinstance(several, Mapping) else (("", fit) for fit in several)
    named = dict[str, Any]()
    for given_name, fit in pairs:
        if hasattr(fit, "solution"):
            model = fit.solution.model
            described = f"{model.material.name}, {model.discrepancy.name}"
        elif hasattr(fit, "attrs"):
            described = f"{fit.attrs.get('material')}, {fit.attrs.get('discrepancy')}"
        else:
            raise InputError(f"fits are needed, such as {{'none': tq.fit(data, ...)}}, or a list; not {fit!r:.80}.")
        name = str(given_name) or described
        named[f"{name} ({len(named) + 1})" if name in named else name] = fit
    return named
