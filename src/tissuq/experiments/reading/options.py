"""What options of reading may be in Python: columns and dimensions by name, the unit of stress, quantities of pint."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from difflib import get_close_matches
from numbers import Integral
from typing import Any, TypedDict, cast

import numpy as np

from tissuq.errors import InputError
from tissuq.experiments.modes import InflatedTube, LoadingMode, loading_mode
from tissuq.experiments.pint_units import is_quantity, unit_of
from tissuq.experiments.reading.measures import STRAIN_MEASURES, STRESS_MEASURES
from tissuq.experiments.reading.vocabulary import DIMENSION_NAMES

TURNS = {"load": ("load",), "deformation": ("deformation",), "both": ("deformation", "load")}
"""What signs may be changed of, by what asks for it."""
NAMES_OF_OPTIONS: Mapping[str, Collection[str]] = {
    "strain_type": STRAIN_MEASURES,
    "stress_type": STRESS_MEASURES,
    "axis": ("x", "y"),
    "branch": ("loading", "unloading"),
}
"""What options may be that are one of some names."""


class ReadingOptions(TypedDict, total=False):
    """How to read a file where it does not tell by itself: the options of :func:`tissuq.read`."""

    mode: str | LoadingMode | None
    columns: Mapping[str, str | int] | None
    stress_unit: str | None
    stress_type: str | None
    strain_type: str | None
    strain_unit: str | None
    force_unit: str | None
    displacement_unit: str | None
    zero: str | None
    mean_of: int | None
    dimensions: Mapping[str, str] | None
    axial_stretch: float | None
    only: Mapping[str, str | int] | None
    compression_positive: bool | None
    turn: str | None
    load_zero: str | None
    cycle: str | int | None
    branch: str | None
    compliance: str | None
    leave_out: str | None
    preload: str | None
    stretch_range: Sequence[float] | None
    until_peak: bool
    relaxed: bool
    incompressible: bool
    every: int
    axis: str | None
    sheet: str | int | None
    table: int | None
    name: str | None
    skip_rows: int


READING_OPTIONS = tuple(ReadingOptions.__annotations__)


class PythonOptions(ReadingOptions, total=False):
    """The options of :func:`tissuq.read`, with entries of `columns` and `dimensions`, and the unit, by themselves."""

    stretch: str | int | None
    stretch2: str | int | None
    strain: str | int | None
    strain2: str | int | None
    displacement: str | int | None
    displacement2: str | int | None
    shear: str | int | None
    shear2: str | int | None
    twist: str | int | None
    twist2: str | int | None
    rate: str | int | None
    rate2: str | int | None
    sliding: str | int | None
    sliding2: str | int | None
    stress: str | int | None
    stress2: str | int | None
    torque: str | int | None
    torque2: str | int | None
    force: str | int | None
    force2: str | int | None
    outer_diameter: str | int | None
    inner_diameter: str | int | None
    pressure: str | int | None
    total_force: str | int | None
    area: Any
    width: Any
    thickness: Any
    diameter: Any
    length: Any
    unit: str | None


BY_NAME = {"columns": "{'stress': 'P [kPa]'}", "dimensions": "{'width': '5 mm'}", "only": "{'specimen': 'A'}"}
"""Options that are mappings, each with an example."""
TEXTS = ("name", "sheet", *NAMES_OF_OPTIONS)
"""Options that are texts, or numbers of sheets."""
PARTS = {
    name: "dimensions" if name in DIMENSION_NAMES else "columns"
    for name in PythonOptions.__annotations__
    if name not in (*READING_OPTIONS, "unit")
}
"""Options that are entries of another one; ``length`` is that of the specimen."""
NAMES_OF_SHELL = {"estimand": "tolerances"}
"""Options of the shell that have another name in Python."""


def spelled_out(options: Mapping[str, Any], more_names: Collection[str] = ()) -> ReadingOptions:
    """Return options of reading without those that are entries of others, and with quantities as texts.

    Parameters
    ----------
    options : mapping
        By name.
    more_names : collection of str
        Names of other options of the same function.

    Raises
    ------
    InputError
        When there is no option of a name, or something is said twice.

    Examples
    --------
    >>> spelled_out({"force": "Fz", "length": "20 mm", "unit": "kPa"})
    {'columns': {'force': 'Fz'}, 'dimensions': {'length': '20 mm'}, 'stress_unit': 'kPa'}
    """
    _check_kinds(options)
    result: dict[str, Any] = {}
    for name, value in options.items():
        option = PARTS.get(name) or ("stress_unit" if name == "unit" else name)
        if option not in READING_OPTIONS:
            names = [*READING_OPTIONS, *PARTS, "unit", *more_names]
            close = [
                other for other in (NAMES_OF_SHELL.get(name), *get_close_matches(name, names, n=1)) if other in names
            ]
            hint = f" Did you mean '{close[0]}'?" if close else f" There are: {', '.join(names)}."
            raise InputError(f"there is no option '{name}'.{hint}")
        if name in PARTS and value is not None:
            entries = dict(options.get(option) or {}) | dict(result.get(option) or {})
            if entries.get(name) is not None:
                raise InputError(f"{name} is given by itself and in {option}: give it once.")
            result[option] = entries | {name: _plain(name, value)}
        elif name == "unit" and value is not None:
            if options.get(option) is not None:
                raise InputError("unit and stress_unit are the same: give one of them.")
            result[option] = value
        elif name not in PARTS and name != "unit":
            result.setdefault(name, _as_texts(value))
    return cast(ReadingOptions, result)


def _check_kinds(options: Mapping[str, Any]) -> None:
    """Refuse options that are of another kind."""
    for name, example in BY_NAME.items():
        if not isinstance(options.get(name) or {}, Mapping):
            raise InputError(f"{name} must be by name, such as {example}, not {options[name]!r:.80}.")
    for name in TEXTS:
        if not isinstance(options.get(name) or "", str | Integral if name == "sheet" else str):
            raise InputError(f"{name} must be a text, not {options[name]!r:.80}.")


def _plain(name: str, value: Any) -> str | int:
    """Return what stands for a column (its name or number) or a dimension (a text with a unit)."""
    text = _as_texts(value)
    if not isinstance(text, str | int):
        what = "the name of a column, or its number from 1" if PARTS[name] == "columns" else "such as '10 mm'"
        raise InputError(f"{name} must be {what}, not of type {type(value).__name__}.")
    return text


def _as_texts(value: Any) -> Any:
    """Return a quantity of pint, or those in a mapping, as a text with a unit."""
    if isinstance(value, Mapping):
        return {name: _as_texts(entry) for name, entry in value.items()}
    return f"{float(value.magnitude)!r} {unit_of(value)}" if is_quantity(value) else value


def checked_mode(mode_or_name: str | LoadingMode, options: ReadingOptions) -> LoadingMode:
    """Return a loading mode, once the options have been looked at that need no file."""
    mode = loading_mode(mode_or_name)
    step = options.get("every", 1)
    is_tube = isinstance(mode, InflatedTube)
    if len(mode.stresses) > 2 or (len(mode.controls) > len(mode.stresses) and not is_tube):
        raise InputError(
            f"a file is read in loading modes with one stress or two, and '{mode.name}' has "
            f"{', '.join(mode.stresses)}: give its values to Experiment."
        )
    if len(mode.stresses) > 1 and options.get("compression_positive"):
        raise InputError(
            f"compression_positive=True (--compression-positive) is for loading modes with one stress, not for "
            f"'{mode.name}'. Turn all loads: turn='load' (--turn load), or all deformations, or both."
        )
    for option, names in NAMES_OF_OPTIONS.items():
        name: Any = options.get(option)
        if name is not None and name not in names:
            raise InputError(f"{option} must be one of {', '.join(names)}, not '{name}'.")
    turn = options.get("turn")
    if turn is not None and turn not in TURNS:
        raise InputError(f"turn (--turn) must be one of {', '.join(TURNS)}, not '{turn}'.")
    if turn is not None and options.get("compression_positive") is not None:
        raise InputError(
            "turn (--turn) says which signs are changed, and compression_positive (--compression-positive, "
            "--tension-positive) leaves it to the rows: give one of them."
        )
    if not (len(mode.stresses) == 1 or mode.machine_axes) and options.get("preload") is not None:
        raise InputError(
            f"preload (--preload) does not go with loading mode '{mode.name}', where it does not say which stress "
            "carries it. Leave it out, and count stretches in the file from where the specimen is taut."
        )
    if is_tube and options.get("preload") is not None:
        raise InputError(
            f"preload (--preload) does not go with loading mode '{mode.name}', whose hoop stretch is that of the tube "
            "when it is neither stretched nor inflated. Leave rows out with --stretch or --leave-out."
        )
    stretch_range = options.get("stretch_range")
    ends = np.asarray([0.0, 1.0] if stretch_range is None else stretch_range)
    if ends.shape != (2,) or not np.isfinite(ends).all() or ends[0] >= ends[1]:
        raise InputError(
            f"stretch_range (--stretch) must be a lowest and a highest stretch such as 1:1.2, not {stretch_range!r}."
        )
    mean_of = options.get("mean_of")
    if mean_of is not None and (not isinstance(mean_of, int) or mean_of < 2):
        raise InputError(f"mean_of (--mean-of) must be a number of specimens, 2 or more, not {mean_of!r}.")
    if not isinstance(step, int) or step < 1:
        raise InputError(f"every must be a number of rows, 1 or more, not {step!r}.")
    return mode
