"""``tissuq ensemble --finer-model``: the error of the user's mesh, from one draw on a finer one."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from refined_deck import refined

from .conftest import rows_of
from .models import DECK, started

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
FINER = ["--finer-model", "fine/model.inp", "--no-figures"]


def deck(elements, finer="", text=DECK):
    """Return the deck with as many hexahedra, and what the stub makes of it."""
    rows = "".join(f"{n}, {', '.join('1' * 8)}\n" for n in range(1, elements + 1))
    more = f"** finer: {finer}\n" * bool(finer) + f"*ELEMENT, TYPE=C3D8, ELSET=BODY\n{rows}*MATERIAL"
    return text.replace("*MATERIAL", more, 1)


@pytest.fixture
def meshed(model, here):
    """The words after ``tissuq ensemble`` of a model of two elements; a finer one of sixteen is beside it."""
    (here / "fine").mkdir()
    (here / "model.inp").write_text(deck(2), encoding="utf-8")
    (here / "fine" / "model.inp").write_text(deck(16, "0.9"), encoding="utf-8")
    return model


def test_the_band_is_that_for_elements_without_size_and_the_mesh_has_a_share(done, here, meshed):
    """Of first order and with elements half as long the error is twice the change, a quarter of it the sd of that."""
    said = done("ensemble", *meshed, *FINER)
    fine = next((here / "out" / "draws").glob("fine-*")).name
    assert len(started(here)) == 7
    draws = [float(row["force"]) for row in rows_of(here / "out" / "draws.csv")]
    assert int(fine.removeprefix("fine-")) - 1 == np.argsort(draws)[3]
    last = {name: float(value or "nan") for name, value in rows_of(here / "out" / "quantities.csv")[-1].items()
            if name != "quantity"}  # fmt: skip
    mean, sd, spread = np.mean(draws), np.std(draws, ddof=1), 0.05 * np.mean(draws)
    assert last["mean"] == pytest.approx(mean)
    assert last["mesh_free_mean"] == pytest.approx(0.8 * mean)
    assert last["mesh_free_sd"] == pytest.approx(np.hypot(0.8 * sd, spread))
    assert last["mesh"] == pytest.approx(spread**2 / ((0.8 * sd) ** 2 + spread**2))
    assert last["mesh"] + last["parameters"] == pytest.approx(1)
    assert last["mesh_free_low"] < 0.8 * last["low"] < 0.8 * last["high"] < last["mesh_free_high"]
    summary = json.loads((here / "out" / "summary.json").read_text(encoding="utf-8"))["finer_model"]
    assert (summary["cell_ratio"], summary["elements"], summary["draw"]) == (2.0, [2, 16], int(fine[-1]))
    assert summary["changes"]["force"] == pytest.approx(-0.1)
    (number, *_) = json.loads((here / "out" / "result.json").read_text(encoding="utf-8"))["numbers"]
    assert number["value"] == pytest.approx(0.8 * mean, rel=1e-6)
    page = (here / "out" / "report.html").read_text(encoding="utf-8")
    for text in (" ".join(said.out.split()), " ".join(page.split())):
        assert "at the end force -20.0 % beside this mesh" in text
        assert "2 times smaller (by 2 and 16 elements)" in text
    assert "of its loads and of its supports is in no number" not in page
    assert "the mesh is too coarse for it" in " ".join(said.err.split() + said.out.split())


@pytest.mark.slow
def test_it_can_be_added_goes_on_is_in_the_recipe_and_another_finer_model_costs_one_run(done, here, meshed):
    done("ensemble", *meshed, "--no-figures")
    assert "mesh_free_mean" not in rows_of(here / "out" / "quantities.csv")[0]
    for _ in range(2):
        done("ensemble", *meshed, *FINER)
        assert len(started(here)) == 7
    table = (here / "out" / "quantities.csv").read_bytes()
    assert 'finer_model = "finer/model/model.inp"' in (here / "out" / "run.toml").read_text(encoding="utf-8")
    command = meshed[meshed.index("--command") + 1]
    repeat = ["ensemble", "--config", "out/run.toml", "--command", command, "--no-figures", "--max-jobs", 1]
    done(*repeat, "--out", "again")
    assert (here / "again" / "quantities.csv").read_bytes() == table
    assert len(started(here)) == 14
    done("ensemble", *meshed, *FINER, "--mesh-order", 2)
    assert len(started(here)) == 14
    last = rows_of(here / "out" / "quantities.csv")[-1]
    assert float(last["mesh_free_mean"]) == pytest.approx((1 - 4 / 3 * 0.1) * float(last["mean"]))
    (here / "fine" / "model.inp").write_text(deck(54, "0.9"), encoding="utf-8")
    done("ensemble", *meshed, *FINER)
    assert len(started(here)) == 15
    last = rows_of(here / "out" / "quantities.csv")[-1]
    assert float(last["mesh_free_mean"]) == pytest.approx((1 - 3 / 2 * 0.1) * float(last["mean"]))
    done("ensemble", *meshed, *FINER, "--cell-ratio", 5)
    last = rows_of(here / "out" / "quantities.csv")[-1]
    assert float(last["mesh_free_mean"]) == pytest.approx((1 - 5 / 4 * 0.1) * float(last["mean"]))


@pytest.mark.parametrize(
    ("finer", "more", "words"),
    [
        (deck(16).replace("Tissue", "Muscle"), [], ["must have the materials and sets", "no material 'TISSUE'"]),
        (deck(16).replace("NSET=TOP", "NSET=TIP"), [], ["must have", "RF2@TOP:sum", "its sets are BASE, TIP"]),
        (DECK, [], ["cannot be told from its elements", "--cell-ratio"]),
        (deck(16).replace("C3D8", "CAX8"), [], ["cannot be told from its elements"]),
        (deck(2).replace("*STEP", "** another\n*STEP"), [], ["has 2 elements, and the model 2: give a finer mesh"]),
        (deck(2), ["--cell-ratio", 2], ["is the model itself"]),
        (deck(16), ["--cell-ratio", 1], ["cell_ratio", "greater than 1"]),
        (deck(16).replace("*STEP", "*INCLUDE, INPUT=../model.inp\n*STEP"), [], ["outside of the folder of the model"]),
        (None, ["--cell-ratio", 2], ["give --finer-model FILE, too"]),
        (None, ["--mesh-order", 2], ["give --finer-model FILE, too"]),
    ],
)
def test_a_finer_model_that_cannot_be_used_is_refused_before_a_run(cli, here, meshed, finer, more, words):
    if finer is not None:
        (here / "fine" / "model.inp").write_text(finer, encoding="utf-8")
        more = [*FINER, *more]
    said = cli("ensemble", *meshed, *more)
    assert said.status == 2, said.out
    assert all(word in " ".join(said.err.split()) for word in words), said.err
    assert not started(here)
    assert not (here / "out").exists()


def test_a_quantity_that_the_finer_model_does_not_write_costs_two_runs(cli, done, here, meshed):
    (here / "fine" / "model.inp").write_text(deck(16, "silent"), encoding="utf-8")
    said = cli("ensemble", *meshed, *FINER)
    assert said.status == 2
    assert "kept as the result of draw" in said.err
    assert "on the finer mesh" in said.err
    assert len(started(here)) == 2
    (here / "fine" / "model.inp").write_text(deck(16, "0.9"), encoding="utf-8")
    done("ensemble", *meshed, *FINER)
    assert len(started(here)) == 8


def test_a_run_that_fails_on_the_finer_mesh_is_told_and_leaves_the_band(done, here, meshed):
    (here / "fine" / "model.inp").write_text(deck(16, "fails"), encoding="utf-8")
    said = done("ensemble", *meshed, *FINER)
    assert "error of the mesh is not known up to the end (draw" in " ".join(said.err.split() + said.out.split())
    assert len(rows_of(here / "out" / "draws.csv")) == 6
    assert not (here / "out" / "failures.csv").exists()


def numbers_of(line):
    return [float(word) for word in line.split(",") if word.strip()]


def test_the_finer_example_is_the_other_with_every_element_divided_into_four():
    coarse, fine = ((EXAMPLES / f"indentation{end}.inp").read_text(encoding="utf-8") for end in ("", "-fine"))
    divided, stored = refined(coarse, 2).splitlines()[3:], fine.splitlines()[3:]
    assert len(divided) == len(stored)
    for first, second in zip(divided, stored, strict=True):
        # Coordinates of seven digits: Python 3.12 and later may round the last one otherwise.
        assert first == second or numbers_of(first) == pytest.approx(numbers_of(second), abs=2e-6)


@pytest.mark.finite_elements
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed: make system")
def test_the_corrected_force_is_nearer_to_that_of_a_much_finer_mesh(done, here, model):
    """A punch, whose edge is singular: elements of a quarter of the length, which have an error of their own."""
    text = (EXAMPLES / "indentation.inp").read_text(encoding="utf-8")
    text = text.replace("0.05, 1., 1e-4, 0.125", "0.5, 1., 1e-4, 0.5").replace("-0.8\n", "-0.1\n")
    for times in (1, 2, 4):
        (here / f"punch-{times}.inp").write_text(refined(text, times), encoding="utf-8")
    common = ["--replace", "TISSUE", "--qoi", "force=RF2@PUNCH", "--draws", 2, "--max-jobs", 1, "--no-figures"]
    done("ensemble", "run", "punch-1.inp", *common, "--finer-model", "punch-2.inp", "--out", "coarse")
    done("ensemble", "run", "punch-4.inp", *common, "--out", "much-finer")
    last = rows_of(here / "coarse" / "quantities.csv")[-1]
    wanted = float(rows_of(here / "much-finer" / "quantities.csv")[-1]["mean"])
    error, corrected = (abs(float(last[name]) / wanted - 1) for name in ("mean", "mesh_free_mean"))
    assert error > 0.02
    assert corrected < 0.6 * error
