"""Headings of columns: what laboratories and testing machines call quantities and dimensions, and units beside them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache

from tissuq.experiments.reading.measures import STRAIN_MEASURES, STRESS_MEASURES, StrainMeasure, StressMeasure
from tissuq.experiments.reading.vocabulary import (
    DIMENSION_NAMES,
    HEIGHT_NAMES,
    MEAN_WORDS,
    NOUNS,
    OF_SPECIMEN,
    ROLES,
    ROLES_OF_TUBE,
    SPECIMEN_NAME,
    SPREAD_WORDS,
    names_of,
    without_accents,
)
from tissuq.experiments.units import BRACKETS, looks_like_unit, measured_in

MEASURES: dict[str, list[StrainMeasure] | list[StressMeasure]] = {
    "strain": [measure for measure in STRAIN_MEASURES.values() if measure.stretch],
    "shear": [measure for measure in STRAIN_MEASURES.values() if measure.shear],
    "stress": list(STRESS_MEASURES.values()),
}
"""Measures of what columns of a role hold."""
CORRECTED = re.compile(
    r"\b((machine )?compliance )?(corrected|compensated|korrigierte?[rs]?|corrigée?|corregid[oa]|corrett[oa])\b|"
    r"исправленн\w+|скорректированн\w+|校正後?|補正後?"
)
"""Words beside the name of what was corrected."""
DIRECTION_IN_BRACKETS = re.compile(r"\s*[\[(](compress\w*|tens\w*|druck|zug)[\])]", re.IGNORECASE)
"""Of a load, as in ``Strain (compression) [%]``: it tells the sign alone."""
PERCENT_BEFORE = re.compile(r"^\s*%\s*([^\W\d_][^%\[(]*)$")
"""The unit before a name, as in ``% Strain``; no other one follows it."""
NEWTONS = {"n": "N", "kn": "kN", "mn": "mN"}
FORCE_IN_SMALL_LETTERS = re.compile(rf"(?P<quantity>([a-z]+_)*(force|load))_(?P<unit>{'|'.join(NEWTONS)})")
"""With its unit, as programs write names of columns: ``force_n``."""
LINK = re.compile(r"\(\)|\b(de|di|of|nach|selon|according to)\b")
"""What may stand between such a word and the noun."""
SAYS_ALONE = re.compile(r"hencky|almansi|green .+|cauchy|.*(pk|piola).*|.*(angl|ngulo|ngolo|winkel|hoek|角).*")
"""Words for a measure that no noun need follow."""
SYMBOL_AFTER = re.compile(r" [abdhls]_?[0o]$")
"""That of a size in standards, after its name."""
MEASURED_ALONG = re.compile(r"(?:(?<=messlange)|(?<=gage length)|(?<=gauge length)|(?<=\bl0)),? (?P<way>.+)")
"""What is measured along a gauge length, as in ``Messlänge Standardweg`` and ``L0 - course standard``."""


ROLES_AND_SIZES = frozenset(["size"]).union(*(names for role, names in ROLES.items() if role not in ROLES_OF_TUBE))
"""Names of what is along an axis of a biaxial machine."""
STRESS_NOUNS = frozenset(noun for noun in NOUNS["stress"] if len(noun) > 1) | {"σ"}
"""Names of a stress whose measure they leave open; one letter may be anything else."""
AXES = {"x": "x", "y": "y", "1": "x", "2": "y"}
"""Axes of a biaxial machine, by how columns name them."""
COMPONENTS = {"stress": names_of("s, p, t"), "strain": names_of("e")}
"""Symbols of which a component such as S11 or Eyy is along an axis, of a measure that they leave open."""
DIRECTIONS_OF_WALL = {
    "x": r"circumferential|circumf\.?|circ\.?|hoop|umfangs|circonf[ée]rentielle?|circunferencial|circonferenziale|fd",
    "y": r"axial|longitudinal|long\.?|axiale?|längs|longitudinale|xd",
}
"""Directions in a wall, or along and across fibres, by the axis that they stand for."""

MEASURE_IN_BRACKETS = re.compile(
    rf"\s*[\[(]({'|'.join(measure.words for kind in MEASURES.values() for measure in kind)})[\])]", re.IGNORECASE
)
"""As in ``Strain (true) [%]``."""
CHANNEL = re.compile(r"\([^():]+:[^()]+\)(?=\s*[(\[])")
"""A channel of the machine before the unit, as in ``Position(Linear:Position) (mm)``."""
SYMBOL = re.compile(r" ([espftλσεγτ]|e ?gl)$")
"""A symbol after a name, as in ``Green strain E``."""
GREEK_SYMBOL = re.compile(r" [λεσγ]$")
"""One that leaves open which measure it is, as in ``Stretch λ``."""
COMPONENT = re.compile(r" (sigma|eps|[espft]|[σετ]) ?([1x]{2}|[2y]{2})$")
"""Likewise, of what is along an axis, as in ``Cauchy stress T11``."""
DEFORMATION_GRADIENT = re.compile(r"f ?(11|22|xx|yy)")
"""Its components that are stretches, where they have no unit as forces do."""
UNIT_IN_HEADING = (
    re.compile(r"(?P<quantity>.+?)\s*[\[({<](?P<unit>[^\])}>]*)[\])}>]?"),
    re.compile(r"(?P<quantity>[^/]+?)(?:,\s*|\s+in\s+)(?P<unit>\S+)"),
    re.compile(r"(?P<quantity>.+?)\s*/\s*(?P<unit>.+)"),
)
"""Forms of a name with a unit; brackets are often mistyped, as in ``Stress [kPa}``."""
QUOTIENT = re.compile(rf"[^{re.escape(BRACKETS)}/]+/[^{re.escape(BRACKETS)}/]+")
"""A unit without brackets, as in ``Stress N/mm^2``."""
FORMULA = re.compile(r"(?P<quantity>[^\[]*?[0o1])\s*(?:[\[(](?P<unit>[^\])]*)[\])])?", re.IGNORECASE)
FORMULAS = {
    **dict.fromkeys(["l/l0", "l/lo", "h/h0"], "stretch"),
    **dict.fromkeys(["δl/l0", "dl/l0", "deltal/l0", "δh/h0", "(l-l0)/l0", "l/l0-1", "u/l0"], "engineering strain"),
    **dict.fromkeys(["f/a0", "f/s0"], "engineering stress"),
}
"""What quotients of symbols are, in small letters without blanks."""
STRETCH_LESS = r"(lambda|λ|stretch( ratio)?|streckung)\s*[-–−]\s*{}\s*([\[(].*)?"
LESS_ONE, LESS_TWO = (re.compile(STRETCH_LESS.format(number), re.IGNORECASE) for number in (1, 2))
"""As in ``lambda - 1``, unless others are numbered likewise, as ``lambda-2`` is."""
REMEMBERED = 4096
"""Names that are taken apart once."""
COPY = re.compile(r"(?<=[^\d\s])\.\d$")
"""What pandas adds to a name that stands in a table again, as in ``Stress.1``."""
NEXT_WORD = re.compile(r"(?<=[a-zß-ÿ]{3})(?=[A-Z])|(?<=[A-Z][a-z]{2})(?=[A-Z])")
"""Where a word begins without a blank, as in ``TrueStrain`` and ``EngStress``; not in ``mmHg`` and ``kPa``."""
UNIT_AS_SUFFIX = re.compile(r"(?P<quantity>.+)[-_.:;|\s](?P<unit>\S*[^\W\d_]\S*|%)")


@dataclass(frozen=True)
class Heading:
    """A column name taken apart: ``Stress [kPa]`` is the quantity ``stress`` in the unit ``kPa``."""

    quantity: str
    unit: str = ""

    def with_unit(self, name: str) -> str:
        """Return another name with the unit, if there is one."""
        return f"{name} ({self.unit})" if self.unit else name


@lru_cache(maxsize=REMEMBERED)
def heading(name: str) -> Heading:
    """Take a column name apart into its quantity, in lower case, and its unit."""
    if force := FORCE_IN_SMALL_LETTERS.fullmatch(name.strip()):
        return Heading(plain(force["quantity"]), NEWTONS[force["unit"]])
    name = PERCENT_BEFORE.sub(r"\1 (%)", DIRECTION_IN_BRACKETS.sub("", CHANNEL.sub("", name)))
    if formula := FORMULA.fullmatch(name.strip()):
        quantity = FORMULAS.get(re.sub(r"[\s_]", "", formula["quantity"]).lower())
        if quantity:
            return Heading(quantity, (formula["unit"] or "").strip())
    name = MEASURE_IN_BRACKETS.sub(r" \1", COPY.sub("", NEXT_WORD.sub(" ", name.strip()))).strip()
    matches = list(filter(None, (pattern.fullmatch(name) for pattern in UNIT_IN_HEADING)))
    suffix = UNIT_AS_SUFFIX.fullmatch(name)
    is_unit = suffix is not None and looks_like_unit(suffix["unit"])
    if suffix is not None and is_unit and (not matches or QUOTIENT.fullmatch(suffix["unit"])):
        matches = [suffix]
    if not matches:
        return Heading(plain(name))
    match = next((match for match in matches if looks_like_unit(match["unit"])), matches[0])
    return Heading(plain(match["quantity"].rstrip(" ,.:;|_-")), match["unit"].strip())


def plain(name: str) -> str:
    """Return a name in lower case with blanks for hyphens and underscores."""
    return re.sub(r"[\s_–-]+", " ", name).strip().lower()


def dimensions_named(quantity: str, *, is_cylinder: bool = False) -> frozenset[str]:
    """Return the dimensions of a specimen that a name may mean, as its unit says; none for other names.

    A height is the length of a cylinder.

    Examples
    --------
    >>> dimensions_named("initial specimen width"), dimensions_named("messlänge standardweg")
    (frozenset({'width'}), frozenset({'length'}))
    >>> dimensions_named("height"), dimensions_named("height", is_cylinder=True)
    (frozenset(), frozenset({'length'}))
    """
    name = SYMBOL_AFTER.sub("", plain(OF_SPECIMEN.sub(" ", without_accents(quantity))))
    if (along := MEASURED_ALONG.search(name)) and along["way"] in ROLES["displacement"] | ROLES["strain"]:
        name = name[: along.start()]
    dimensions = frozenset(dimension for dimension, names in DIMENSION_NAMES.items() if name in names)
    return dimensions | {"length"} if is_cylinder and name in HEIGHT_NAMES else dimensions


def without_correction(quantity: str) -> str:
    """Return what a column holds without words that it was corrected, as for the machine's compliance.

    Examples
    --------
    >>> without_correction("corrected load"), without_correction("compliance corrected extension")
    ('load', 'extension')
    """
    return plain(CORRECTED.sub(" ", quantity))


def contents_of(names: Sequence[str], units: Sequence[str]) -> list[tuple[str, str]]:
    """Return what columns hold by their names, and the measure of strain or stress; empty texts of spreads.

    A stretch less one is a strain, unless the names number stretches; a component of the deformation gradient, which
    has no unit as forces do, is a stretch along its axis. Of columns with and without a correction only the corrected
    ones are named, and beside columns of a spread words for a mean are left out.

    Examples
    --------
    >>> contents_of(["lambda - 1", "True stress (kPa)"], ["", "kPa"]), contents_of(["lambda-1", "lambda-2"], ["", ""])
    ([('strain', ''), ('stress', 'cauchy')], [('lambda 1', ''), ('lambda 2', '')])
    >>> contents_of(["F11", "f1", "corrected load", "load"], ["", "", "N", "N"])
    [('stretch 11', ''), ('f1', ''), ('load', ''), ('', '')]
    """
    are_numbered = any(LESS_TWO.fullmatch(name.strip()) for name in names)
    less_one = [LESS_ONE.fullmatch(name.strip()) and not are_numbered for name in names]
    stated = ["strain" if is_one else heading(name).quantity for name, is_one in zip(names, less_one, strict=True)]
    quantities = [without_correction(quantity) for quantity in stated]
    corrected = {name for name, quantity in zip(quantities, stated, strict=True) if name != quantity}
    for column, (name, unit) in enumerate(zip(quantities, units, strict=True)):
        is_share_of_length = name in ROLES["length"] and measured_in(unit) == "strain"
        if stated[column] in corrected or is_share_of_length:
            quantities[column] = ""
        elif DEFORMATION_GRADIENT.fullmatch(name) and (not unit or measured_in(unit) == "strain"):
            quantities[column] = DEFORMATION_GRADIENT.sub(r"stretch \1", name)
    is_spread = [bool(of_spread(quantity)[0]) for quantity in quantities]
    if any(is_spread):
        quantities = [without_mean(quantity) or quantity for quantity in quantities]
    return [("", "") if spread else measure_in(name) for name, spread in zip(quantities, is_spread, strict=True)]


def measure_in(quantity: str) -> tuple[str, str]:
    """Return what a column holds without the words for a measure of strain or stress, and the name of that measure.

    Examples
    --------
    >>> measure_in("wahre dehnung"), measure_in("pk2"), measure_in("true stress x"), measure_in("stress")
    (('dehnung', 'true'), ('stress', 'second-piola-kirchhoff'), ('stress x', 'cauchy'), ('stress', ''))
    """
    for role, measures in MEASURES.items():
        for measure in measures:
            match = _words(measure.words).search(quantity)
            if not match:
                continue
            noun = plain(LINK.sub(" ", f"{quantity[: match.start()]} {quantity[match.end() :]}"))
            noun = COMPONENT.sub(r" \2", noun)
            axis, name = on_axis(noun)
            if name in ROLES[role]:
                return noun, measure.name
            if SYMBOL.sub("", name) in ROLES[role]:
                return SYMBOL.sub("", noun), measure.name
            is_component = bool(axis) and name in COMPONENTS.get(role, ())
            if name in NOUNS.get(role, ()) or is_component or (not noun and SAYS_ALONE.fullmatch(match[0])):
                return f"{role} {axis}".strip(), measure.name
    noun = GREEK_SYMBOL.sub("", quantity)
    return (noun if any(noun in names for names in ROLES.values()) else quantity), ""


def is_of_role(name: str) -> bool:
    """Tell whether a name is that of a deformation or a load."""
    return any(measure_in(heading(name).quantity)[0] in names for names in ROLES.values())


def of_spread(quantity: str) -> tuple[str, str]:
    """Return what a column holds beside a mean, ``sem``, ``sd`` or ``open``, and of what; empty texts for others.

    Examples
    --------
    >>> of_spread("stress std dev"), of_spread("sem"), of_spread("±"), of_spread("stress")
    (('sd', 'stress'), ('sem', ''), ('open', ''), ('', ''))
    """
    for kind, words in SPREAD_WORDS.items():
        match = _words(words).search(quantity)
        if match:
            noun = without_mean(f"{quantity[: match.start()]} {quantity[match.end() :]}")
            return kind, plain(re.sub(r"\bof( the)?\b", " ", noun))
    return "", ""


def without_mean(quantity: str) -> str:
    """Return what a column holds without words for a mean."""
    return plain(_words(MEAN_WORDS).sub(" ", quantity))


def is_of_mean(quantity: str) -> bool:
    """Tell whether a column of that name is of a mean of specimens."""
    return _words(MEAN_WORDS).search(quantity) is not None


@cache
def _words(words: str) -> re.Pattern[str]:
    """Return the pattern of words, not within others; those of Chinese or Japanese letters may be."""
    return re.compile(rf"(?<![a-zß-ÿа-яё])(?:{words})(?![a-zß-ÿа-яё])")


def is_of_specimens(quantity: str) -> bool:
    """Tell whether a column of that name tells which specimen a row is of.

    Examples
    --------
    >>> is_of_specimens("specimen id"), is_of_specimens("specimen width")
    (True, False)
    """
    return SPECIMEN_NAME.fullmatch(quantity) is not None


def on_axis(quantity: str) -> tuple[str, str]:
    """Return the axis (x, y, or nothing) that a column of a biaxial machine belongs to, and its name without it.

    Axes that are numbered 1 and 2 are x and y, as are the circumferential and the axial direction; components such as
    xx and 22 are along them.

    Examples
    --------
    >>> on_axis("xforce"), on_axis("stress y"), on_axis("stretch 1"), on_axis("sigma yy"), on_axis("load")
    (('x', 'force'), ('y', 'stress'), ('x', 'stretch'), ('y', 'sigma'), ('', 'load'))
    """
    splits = [(quantity[:1], quantity[1:].strip()), (quantity[-1:], quantity[:-1].strip())]
    if quantity[-1:] == quantity[-2:-1]:
        component = quantity[-1:], quantity[:-2].strip()
        if component[0] in AXES and component[1] in frozenset().union(*COMPONENTS.values()):
            return AXES[component[0]], component[1]
        splits.append(component)
    for axis, name in splits:
        if axis in AXES and (name in ROLES_AND_SIZES or name in STRESS_NOUNS):
            return AXES[axis], name
    for axis, words in DIRECTIONS_OF_WALL.items():
        name = plain(_words(words).sub(" ", quantity, count=1))
        if name != quantity and (name in ROLES_AND_SIZES or name in STRESS_NOUNS):
            return axis, name
    return "", quantity


def on_lettered_axis(quantity: str) -> tuple[str, str]:
    """Return `on_axis`, but for axes that are numbered: the numbers may be those of specimens.

    Examples
    --------
    >>> on_lettered_axis("stress y"), on_lettered_axis("stretch 1")
    (('y', 'stress'), ('', 'stretch 1'))
    """
    axis, name = on_axis(quantity)
    is_numbered = AXES.keys() - AXES.values() & {quantity[:1], quantity[-1:]}
    return ("", quantity) if is_numbered else (axis, name)


def on_axes_by_unit(names: Sequence[tuple[str, str]], units: Sequence[str]) -> list[tuple[str, str]]:
    """Return axes and names of columns, where others have axes also of a symbol that its unit makes one of a load.

    Examples
    --------
    >>> on_axes_by_unit([("", "p1"), ("", "fx"), ("", "f x"), ("", "f1"), ("y", "p")], ["kPa", "N", "", "", "kPa"])
    [('x', 'p'), ('x', 'force'), ('x', 'force'), ('', 'f1'), ('y', 'p')]
    """
    return [name if name[0] else _on_axis_by_unit(name[1], unit) for name, unit in zip(names, units, strict=True)]


def _on_axis_by_unit(quantity: str, unit: str) -> tuple[str, str]:
    symbol, axis, kind = quantity[:1], quantity[1:].strip(), measured_in(unit)
    if axis in AXES and symbol in COMPONENTS["stress"] and kind == "stress":
        return AXES[axis], symbol
    if axis in AXES and symbol == "f" and (kind == "force" or not (unit or axis.isdecimal())):
        return AXES[axis], "force"
    return "", quantity
