"""``tissuq ensemble``: the whole path with a program in the place of CalculiX."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import tissuq as tq
from tissuq.report.source_run import said_by

from .conftest import rows_of, write_specimen
from .models import DECK, started


@pytest.mark.slow
def test_the_forces_are_those_of_the_draws_that_export_writes(done, here, model):
    said = done("ensemble", *model, "--unit", "kPa")
    assert "Model 'model.inp' with 6 draws" in said.out
    assert str(Path("out") / "report.html") in said.out
    done("export", "run", "--format", "calculix", "--draws", 6, "--unit", "kPa", "--out", "cards")
    constants = [float(row["card_C10"]) for row in rows_of(here / "cards" / "index.csv")]
    assert len(set(constants)) == 6
    draws = rows_of(here / "out" / "draws.csv")
    assert [float(row["force"]) for row in draws] == pytest.approx(constants, rel=1e-8)
    assert [float(row["C10 [kPa]"]) for row in draws] == pytest.approx(constants, rel=1e-8)
    summary = json.loads((here / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["quantities"]["force"]["mean"] == pytest.approx(np.mean(constants), rel=1e-8)
    assert summary["quantities"]["force"]["sd"] == pytest.approx(np.std(constants, ddof=1), rel=1e-6)
    halves = rows_of(here / "out" / "quantities.csv")
    assert [float(row["time"]) for row in halves] == [0.5, 1.0]
    assert float(halves[0]["mean"]) == pytest.approx(np.mean(constants) / 2, rel=1e-8)
    page = (here / "out" / "report.html").read_text(encoding="utf-8")
    assert "too few for a 95\u00a0% band" in page
    assert page.count("data:image/svg+xml") == 2
    assert "HYPERELASTIC, NEO HOOKE" in page
    assert "curves are interpolated between them by monotone cubics" in page


def test_what_the_fit_says_against_finite_elements_is_said_of_the_band(cli, done, here, model):
    result = here / "run" / "result.json"
    record = json.loads(result.read_text(encoding="utf-8"))
    record["uses"][-1] |= {"verdict": "no", "reason": "it tore"}
    record["next"] = "see which test would make it narrower: tissuq design {run}"
    record["warnings"].append({"code": "measurements", "severity": "caution", "text": "it tore: give --until-peak."})
    result.write_text(json.dumps(record), encoding="utf-8")
    done("ensemble", *model, "--no-figures")
    of_band = json.loads((here / "out" / "result.json").read_text(encoding="utf-8"))
    assert of_band["uses"] == [{"purpose": "use of the fit in finite elements", "verdict": "no", "reason": "it tore"}]
    next_step = "see which test would make it narrower: tissuq design run"
    assert of_band["next"] == f"do not use this yet; next step of the fit: {next_step}"
    assert "it tore: give --until-peak." in [warning["text"] for warning in of_band["warnings"]]
    of_other = SimpleNamespace(material=SimpleNamespace(name="yeoh"), discrepancy=SimpleNamespace(name="other"))
    assert said_by(here / "run", of_other).use is None
    record["uses"][-1]["verdict"] = "perhaps"
    result.write_text(json.dumps(record), encoding="utf-8")
    with pytest.raises(tq.InputError, match="is damaged"):
        said_by(here / "run", tq.load(here / "run").model)
    result.write_text("{", encoding="utf-8")
    said = cli("structure", "run", "--draws", 2, "--no-figures")
    assert (said.status, "result.json' is damaged" in said.err) == (2, True)
    assert not (here / "runs").exists()


@pytest.mark.slow
def test_the_next_test_is_for_a_quantity_of_the_model(done, here, model):
    """The stub's force is C10: what a test tells of the one it tells of the other."""
    model[model.index("--draws") + 1] = 16
    done("ensemble", *model, "--no-figures")
    said = done("design", "run", "--target", "ensemble:out", "--target", "C10", "--out", "ranking", "--no-figures")
    assert "Force of the model model.inp" in said.out
    rows = rows_of(here / "ranking" / "design.csv")
    gains = {
        target: [float(row["reduction"]) for row in rows if row["target"] == target]
        for target in ("ensemble:out:force", "C10")
    }
    assert len(gains["C10"]) > 3
    np.testing.assert_allclose(gains["ensemble:out:force"], gains["C10"], rtol=1e-5)
    done("design", "--config", "ranking/run.toml", "--out", "again", "--no-figures")
    assert (here / "again" / "design.csv").read_bytes() == (here / "ranking" / "design.csv").read_bytes()


@pytest.mark.parametrize(
    ("target", "words"),
    [("ensemble:nowhere", "no complete ensemble in"), ("ensemble:out:moment", "ensemble:.*out:force")],
)
def test_a_quantity_that_no_ensemble_has_is_refused(cli, done, here, model, target, words):
    done("ensemble", *model, "--no-figures")
    said = cli("design", "run", "--target", target)
    assert said.status == 2
    assert re.search(words, said.err)


@pytest.mark.slow
def test_an_ensemble_of_another_run_is_refused(cli, done, here, model):
    done("ensemble", *model, "--no-figures")
    fit = "fit", write_specimen(here / "other.csv"), "--material", "yeoh", "--discrepancy", "none", "--no-figures"
    done(*fit, "--out", "another")
    said = cli("design", "another", "--target", "ensemble:out")
    assert said.status == 2
    assert "none of the materials of the ensemble (TISSUE) is of this run" in said.err


