"""The loading mode that a file states: in a comment or a column, by its name or that of a sheet, or by its columns."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode, loading_mode, loading_modes
from tissuq.experiments.reading.columns_of_tube import mode_of_tube
from tissuq.experiments.reading.headings import (
    COMPONENTS,
    NEXT_WORD,
    STRESS_NOUNS,
    heading,
    measure_in,
    on_axes_by_unit,
    on_axis,
    on_lettered_axis,
)
from tissuq.experiments.reading.options import ReadingOptions
from tissuq.experiments.reading.recognition import SHEARS, adding
from tissuq.experiments.reading.table import Table
from tissuq.experiments.reading.vocabulary import ROLE_OF_AXIAL_STRETCH, ROLES

DEFAULT_MODE = "uniaxial"
"""Where nothing states one."""
GIVEN, DEFAULT_SOURCE = "as given", "nothing says otherwise"
"""Where a mode comes from that the file does not state."""
MODE_WORDS = {"tension": "uniaxial", "compression": "uniaxial", "axial": "uniaxial", "shear": "simple-shear"}
"""Words for loading modes beside their names."""
NAMES_OF_MODES = {"pure-shear": "planar"}
"""Further names of loading modes."""
ABBREVIATIONS = {
    **dict.fromkeys(["ut", "uc", "ux"], "uniaxial"),
    **dict.fromkeys(["et", "eb", "ebt", "ebx"], "equibiaxial"),
    "ps": "planar",
    "ss": "simple-shear",
}
"""What modes are called in tables: uniaxial tension, pure shear and so on. Such letters may mean anything elsewhere."""
LONGEST_ABBREVIATION = 3
"""Capital letters."""
ABBREVIATED = re.compile(r"(?<![^\W_])(ET|EBT?|EBX|PS)(?![^\W_])")
"""Those of modes that are not read unless said, within the name of a file or a sheet."""
AXIS_2 = "@2"
"""After the name of a mode: of a specimen along axis 2 of the tissue."""
NAMES_OF_COLUMN = frozenset({"mode", "loading mode", "mode of loading", "deformation mode", "test mode"})
"""Names of a column that tells in which loading mode a row was measured."""
OF_MACHINE = re.compile(
    r"^\W*(test(ing)? )?(station|machine|frame|system|device|rig|instrument|configuration|(prüf)?maschine)\b[^:=]*[:=]|"
    r"\w\.(?!csv|tsv|txt|dat|xls|ods|mat)[a-z]\w{1,3}\W*$",
    re.IGNORECASE,
)
"""Lines that name a machine or a file of its settings, such as ``Biaxial.cfg``, and not what was done with it."""
MEANT = {
    "biaxial": " If both axes were stretched alike, call it equibiaxial.",
    "simple-shear": " If it is pure shear, of a wide strip that was pulled, call it planar.",
}
"""What a mode may be that words of files name so."""
RISES_WITH, PRESSURE_RISES = 0.9, 0.2
"""Correlation of a stress and a pressure beyond which one comes from the other, and by which share that rises."""
CONFINED = re.compile(r"(^|-)confined($|-)")
"""Words for compression between walls, which no loading mode is."""
RHEOMETER = re.compile(
    r"parallel[ -]plate|plate[ -/]plate|platte[ -/]platte|cone|kegel|geometry name|rheomet|interval and data points|"
    r"interval data|rheocompass|\btrios\b"
)
"""Words above a table of a rheometer."""
OF_RHEOMETER = re.compile(
    r"normal ?(force|stress|kraft|spannung)|force normale|\bgap\b|spalt|нормальн|法向力|法線力|^step time$"
)
"""Names of columns that a rheometer writes beside strain and stress."""
DIRECTIONS_OF_LOAD = {
    "compression": re.compile(
        r"compress|(?<![a-z])compr(?![a-z])|compresi|(?<![^\W_])druck|stauch|压缩|压应|圧縮|압축|сжати|сжим|ściskan"
    ),
    "tension": re.compile(
        r"(?<![a-z])tension|tensile|zugversuch|traction|tracci|trazione|tração|拉伸|引張|인장|растяжени|rozciągan"
    ),
}
"""Words for the direction of a load."""
SIZES_OF_SHEET = frozenset({"length", "width", "thickness"})
"""Those that forces along both of its axes need."""
BY_KIND = ["stretch", "stretch", "load", "load"]
"""Stretches or strains and loads of two axes, in this order; those of two specimens are one test after another."""
HEAD_LINES = 20
"""Lines of a file in which a comment may state its mode."""


def mode_named(stem: str, words: Sequence[str] = ()) -> tuple[str, str]:
    """Return the mode that the name of a file without its ending says, and where; empty texts where it says none.

    Other words, such as the name of a sheet, go before it, the last ones first.

    Examples
    --------
    >>> mode_named("liver-7-planar"), mode_named("simple_shear"), mode_named("liver", ["Sheet 1", "tension"])
    (('planar', 'the name of the file'), ('simple-shear', 'the name of the file'), ('uniaxial', "'tension'"))
    """
    for word in reversed([word for word in words if not OF_MACHINE.search(word)]):
        if mode := _mode_of_words(word):
            return mode, f"'{word}'"
    mode = _mode_of_words(stem)
    return mode, "the name of the file" if mode else ""


def mode_of(
    file: str | os.PathLike[str], table: Table, options: ReadingOptions, words: Sequence[str] = ()
) -> tuple[str | LoadingMode, str]:
    """Return the mode of the options; else that the file states, or its columns leave no choice about; else uniaxial.

    Parameters
    ----------
    file : str or path
    table : Table
    words : sequence of str
        Further names of the test.
    options : ReadingOptions
        Where they choose columns or an axis, other columns tell nothing.

    Returns
    -------
    (str or LoadingMode, str)
        The mode, and where it comes from.
    """
    if (wanted := options.get("mode")) is not None:
        return wanted, GIVEN
    path, is_by_word = Path(file), False
    mode, source = _mode_of_words(comment_on_mode(path)), "a comment in the file"
    for column in range(len(table.names)) if not mode else ():
        _check_modes_in_column(table, column)
        if len(modes := modes_in_column(table, column)) == 1:
            mode, source = modes.pop(), f"column {table.label(column)}"
            break
    if not mode:
        mode, source = mode_named(path.stem, [table.sheet, table.title, *words])
        is_by_word = mode == DEFAULT_MODE  # which a tube may be called, too: axial
    columns = options.get("columns") or {}
    if not mode and columns.keys() & {*SHEARS, "torque"}:
        mode, source = "simple-shear", "a column of shear"
    if (is_by_word or not mode) and not options.get("axis"):
        of_tube = mode_of_tube(table, options)
        mode, source = of_tube if of_tube[0] else (mode, source)
    if not mode and (options.get("axial_stretch") is not None or ROLE_OF_AXIAL_STRETCH in columns):
        mode, source = "inflated-tube", "an axial stretch"
    if not (mode or columns or options.get("axis")):
        mode, source = _mode_of_columns(table, options.get("dimensions") or {})
    if not mode:
        _check_abbreviations(table, path.stem, table.sheet)
    return (mode, source) if mode else (DEFAULT_MODE, DEFAULT_SOURCE)


def _check_abbreviations(table: Table, *names: str) -> None:
    """Ask about a name in which letters stand that may abbreviate a loading mode, as in ``Treloar_PS``."""
    for name in names:
        if letters := ABBREVIATED.search(name):
            mode = ABBREVIATIONS[letters[0].lower()]
            raise InputError(
                f"{table.file}: {letters[0]} in '{name}' may mean the loading mode {mode}, and nothing else says one. "
                f"If it does, give --mode {mode}; if not, --mode {DEFAULT_MODE}, or another."
            )


def modes_in_column(table: Table, column: int) -> set[str]:
    """Return the loading modes that the cells of a column name, if its name says that it tells them."""
    if table.quantities[column] not in NAMES_OF_COLUMN:
        return set()
    return {_mode_of_words(cell) for cell in set(table.texts(column))} - {""}


def _check_modes_in_column(table: Table, column: int) -> None:
    """Refuse a column that tells the modes, and abbreviates one that is not known."""
    cells = sorted(set(table.texts(column))) if table.quantities[column] in NAMES_OF_COLUMN else []
    for cell in cells:
        if cell.isupper() and len(cell) <= LONGEST_ABBREVIATION and not _mode_of_words(cell):
            raise InputError(
                f"{table.place(column)}: '{cell}' is no loading mode that is known. Write the mode there, such as "
                "uniaxial, equibiaxial, planar or simple-shear (tissuq modes lists them), or give --mode."
            )


def direction_of(*texts: str) -> str:
    """Return the direction of load, compression or tension, that the last of some texts to say one says.

    Examples
    --------
    >>> direction_of("Compression", "sample 3"), direction_of("liver", "tension and compression")
    ('compression', '')
    """
    said = [{name for name, words in DIRECTIONS_OF_LOAD.items() if words.search(text.lower())} for text in texts]
    last = next((names for names in reversed(said) if names), set())
    return last.pop() if len(last) == 1 else ""


def is_named_by_mode(text: str) -> bool:
    """Return whether words are those of a loading mode alone, as what tells tests apart.

    Examples
    --------
    >>> is_named_by_mode("pure shear"), is_named_by_mode("ut"), is_named_by_mode("axial")
    (True, True, False)
    """
    words = text.lower().split()
    of_modes = {*ABBREVIATIONS, "tension", "compression", "pure"}.union(*(name.split("-") for name in loading_modes()))
    return bool(words) and of_modes.issuperset(words)


def is_torque(name: str) -> bool:
    """Return whether the name of a column is that of a torque."""
    return measure_in(heading(name).quantity)[0] in ROLES["torque"]


def check_not_sheared(table: Table) -> None:
    """Refuse strains and stresses of which nothing says the mode, and that a rheometer seems to have measured."""
    columns = [f"column '{name}' is a torque" for name in table.names if is_torque(name)]
    columns += [f"it has a column '{name}'" for name in table.names if OF_RHEOMETER.search(heading(name).quantity)]
    lines = [f"line {line} says '{text.strip()}'" for line, text in table.head if RHEOMETER.search(text.lower())]
    if signs := lines or columns:
        raise InputError(
            f"{table.file}: {signs[0]}, as rheometers write it: if one sheared the specimen, give --mode simple-shear, "
            "if it was pulled or pressed, --mode uniaxial."
        )


def check_not_inflated(table: Table, stress: int) -> None:
    """Ask about a stress that rises with a pressure beside it where nothing says the mode: a wall was inflated."""
    for column, quantity in enumerate(table.quantities):
        if column == stress or quantity not in ROLES["pressure"] or not table.varies(column):
            continue
        pressures, stresses = table.without_missing([column, stress]).numbers([column, stress])
        rises = np.ptp(pressures) > PRESSURE_RISES * np.abs(pressures).max() and np.ptp(stresses) > 0
        if rises and np.corrcoef(pressures, stresses)[0, 1] > RISES_WITH:
            raise InputError(
                f"{table.place(stress)} rises with the pressure {table.label(column)}: if that stretched the specimen, "
                "say in which loading mode it was, such as --mode equibiaxial (a membrane that bulges) or planar (a "
                f"tube that keeps its length); if it was pulled, --mode {DEFAULT_MODE}."
            )


def about_mode(mode: str, source: str) -> AbstractContextManager[None]:
    """Add to what is wrong with the columns where the file's loading mode comes from, unless it was given."""
    is_stated = mode and source not in ("", GIVEN, DEFAULT_SOURCE)
    about = f"The loading mode {mode} is from {source}; give --mode for another.{MEANT.get(mode, '')}"
    return adding(about if is_stated else "")


