"""Measured curves that come with the package: CSV files whose comment lines tell their source and mode."""

from __future__ import annotations

import os
import shutil
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING

from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.reading.read import read_experiment
from tissuq.experiments.reading.text_file import DATA_SETS

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["citation", "copy", "load", "names", "path", "table"]


def names() -> list[str]:
    """Return the names of the data sets in alphabetical order.

    Examples
    --------
    >>> names()[:3]
    ['brain-cortex-shear', 'brain-cortex-uniaxial', 'rubber-treloar-equibiaxial']
    """
    return sorted(file.stem for file in DATA_SETS.glob("*.csv"))


def path(name: str) -> Path:
    """Return the CSV file of a data set.

    Raises
    ------
    InputError
        When there is no data set of that name.
    """
    if name not in names():
        close = get_close_matches(str(name), names(), n=1)
        hint = f" Did you mean '{close[0]}'?" if close else ""
        raise InputError(f"there is no data set named '{name}'.{hint} Choose one of: {', '.join(names())}.")
    return DATA_SETS / f"{name}.csv"


def citation(name: str) -> str:
    """Return the publication that a data set comes from.

    Raises
    ------
    InputError
        When there is no data set of that name.
    """
    return _comments(path(name))["citation"]


def load(name: str) -> Experiment:
    """Return a data set as an experiment, ready to fit.

    Raises
    ------
    InputError
        When there is no data set of that name.

    Examples
    --------
    >>> brain = load("brain-cortex-uniaxial")
    >>> len(brain), brain.stress_unit
    (34, 'kPa')
    """
    file = path(name)
    about = _comments(file)
    experiment = read_experiment(file, mode=about["mode"], name=name)
    return experiment.labelled(source=f"{about['citation']} ({experiment.source})")


def table(name: str) -> pd.DataFrame:
    """Return the values of a data set with its columns and units as they are in the file.

    Raises
    ------
    InputError
        When there is no data set of that name.
    """
    import pandas as pd

    return pd.read_csv(path(name), comment="#")


def copy(name: str, folder: str | os.PathLike[str], force: bool = False) -> Path:
    """Copy the CSV file of a data set into a folder, which is made if need be, and return the new file.

    Raises
    ------
    InputError
        When there is no data set of that name, the folder cannot be written, or the file is already
        there and ``force`` is false.
    """
    source = path(name)
    target = Path(folder) / source.name
    partial = target.with_name(f".{target.name}-partial")
    if target.exists() and not force:
        raise InputError(f"{target} is already there; give force=True (--force) to overwrite it.")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, partial)
        partial.replace(target)
    except OSError as error:
        with suppress(OSError):
            partial.unlink()
        raise InputError(f"{target} cannot be written: {error}.") from error
    return target


def _comments(file: Path) -> dict[str, str]:
    """Return the ``# key: value`` lines at the head of a data file."""
    lines = file.read_text(encoding="utf-8").splitlines()
    return dict(line[1:].strip().split(": ", maxsplit=1) for line in lines if line.startswith("#"))