def test_the_decks_differ_from_the_model_in_the_material_alone(done, here, model):
    done("ensemble", *model, "--no-figures")
    start, end = DECK.index("*ELASTIC"), DECK.index("*MATERIAL, NAME=Fat")
    for number in range(1, 7):
        text = (here / "out" / "draws" / f"complete-{number}" / "model.inp").read_text(encoding="utf-8")
        assert text.startswith(DECK[:start])
        assert text.endswith(DECK[end:])
        assert text.count("*HYPERELASTIC") == 1


OTHERS = {
    "febio": (
        "model.feb",
        '<febio_spec version="4.0"><Material><material id="1" name="Fat" type="neo-Hookean"><E>1</E></material>'
        '<material id="2" name="Tissue" type="neo-Hookean"><E>1</E></material></Material></febio_spec>',
        "Tissue",
        r"id=.2. name=.Tissue. type=.Mooney-Rivlin.>\s*<c1>(.*?)</c1>",
        "card_c1",
    ),
    "ls-dyna": (
        "model.k",
        "*KEYWORD\n*MAT_ELASTIC\n         7   1.1e-9        1.       0.3\n*END\n",
        "7",
        r"\n +7 +1\.1e-9.*\n.*\n +(\S+)",
        "card_C10",
    ),
    "ansys": ("model.cdb", "/PREP7\nMP,EX,3,1.0\n/SOLU\n", "3", r"TB,HYPER,3,1,,NEO\nTBDATA,1,([^,]+)", "card_mu"),
}
"""Of each format a deck, its material, where a draw's first constant stands then, and its name in the index."""


@pytest.mark.parametrize("code", OTHERS)
def test_other_solvers_get_their_decks_and_a_function_reads_what_they_leave(done, here, model, code):
    name, deck, wanted, pattern, column = OTHERS[code]
    (here / name).write_text(deck, encoding="utf-8")
    body = (
        f"import re\ndef first(folder):\n    return float(re.search({pattern!r}, (folder / {name!r}).read_text())[1])\n"
    )
    (here / "mine.py").write_text(body, encoding="utf-8")
    says = "N O R M A L   T E R M I N A T I O N"
    command = f'"{Path(sys.executable).as_posix()}" -c "print(\'{says}\')"'
    solver = ["--solver", "febio4"] if code == "febio" else []
    options = ["--qoi", "first=mine.py:first", *solver, "--command", command, "--draws", 3, "--max-jobs", 1]
    done("ensemble", "run", name, "--replace", wanted, *options, "--no-figures", "--out", "out")
    done("export", "run", "--format", code, "--draws", 3, "--out", "cards")
    constants = [float(row[column]) for row in rows_of(here / "cards" / "index.csv")]
    assert [float(row["first"]) for row in rows_of(here / "out" / "draws.csv")] == pytest.approx(constants, rel=1e-9)


def test_every_material_may_name_its_run(done, here, model):
    words = ["model.inp", "--replace", "TISSUE=run", *model[4:]]
    done("ensemble", *words, "--no-figures")
    assert len(rows_of(here / "out" / "draws.csv")) == 6


def test_a_dry_run_shows_the_diff_and_leaves_nothing(done, here, model):
    said = done("ensemble", *model, "--dry-run")
    lines = said.out.splitlines()
    gone = [line for line in lines if line.startswith("-") and not line.startswith(("---", "- "))]
    assert gone == ["-*ELASTIC", "-1., 0.3"]
    assert "+*HYPERELASTIC, NEO HOOKE" in lines
    assert not (here / "out").exists()
    assert not started(here)


def test_two_materials_get_draws_of_their_runs_that_are_independent(done, here, model):
    done("fit", write_specimen(here / "other.csv"), "--noise-sd", 2, "--discrepancy", "none", "--no-figures")
    done("ensemble", *model, "--replace", "fat=runs/other", "--no-figures")
    rows = rows_of(here / "out" / "draws.csv")
    pairs = np.array([[float(row["TISSUE.C10 [MPa]"]), float(row["fat.C10 [MPa]"])] for row in rows])
    assert abs(np.corrcoef(pairs.T)[0, 1]) < 0.95  # one sequence for both would order them alike
    text = (here / "out" / "draws" / "complete-1" / "model.inp").read_text(encoding="utf-8")
    assert text.count("*HYPERELASTIC") == 2


def test_a_function_is_named_as_typed_and_a_dry_run_of_a_recipe_does_not_run_it(done, here, model):
    (here / "mine.py").write_text("def size(folder):\n    return 1\n")
    done("ensemble", *model, "--no-figures", "--qoi", "size=mine.py:size")
    page = (here / "out" / "report.html").read_text(encoding="utf-8")
    assert "<p>mine.py:size, in the units of the model" in page  # as typed
    copy = here / "out" / "quantities" / "mine.py"
    copy.write_text(f"open({str(here / 'ran')!r}, 'w')\n" + copy.read_text())
    said = done("ensemble", "--config", "out/run.toml", "--dry-run")
    assert "+*HYPERELASTIC" in said.out
    assert not (here / "ran").exists()
