"""Dimensions of a specimen, and the length, cross-section or wall that follow from them where they are known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isclose, pi, prod, sqrt

from tissuq.arrays import FloatArray
from tissuq.errors import InputError
from tissuq.experiments.reading.stated_sizes import StatedSize
from tissuq.experiments.reading.tube import Tube
from tissuq.experiments.units import AREA, LENGTH, PIXELS, Quantity

SHOWN = 3
"""Number of other sizes that a message shows."""
CONTRADICTION = 0.01
"""Relative difference from which two statements of one dimension contradict each other."""
HOW_TO_GIVE_SECTION = (
    'area (--area "10 mm2"), or width and thickness (--width "5 mm" --thickness "2 mm"), or diameter '
    '(--diameter "4 mm").'
)
SECTIONS = {"area": ("area",), "rectangle": ("width", "thickness"), "circle": ("diameter",)}
"""Forms of cross-sections, by the dimensions that they follow from."""
WAYS = frozenset(["area", "width", "diameter"])
"""Dimensions that each say the cross-section in another way: one of them is given."""
BREADTHS = ("diameter",), ("width", "thickness")
"""Sizes that say how broad a specimen is; an area alone tells it of a round one."""
EACH_ALONE = " If they differ from test to test, read each by its name, FILE#NAME, with its own."
NOT_IN_FILE = (
    "None is recognised in the file. A table of those of many specimens does, too (the option sizes of commands, or "
    "tissuq.read_sizes)."
)
PLURALS = {"thickness": "thicknesses"}
"""Of names of sizes that do not end in s alone."""


@dataclass(frozen=True)
class Dimension:
    """One dimension in mm or mm², or in pixels, and the words that tell where it comes from."""

    value: float
    source: str
    unit: str = ""


@dataclass(frozen=True)
class Dimensions:
    """The dimensions of a specimen.

    Those that the user gives, what the file states in two ways, other sizes in it, what it states without a unit, and
    where it differs from the user;
    ``divide_forces`` says that the cross-section is needed, beside whatever else is; ``averages`` of which measurements
    a size is the mean, and ``is_one_of_several`` that the table holds several tests;
    ``open_height`` asks which side is the height, and ``axial_stretch`` is that at which a tube is held, in every row.
    """

    file: str
    sizes: Mapping[str, Dimension]
    set_by_user: frozenset[str]
    ambiguous: Mapping[str, str]
    further_sizes: tuple[StatedSize, ...] = ()
    without_unit: tuple[str, ...] = ()
    contradictions: tuple[str, ...] = ()
    divide_forces: bool = False
    averages: tuple[str, ...] = ()
    is_one_of_several: bool = False
    open_height: str = ""
    axial_stretch: FloatArray | float = 1.0

    @property
    def length(self) -> Dimension:
        """The undeformed length.

        Raises
        ------
        InputError
            When it is not known.
        """
        area_too = f" Forces need the undeformed cross-section, too: {HOW_TO_GIVE_SECTION}"
        return self._size(
            "length",
            "to turn displacements into stretches give the undeformed length "
            '(--length "20 mm"; in Python dimensions={"length": "20 mm"}).'
            + area_too
            * (self.divide_forces and not sections_of(self.sizes)),
        )

    def distance(self, first_distance: float) -> Dimension:
        """Return the undeformed distance of marks in pixels: the one that is given, or else the first of the test.

        Raises
        ------
        InputError
            When a length is given that is not in pixels.
        """
        if "length" not in self.set_by_user:
            return Dimension(first_distance, "in its first row", PIXELS.unit)
        if self.sizes["length"].unit != PIXELS.unit:
            raise InputError(
                f"{self.file}: distances are in pixels, and so must be the undeformed one: give it as "
                f'--length "{first_distance:.4g} px", or leave it out where the test begins undeformed.'
            )
        return self.sizes["length"]

    @property
    def radius(self) -> Dimension:
        """That of the disc that a rheometer twists.

        Raises
        ------
        InputError
            When it is not known.
        """
        diameter = self._size(
            "diameter",
            "to turn a torque and a twist into stress and shear at the rim of a disc give its diameter "
            '(--diameter "20 mm"; in Python dimensions={"diameter": "20 mm"}), and its height as --length "2 mm".',
        )
        return Dimension(diameter.value / 2, f"half the diameter {diameter.source}")

    @property
    def tube(self) -> tuple[Tube, str]:
        """The undeformed tube, and its radii in words.

        Raises
        ------
        InputError
            When its outer diameter or the thickness of its wall is not known, or the wall is thicker than half the
            diameter, or other sizes are given.
        """
        advice = (
            "to turn pressure and diameter of a tube into stress and stretch give its undeformed outer diameter and "
            'the thickness of its wall: --diameter "3 mm" --thickness "0.5 mm" (in Python '
            'dimensions={"diameter": "3 mm", "thickness": "0.5 mm"}).'
        )
        diameter, thickness = self._size("diameter", advice), self._size("thickness", advice)
        if unneeded := sorted(self.set_by_user - {"diameter", "thickness"}):
            raise InputError(f"{self.file} is read as pressure and diameter of a tube, which need no {unneeded[0]}.")
        if thickness.value >= diameter.value / 2:
            raise InputError(
                f"{self.file}: a wall of {thickness.value:g} mm (thickness {thickness.source}) does not fit into an "
                f"outer diameter of {diameter.value:g} mm ({diameter.source})."
            )
        tube = Tube(diameter.value / 2 - thickness.value, diameter.value / 2)
        words = f"A = {tube.inner:g} mm and B = {tube.outer:g} mm (undeformed radii; diameter {diameter.source}, "
        return tube, f"{words}thickness {thickness.source})"

    @property
    def area(self) -> Dimension:
        """The undeformed cross-section.

        Raises
        ------
        InputError
            When it is not known, or follows in two ways that contradict each other.
        """
        areas = sections_of(self.sizes)
        self._refuse_open_height("area", "width", "thickness", "diameter")
        areas_of_user = {name: area for name, area in areas.items() if self.set_by_user & set(SECTIONS[name])}
        if not areas_of_user:
            self._refuse_ambiguous("area", "width", "thickness", "diameter")
        areas = areas_of_user or areas
        if not areas:
            raise InputError(
                f"{self.file}: to turn forces into stresses give the undeformed cross-section: {HOW_TO_GIVE_SECTION} "
                f"{self._partly_known()}"
            )
        area, *alternatives = areas.values()
        if any(not agree(area, alternative) for alternative in alternatives):
            words = " or ".join(f"{section.value:g} mm2 ({section.source})" for section in areas.values())
            raise InputError(
                f"{self.file}: the cross-section could be {words}. "
                'Say which: --area "10 mm2", and leave out the others.'
            )
        return area

    @property
    def thickness(self) -> Dimension:
        """The undeformed thickness.

        Raises
        ------
        InputError
            When it is not known, or sizes are given that a force per width does not need.
        """
        if unneeded := sorted(self.set_by_user & {"area", "width", "diameter"}):
            raise InputError(
                f"{self.file} holds a force per width, which over the thickness is a stress: leave {unneeded[0]} out, "
                'and give the undeformed thickness (--thickness "2 mm").'
            )
        return self._size(
            "thickness", 'to turn a force per width into a stress give the undeformed thickness (--thickness "2 mm").'
        )

    @property
    def broad_in_words(self) -> str:
        """That the specimen is broader than long, if its sizes say so: such specimens are rather compressed."""
        length = self.sizes.get("length")
        if length is None or length.unit == PIXELS.unit:
            return ""
        if names := next((names for names in BREADTHS if self.sizes.keys() >= {*names}), ()):
            sides = [self.sizes[name].value for name in names]
            words = " x ".join(f"{side:g}" for side in sides) + " mm"
        elif "area" in self.sizes:
            sides = [sqrt(4 / pi * self.sizes["area"].value)]
            words = f"{sides[0]:.3g} mm across if it is round, by its area"
        else:
            return ""
        if min(sides) <= length.value:
            return ""
        return f"the specimen is broader ({words}) than long ({length.value:g} mm), as specimens for compression are"

    def _size(self, name: str, advice: str) -> Dimension:
        """Return a size that must be known, and be stated once."""
        self._refuse_open_height(name)
        self._refuse_ambiguous(name)
        if name not in self.sizes or self.sizes[name].unit == PIXELS.unit:
            raise InputError(f"{self.file}: {advice} {self._others(LENGTH, name)}")
        return self.sizes[name]

    def _refuse_open_height(self, *names: str) -> None:
        if self.open_height and not self.set_by_user & set(names):
            raise InputError(f"{self.file}: {self.open_height}")

    def _refuse_ambiguous(self, *names: str) -> None:
        for name in names:
            if name in self.ambiguous:
                count = "two" if self.ambiguous[name].count(" and ") == 1 else "several"
                sizes = f"{count} {PLURALS.get(name, f'{name}s')}"
                raise InputError(
                    f"{self.file}: the file states {sizes}: {self.ambiguous[name]}. Say which: --{name} "
                    f'"NUMBER {quantity_of(name).unit}".{EACH_ALONE * self.is_one_of_several}'
                )

    def _partly_known(self) -> str:
        sides = [name for name in ("width", "thickness") if name in self.sizes]
        if sides:
            missing_side = "thickness" if sides[0] == "width" else "width"
            others = self._others(LENGTH, missing_side, default="")
            return f"The {sides[0]} is known, so that the {missing_side} is enough. {others}".rstrip()
        areas = self._others(AREA, "area", default="")
        return areas or self._others(LENGTH, "width", "thickness", "diameter")

    def _others(self, kind: Quantity, *names: str, default: str = NOT_IN_FILE) -> str:
        """Return what other sizes the file states, and the options that say what they are."""
        sizes = [size for size in self.further_sizes if size.kind is kind][:SHOWN]
        if not sizes and "length" in names and {"diameter", "thickness"} <= self.sizes.keys():
            size = self.sizes["thickness"]
            return f'If it was loaded along its thickness, give --length "{size.value:g} mm" ({size.source}).'
        if not sizes and default and self.without_unit:
            return f"The file says {', '.join(self.without_unit[:SHOWN])}, without a unit: give sizes with theirs."
        if not sizes:
            return default
        said = ", ".join(f"{size.source} '{size.text}'" for size in sizes)
        reference = "that" if len(sizes) == 1 else "one of these"
        number = f"{sizes[0].value:g}" if len(sizes) == 1 else "NUMBER"
        options = " or ".join(f'--{name} "{number} {kind.unit}"' for name in names)
        each_alone = EACH_ALONE * self.is_one_of_several
        return f"The file says {said}: if {reference} is the {' or '.join(names)}, give {options}.{each_alone}"


def agree(size: Dimension, alternative: Dimension) -> bool:
    """Tell whether two statements of one dimension do not contradict each other."""
    return isclose(size.value, alternative.value, rel_tol=CONTRADICTION)


def sections_of(sizes: Mapping[str, Dimension]) -> dict[str, Dimension]:
    """Return the cross-section in every way in which it follows from sizes."""
    sections = {}
    for form, names in SECTIONS.items():
        if all(name in sizes for name in names):
            sides = [sizes[name] for name in names]
            words = (f"{name} {side.value:g} mm {side.source}" for name, side in zip(names, sides, strict=True))
            value = pi / 4 * sides[0].value ** 2 if form == "circle" else prod(side.value for side in sides)
            sections[form] = sides[0] if form == "area" else Dimension(value, " and ".join(words))
    return sections


def quantity_of(name: str) -> Quantity:
    """Return what a dimension of that name is, an area or a length."""
    return AREA if name == "area" else LENGTH


def in_words(dimension: Dimension) -> str:
    """Return a length and where it comes from."""
    return f"{dimension.value:g} mm ({dimension.source})"
