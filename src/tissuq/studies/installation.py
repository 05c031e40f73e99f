"""What tissuq finds on this computer: packages with their versions, extras, and programs for finite elements."""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from importlib import metadata

EXTRAS = {
    "ansys": "reads result files of ANSYS (tissuq ensemble and calibrate --model with .rst)",
    "app": "opens the local page in the browser (tissuq app)",
    "cluster": "spreads campaigns and finite elements over a Dask cluster (--scheduler)",
    "excel": "reads workbooks (.xlsx, .xls, .xlsb, .ods)",
    "fe": "computes indentations and bars (tissuq structure), and materials for FElupe",
    "parquet": "reads Parquet files and data frames of Polars",
    "slurm": "starts the workers of a Dask cluster as batch jobs (--scheduler slurm)",
    "umbridge": "calibrates models behind an UM-Bridge server (tissuq calibrate --umbridge)",
}
"""What each extra is for."""

DEVELOPER_EXTRAS = ("bench", "dev", "docs")
"""The extras that only those need who change tissuq."""

PROGRAMS = {
    "CalculiX": (("ccx",), "runs the cards of tissuq export --format calculix; judges cards in the tests"),
    "Abaqus": (("abaqus", "abq"), "runs the cards of tissuq export --format abaqus"),
    "ANSYS": (("ansys", "mapdl"), "runs the cards of tissuq export --format ansys"),
    "FEBio": (("febio4", "febio3", "febio"), "runs the cards of tissuq export --format febio"),
    "LS-DYNA": (("lsdyna", "ls-dyna", "ls-dyna_smp_d"), "runs the cards of tissuq export --format ls-dyna"),
    "Chromium": (
        ("chromium", "chromium-browser", "google-chrome", "chrome", "msedge"),
        "prints reports (tissuq show RUN --pdf FILE)",
    ),
    "ParaView": (("paraview",), "opens the fields that tissuq structure writes"),
}
"""Programs, the names that they may have on the PATH, and what each is for. None of them is needed to fit."""


@dataclass(frozen=True)
class Package:
    """A package that tissuq asks for: its version here, and the least version."""

    name: str
    version: str | None
    least: str

    @property
    def is_enough(self) -> bool:
        """Whether it is installed, and not too old."""
        return self.version is not None and _numbers(self.version) >= _numbers(self.least)


@dataclass(frozen=True)
class Extra:
    """An extra: what it is for, and the packages that it adds."""

    name: str
    purpose: str
    packages: tuple[Package, ...]


@dataclass(frozen=True)
class Program:
    """A program: what it is for, and where it lies, if it is on the PATH."""

    name: str
    purpose: str
    path: str | None


def needed() -> list[Package]:
    """Return the packages that tissuq cannot do without.

    Examples
    --------
    >>> all(package.is_enough for package in needed())
    True
    """
    return _packages(None)


def extras() -> list[Extra]:
    """Return the extras that add something for a user, with their packages."""
    names = metadata.metadata("tissuq").get_all("Provides-Extra") or []
    users = sorted(set(names) - set(DEVELOPER_EXTRAS))
    return [Extra(name, EXTRAS.get(name, ""), tuple(_packages(name))) for name in users]


def programs() -> list[Program]:
    """Return the programs that tissuq can work with, and where they are on the PATH."""
    return [
        Program(name, purpose, next((path for word in words if (path := shutil.which(word))), None))
        for name, (words, purpose) in PROGRAMS.items()
    ]


def _packages(extra: str | None) -> list[Package]:
    """Return what is here of the requirements of an extra, or of those without one."""
    requirements = []
    for line in metadata.requires("tissuq") or []:
        requirement, _, marker = line.partition(";")
        named = re.search(r"extra\s*==\s*['\"]([^'\"]+)['\"]", marker)
        if (named[1] if named else None) == extra:
            requirements.append(requirement.strip())
    return list(map(_package, sorted(requirements)))


def _package(requirement: str) -> Package:
    """Return what is here of a requirement such as ``arviz-stats[xarray]>=0.8``."""
    name, bound = re.match(r"([\w.-]+)(?:\[[^]]*\])?(?:.*>=\s*([\w.]+))?", requirement).groups()  # type: ignore[union-attr]
    try:
        version = metadata.version(name)
    except metadata.PackageNotFoundError:
        version = None
    return Package(name, version, bound or "0")


def _numbers(version: str) -> tuple[int, ...]:
    """Return the numbers of a release, without what follows them (``1.2rc1`` is 1.2)."""
    release = re.match(r"\d+(?:\.\d+)*", version)
    numbers = [int(number) for number in release[0].split(".")] if release else []
    while numbers and not numbers[-1]:
        numbers.pop()
    return tuple(numbers)
