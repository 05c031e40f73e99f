"""Files of measurements on the command line: options of reading, tests in them, modes, specimens and noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from inspect import Parameter
from inspect import signature as signature_of
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tissuq.cli.options import once_each
from tissuq.errors import InputError
from tissuq.studies.settings import load_settings

if TYPE_CHECKING:
    from tissuq.experiments.reading.experiment_file import Reading

__all__ = [
    "DIMENSIONS",
    "OPTIONS",
    "Mode",
    "files_of",
    "find_tests",
    "measured",
    "one_noise",
    "reads_files",
    "resolve",
    "run_name",
    "settings_of",
    "tolerances",
]

Mode = Annotated[str | None, typer.Option(help="Loading mode [as file and columns say, or uniaxial].")]
OPTIONS: dict[str, Any] = {
    "column": Annotated[
        list[str] | None,
        typer.Option(
            help="ROLE=COLUMN for stretch, strain, displacement, length, shear or twist, and stress, force or torque, "
            "or pressure and outer_diameter (or inner_diameter) of a tube, such as stretch=Strain; "
            "of the spread of a mean: sd or sem, and n; repeat. Of a second axis or stress: stretch2 ... sem2."
        ),
    ],
    "stress_unit": Annotated[
        str | None,
        typer.Option(help="Unit of the stress column [the file's, or MPa]; for forces, the unit shown [kPa]."),
    ],
    "stress_type": Annotated[
        str | None,
        typer.Option(
            help="engineering, cauchy (true), second-piola-kirchhoff, or torsion (as rheometers state it for a disc) "
            "[what the column's name says, or engineering]."
        ),
    ],
    "strain_type": Annotated[
        str | None,
        typer.Option(help="engineering, true (logarithmic), green, almansi or angle (of shear) [likewise]."),
    ],
    "strain_unit": Annotated[
        str | None, typer.Option(help="Unit of a strain column: 1 or percent; of an angle of shear: rad or deg.")
    ],
    "force_unit": Annotated[
        str | None, typer.Option(help="Unit of a force, torque or pressure column that states none, such as mN.")
    ],
    "displacement_unit": Annotated[str | None, typer.Option(help="Unit of a displacement column that states none.")],
    "zero": Annotated[
        str | None,
        typer.Option(help="Value from which displacements are counted ('35.2 mm'), or first: that of the first row."),
    ],
    "mean_of": Annotated[
        int | None,
        typer.Option(
            help="Number of specimens that the stresses are means of, for a column of standard deviations [the file's]."
        ),
    ],
    "length": Annotated[
        str | None, typer.Option(help="Undeformed length, such as '20 mm' [the file's]; in mode biaxial that along x.")
    ],
    "area": Annotated[str | None, typer.Option(help="Undeformed cross-section, such as '10 mm2' [the file's].")],
    "width": Annotated[
        str | None, typer.Option(help="With --thickness, instead of --area; in mode biaxial the size along y.")
    ],
    "thickness": Annotated[
        str | None, typer.Option(help="With --width, instead of --area; with --diameter of a tube its undeformed wall.")
    ],
    "diameter": Annotated[
        str | None, typer.Option(help="Of a round specimen, instead of --area; of a tube the undeformed outer one.")
    ],
    "only": Annotated[
        list[str] | None,
        typer.Option(help="COLUMN=VALUE: the only rows to read, such as Specimen=S1 [all of one specimen]; repeat."),
    ],
    "compression_positive": Annotated[
        bool | None,
        typer.Option("--compression-positive/--tension-positive", help="Which the file counts as positive [its sign]."),
    ],
    "turn": Annotated[
        str | None,
        typer.Option(help="Signs to change: load (of a cell that counts tension as negative), deformation or both."),
    ],
    "load_zero": Annotated[
        str | None,
        typer.Option(help="What the load cell reads without load ('0.02 N'), or first: the load of the first row."),
    ],
    "cycle": Annotated[str | None, typer.Option(help="Use only this cycle: first, last or its number [all].")],
    "branch": Annotated[str | None, typer.Option(help="Use only loading or unloading [both].")],
    "compliance": Annotated[
        str | None, typer.Option(help="Of the machine ('0.5 um/N'): what it gives way is taken off displacements.")
    ],
    "leave_out": Annotated[str | None, typer.Option(help="Lines of the file to leave out, such as 31,45:50.")],
    "preload": Annotated[
        str | None,
        typer.Option(
            help="Force or stress at which the specimen is taut ('0.05 N'), or auto, where load begins: stretch 1 is "
            "there."
        ),
    ],
    "stretch_range": Annotated[
        str | None, typer.Option(help="LOW:HIGH, the only stretches to use, such as 1:1.2 [all].")
    ],
    "until_peak": Annotated[
        bool | None, typer.Option("--until-peak", help="Leave out the rows after the largest stress.")
    ],
    "every": Annotated[int | None, typer.Option(help="Use only every N-th row [1].")],
    "axis": Annotated[str | None, typer.Option(help="x or y: the only axis to read from a biaxial machine's file.")],
    "sheet": Annotated[str | None, typer.Option(help="Sheet of a workbook, by name or number.")],
    "table": Annotated[int | None, typer.Option(help="Which of several tables of a text or sheet, from 1.")],
    "skip_rows": Annotated[int | None, typer.Option(help="Lines to skip at the top of the file.")],
}
"""The options, in the order of the help, by the names of the settings that they are."""
SELECTION = ("sheet", "table", "columns", "only", "dimensions", "compression_positive")
"""Options that differ between the tests in a file: where each is, and what not all need."""
DIMENSIONS = ("length", "area", "width", "thickness", "diameter")


def reads_files(command: Callable[..., None], names: Mapping[str, str] | None = None) -> Callable[..., None]:
    """Give a command the options that say how files are read, in place of its parameter ``read_as``.

    That gets them as the settings of a file's reading. ``names`` are those of options that the command itself has
    another use for.
    """
    names = {name: name for name in OPTIONS} | {"stretch_range": "stretch"} | dict(names or {})
    signature = signature_of(command, eval_str=True)
    position = list(signature.parameters).index("read_as")
    parameters = list(signature.parameters.values())
    options = [
        Parameter(names[name], Parameter.KEYWORD_ONLY, default=None, annotation=option)
        for name, option in OPTIONS.items()
    ]

    @wraps(command)
    def reading(**arguments: Any) -> None:
        values = {name: arguments.pop(names[name]) for name in OPTIONS}
        command(**arguments, read_as=settings_of(values))

    reading.__signature__ = signature.replace(  # type: ignore[attr-defined]  # what Typer reads
        parameters=[*parameters[:position], *options, *parameters[position + 1 :]]
    )
    return reading


def settings_of(values: dict[str, Any]) -> dict[str, Any]:
    """Return the settings of a file's reading for the options' values by name."""
    dimensions = {name: values.pop(name) for name in DIMENSIONS}
    columns = once_each("--column", map(_role, values.pop("column") or []))
    only = once_each("--only", map(_cell, values.pop("only") or []))
    stated = {name: value for name, value in dimensions.items() if value}
    if (text := values.pop("stretch_range")) is not None:
        values["stretch_range"] = _range(text)
    return values | {"dimensions": stated or None, "columns": columns or None, "only": only or None}


def resolve(file: Path) -> Path:
    """Return the user's file, or the built-in data set of that name."""
    from tissuq.experiments import datasets

    if file.exists() or str(file) not in datasets.names():
        return file
    return datasets.path(str(file))


