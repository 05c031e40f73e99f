"""Units as laboratories write them: of stress in MPa, of strain as a plain ratio, of length, area, force and others."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, prod

from tissuq.errors import InputError
from tissuq.experiments.numbers import number_and_unit, sides_and_unit
from tissuq.experiments.pint_units import stress_factor

COMMON_STRESS_UNITS = {
    "Pa": 1e-6,
    "hPa": 1e-4,
    "kPa": 1e-3,
    "MPa": 1.0,
    "GPa": 1e3,
    "N/mm2": 1.0,
    "N/cm2": 1e-2,
    "N/m2": 1e-6,
    "kN/m2": 1e-3,
    "MN/m2": 1.0,
    "mN/mm2": 1e-3,
    "kgf/cm2": 0.0980665,
    "kgf/mm2": 9.80665,
    "gf/mm2": 9.80665e-3,
    "dyn/cm2": 1e-7,
    "psi": 0.006894757293168361,
}
SMALL, READABLE = 0.1, (1.0, 1e-3)
"""Share of a unit below which a stress is read in a smaller one, and the units (MPa) of which that holds."""
PASCALS = {unit.lower(): unit for unit in COMMON_STRESS_UNITS if unit.endswith("Pa")}
STRAIN_UNITS = dict.fromkeys(["", "1", "-", "mm/mm"], 1.0)
STRAIN_UNITS |= dict.fromkeys(["%", "percent", "pct"], 0.01)
STRAIN_UNITS |= dict.fromkeys(["‰", "permille", "mε", "millistrain"], 1e-3)
STRAIN_UNITS |= dict.fromkeys(["µε", "με", "microstrain"], 1e-6)
POWER_OF_TEN = re.compile(
    r"(?:10\s*(?:(?:\^|\*\*)\s*\(?(?P<power>[+-]?\d+)\)?|(?P<raised>[⁺⁻]?[⁰¹²³⁴⁵⁶⁷⁸⁹]+))|1[eE](?P<digits>[+-]?\d+))"
    r"\s*[*·⋅]?\s*(?P<unit>[^\W\d].*)"
)
"""Before a unit that is multiplied by it, as in ``10^-2 MPa``; ``x 10^-2`` may be of the numbers instead."""
RAISED = str.maketrans("⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "+-0123456789")
LARGEST_POWER = 12
"""Exponent of ten before a unit, at most."""
BRACKETS = "[](){}<>"
"""What units stand in, not always well matched."""
MASSES = {"g": "gf", "kg": "kgf", "lb": "lbf"}
MASSES |= dict.fromkeys(["gram", "grams"], "gf") | dict.fromkeys(["kilogram", "kilograms"], "kgf")
MASSES |= dict.fromkeys(["lbs", "pound", "pounds"], "lbf")
"""Units of mass that are written where units of force are meant, and these."""

OF_LETTERS = {
    "мм": "mm", "см": "cm", "м": "m", "мкм": "um", "нм": "nm",
    "Н": "N", "кН": "kN", "мН": "mN", "мкН": "uN", "МН": "MN", "н": "N", "кгс": "kgf", "гс": "gf", "кГ": "kgf",
    "кг": "kg", "г": "g", "Па": "Pa", "кПа": "kPa", "МПа": "MPa", "ГПа": "GPa", "гПа": "hPa", "мПа": "mPa",
    "бар": "bar", "мбар": "mbar", "атм": "atm", "с": "s", "сек": "s", "мс": "ms", "мин": "min", "ч": "h", "Гц": "Hz",
    "рад": "rad", "мрад": "mrad", "град": "deg",
    "毫米": "mm", "厘米": "cm", "米": "m", "微米": "um", "牛": "N", "牛顿": "N", "千牛": "kN", "毫牛": "mN",
    "帕": "Pa", "千帕": "kPa", "兆帕": "MPa", "秒": "s", "分钟": "min", "度": "deg", "弧度": "rad",
}  # fmt: skip
"""Units in Cyrillic and Chinese letters, as the International System of Units has them."""
MERCURY = re.compile(r"мм\.?\s*рт\.?\s*ст\.?")
WORD = re.compile(r"[\u0400-\u04ff\u4e00-\u9fff]+")
SPELLINGS = dict.fromkeys(["micron", "microns", "micrometer", "micrometre"], "um") | {"inch": "in", "inches": "in"}
SPELLINGS |= {"lbf": "lbf", "kgf": "kgf", "newton": "N", "newtons": "N", "millimeter": "mm", "millimetre": "mm"}
SPELLINGS |= {"millimeters": "mm", "millimetres": "mm", "centimeter": "cm", "centimetre": "cm", "centimeters": "cm"}
SPELLINGS |= {"centimetres": "cm", "meter": "m", "metre": "m", "meters": "m", "metres": "m", "micrometers": "um"}
SPELLINGS |= {"micrometres": "um", "millinewton": "mN", "millinewtons": "mN", "kilonewton": "kN", "kilonewtons": "kN"}
"""Units in other spellings, in small letters."""


@dataclass(frozen=True)
class StressUnit:
    """A unit of stress.

    Parameters
    ----------
    name : str
        The unit as the user wrote it, pascals with the capitals of the SI.
    to_mpa : float
        Number of MPa in one such unit.
    """

    name: str
    to_mpa: float

    def written(self, stress: float) -> str:
        """Return a stress in MPa as people read it, in this unit.

        Examples
        --------
        >>> StressUnit("kPa", 1e-3).written(0.25)
        '250 kPa'
        """
        return f"{stress / self.to_mpa:.6g} {self.name}"

    def readable(self, stress: float) -> StressUnit:
        """Return this unit, or kPa or Pa where the largest stress, in MPa, is less than a tenth of MPa or kPa.

        Examples
        --------
        >>> StressUnit("MPa", 1.0).readable(0.25).name, StressUnit("MPa", 1.0).readable(0.004).name
        ('MPa', 'kPa')
        """
        smaller = (StressUnit(name, COMMON_STRESS_UNITS[name]) for name in ("kPa", "Pa"))
        is_small = self.to_mpa in READABLE and stress < SMALL * self.to_mpa
        return next((unit for unit in smaller if is_small and stress >= SMALL * unit.to_mpa), self)


def stress_unit(text: str) -> StressUnit:
    """Return the stress unit that a text means.

    Accepted are all pressure units that pint knows, powers with or without a mark (``N/mm2``,
    ``N/mm^2``, ``N/mm²``), and pascals in any capitals: ``KPa``, ``MPA`` and ``mpa`` are kilo- and
    megapascal. Only ``mPa`` is refused: it is the millipascal of the SI, and nearly always a slip.

    Raises
    ------
    InputError
        When the unit is unknown, is not a force over an area, or is ``mPa``.

    Examples
    --------
    >>> stress_unit("kpa")
    StressUnit(name='kPa', to_mpa=0.001)
    >>> stress_unit("N/mm²")
    StressUnit(name='N/mm²', to_mpa=1.0)
    >>> stress_unit("10^-2 MPa").to_mpa
    0.01
    """
    name = str(text).strip()
    multiple, unit = _without_power(name)
    if multiple != 1:
        return StressUnit(name, multiple * stress_unit(unit).to_mpa)
    power_and_unit = name.lstrip("x×*· ")
    if power_and_unit != name and _without_power(power_and_unit)[0] != 1:
        raise InputError(
            f"'{name}' may be what the numbers are to be multiplied by, or say by what they have been. In the first "
            f"case write {power_and_unit}, without the sign of multiplication."
        )
    compact = _compact(name)
    if compact == "mPa":
        raise InputError("'mPa' is the millipascal; write MPa for megapascal, or millipascal in full.")
    if compact.lower() in PASCALS:
        compact = PASCALS[compact.lower()]
    factor, spelling = PRESSURE.factors.get(compact), name.lower() if name.lower() in WORDS else in_latin(name)
    return StressUnit(PASCALS.get(name.lower(), name), stress_factor(spelling) if factor is None else factor)


def _without_power(unit: str) -> tuple[float, str]:
    """Return the power of ten before a unit, 1 where there is none, and the unit."""
    match = POWER_OF_TEN.fullmatch(unit.strip())
    if not match:
        return 1.0, unit
    power = int(match["power"] or match["digits"] or match["raised"].translate(RAISED))
    return (float(f"1e{power}"), match["unit"]) if abs(power) <= LARGEST_POWER else (1.0, unit)


def _compact(unit: str) -> str:
    """Return a unit of stress without blanks and marks of powers, in Latin letters."""
    return re.sub(r"\s+|\^|\*\*", "", in_latin(unit)).replace("²", "2")


def strain_factor(text: str) -> float:
    """Return what one unit of strain is as a plain ratio: 1 for ``mm/mm``, ``-`` or nothing, 0.01 for ``%``.

    Raises
    ------
    InputError
        When the text is not a unit of strain.

    Examples
    --------
    >>> strain_factor("%"), strain_factor("mm/m")
    (0.01, 0.001)
    """
    compact = re.sub(r"\s+", "", in_latin(str(text))).lower()
    if compact in STRAIN_UNITS:
        return STRAIN_UNITS[compact]
    length, _, over = compact.partition("/")
    factors = LENGTH.factor_or_none(length), LENGTH.factor_or_none(over)
    if factors[0] is None or factors[1] is None:
        raise InputError(f"'{text}' is not a unit of strain; write '%', or '1' (also 'mm/mm') for a plain ratio.")
    return factors[0] / factors[1]


@dataclass(frozen=True)
class Quantity:
    """A kind of quantity: its name, the unit of the values here, and what other units are in it."""

    name: str
    unit: str
    factors: Mapping[str, float]
    ignored: str = r"[\s^]"
    """What may stand within a unit."""

    def factor_or_none(self, text: str) -> float | None:
        """Return what one unit of that name is in the unit of this quantity; None for other quantities."""
        multiple, unit = _without_power(text)
        compact = re.sub(self.ignored, "", in_latin(unit)).replace("µ", "u").replace("μ", "u").replace("²", "2")
        factor = self.factors.get(SPELLINGS.get(compact.lower(), compact))
        return None if factor is None else factor * multiple

    def factor(self, text: str) -> float:
        """Return what one unit of that name is in the unit of this quantity.

        Raises
        ------
        InputError
            When it is not a unit of this quantity.

        Examples
        --------
        >>> FORCE.factor("mN")
        0.001
        """
        factor = self.factor_or_none(text)
        if factor is None and self.name == "force" and (force := MASSES.get(text.lower())):
            raise InputError(f"'{text}' is a mass, not a force; if the unit of force is meant, write {force}.")
        if factor is None and self.name == LENGTH.name and PIXELS.factor_or_none(text):
            raise InputError(
                f"'{text}' is no length. A distance between marks in pixels is read as --column length=NAME, with the "
                'undeformed one (--length "812 px") where the test does not begin there.'
            )
        if factor is None:
            raise InputError(f"'{text}' is not a unit of {self.name}; write one of {', '.join(self.factors)}.")
        return factor

    def value(self, text: str) -> float:
        """Return a positive number with its unit, such as ``1.5 mm``, or an area by its sides, in the unit of this.

        Raises
        ------
        InputError
            When the number or its unit is missing, not positive, or not of this quantity.

        Examples
        --------
        >>> LENGTH.value("1.5 cm"), AREA.value("5 x 2 mm")
        (15.0, 10.0)
        """
        sides, unit_of_sides = sides_and_unit(text)
        if len(sides) == 2 and min(sides) > 0 and self.name == AREA.name:
            return prod(sides) * LENGTH.factor(unit_of_sides) ** 2
        number, unit = number_and_unit(text)
        if len(sides) == 2 and self.name == LENGTH.name:
            raise InputError(f"'{text}' is no length, but two sides of a cross-section: give it as area (--area).")
        if number is None or number <= 0:
            raise InputError(f"'{text}' is not a {self.name}; write a positive number with its unit: '10 {self.unit}'.")
        if not unit:
            raise InputError(f"the {self.name} '{text}' has no unit; write it with one, such as '{text} {self.unit}'.")
        return number * self.factor(unit)


LENGTH = Quantity("length", "mm", {"mm": 1.0, "cm": 10.0, "m": 1e3, "um": 1e-3, "in": 25.4})


PIXELS = Quantity("pixels", "px", dict.fromkeys(["px", "pixel", "pixels", "Pixel", "Pixels", "pix"], 1.0))
"""Distances in pictures, which are lengths only in proportion to another one."""


ANGLE = Quantity("angle", "rad", {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180, "°": pi / 180, "degrees": pi / 180})


AREA = Quantity("area", "mm2", {f"{unit}2": factor**2 for unit, factor in LENGTH.factors.items()})


FORCE = Quantity(
    "force",
    "N",
    {"N": 1.0, "mN": 1e-3, "uN": 1e-6, "kN": 1e3, "gf": 9.80665e-3, "kgf": 9.80665, "lbf": 4.4482216152605}
    | {"cN": 1e-2, "dN": 0.1, "daN": 10.0, "hN": 100.0, "nN": 1e-9, "pN": 1e-12, "dyn": 1e-5},
)


FORCE_PER_WIDTH = Quantity(
    "force per width",
    "N/mm",
    {
        f"{force}/{length}": FORCE.factors[force] / LENGTH.factors[length]
        for force in FORCE.factors
        for length in LENGTH.factors
    },
)
"""As of sheets and membranes, whose thickness makes it a stress."""


TIME = Quantity("time", "s", {"s": 1.0, "sec": 1.0, "Sec": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0})


RATE = Quantity(
    "rate",
    "1/s",
    {form.format(unit): 1 / factor for unit, factor in TIME.factors.items() for form in ("1/{}", "{}-1", "/{}")},
)


PRESSURES = {"mmHg": 133.322387415e-6, "mmhg": 133.322387415e-6, "cmH2O": 98.0665e-6, "mmH2O": 9.80665e-6}


PRESSURES |= dict.fromkeys(["torr", "Torr"], 0.101325 / 760) | {"mbar": 1e-4, "bar": 0.1, "atm": 0.101325}
"""Conventional columns of mercury (13.5951 g/cm3) and water (1 g/cm3) under standard gravity, and multiples of the
bar."""


PRESSURE = Quantity("pressure", "MPa", PRESSURES | COMMON_STRESS_UNITS | {"kpa": 1e-3, "KPa": 1e-3})


TORQUE = Quantity(
    "torque",
    "N mm",
    {
        f"{force}{length}": FORCE.factors[force] * LENGTH.factors[length]
        for force in ("N", "mN", "uN", "kN")
        for length in ("m", "cm", "mm")
    }
    | {"nNm": 1e-6},
    ignored=r"[\s^.·⋅*-]",
)


SYMBOLS = frozenset().union(*(kind.factors for kind in (LENGTH, PIXELS, ANGLE, FORCE, TIME, PRESSURE, TORQUE))) | {
    "mPa", "Mpa", "MPA", "mpa", "ksi", "Hg", "MN", "kp", "dyne", "lbF", "lb", "kg", "g", "micron", "nm", "inch", "ft",
    "Hz", "K", "C", "F", "V", "mV", "percent", "pct",
}  # fmt: skip
"""Units of quantities of any kind."""
WORDS = {unit.replace("µ", "u").replace("μ", "u") for unit in (*SPELLINGS, *STRAIN_UNITS, *MASSES) if len(unit) > 1}
WORDS |= {f"{prefix}pascal{end}" for prefix in ("", "kilo", "mega") for end in ("", "s")}
WORDS -= {"meter", "micrometer"}
"""Units in words, in small letters, but for those that instruments are called, too."""


def measured_in(unit: str) -> str:
    """Return what a usual unit is one of, such as a stress, a pressure, a force, a length or a time; or nothing.

    Units that pressures and stresses share are those of a stress.

    Examples
    --------
    >>> [measured_in(unit) for unit in ("kPa", "mmHg", "N", "mm", "%", "s", "V", "")]
    ['stress', 'pressure', 'force', 'length', 'strain', 'time', '', '']
    """
    compact = _compact(_without_power(unit)[1])
    if compact in COMMON_STRESS_UNITS or compact.lower() in PASCALS:
        return "stress"
    for quantity in (FORCE, LENGTH, ANGLE, TORQUE, PRESSURE, FORCE_PER_WIDTH, PIXELS):
        if quantity.factor_or_none(compact) is not None:
            return quantity.name
    if compact and compact.lower() in STRAIN_UNITS:
        return "strain"
    return TIME.name if TIME.factor_or_none(compact.lower()) else ""


def looks_like_unit(text: str) -> bool:
    """Tell whether a cell beneath a column name reads as a unit of anything: ``[kPa]``, ``%``, ``s``."""
    text = in_latin(text.strip())
    if re.fullmatch(r"[\[({<].*[\])}>]|[%‰°1-]|", text):
        return True
    symbols = [
        symbol
        for symbol in re.split(r"(?:[\s·*/.^%°⁻²³-]|(?<!H)\d)+", text.replace("µ", "u").replace("μ", "u"))
        if symbol
    ]
    return bool(symbols) and all(symbol in SYMBOLS or symbol.lower() in WORDS for symbol in symbols)


def stress_units_in(text: str) -> list[str]:
    """Return the usual units of stress among the words of a text.

    Examples
    --------
    >>> stress_units_in("Stress.kPa of the 2nd cycle"), stress_units_in("P in N/mm2"), stress_units_in("Pascal's test")
    (['kPa'], ['N/mm2'], [])
    """
    words = re.findall(r"[^\W\d_]+(?:/[^\W\d_]+[2²])?", in_latin(text.replace("^", "")))
    return [word for word in words if word in COMMON_STRESS_UNITS or word.lower() in PASCALS.keys() - {"pa"}]


def in_latin(unit: str) -> str:
    """Return a unit with its parts in Cyrillic or Chinese letters in Latin ones, others as they are.

    Examples
    --------
    >>> in_latin("Н/мм2"), in_latin("кПа"), in_latin("мм рт. ст."), in_latin("mm")
    ('N/mm2', 'kPa', 'mmHg', 'mm')
    """
    if unit.isascii():
        return unit
    return WORD.sub(lambda word: OF_LETTERS.get(word[0], word[0]), MERCURY.sub("mmHg", unit))
