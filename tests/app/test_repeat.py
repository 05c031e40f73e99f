"""The command and the lines of Python that the page shows give the numbers that it shows."""

from __future__ import annotations

import json
import shlex
import shutil
import sys
from pathlib import Path

import pytest

from tissuq.app.repeat import fit_lines, reading_words
from tissuq.app.tasks import TASKS
from tissuq.cli import main
from tissuq.studies.measured_file import ReadingSettings

EVERY_OPTION = {
    "columns": {"stretch": "stretch", "stress": "stress [kPa]"}, "stress_unit": "kPa", "stress_type": "cauchy",
    "strain_type": "green", "strain_unit": "%", "force_unit": "mN", "displacement_unit": "um", "zero": "first",
    "mean_of": 3, "dimensions": {"length": "20 mm", "area": "10 mm2"}, "only": {"Specimen": "S 1"},
    "compression_positive": True, "turn": "load", "load_zero": "0.02 N", "cycle": "last", "branch": "loading",
    "compliance": "0.5 um/N", "leave_out": "31,45:50", "preload": "auto", "stretch_range": [1.0, 1.25],
    "until_peak": True, "relaxed": True, "incompressible": True, "every": 2, "axis": "x", "sheet": "2", "table": 1,
    "skip_rows": 3, "axial_stretch": 1.5,
}  # fmt: skip


def done(task, request):
    """Return what a task says, by kind."""
    said = {}
    TASKS[task](request, lambda kind, data: said.update({kind: data}))
    return said


