"""Which side of a block is its height, along which it was compressed, or which lies between its sheared planes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isclose

import numpy as np

from tissuq.experiments.reading.dimensions import Dimension, Dimensions
from tissuq.experiments.reading.headings import dimensions_named
from tissuq.experiments.reading.recognition import SHEARS, ColumnChoice
from tissuq.experiments.reading.stated_mode import direction_of
from tissuq.experiments.reading.table import Column, Table
from tissuq.experiments.units import FORCE, LENGTH

__all__ = ["of_block"]

SIDES = ("length", "width", "thickness")
SAME_AREA = 0.01
"""Relative difference up to which an area is that of two sides."""
COMPRESSION, SHEAR = "compression", "shear"
HEIGHTS = {
    COMPRESSION: "along which of them the specimen was compressed",
    SHEAR: "which of them lies between the sheared planes",
}
DISPLACEMENTS = ("displacement", "sliding")


@dataclass(frozen=True)
class _Block:
    """The sides of a block that the file states, how it was loaded, and how far and hard, in mm and N where known."""

    sides: dict[str, Dimension]
    how: str
    furthest: float | None
    largest: float | None

    def across(self, side: str) -> float:
        """Return the area of the two other sides."""
        return float(np.prod([size.value for name, size in self.sides.items() if name != side]))

    def said(self, side: str) -> str:
        """Return the options that say that one side is the height, and what follows from them."""
        height, area = self.sides[side].value, self.across(side)
        measure = "an amount of shear of" if self.how == SHEAR else "a strain of"
        furthest = f"{measure} {self.furthest / height:.3g}" if self.furthest else ""
        largest = f"{1e3 * self.largest / area:.3g} kPa" if self.largest else ""
        gives = " and ".join(filter(None, (furthest, largest)))
        return f'its {side}: --length "{height:g} mm" --area "{area:g} mm2"{f", which gives {gives}" if gives else ""}'


def of_block(
    table: Table, choice: ColumnChoice, numbers: tuple[Column, Column], dimensions: Dimensions, words: Sequence[str]
) -> Dimensions:
    """Return dimensions in which the length of a block that was compressed or sheared is its height.

    A height that the file names is that; of a length, a width and a thickness it is open which one is, unless the area
    is that of two of them. Sizes as given stay. ``words`` may tell that the specimen was compressed; so do loads and
    displacements that are negative.
    """
    how = _how(table, choice, numbers, words)
    if not how or "diameter" in dimensions.sizes or "length" in dimensions.ambiguous:
        return dimensions
    heights = [size for size in dimensions.further_sizes if dimensions_named(size.name, is_cylinder=True) == {"length"}]
    if len({size.value for size in heights}) == 1:
        return _with_height(dimensions, Dimension(heights[0].value, heights[0].source), how)
    sides = {name: dimensions.sizes[name] for name in SIDES if name in dimensions.sizes}
    if len(sides) < len(SIDES) or dimensions.set_by_user & set(SIDES[1:]):
        return dimensions
    block = _Block(sides, how, *_extremes(table, choice, numbers))
    area = dimensions.sizes.get("area")
    heights_by_area = [side for side in SIDES if area and isclose(block.across(side), area.value, rel_tol=SAME_AREA)]
    if area and len(heights_by_area) == 1 and "area" not in dimensions.set_by_user:
        return replace(dimensions, sizes={"length": sides[heights_by_area[0]], "area": area})
    stated = ", ".join(f"{name} {size.value:g} mm {size.source}" for name, size in sides.items())
    options = "; ".join(map(block.said, SIDES))
    text = f"the file states {stated}, and does not say {HEIGHTS[how]}. Say so with the area across it: {options}."
    return replace(dimensions, open_height=text)


def _extremes(table: Table, choice: ColumnChoice, numbers: tuple[Column, Column]) -> tuple[float | None, float | None]:
    """Return the largest displacement (mm) and force (N); None for what columns do not hold, or state no unit of."""
    factors = (
        LENGTH.factor_or_none(table.unit(choice.deformation)) if choice.measure in DISPLACEMENTS else None,
        FORCE.factor_or_none(table.unit(choice.stress)) if choice.load == "force" else None,
    )
    moved, load = (
        float(np.abs(column).max()) * factor if factor else None
        for column, factor in zip(numbers, factors, strict=True)
    )
    return moved, load


def _with_height(dimensions: Dimensions, height: Dimension, how: str) -> Dimensions:
    """Return dimensions with a height for the length, and the other two sides for the section."""
    if "length" in dimensions.set_by_user:
        return dimensions
    sizes = dict(dimensions.sizes)
    length = sizes.pop("length", None)
    if length and "area" not in sizes and len(sizes.keys() & {"width", "thickness"}) == 1:
        (side,) = sizes.keys() & {"width", "thickness"}
        sizes[({"width", "thickness"} - {side}).pop()] = length
    if length and dimensions.set_by_user & {"width", "thickness"}:
        text = (
            f"the file states a height of {height.value:g} mm, which is the length in {how}, and a length beside it, "
            "and width or thickness is given. Leave that out, or give --length and --area."
        )
        return replace(dimensions, open_height=text)
    note = f"the height, {height.value:g} mm {height.source}, was taken for the length, which it is in {how}."
    unnamed = tuple(
        size for size in dimensions.further_sizes if size.value != height.value or size.source != height.source
    )
    return replace(
        dimensions, sizes=sizes | {"length": height}, further_sizes=unnamed, averages=(*dimensions.averages, note)
    )


def _how(table: Table, choice: ColumnChoice, numbers: tuple[Column, Column], words: Sequence[str]) -> str:
    """Return how a block was loaded where its height matters; an empty text in tension, and where forces do not."""
    if choice.measure in SHEARS:
        return SHEAR if choice.measure == "sliding" or choice.load == "force" else ""
    if choice.measure != "displacement" and choice.load != "force":
        return ""
    columns = [table.names[choice.deformation], table.names[choice.stress]]
    direction = direction_of(*(text for _, text in table.head), *words, *columns)
    is_pressed = choice.measure == "displacement" and all(column.sum() < 0 for column in numbers)
    is_pressed = is_pressed and choice.load == "force" and direction != "tension"
    return COMPRESSION if direction == COMPRESSION or is_pressed else ""
