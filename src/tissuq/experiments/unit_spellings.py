"""Spellings of units: symbols of any quantity, words for them, and units in Cyrillic and Chinese letters."""

from __future__ import annotations

import re

__all__ = ["SPELLINGS", "SYMBOLS", "in_latin"]

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
SYMBOLS = {
    "Pa", "hPa", "kPa", "MPa", "GPa", "KPa", "kpa", "mPa", "Mpa", "MPA", "mpa", "psi", "ksi",
    "bar", "mbar", "atm", "mmHg", "mmhg", "Hg", "torr", "Torr", "cmH2O", "mmH2O",
    "N", "mN", "uN", "nN", "pN", "cN", "dN", "daN", "hN", "kN", "MN", "kgf", "gf", "kp", "dyn", "dyne", "lbf", "lbF",
    "lb", "kg", "g", "m", "cm", "mm", "um", "micron", "nm", "in", "inch", "ft", "px", "pixel", "pixels", "Pixel",
    "Pixels", "pix", "h", "min", "sec", "Sec", "s", "ms", "Hz", "K", "C", "F", "Nm", "mNm", "uNm", "nNm", "kNm", "Ncm",
    "mNcm", "Nmm", "mNmm", "V", "mV", "deg", "degrees", "rad", "mrad", "percent", "pct",
}  # fmt: skip
"""Of quantities of any kind."""


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