def run_in_shell(line, monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", [*shlex.split(line), *arguments])
    with pytest.raises(SystemExit) as end:
        main()
    assert not end.value.code


def executed(lines):
    names = {}
    exec(compile(lines, "lines", "exec"), names)
    return names


def check_repeats(said, monkeypatch):
    """Run both in the current folder; each gives the estimates that were shown, to rounding."""
    shown = said["answer"]
    run_in_shell(shown["repeat"]["shell"], monkeypatch, "--no-figures", "--out", "again")
    expected = [[number[name] for name in ("value", "low", "high")] for number in shown["numbers"]]
    again = json.loads(Path("again/result.json").read_text())["numbers"]
    answer = executed(shown["repeat"]["python"])["posterior"].answer
    scale = {"kPa": 1000.0, "MPa": 1.0}[shown["numbers"][0]["unit"]]
    for found, numbers, estimate in zip(again, expected, answer.estimates, strict=True):
        assert [found[name] for name in ("value", "low", "high")] == pytest.approx(numbers, rel=1e-9)
        assert [scale * value for value in estimate[1:]] == pytest.approx(numbers, rel=1e-9)


def test_every_option_of_reading_is_written_as_the_shell_reads_it(monkeypatch):
    assert {*EVERY_OPTION} | {"mode"} == {*ReadingSettings.model_fields}
    seen = []
    from tissuq.cli import inspect

    monkeypatch.setattr(inspect, "find_tests", lambda file, reading, is_only_file: seen.append(reading) or [])
    line = shlex.join(["tissuq", "inspect", "a.csv", *reading_words(EVERY_OPTION), "--mode", "uniaxial"])
    monkeypatch.setattr(sys, "argv", shlex.split(line))
    with pytest.raises(SystemExit):
        main()
    (reading,) = seen
    stated = {name: value for name, value in reading.items() if value is not None}
    assert stated.pop("mode") == "uniaxial"
    assert {name: str(value) for name, value in stated.items()} == {
        name: str(tuple(value) if isinstance(value, list) else value) for name, value in EVERY_OPTION.items()
    }


def test_false_is_written_as_its_own_switch():
    assert reading_words({"compression_positive": False, "until_peak": False}) == ["--tension-positive"]


def test_a_sign_that_is_denied_stands_in_the_python_that_repeats_a_reading(here, write_stretches):
    write_stretches(here)
    reading = {"compression_positive": False, "skip_rows": 0}
    said = done("inspect", {"files": ["kidney.csv"], "modes": ["uniaxial"], "reading": reading})
    assert said["done"]["repeat"]["python"].endswith(
        "print(tq.inspect('kidney.csv', compression_positive=False, skip_rows=0, mode='uniaxial'))"
    )


@pytest.mark.slow
def test_a_fit_is_repeated_by_its_command_and_by_its_python(here, write_stretches, monkeypatch):
    write_stretches(here)
    request = {
        "files": ["kidney.csv"], "modes": ["uniaxial"], "reading": {"stretch_range": [1.05, 1.4]},
        "discrepancies": ["none"], "noise_sd": 0.05,
    }  # fmt: skip
    said = done("fit", request)
    (modulus, _) = said["answer"]["numbers"]
    assert modulus["low"] < 10 < modulus["high"]
    assert "--stretch 1.05:1.4" in said["answer"]["repeat"]["shell"]
    check_repeats(said, monkeypatch)


@pytest.mark.slow
def test_a_fit_of_small_stresses_in_mpa_is_repeated_with_its_noise(here, monkeypatch):
    rows = "".join(f"{x},{5e-3 * (x - x**-2)}\n" for x in (1.05, 1.1, 1.15, 1.2, 1.25, 1.3))
    (here / "soft.csv").write_text(f"stretch,stress_MPa\n{rows}", encoding="utf-8")
    request = {"files": ["soft.csv"], "modes": ["uniaxial"], "discrepancies": ["none"], "noise_sd": 5e-5}
    said = done("fit", request)
    assert said["answer"]["numbers"][0]["unit"] == "kPa"
    check_repeats(said, monkeypatch)


@pytest.mark.slow
def test_a_fit_of_a_mended_file_is_repeated(here, write_machine, monkeypatch):
    write_machine(here, "skin 1.csv")
    reading = {"dimensions": {"length": "12 mm"}, "branch": "loading", "preload": "auto"}
    request = {"files": ["skin 1.csv"], "modes": ["uniaxial"], "reading": reading, "material": "yeoh"}
    check_repeats(done("fit", request | {"estimand": "tissue"}), monkeypatch)


@pytest.mark.slow
def test_a_fit_of_several_files_is_repeated(here, write_stretches, monkeypatch):
    write_stretches(here, "a.csv")
    write_stretches(here, "b.csv", c10=6.0)
    request = {"files": ["a.csv", "b.csv"], "modes": ["uniaxial", "planar"], "discrepancies": ["none"]}
    said = done("fit", request)
    assert said["answer"]["run"] == "a-and-1-more"
    check_repeats(said, monkeypatch)


@pytest.mark.slow
def test_a_fit_of_tests_that_are_said_to_be_of_one_specimen_is_repeated(here, write_stretches, monkeypatch):
    write_stretches(here, "a.csv")
    write_stretches(here, "b.csv", c10=6.0)
    request = {"files": ["a.csv", "b.csv"], "modes": ["uniaxial"], "discrepancies": ["none"], "is_one_specimen": True}
    said = done("fit", request)
    assert "for this specimen" in said["answer"]["finding"]
    check_repeats(said, monkeypatch)


@pytest.mark.slow
def test_strips_along_both_axes_of_a_tissue_are_repeated(here, write_stretches, monkeypatch):
    write_stretches(here, "circumferential.csv")
    write_stretches(here, "axial.csv", c10=3.0)
    request = {"files": ["circumferential.csv", "axial.csv"], "modes": ["uniaxial", "uniaxial@2"]}
    said = done("fit", request | {"discrepancies": ["none"]})
    assert said["answer"]["modes"] == ["uniaxial", "uniaxial@2"]
    assert "--mode uniaxial --mode uniaxial@2" in said["answer"]["repeat"]["shell"]
    check_repeats(said, monkeypatch)


@pytest.mark.slow
def test_laws_predictions_and_cards_are_repeated(here, write_stretches, monkeypatch):
    write_stretches(here)
    measured = {"files": ["kidney.csv"], "modes": ["uniaxial"], "discrepancies": ["none"]}
    run = done("fit", measured)["done"]["run"]

    shown = done("laws", measured | {"laws": ["neo-hookean", "yeoh"], "stable_in": ["all"]})["done"]
    assert "--stable-in all" in shown["repeat"]["shell"]
    table = executed(shown["repeat"]["python"])["comparison"].table
    assert [row[0] for row in shown["rows"]] == list(table.index)
    moduli = [float(row[1]) for row in shown["rows"]]
    assert moduli == pytest.approx(table["modulus"].tolist(), rel=6e-3)
    run_in_shell(shown["repeat"]["shell"], monkeypatch, "--no-figures", "--force")
    stored = json.loads(Path("runs/kidney-laws/laws.json").read_text())
    assert [row["law"] for row in stored] == list(table.index)
    assert [row["modulus"] for row in stored] == pytest.approx(table["modulus"].tolist(), rel=1e-9)

    shown = done("predict", {"run": run, "mode": "planar", "stretch": "1:1.2"})["done"]
    before = Path("runs/kidney-planar/prediction.csv").read_text()
    (header, *_), table = before.splitlines(), executed(shown["repeat"]["python"])["prediction"].table
    assert header.split(",")[0] == table.columns[0] == "stretch"
    run_in_shell(shown["repeat"]["shell"], monkeypatch, "--no-figures", "--force")
    assert Path("runs/kidney-planar/prediction.csv").read_text() == before
    median = next(name for name in table.columns if "median" in name)
    closed_form = 10 * (1.2 - 1.2**-3)
    assert table[median].iloc[-1] == pytest.approx(closed_form, rel=0.05)

    shown = done("export", {"run": run, "format": "abaqus", "draws": 3, "unit": "kPa"})["done"]
    folder = Path(shown["folder"])
    assert shown["explanations"][0].startswith("use of the fit in finite elements: ")
    cards = {name: (folder / name).read_text() for name in shown["files"]}
    for repeat in (
        lambda: run_in_shell(shown["repeat"]["shell"], monkeypatch, "--force"),
        lambda: (shutil.rmtree(folder), executed(shown["repeat"]["python"])),
    ):
        repeat()
        again = {name: (folder / name).read_text() for name in shown["files"]}
        assert [_without_remarks(text) for text in again.values()] == [_without_remarks(t) for t in cards.values()]


def _without_remarks(text):
    return [line for line in text.splitlines() if not line.startswith("**")]


def test_noise_is_in_the_unit_of_the_file_and_the_estimand_is_a_tolerance():
    lines = fit_lines({"file": "a.csv", "mode": "uniaxial", "noise_sd": 0.5, "estimand": "tissue"}, "kPa")
    assert "tq.read('a.csv', mode='uniaxial')" in lines
    assert "noise_sd='0.5 kPa', tolerances='tissue'" in lines