def _range(text: str) -> tuple[float, float]:
    low, _, high = text.partition(":")
    try:
        return float(low), float(high)
    except ValueError as error:
        raise InputError(f"--stretch needs LOW:HIGH, such as 1:1.2, not '{text}'.") from error


def _role(text: str) -> tuple[str, str | int]:
    role, _, name = text.partition("=")
    if not name:
        raise InputError(f"--column needs ROLE=COLUMN, such as stress='Stress (kPa)', not '{text}'.")
    return role.strip(), int(name) if name.strip().isdecimal() else name.strip()


def _cell(text: str) -> tuple[str, str]:
    name, _, value = text.rpartition("=")
    if not name or not value:
        raise InputError(f"--only needs COLUMN=VALUE, such as Specimen=S1, not '{text}'.")
    return name.strip(), value.strip()


def files_of(paths: Sequence[Path]) -> list[Path]:
    """Return the files that were given; of a folder those in it that may hold measurements."""
    from tissuq.experiments.reading.several_files import SUFFIXES

    files: list[Path] = []
    for path in paths:
        if not path.is_dir():
            files.append(resolve(path))
            continue
        inside = sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
        if not inside:
            raise InputError(f"folder '{path}' has no files of measurements ({', '.join(SUFFIXES)}).")
        files += inside
    return files


