"""Sets of real tests of one tissue each: a folder of CSV files in one form, or those that come with the package."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tissuq.errors import InputError, TissuqError
from tissuq.experiments import datasets
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode, Uniaxial, loading_mode

if TYPE_CHECKING:
    import pandas as pd

INDEX = "index.csv"
"""The file of a folder that tells what each set is of: columns ``dataset`` and ``class`` or ``tissue``."""
COLUMNS = ("mode", "stretch", "stress_MPa")
"""Columns that every file of a set has; ``stretch_2``, ``stress_2_MPa``, ``direction`` and ``specimen`` may follow."""
MIN_POINTS = 4
"""Number of measurements of the smallest test that is taken."""


@dataclass(frozen=True, eq=False)
class TissueSet:
    """Tests of one tissue.

    Attributes
    ----------
    name : str
    tissue_class : str
        What it is of, such as ``"brain"``: results are summarised over all sets of a class.
    tests : tuple of Experiment
        One for each mode, direction and specimen; tension and compression are two.
    """

    name: str
    tissue_class: str
    tests: tuple[Experiment, ...]


def read_corpus(folder: str | Path | None = None) -> tuple[TissueSet, ...]:
    """Return all sets of a folder, or those that come with the package.

    Parameters
    ----------
    folder : str or Path, optional
        Holds one CSV file for each set, with the columns ``mode``, ``stretch`` (or amount of shear) and ``stress_MPa``
        (engineering stress, tension positive); where there are two axes ``stretch_2`` and ``stress_2_MPa``; and where
        there are several ``direction`` and ``specimen``. A file ``index.csv`` may say what ``class`` (or ``tissue``)
        each ``dataset`` is of; without it, the name of the file does, up to its first dash.

    Raises
    ------
    InputError
        When there is no such folder, it holds no set, or a file is not of this form.

    Examples
    --------
    >>> [(tissue.name, tissue.tissue_class, len(tissue.tests)) for tissue in read_corpus()]
    [('brain-cortex', 'brain', 3), ('rubber-treloar', 'rubber', 3), ('silicone-meunier', 'silicone', 4)]
    """
    if folder is None:
        return tuple(_sets_of_package())
    path = Path(folder)
    if not path.is_dir():
        raise InputError(f"there is no folder '{folder}' of data sets.")
    classes = _classes(path / INDEX)
    files = sorted(file for file in path.glob("*.csv") if file.name != INDEX)
    if not files:
        raise InputError(f"'{folder}' holds no data set: expected CSV files with the columns {', '.join(COLUMNS)}.")
    return tuple(_read_set(file, classes.get(file.stem) or file.stem.partition("-")[0]) for file in files)


def _sets_of_package() -> Iterator[TissueSet]:
    names = [name.rpartition("-")[0] for name in datasets.names()]
    for name in dict.fromkeys(names):
        members = [datasets.load(member) for member in datasets.names() if member.rpartition("-")[0] == name]
        yield TissueSet(name, name.partition("-")[0], tuple(side for test in members for side in _sides(test)))


def _classes(index: Path) -> dict[str, str]:
    """Return the class of every set that the index names."""
    import pandas as pd

    if not index.is_file():
        return {}
    table = _read(index)
    column = next((name for name in ("class", "tissue") if name in table), None)
    if column is None or "dataset" not in table:
        raise InputError(f"{index} needs the columns 'dataset' and 'class' (or 'tissue').")
    labels = zip(table["dataset"].astype(str), table[column], strict=True)
    return {name: _short(str(label)) for name, label in labels if not pd.isna(label)}


def _short(label: str) -> str:
    """Return the words of a label before what is more exact, as ``brain`` of ``Brain, white (to failure)``."""
    return re.split(r"[,(/]", label)[0].strip().lower()


def _read(file: Path) -> pd.DataFrame:
    import pandas as pd

    try:
        return pd.read_csv(file, comment="#")
    except (OSError, ValueError) as error:  # of pandas' parsers, too
        raise InputError(f"{file} cannot be read as a table: {error}.") from error


def _read_set(file: Path, tissue_class: str) -> TissueSet:
    table = _read(file)
    missing = [column for column in COLUMNS if column not in table]
    if missing:
        raise InputError(f"{file} has no column {', '.join(map(repr, missing))}, which a data set needs.")
    labels = ["mode", *(label for label in ("direction", "specimen") if label in table)]
    tests: list[Experiment] = []
    for values, rows in table.groupby(labels, sort=False, dropna=False):
        names = dict(zip(labels, (str(value) for value in values), strict=True))
        try:
            tests += _sides(_test(loading_mode(names["mode"]), names, rows))
        except (TissuqError, ValueError) as error:  # a cell that is no number
            raise InputError(f"{file}, test {' '.join(names.values())}: {error}") from error
    return TissueSet(file.stem, tissue_class, tuple(test for test in tests if len(test) >= MIN_POINTS))


def _test(mode: LoadingMode, labels: dict[str, str], rows: pd.DataFrame) -> Experiment:
    stretches = ["stretch", "stretch_2"][: len(mode.controls)]
    stresses = ["stress_MPa", "stress_2_MPa"][: len(mode.stresses)]
    missing = [column for column in (*stretches, *stresses) if column not in rows]
    if missing:
        raise InputError(f"mode '{mode.name}' needs the column {', '.join(map(repr, missing))}.")
    stretch, stress = (rows[columns].to_numpy(float) for columns in (stretches, stresses))
    return Experiment(
        mode,
        stretch[:, 0] if len(stretches) == 1 else stretch,
        stress[:, 0] if len(stresses) == 1 else stress,
        name=" ".join(labels.values()),
        specimen=labels.get("specimen", ""),
    )


def _sides(test: Experiment) -> list[Experiment]:
    """Return tension and compression along one axis as two tests, as they are made; any other test as it is."""
    if test.mode.along_axis_1 != Uniaxial():
        return [test]
    is_side = {"tension": test.stretch > 1, "compression": test.stretch < 1}
    sides = {name: rows for name, rows in is_side.items() if np.count_nonzero(rows) >= MIN_POINTS}
    if len(sides) < len(is_side):
        return [test]
    return [test.where(rows).labelled(name=f"{test.name} {name}") for name, rows in sides.items()]
