"""Names of quantities over several columns each, beneath which stand the names of specimens, and units."""

from __future__ import annotations

from dataclasses import replace

from tissuq.experiments.reading.headings import heading, is_of_mean, is_of_role, of_spread
from tissuq.experiments.reading.layout import split
from tissuq.experiments.reading.several_specimens import filled_on
from tissuq.experiments.reading.table import Table, padded
from tissuq.experiments.units import looks_like_unit

__all__ = ["with_names_above"]


def with_names_above(table: Table, above: str) -> Table:
    """Return the table with the names of quantities in the line above its names, which are then those of specimens.

    Only where that line names quantities alone, the names do not, and one of them is over several columns. Names of
    means and of spreads are added to that of the quantity.
    """
    quantities = split(above, table.separator)
    if not all(is_of_role(name) for name in quantities if name) or len(quantities) > len(table.names):
        return table
    over = filled_on(padded(quantities, len(table.names)))
    is_unit = [not name or looks_like_unit(name) for name in table.names]
    specimens = [column for column, unit in enumerate(is_unit) if not unit]
    has_several = any([over[column] for column in specimens].count(name) > 1 for name in quantities if name)
    if not has_several or not all(over) or any(is_of_role(table.names[column]) for column in specimens):
        return table
    names = [
        name if unit else _joined(name, label) for name, label, unit in zip(over, table.names, is_unit, strict=True)
    ]
    units = [unit or name * beneath for unit, name, beneath in zip(table.units, table.names, is_unit, strict=True)]
    return replace(table, names=tuple(names), units=tuple(units))


def _joined(quantity: str, label: str) -> str:
    """Return the name of a quantity, with the unit that its label has, if any, and the words of a mean or a spread."""
    name, of_label = heading(quantity), heading(label)
    is_statistic = is_of_mean(of_label.quantity) or of_spread(of_label.quantity)[0]
    words = f"{name.quantity} {of_label.quantity}" if is_statistic else name.quantity
    unit = of_label.unit or name.unit
    return f"{words} ({unit})" if unit else words
