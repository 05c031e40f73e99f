"""Files of measurements named with their options: tests in them, modes, specimens, noise, and a TOML file of these."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.errors import InputError
from tissuq.studies.measured_file import ReadingSettings
from tissuq.studies.option_texts import columns_in
from tissuq.studies.settings import load_settings, seen_from

if TYPE_CHECKING:
    from tissuq.experiments.reading.experiment_file import Reading
    from tissuq.experiments.reading.inspection import Inspection
    from tissuq.experiments.reading.table import Table

OPTIONAL_FOR_TESTS = ("dimensions", "compression_positive")
"""Options that a test does without where another one needs them: an error where none does."""
SELECTION = ("sheet", "table", "columns", "only", *OPTIONAL_FOR_TESTS)
"""Options that differ between the tests in a file: where each is, and what not all need."""
HEAD = """\
# What was understood of these tests. Change what is wrong, then: tissuq fit FILE.toml
# The options of every test are those of reading (tissuq inspect --help); lines that begin with a # are remarks.

material = "neo-hookean"        # see: tissuq materials
# discrepancies = ["auto"]      # see: tissuq discrepancies
# estimand = "tissue"           # what intervals are of: as-tested, specimen or tissue
# stable_in = ["all"]           # modes in which the material must be stable

"""
OPTIONS = """\
# specimen = "S1"               # tests with the same name are of one specimen
# cycle = "last"
# branch = "loading"
# preload = "0.01 N"
# until_peak = true
"""
"""Options that tests often need, as remarks on the first."""


def resolve(file: Path) -> Path:
    """Return the user's file, or the built-in data set of that name."""
    from tissuq.experiments import datasets

    if file.exists() or str(file) not in datasets.names():
        return file
    return datasets.path(str(file))


def files_of(paths: Sequence[Path], sizes: Path | None = None) -> list[Path]:
    """Return the files that were given; of a folder those that may hold measurements, but for a table of sizes."""
    from tissuq.experiments.reading.file_format import SUFFIXES
    from tissuq.experiments.reading.specimens_in_files import tables_in

    files: list[Path] = []
    for path in paths:
        if path.suffix == ".toml":
            raise InputError(f"'{path}' holds no measurements; if it is a study, give it alone: tissuq fit {path}.")
        if not path.is_dir():
            files.append(resolve(path))
            continue
        inside = [file for file in tables_in(path) if sizes is None or file.resolve() != sizes.resolve()]
        if not inside:
            raise InputError(f"folder '{path}' has no files of measurements ({', '.join(SUFFIXES)}).")
        files += inside
    return files