def _mode_of_columns(table: Table, sizes: Collection[str]) -> tuple[str, str]:
    """Return the mode that the columns of a table leave no choice about, and why; empty texts where they do.

    Numbers may be those of specimens; with the sizes of a sheet along both axes given, two of each are of axes.
    """
    quantities = [measure_in(quantity)[0] for quantity in table.quantities]
    deformations = ROLES["stretch"] | ROLES["strain"] | ROLES["displacement"]
    loads = ROLES["stress"] | STRESS_NOUNS | COMPONENTS["stress"] | ROLES["force"]
    is_of_sheet = SIZES_OF_SHEET.issubset(sizes)
    on_axes = [(on_axis if is_of_sheet else on_lettered_axis)(quantity) for quantity in quantities]
    if any(axis and name in deformations for axis, name in on_axes):
        on_axes = on_axes_by_unit(on_axes, [*map(table.unit, range(len(on_axes)))])
    kinds = ["load" if name in loads else name for _, name in on_axes if name in deformations | loads]
    kinds = ["stretch" if name in ROLES["stretch"] | ROLES["strain"] else name for name in kinds]
    are_numbered = not any(on_lettered_axis(quantity)[0] for quantity in quantities)
    has_both = all({axis for axis, name in on_axes if name in names} >= {"x", "y"} for names in (deformations, loads))
    if has_both and (kinds == BY_KIND or not are_numbered):
        return "biaxial", "columns of both axes"
    stretches, shears, twists = (
        names & set(quantities) for names in (deformations, ROLES["shear"] | ROLES["sliding"], ROLES["twist"])
    )
    if not stretches and len(shears) == 1:
        return "simple-shear", "a column of shear"
    is_disc = not stretches and len(twists) == 1 and len(ROLES["torque"] & set(quantities)) == 1
    gaps = [column for column, quantity in enumerate(quantities) if quantity in ROLES["length"]]
    if not is_disc or any(map(table.varies, gaps)):
        return "", ""
    return "simple-shear", "columns of twist and torque"