def measured(
    files: Sequence[Path],
    reading: dict[str, Any],
    modes: Sequence[str] | None,
    specimens: Sequence[str] | None,
    noise_sd: str | None,
) -> tuple[dict[str, Any], list[Reading | None]]:
    """Return the settings of a fit that say what was measured: of the only test, or of each of several.

    And what has been read of every test; None where it is to be read in another mode than it was found in.

    Raises
    ------
    InputError
        When there is not one mode, specimen or noise for each file or test, or a test does not say its mode.
    """
    from tissuq.experiments.modes import loading_modes
    from tissuq.experiments.reading.inspection import Inspection, lines_of_tests

    noise = _numbers(noise_sd)
    if not files:
        return reading | {"noise_sd": noise[0] if noise else None}, []
    of_files = [
        find_tests(file, reading | {"mode": mode}, is_only_file=len(files) == 1)
        for file, mode in zip(files, _modes(files, modes), strict=True)
    ]
    tests, counts = [settings for of_file in of_files for settings, _ in of_file], list(map(len, of_files))
    found = [of_test for of_file in of_files for _, of_test in of_file]
    if len(tests) == 1:
        for option, stated in (("--mode", modes), ("--specimen", specimens), ("--noise-sd", noise)):
            if stated and len(stated) > 1:
                raise InputError(f"{option} is given {len(stated)} times for one test; give it once.")
        return reading | tests[0] | {"noise_sd": noise[0] if noise else None}, list(found)
    if len(tests) > len(files):
        print(*lines_of_tests(list(map(Inspection.of, found))), "", sep="\n")
    stated_noise = noise if noise and len(noise) > 1 else None
    for name, option, values in (
        ("mode", "--mode", modes), ("specimen", "--specimen", specimens), ("noise_sd", "--noise-sd", stated_noise)
    ):  # fmt: skip
        for test, value in zip(tests, _for_each(counts, option, values), strict=False):
            test[name] = value
    silent = next((test["file"] for test in tests if "mode" not in test), None)
    if silent is not None:
        raise InputError(
            f"neither '{silent}' nor its name says in which loading mode it was measured: give --mode once for each "
            f"file, in their order ({', '.join(loading_modes())})."
        )
    pairs = zip(tests, found, strict=True)
    as_found = [of_test if of_test.experiment.mode.name == test["mode"] else None for test, of_test in pairs]
    return {"tests": tests, "noise_sd": noise[0] if noise and len(noise) == 1 else None}, as_found


def _modes(files: Sequence[Path], modes: Sequence[str] | None) -> Sequence[str | None]:
    """Return the mode in which to read every file; None where it is given for each of several tests in it, or not."""
    if not modes or len(modes) not in (1, len(files)):
        return [None] * len(files)
    return [*modes] * (len(files) if len(modes) == 1 else 1)


