"""The dimensions of the specimen in a table: as given or as the file states them, along each axis, and its height."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isclose

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.numbers import number_and_unit
from tissuq.experiments.reading.dimensions import SECTIONS, WAYS, Dimension, Dimensions, agree, quantity_of, sections_of
from tissuq.experiments.reading.headings import dimensions_named, heading, on_axis
from tissuq.experiments.reading.recognition import SHEARS, ColumnChoice
from tissuq.experiments.reading.side_by_side import TestBeside
from tissuq.experiments.reading.stated_mode import direction_of
from tissuq.experiments.reading.stated_sizes import StatedSize, sizes_without_unit, stated_sizes
from tissuq.experiments.reading.table import Column, Table
from tissuq.experiments.reading.vocabulary import DIMENSION_NAMES
from tissuq.experiments.units import FORCE, LENGTH, PIXELS

NOTABLE_SCATTER = 0.2
"""Range of measurements of one size over their mean, from which they are hardly those of one specimen."""
MEAN_OF = "mean of"
"""How the source of a mean begins."""
TURNED = {"length": "width", "width": "length"}
"""What the undeformed sizes along the first and the second axis are to the second one."""

SIDES = ("length", "width", "thickness")
SAME_AREA = 0.01
"""Relative difference up to which an area is that of two sides."""
COMPRESSION, SHEAR = "compression", "shear"
HEIGHTS = {
    COMPRESSION: "along which of them the specimen was compressed",
    SHEAR: "which of them lies between the sheared planes",
}
DISPLACEMENTS = ("displacement", "sliding")


def dimensions_of(
    table: Table,
    set_by_user: Mapping[str, str] | None,
    specimens: Collection[str],
    test: TestBeside | None = None,
) -> Dimensions:
    """Return the dimensions that the user gives, and those of the file where the user gives none.

    The file may state those of several specimens; that in the table is the one which it calls by some names, or over
    whose columns they stand.

    Raises
    ------
    InputError
        When a dimension is unknown or has no unit.
    """
    texts = dict(set_by_user or {})
    unknown = [name for name in texts if name not in DIMENSION_NAMES]
    if unknown:
        raise InputError(f"there is no dimension '{unknown[0]}'; give {', '.join(DIMENSION_NAMES)}.")
    if len(WAYS & texts.keys()) > 1:
        raise InputError("give the cross-section in one way: area, or width and thickness, or diameter.")
    every_size = stated_sizes(table, specimens, test)
    is_cylinder = "diameter" in texts or any(size.is_of("diameter", is_cylinder=False) for size in every_size)
    stated, ambiguous, unnamed, averages = dict[str, Dimension](), dict[str, str](), every_size, list[str]()
    for name in DIMENSION_NAMES:
        of_name = [size for size in every_size if size.is_of(name, is_cylinder=is_cylinder)]
        unnamed = [size for size in unnamed if size not in of_name]
        sizes = [Dimension(*statement) for statement in statements_of_size(of_name)]
        means = [size for size in sizes if size.source.startswith(MEAN_OF) and name not in texts]
        averages += [f"the {name} is the {mean.source}: {mean.value:.4g} {quantity_of(name).unit}." for mean in means]
        if name not in texts and any(not agree(size, sizes[0]) for size in sizes):
            ambiguous[name] = " and ".join(f"{size.value:g} {quantity_of(name).unit} {size.source}" for size in sizes)
        elif sizes:
            stated[name] = sizes[0]
    of_user = {name: given_size(name, str(text)) for name, text in texts.items()}
    dimensions = Dimensions(
        table.file,
        stated | of_user,
        frozenset(texts),
        ambiguous,
        tuple(unnamed),
        sizes_without_unit(table),
        averages=tuple(averages),
        is_one_of_several=test is not None,
    )
    return replace(dimensions, contradictions=tuple(_contradictions(dimensions, stated)))


def dimensions_of_stresses(
    table: Table,
    dimensions: Dimensions,
    mode: LoadingMode,
    choices: Sequence[ColumnChoice],
    deformations: Sequence[Column],
) -> list[Dimensions]:
    """Return the dimensions that belong to every stress: the same, unless the mode is that of a machine with two axes.

    There the specimen's length is that along the first axis, its width that along the second one; each is the width of
    the other axis. Where neither the user nor the lines above the table say them, the file's columns of sizes may.

    Raises
    ------
    InputError
        When a diameter is given for two axes.
    """
    if not mode.machine_axes:
        return [dimensions] * len(choices)
    if "diameter" in dimensions.set_by_user:
        raise InputError(
            f"{table.file}: the cross-sections of two axes do not follow from a diameter. Give thickness, and length "
            "and width (the undeformed sizes along the first and the second axis) where the file does not say them."
        )
    sizes = {name: size for name, size in dimensions.sizes.items() if name != "diameter"}
    along_first = replace(dimensions, sizes=sizes)
    along = along_first, _turned(along_first)
    across = choices[::-1], deformations[::-1]
    return [_of_axis(table, *axis) for axis in zip(along, choices, *across, strict=True)]


def initial_size(table: Table, choice: ColumnChoice, displacement: Column) -> Dimension | None:
    """Return the length from a column of sizes beside that of displacements (CellScale's machines write one)."""
    moved = heading(table.names[choice.deformation])
    axis, _ = on_axis(moved.quantity)
    headings = [heading(name) for name in table.names]
    columns = [
        k for k, name in enumerate(headings) if on_axis(name.quantity) == (axis, "size") or name.quantity == "size"
    ]
    if len(columns) != 1 or headings[columns[0]].unit != moved.unit or LENGTH.factor_or_none(moved.unit) is None:
        return None
    (size,) = table.taken(np.arange(1)).numbers(columns)
    value = float(size[0] - displacement[0]) * LENGTH.factor(moved.unit)
    return Dimension(value, f"from column {table.label(columns[0])} less the displacement")


def _of_axis(
    table: Table, dimensions: Dimensions, choice: ColumnChoice, across: ColumnChoice, moved_across: Column
) -> Dimensions:
    """Return the dimensions of an axis, with the width from a column of sizes along the axis across it."""
    unneeded = {"length"} if choice.measure != "displacement" and across.load == "force" else set()
    unneeded |= {"width"} if choice.load != "force" and across.measure == "displacement" else set()
    sizes = dict(dimensions.sizes)
    is_sought = "width" not in sizes and ("area" not in sizes or "thickness" in dimensions.set_by_user)
    if is_sought and across.measure == "displacement" and (width := initial_size(table, across, moved_across)):
        sizes["width"] = width
    return replace(dimensions, sizes=sizes, set_by_user=dimensions.set_by_user - unneeded)


def _turned(dimensions: Dimensions) -> Dimensions:
    """Return the dimensions as the second axis has them."""

    def turned(name: str) -> str:
        return TURNED.get(name, name)

    return replace(
        dimensions,
        sizes={turned(name): size for name, size in dimensions.sizes.items()},
        set_by_user=frozenset(map(turned, dimensions.set_by_user)),
        ambiguous={turned(name): text for name, text in dimensions.ambiguous.items()},
    )


def _contradictions(dimensions: Dimensions, stated: Mapping[str, Dimension]) -> Iterator[str]:
    """Yield a sentence where the file states another length, cross-section or side of it than the user."""
    pairs = []
    is_length = "length" in dimensions.set_by_user and not dimensions.sizes["length"].unit
    if is_length and "length" in stated:
        pairs.append(("length", "mm", dimensions.length, stated["length"]))
    is_set_by_user = any(dimensions.set_by_user & set(SECTIONS[form]) for form in sections_of(dimensions.sizes))
    if is_set_by_user and sections_of(stated):
        pairs.append(("cross-section", "mm2", dimensions.area, next(iter(sections_of(stated).values()))))
    elif is_set_by_user:
        sides = [name for name in stated if name in dimensions.set_by_user and name != "length"]
        pairs += [(name, quantity_of(name).unit, dimensions.sizes[name], stated[name]) for name in sides]
    for what, unit, size, in_file in pairs:
        if not agree(size, in_file):
            yield (
                f"the {what} is {size.value:g} {unit} ({size.source}), but the file says {in_file.value:g} {unit} "
                f"({in_file.source})."
            )


def given_size(name: str, text: str) -> Dimension:
    """Return a dimension that the user gives with its unit; a length may be in pixels."""
    if name == "length" and PIXELS.factor_or_none(number_and_unit(text)[1]):
        return Dimension(PIXELS.value(text), "as given", PIXELS.unit)
    return Dimension(quantity_of(name).value(text), "as given")


def statements_of_size(sizes: Sequence[StatedSize]) -> list[tuple[float, str]]:
    """Return the values of one size and where they stand; measurements that differ little as their mean."""
    by_number = {(size.measurement, size.value): size for size in sizes if size.measurement}
    values = [value for _, value in by_number]
    once = [(size.value, size.source) for size in sizes if not size.measurement]
    mean = sum(values) / max(1, len(values))
    if len(values) < 2 or max(values) - min(values) >= NOTABLE_SCATTER * mean:
        return [*once, *((size.value, size.source) for size in by_number.values())]
    sources = ", ".join(dict.fromkeys(size.source.removeprefix("in ") for size in by_number.values()))
    listed = ", ".join(f"{value:g}" for value in values)
    return [*once, (mean, f"{MEAN_OF} {len(values)} measurements ({listed}, in {sources})")]


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