def measured(
    files: Sequence[Path],
    reading: dict[str, Any],
    modes: Sequence[str] | None,
    specimens: Sequence[str] | None,
    noise: Sequence[float | str] | None,
    axial_stretches: Sequence[float] | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> tuple[dict[str, Any], list[Reading | None]]:
    """Return the settings of a fit that say what was measured: of the only test, or of each of several.

    And what has been read of every test; None where it is to be read in another mode than it was found in. ``say`` is
    told which tests files of several hold.

    Raises
    ------
    InputError
        When there is not one mode, specimen or noise for each file or test, or a test does not say its mode.
    """
    from tissuq.experiments.modes import loading_modes
    from tissuq.experiments.reading.inspection import Inspection, lines_of_tests

    if not files:
        return reading | {"noise_sd": noise[0] if noise else None}, []
    held = _for_each([1] * len(files), "--axial-stretch", axial_stretches or [reading.get("axial_stretch")])
    of_files = [
        find_tests(file, reading | {"mode": mode, "axial_stretch": stretch}, files)
        for file, mode, stretch in zip(files, _modes(files, modes), held, strict=True)
    ]
    tests, counts = [settings for of_file in of_files for settings, _ in of_file], list(map(len, of_files))
    readings = [of_test for of_file in of_files for _, of_test in of_file]
    if any(reading.get(option) and not any(test.get(option) for test in tests) for option in OPTIONAL_FOR_TESTS):
        find_tests(files[0], reading, files[:1])
    if len(tests) == 1:
        for option, stated in (("--mode", modes), ("--specimen", specimens), ("--noise-sd", noise)):
            if stated and len(stated) > 1:
                raise InputError(_too_many(option, stated, "one test", "give it once"))
        if specimens:
            raise InputError(f"--specimen {specimens[0]}: it tells tests of one specimen from others, and '{files[0]}' "
                             "is of one test; leave it out.")  # fmt: skip
        of_all = {name: value for name, value in reading.items() if name != "sizes"}
        return of_all | tests[0] | {"noise_sd": noise[0] if noise else None}, list(readings)
    if len(tests) > len(files):
        say("\n".join([*lines_of_tests(list(map(Inspection, readings))), ""]))
    if len(files) == 1:
        _check_whole(files[0], readings, specimens)
    stated_noise = noise if noise and len(noise) > 1 else None
    for name, option, values in (
        ("mode", "--mode", modes), ("specimen", "--specimen", specimens), ("noise_sd", "--noise-sd", stated_noise)
    ):  # fmt: skip
        for test, value in zip(tests, _for_each(counts, option, values), strict=False):
            test[name] = value
    silent = next((test["file"] for test in tests if "mode" not in test), None)
    if silent is not None:
        raise InputError(
            f"neither '{silent}' nor its name says in which loading mode it was measured: give --mode once for all "
            f"files, or once for each in their order ({', '.join(loading_modes())})."
        )
    pairs = zip(tests, readings, strict=True)
    as_found = [of_test if of_test.experiment.mode.name == test["mode"] else None for test, of_test in pairs]
    return {"tests": tests, "noise_sd": noise[0] if noise and len(noise) == 1 else None}, as_found


def reading_of(file: Path, files: Sequence[Path], reading: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that read one of several files: without columns that others have, and it has not.

    Of a table of ``sizes`` among the options they are those of its specimen, where none are given.

    Raises
    ------
    InputError
        When it has several columns that are given for one role, or no row in the table of sizes.
    """
    from tissuq.experiments.reading.recognition import find_column

    def has(path: Path, role: str, name: str | int) -> bool:
        for table in tables(path):
            with suppress(InputError):
                find_column(table, role, name)
                return True
        return False

    tables = cache(lambda path: tables_of(path, reading))
    columns = dict(reading.get("columns") or {})
    for role, value in list(columns.items()):
        names = columns_in(value)
        if len(names) == len(files) == 1:
            continue
        here = [name for name in names if has(file, role, name)]
        if len(here) > 1:
            listed = " and ".join(f"'{name}'" for name in here)
            raise InputError(f"{file}: --column is given twice for '{role}', and there are {listed}; give it once.")
        if here:
            columns[role] = here[0]
        elif any(has(other, role, name) for other in files for name in names):
            del columns[role]
    others = {name: value for name, value in reading.items() if name != "sizes"}
    if sizes := reading.get("sizes"):
        folder = Path(str(file)).resolve().parent.name
        others["dimensions"] = sizes.dimensions(names_of(file), str(file), reading.get("dimensions"), folder)
    return {**others, "columns": columns or None}


def names_of(file: Path) -> list[str]:
    """Return how a table of specimens may call that of a file, or of the test FILE#NAME."""
    name, _, test = (str(file), "", "") if file.exists() else str(file).partition("#")
    path = Path(name)
    return [name for name in (test, path.name, path.stem) if name]


def _modes(files: Sequence[Path], modes: Sequence[str] | None) -> Sequence[str | None]:
    """Return the mode in which to read every file; None where it is given for each of several tests in it, or not."""
    if not modes or len(modes) not in (1, len(files)):
        return [None] * len(files)
    return [*modes] * (len(files) if len(modes) == 1 else 1)


def find_tests(file: Path, reading: Mapping[str, Any], files: Sequence[Path]) -> list[tuple[dict[str, Any], Reading]]:
    """Return the tests in a file, or the one that ``FILE#NAME`` names: the settings that read each, and what is read.

    One of several ``files`` that does not say its mode is without one, and is read with `reading_of` it.

    Raises
    ------
    InputError
        When the file cannot be read, or there is no such test in it.
    """
    from tissuq.experiments.reading.stated_mode import DEFAULT_SOURCE
    from tissuq.experiments.reading.tests_in_file import find_tests_in_file

    path, _, name = (str(file), "", "") if file.exists() else str(file).partition("#")
    is_only_file = len(files) == 1
    options = {name: value for name, value in reading_of(file, files, reading).items() if value is not None}
    reading_options = load_settings(ReadingSettings, None, options).reading_options
    tests = find_tests_in_file(path, is_one_of_several=not is_only_file, **reading_options)
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


def tests_in_words(tests: Sequence[tuple[Mapping[str, Any], Reading]]) -> str:
    """Return what the first of some tests is, and how many more there are."""
    from tissuq.experiments.reading.inspection import Inspection

    more = f", and {len(tests) - 1} more tests" if len(tests) > 1 else ""
    return f"{Inspection(tests[0][1]).line}{more}"


def tables_of(file: Path, reading: Mapping[str, Any]) -> list[Table]:
    """Return the tables of a file, or of the one that ``FILE#NAME`` names; nothing where none can be read."""
    from tissuq.experiments.reading.tables import read_tables

    path = file if file.exists() else Path(str(file).partition("#")[0])
    try:
        skip_rows, sheet, number = reading.get("skip_rows") or 0, reading.get("sheet"), reading.get("table")
        return read_tables(path, skip_rows=skip_rows, sheet=sheet, table=number)
    except InputError:
        return []


def run_name(paths: Sequence[Path], config: Path | None, sources: Sequence[Path]) -> str:
    """Return the name of a run's folder unless one is given."""
    if config is not None and len(sources) > 1:
        return config.stem
    if len(paths) == 1:
        return paths[0].stem
    return sources[0].stem + (f"-and-{len(sources) - 1}-more" if len(sources) > 1 else "")


def _check_whole(file: Path, readings: Sequence[Reading], specimens: Sequence[str] | None) -> None:
    """Refuse one of the specimens that a file tells apart as the name of them all."""
    named = dict.fromkeys(reading.experiment.specimen for reading in readings)
    if specimens and len(specimens) == 1 and specimens[0] in named and len(named) > 1:
        raise InputError(
            f"--specimen {specimens[0]} would call all tests so, and '{file}' has the specimens {', '.join(named)}: to "
            f"fit one alone give --only COLUMN={specimens[0]}, of the column that names them."
        )


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
    raise InputError(_too_many(option, values, f"{len(counts)} files{tests}", "give it once for each"))


def _too_many(option: str, values: Sequence[Any], tests: str, advice: str) -> str:
    """Return why an option cannot be of some tests; numbers between commas may be one with a decimal comma."""
    if option != "--noise-sd":
        return f"{option} is given {len(values)} times for {tests}; {advice}."
    numbers = " and ".join(f"{value:g}" for value in values)
    return f"--noise-sd has {len(values)} numbers, {numbers}, for {tests}; {advice}, with a decimal point and no comma."


def study_file(tests: Sequence[Mapping[str, Any]], inspections: Sequence[Inspection], folder: Path) -> str:
    """Return the text of a file that ``tissuq fit`` takes, with remarks on what was understood of every test.

    Parameters
    ----------
    tests : sequence of mapping
        The settings that read each test.
    inspections : sequence of Inspection
        What was understood of them.
    folder : Path
        Where the file will lie: files of measurements are named from there.
    """
    import tomli_w

    blocks = [HEAD]
    for test, inspection in zip(tests, inspections, strict=True):
        remarks = [inspection.line, *(f"Note: {text}" for text in inspection.warnings)]
        named = {"name": inspection.reading.experiment.name, **test}
        named["file"] = Path(seen_from(folder, test["file"])).as_posix()
        if "mode" not in test:
            named["mode"] = inspection.reading.experiment.mode.name
            remarks.append("Note: the loading mode is a guess: nothing in the file says which it is.")
        comments = "".join(f"# {line}\n" for text in remarks for line in text.splitlines())
        values = {name: value for name, value in named.items() if not isinstance(value, dict)}
        tables = {name: value for name, value in named.items() if isinstance(value, dict) and value}
        settings = tomli_w.dumps(values) + "".join(
            f"\n[tests.{name}]\n{tomli_w.dumps(value)}" for name, value in tables.items()
        )
        blocks.append(f"[[tests]]\n{comments}{OPTIONS if test is tests[0] else ''}{settings}\n")
    return "".join(blocks)
