"""The command line as a person meets it: arguments in; exit status, output and files out."""

from __future__ import annotations

import csv
import functools
import os
import re
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest
import typer.main

from command_line import Outcome, done_in
from tissuq.cli import main

from .models import write_model

Cli = Callable[..., Outcome]

STRETCH = [0.8, 0.9, 1.1, 1.2, 1.3, 1.4]
STRESS_KPA = [-75.25, -33.06, 27.86, 49.31, 70.83, 88.48]
"""100 (l - l^-2) kPa, C10 = 50 kPa, with errors of +1, 0, 0.5, -1.25, 0 and -0.5 kPa rounded to 0.01."""
TO_MPA = {"kPa": 1e-3, "Pa": 1e-6, "MPa": 1.0, "N/cm2": 1e-2, "psi": 6.894757293168361e-3}


@pytest.fixture(scope="session", autouse=True)
def one_parser():
    """Build the parser of the command line once, as every process of a person does."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typer.main, "get_command", functools.cache(typer.main.get_command))
        yield


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty current folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def cli(here, monkeypatch, capsys) -> Cli:
    """Run ``tissuq ARGUMENTS`` in this process, through `main`, in the folder `here`."""

    def run(*arguments: object) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["tissuq", *map(str, arguments)])
        monkeypatch.setattr(warnings, "formatwarning", warnings.formatwarning)  # which the command sets
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main()
        said = capsys.readouterr()
        return Outcome(int(end.value.code or 0), said.out, said.err)

    return run


@pytest.fixture
def done(cli) -> Cli:
    """Run a command that ends well."""

    def run(*arguments: object) -> Outcome:
        said = cli(*arguments)
        assert said.status == 0, said.err
        return said

    return run


@pytest.fixture
def refused(cli, here) -> Callable[..., Outcome]:
    """Run a command that says in one message, with these words, what is wrong, and leaves the folder as it was."""

    def run(words: Iterable[str], *arguments: object) -> Outcome:
        before = tree(here)
        said = cli(*arguments)
        assert (said.status, said.out) == (2, "")
        assert said.err.startswith("tissuq: ")
        assert said.err.count("\n") == 1
        for word in words:
            assert word in " ".join(said.err.split())
        assert tree(here) == before
        return said

    return run


@pytest.fixture
def specimen(here):
    """A file of six measurements in kPa."""
    return write_specimen(here / "specimen.csv")


def write_specimen(path: Path) -> Path:
    rows = [f"{stretch},{stress}\n" for stretch, stress in zip(STRETCH, STRESS_KPA, strict=True)]
    path.write_text("stretch,stress_kPa\n" + "".join(rows), encoding="utf-8")
    return path


def command(*arguments: object, folder: Path) -> Outcome:
    """Run ``tissuq ARGUMENTS`` in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", "from tissuq.cli import main; main()", *map(str, arguments)],
        cwd=folder, capture_output=True, text=True, env={**os.environ, "COLUMNS": "80"}, check=False,
    )  # fmt: skip
    return Outcome(done.returncode, done.stdout, done.stderr)


def fitted_in(folder: Path, *options: object) -> Outcome:
    """Fit a file of six measurements in a folder, with their noise."""
    write_specimen(folder / "specimen.csv")
    return done_in(folder, "fit", "specimen.csv", "--noise-sd", 1, *options)