def comment_on_mode(file: Path) -> str:
    """Return what a comment line such as ``# mode: planar`` at the head of a file says, or an empty text."""
    try:
        with file.open("rb") as content:
            head = [content.readline(1000).decode("latin-1") for _ in range(HEAD_LINES)]
    except (OSError, ValueError):
        return ""
    stated = (line.split(":", 1)[1] for line in head if re.match(r"#\s*mode\s*:", line, re.IGNORECASE))
    return next(stated, "").strip()


def _mode_of_words(text: str) -> str:
    """Return the loading mode that words name, or that they abbreviate; an empty text for none, or several."""
    if abbreviated := ABBREVIATIONS.get(text.strip().lower()):
        return abbreviated
    words = "-".join(re.findall(r"[a-z]+", NEXT_WORD.sub(" ", text).lower()))
    names = dict.fromkeys(loading_modes()) | NAMES_OF_MODES
    for name in sorted(names, key=len, reverse=True):
        if re.search(rf"(^|-){name}($|-)", words):
            mode = names[name] or name
            return f"{mode}{AXIS_2}" if AXIS_2 in text and loading_mode(mode).has_axis else mode
    if CONFINED.search(words):
        raise InputError(
            f"'{text}' says that the specimen was confined, and no loading mode is with walls. If it could widen "
            "freely, say so: --mode uniaxial."
        )
    modes = {mode for word, mode in MODE_WORDS.items() if word in words.split("-")}
    return modes.pop() if len(modes) == 1 else ""