def find_tests(file: Path, reading: Mapping[str, Any], *, is_only_file: bool) -> list[tuple[dict[str, Any], Reading]]:
    """Return the tests in a file, or the one that ``FILE#NAME`` names: the settings that read each, and what is read.

    One of several files that does not say its mode is without one.

    Raises
    ------
    InputError
        When the file cannot be read, or there is no such test in it.
    """
    from tissuq.experiments.reading.stated_mode import DEFAULT_SOURCE
    from tissuq.experiments.reading.tests_in_file import find_tests_in_file
    from tissuq.studies.measured_file import ReadingSettings

    path, _, name = (str(file), "", "") if file.exists() else str(file).partition("#")
    options = {name: value for name, value in reading.items() if value is not None}
    tests = find_tests_in_file(path, **load_settings(ReadingSettings, None, options).reading_options)
    names = {str(number): test for number, test in enumerate(tests, start=1)} | {test.name: test for test in tests}
    if name and name not in names:
        there_are = ", ".join(f"'{test.name}'" for test in tests)
        raise InputError(f"there is no test '{name}' in {path}. Its tests are: {there_are}.")
    settings = []
    for test in [names[name]] if name else tests:
        mode = test.options["mode"] if is_only_file or test.reading.mode_source != DEFAULT_SOURCE else None
        of_test = options | {"file": path, "mode": mode, **{key: test.options.get(key) for key in SELECTION}}
        if len(tests) > 1:
            of_test["name"] = test.name if is_only_file else f"{Path(path).stem} {test.name}"
        settings.append(({key: value for key, value in of_test.items() if value is not None}, test.reading))
    return settings


def tolerances(texts: Sequence[str] | None) -> dict[str, float] | None:
    """Return tolerances from texts such as ``stress=10%``; an empty one from ``none``."""
    if not texts:
        return None
    if list(texts) == ["none"]:
        return {}
    return once_each("--tolerance", map(_tolerance, texts))


def one_noise(text: str | None) -> float | str | None:
    """Return the standard deviation of the noise of all files: a number, or 'unknown'."""
    values = _numbers(text)
    if values and len(values) > 1:
        raise InputError(f"--noise-sd is given {len(values)} times for a population; give it once for all specimens.")
    return values[0] if values else None


def run_name(paths: Sequence[Path], config: Path | None, sources: Sequence[Path]) -> str:
    """Return the name of a run's folder unless one is given."""
    if config is not None and len(sources) > 1:
        return config.stem
    if len(paths) == 1:
        return paths[0].stem
    return sources[0].stem + (f"-and-{len(sources) - 1}-more" if len(sources) > 1 else "")


def _tolerance(text: str) -> tuple[str, float]:
    from tissuq.model.measurement_errors import measurement_errors

    name, _, number = text.partition("=")
    scale = 0.01 if number.strip().endswith("%") else 1.0
    try:
        value = float(number.strip().removesuffix("%")) * scale
    except ValueError:
        value = -1.0
    name, errors = name.strip(), measurement_errors()
    is_share = name not in errors or not errors[name].is_stress
    if name not in errors or value < 0 or (is_share and value > 1) or (not is_share and scale != 1.0):
        names = ", ".join(errors)
        raise InputError(
            f"'{text}' is not a tolerance; write stress=10%, length=2%, slack=0.01, smooth=2%, zero=0.1 or "
            f"stretch=0.001 (the errors are {names}; zero is in the unit of stress of the file)."
        )
    return name, value


def _numbers(text: str | None) -> list[float | str] | None:
    if text is None or text == "unknown":
        return None if text is None else [text]
    try:
        return [float(number) for number in text.split(",")]
    except ValueError as error:
        raise InputError(
            f"--noise-sd needs a number in the file's stress unit, or 'unknown', not '{text}'. For several files, one "
            "for each with commas."
        ) from error


def _for_each(counts: Sequence[int], option: str, values: Sequence[Any] | None) -> list[Any]:
    """Return the values of an option for every test, where they are given once, for each file or for each test.

    ``counts`` are the numbers of tests in the files.
    """
    if not values:
        return []
    if len(values) == 1:
        return list(values) * sum(counts)
    if len(values) == len(counts):
        return [value for value, count in zip(values, counts, strict=True) for _ in range(count)]
    if len(values) == sum(counts):
        return list(values)
    tests = f" with {sum(counts)} tests" if sum(counts) != len(counts) else ""
    raise InputError(f"{option} is given {len(values)} times for {len(counts)} files{tests}; give it once for each.")
