"""`tissuq export`, as a user runs it."""

from __future__ import annotations

import json
import shutil

import pytest

import tissuq as tq
from tissuq.export import card_formats

from .conftest import fitted_in, rows_of

FREE = "auto"


@pytest.fixture(scope="module")
def earlier(tmp_path_factory):
    """A run with a free energy, none, and an error of the stress."""
    folder = tmp_path_factory.mktemp("export")
    chosen = [word for name in (FREE, "none", "gp") for word in ("--discrepancy", name)]
    fitted_in(folder, *chosen, "--no-figures")
    return folder / "runs" / "specimen"


@pytest.fixture
def run(earlier, here):
    shutil.copytree(earlier, here / "runs" / "specimen")
    return "runs/specimen"


def test_a_run_becomes_the_cards_of_its_posterior(done, here, run):
    said = done(
        "export", run, "--discrepancy", "none", "--draws", 4, "--unit", "kPa", "--format", "calculix", "--seed", 3
    )
    assert "exactly: NEO HOOKE" in " ".join(said.out.split())
    assert "cards/specimen-calculix/draw-1.inp to draw-4.inp" in said.out
    rows = rows_of(here / "cards" / "specimen-calculix" / "index.csv")
    draws = tq.load(run, "none").ensemble(4, 3)
    assert [float(row["C10"]) for row in rows] == pytest.approx([1e3 * draw.values["C10"] for draw in draws])
    typical = min(rows, key=lambda row: float(row["from_median"]))["file"]
    assert f"median stresses: {typical}\n" in said.out
    text = (here / "cards" / "specimen-calculix" / "draw-2.inp").read_text()
    assert "calibrated stretches: uniaxial" in " ".join(said.out.split())
    assert "run specimen of tissuq, sobol draws from seed 3" in " ".join(text.split())


def test_a_free_energy_is_projected_and_its_error_said(done, here, run):
    said = done("export", run, "--draws", 4, "--all-draws", "--law", "ogden", "--order", 3, "--out", "mine")
    words = " ".join(said.out.split())
    assert "nearest OGDEN, N=3" in words
    assert "root mean square" in words
    text = (here / "mine" / "draw-1.inp").read_text()
    assert "admissible: not looked at" in text
    assert "PROJECTION" in text


def test_cards_say_what_the_fit_says_of_finite_elements(done, here, run):
    result = here / run / "result.json"
    record = json.loads(result.read_text())
    (of_fit,) = (use for use in record["uses"] if use["purpose"].startswith("simulate"))
    of_fit |= {"verdict": "no", "reason": "it was made so by a test"}
    result.write_text(json.dumps(record))
    said = done("export", run, "--draws", 2)
    assert said.out.startswith("  NO  use of the fit in finite elements: it was made so by a test\n")
    assert "Next: do not use this yet; next step of the fit: " in said.out
    for text in (here / "cards" / "specimen-abaqus").glob("*.inp"):
        assert "use of the fit in finite elements: NO, it was made so by a test" in " ".join(
            line.strip("* ") for line in text.read_text().splitlines()
        )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--discrepancy", "gp"], "is an error of the measured stress"),
        (["--discrepancy", "yeoh"], "choose one of auto, gp, none"),
        (["--format", "nastran"], "no format of cards named 'nastran'"),
        (["--number", "3"], "--number: cards of the format 'abaqus' have none"),
        (["--number", "3", "--name", "X", "--format", "table"], "--name and --number: tables of the format 'table'"),
        (["--unit", "psi"], "MPa, kPa, Pa"),
        (["--law", "gent"], "no law 'gent'"),
        (["--draws", "0"], "one draw or more"),
        (["--sampling", "halton"], "'sobol', 'latin' or 'random'"),
        (["--poisson", "0.6"], "between 0 and 0.5"),
        (["--bulk-modulus", "10", "--poisson", "0.4"], "not both"),
        (["--out", "runs/specimen", "--force"], "is the run itself"),
        (["--out", "runs", "--force"], "is the run itself or contains it"),
        (["--out", "runs/specimen/cards"], "lies inside the run"),
        (["--seed", "-1"], "seed must be a whole number from 0 to 4611686018427387904, not -1"),
        (["--user-law", "yeoh"], "'yeoh' is not of the form law.py:Name"),
        (["--material", "yeoh"], "is of the material 'neo-hookean', and not of 'yeoh'"),
    ],
    ids=lambda each: " ".join(each) if isinstance(each, list) else "",
)
def test_what_cannot_be_is_refused_and_nothing_written(refused, run, options, words):
    refused([words], "export", run, *options)


def test_tables_are_called_so(done, here, run):
    said = done("export", run, "--discrepancy", "none", "--draws", 2, "--format", "table")
    assert "Tables: cards/specimen-table/draw-1.csv" in said.out
    assert "card " not in said.out
    assert "In the tables: calibrated stretches" in said.out
    assert "card" not in (here / "cards" / "specimen-table" / "draw-1.csv").read_text()


def test_cards_are_never_overwritten_unasked(cli, here, run):
    for options, status in (([], 0), ([], 2), (["--force"], 0)):
        said = cli("export", run, "--discrepancy", "none", "--draws", 1, *options)
        assert said.status == status
        assert ("exists" in said.err) == (status == 2)


def test_fibres_have_cards_for_the_codes_that_have_them(refused, done, here):
    rows = [f"{x},{y},{100 * (x - 1):.3f},{90 * (y - 1):.3f}" for x in (1.05, 1.1, 1.2) for y in (1.02, 1.1, 1.15)]
    (here / "sheet.csv").write_text("stretch x,stretch y,stress x (kPa),stress y (kPa)\n" + "\n".join(rows) + "\n")
    done(
        "fit", "sheet.csv", "--mode", "biaxial", "--material", "neo-hookean+standard-fibres:one@0", "--noise-sd", 1,
        "--discrepancy", "none", "--no-figures",
    )  # fmt: skip
    done("export", "runs/sheet", "--format", "calculix", "--draws", 2)
    (first, _) = sorted((here / "cards" / "sheet-calculix").glob("*.inp"))
    assert "*MATERIAL, NAME=ELASTIC_FIBER_TISSUE\n*USER MATERIAL, CONSTANTS=6\n" in first.read_text()
    refused(["abaqus or calculix or febio"], "export", "runs/sheet", "--format", "ls-dyna")


def test_the_help_names_every_format(cli):
    said = " ".join(cli("export", "--help").out.split())
    assert all(name in said for name in card_formats())