def tree(folder: Path) -> dict[str, bytes | None]:
    """Return every file and folder in a folder, hidden ones too, with the bytes of the files."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")
    }


def rows_of(file: Path) -> list[dict[str, str]]:
    """Return the rows of a table."""
    with file.open(newline="", encoding="utf-8") as lines:
        return list(csv.DictReader(lines))


def rows_in_mpa(file: Path) -> list[dict[str, str]]:
    """Return the rows of a table with the cells of stresses in MPa, under the names without a unit."""

    def in_mpa(row: dict[str, str]) -> dict[str, str]:
        cells = ((*name.removesuffix("]").partition(" ["), value) for name, value in row.items())
        return {name: str(float(value) * TO_MPA[unit]) if unit else value for name, _, unit, value in cells}

    return list(map(in_mpa, rows_of(file)))


def carry_out_paper(folder: Path) -> tuple[Path, Outcome]:
    options = ["--points", 12, "--noise-sd", 0.4, "--seed", 7, "--prior", "c=uniform(0,2)"]
    return folder / "run", done_in(folder, "paper", *options, "--out", "run")


@pytest.fixture
def empty_posteriors(monkeypatch):
    """Leave empty files in the place of posteriors, which other tests write and read."""
    monkeypatch.setattr("tissuq.posterior.posterior.Posterior.save", lambda self, path: path.touch())


def save_no_figure(figure: object, folder: Path, name: str) -> None:
    """Leave empty files where `save_figure` would draw."""
    for kind in ("svg", "png"):
        (folder / f"{name}.{kind}").touch()


@pytest.fixture
def empty_figures(monkeypatch):
    """Leave empty files in the place of figures."""
    monkeypatch.setattr("tissuq.drawing.style.save_figure", save_no_figure)


@pytest.fixture(scope="session")
def paper_run(tmp_path_factory):
    """A small run of the paper's study, on one range, with figures left empty: its folder and what was said."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tissuq.validation.paper.study.RANGES", ())
        patch.setattr("tissuq.drawing.style.save_figure", save_no_figure)
        return carry_out_paper(tmp_path_factory.mktemp("paper"))


@pytest.fixture(scope="session")
def whole_paper_run(tmp_path_factory):
    """The same run with every stretch range and its figures drawn, for slow tests."""
    return carry_out_paper(tmp_path_factory.mktemp("whole_paper"))


@pytest.fixture(scope="session")
def fit_run(tmp_path_factory):
    """A fit with figures of three discrepancies: its folder and what was said."""
    folder = tmp_path_factory.mktemp("fit")
    chosen = [word for name in ("none", "constant", "gp") for word in ("--discrepancy", name)]
    said = fitted_in(folder, *chosen, "--seed", 3)
    return folder / "runs" / "specimen", said


@pytest.fixture(scope="session")
def run_without_discrepancy(tmp_path_factory):
    """The run folder of a fit without discrepancy."""
    folder = tmp_path_factory.mktemp("without_discrepancy")
    fitted_in(folder, "--discrepancy", "none", "--no-figures", "--out", "run")
    return folder / "run"


@pytest.fixture
def model(run_without_discrepancy, here):
    """A run, a deck and a stub of CalculiX in the current folder: the words after ``tissuq ensemble``."""
    shutil.copytree(run_without_discrepancy, here / "run")
    return [
        "run", "model.inp", "--replace", "TISSUE", "--qoi", "force=RF2@TOP", "--solver", "ccx",
        "--command", write_model(here), "--draws", 6, "--max-jobs", 1, "--out", "out",
    ]  # fmt: skip


def without_wall_times(folder: Path) -> dict[str, bytes | None]:
    """Return a run's files but the log, with the wall times in its summaries and its report struck out."""
    files = tree(folder)
    for name in [name for name in files if name.startswith("summary")]:
        number = rb'(?<="seconds": )[\d.e-]+' if name.endswith(".json") else rb"(?<=,)[\d.e-]+(?=\n)"
        files[name] = re.sub(number, b"", files[name] or b"")
    files.pop("tissuq.log", None)
    time = rb"(?<=It took )\d+\.\d\d(?= s\.)"
    files["report.html"] = re.sub(rb"<td>\d+\.\d\d</td></tr>|" + time, b"", files["report.html"] or b"")
    files["result.json"] = re.sub(rb'"\d+\.\d\d"(?=\n *\])|' + time, b"", files["result.json"] or b"")
    return files
