"""What pint knows of units: quantities that people give, and units of stress beyond the usual ones."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

from tissuq.errors import InputError

LONGEST_UNIT = 40
"""Characters."""
UNIT_EXPRESSION = re.compile(
    r"(?:[^\W\d]\w*|(?:\^|\*\*)\s*\(?[+-]?\d(?:\.\d)?\)?(?!\s*[\d^*])|1(?![\d.])|[%‰°*/·.()\s⁻⁰¹²³⁴⁵⁶⁷⁸⁹])++"
)
"""Products, quotients and powers of names, and no arithmetic of numbers, which could take for ever."""
NO_STRESSES = {
    "[mass] / [length]**2": "a mass over an area, not a stress. If the unit of force is meant, write it as a force: "
    "kgf/cm2, gf/mm2 or lbf/in2 (psi).",
    "[force] / [length]": "a force over a width, not a stress. Say that the column holds forces (--column force=NAME) "
    "and give the undeformed thickness (--thickness).",
    "[force]": "a force, not a stress. Say that the column holds forces (--column force=NAME) and give the undeformed "
    "cross-section (--area).",
}
"""What units are that are taken for those of stress, by their dimensions, and what to do."""
SUGGESTED_UNITS = "Write a unit of stress such as MPa, kPa, Pa, N/mm2, kgf/cm2 or psi."


def is_quantity(values: Any) -> bool:
    """Tell whether values are a quantity of pint, of whatever registry."""
    return hasattr(values, "magnitude") and hasattr(values, "is_compatible_with")


def unit_of(quantity: Any) -> str:
    """Return the unit of a quantity of pint in short; an empty text for plain numbers.

    Examples
    --------
    >>> import pint
    >>> unit_of(pint.UnitRegistry().Quantity([1.0, 2.0], "kilopascal"))
    'kPa'
    """
    return f"{quantity.units:~C}".replace("**", "")


def stress_factor(name: str) -> float:
    """Return what one unit of stress is in MPa.

    Raises
    ------
    InputError
        When it is not known, or none of stress.
    """
    for spelling in (name, _spelled_for_pint(name)):
        quantity = _parsed_by_pint(spelling)
        if quantity is not None and quantity.check("[pressure]"):
            return float(quantity.to("megapascal").magnitude)
        if quantity is not None:
            other = f"not a unit of stress (a force over an area). {SUGGESTED_UNITS}"
            what = next((what for dimensions, what in NO_STRESSES.items() if quantity.check(dimensions)), other)
            raise InputError(f"'{name}' is {what}")
    raise InputError(f"the unit '{name}' is not known. {SUGGESTED_UNITS}")


def _spelled_for_pint(name: str) -> str:
    """Rewrite powers without a mark (mm2), dots as products (N.mm-2) and the kilopond."""
    spelling = re.sub(r"(?<=[^\W\d_])(-?\d+)(?![^\W\d_])", r"^\1", name.replace("²", "2").replace("**", ""))
    spelling = re.sub(r"(?<=\w)[.·](?=[^\W\d_])", "*", spelling)
    return re.sub(r"\bkp\b", "kgf", spelling)


def _parsed_by_pint(spelling: str) -> Any | None:
    if len(spelling) > LONGEST_UNIT or not UNIT_EXPRESSION.fullmatch(spelling):
        return None
    try:
        return _pint_registry().Quantity(1.0, spelling)
    except Exception:  # pint raises a dozen unrelated types (TypeError, AttributeError, tokenize errors)
        return None


@cache
def _pint_registry() -> Any:
    import pint

    return pint.UnitRegistry()
