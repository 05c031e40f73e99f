"""`tissuq fit` with several materials, as a user runs it."""

from __future__ import annotations

import tomllib
from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import nullcontext

import numpy as np
import pytest

import tissuq as tq
from class_law import SIMPLE
from tissuq.studies import laws

from .conftest import STRESS_KPA, STRETCH, rows_of

ALONE = ["--discrepancy", "none", "--noise-sd", "1", "--estimand", "as-tested"]
TWO = ["--material", "neo-hookean", "--material", "mooney-rivlin"]
LAW = """
def softening(I1, I2, mu, k):
    return mu * (I1 - 3) / 2 - k * (I1 - 3) ** 2
"""


def laws_in(folder):
    return {row["law"]: row for row in rows_of(folder / "laws.csv")}


@pytest.mark.slow
def test_two_laws_are_compared_and_one_is_gone_on_with(cli, done, here, specimen):
    said = done("fit", specimen, *TWO, *ALONE, "--out", "two")
    words = " ".join(said.out.split())
    assert "Laws of specimen, moduli in kPa" in words
    assert "The initial shear modulus, averaged over the laws, has the mean" in words
    rows = laws_in(here / "two")
    stretch, stress = np.array(STRETCH), 1e-3 * np.array(STRESS_KPA)
    experiment = tq.Experiment("uniaxial", stretch, stress)
    for name, row in rows.items():
        options = {"discrepancy": "none", "noise_sd": 1e-3, "tolerances": "as-tested"}
        posterior = tq.fit(experiment, material=name, **options)
        assert float(row["log_evidence"]) == pytest.approx(posterior.log_evidence, rel=1e-6)
        modulus = posterior.initial_shear_modulus.quantile(0.5)
        assert float(row["modulus [kPa]"]) == pytest.approx(1e3 * modulus, rel=1e-6)
    page = (here / "two" / "report.html").read_text()
    assert page.count("<svg") + page.count("data:image/svg+xml") == 2
    for number, option in enumerate(("--material", "--discrepancy")):  # the other one is its former name
        predicted = done(
            "predict", "two", option, "mooney-rivlin", "--mode", "planar", "--no-figures", "--out", f"p{number}"
        )
        assert f"tissuq predict two {option} mooney-rivlin --mode planar --data" in " ".join(predicted.out.split())
    assert (here / "p0" / "prediction.csv").read_bytes() == (here / "p1" / "prediction.csv").read_bytes()
    again = cli("predict", "--config", "p0/run.toml", "--no-figures", "--out", "again")
    assert (again.status, (here / "again" / "prediction.csv").read_bytes()) == (
        0,
        (here / "p0" / "prediction.csv").read_bytes(),
    )
    assert "--material" in said.out.partition("Next: ")[2].partition("Warning")[0]
    for options, words in (
        (["--material", "gent"], "has no law 'gent': choose one of mooney-rivlin, neo-hookean (--material)"),
        (["--material", "mooney-rivlin", "--discrepancy", "auto"], "has no discrepancy 'auto': its laws are with none"),
    ):
        refused = cli("predict", "two", *options, "--mode", "planar", "--no-figures")
        assert (refused.status, words in refused.err) == (2, True)
    done("export", "two", "--material", "neo-hookean", "--draws", 2, "--format", "abaqus")
    asked = cli("predict", "two", "--mode", "planar", "--no-figures", "--out", "other")
    assert (asked.status, asked.err.count("\n")) == (2, 1)
    assert "has several laws: choose one of mooney-rivlin, neo-hookean" in asked.err


@pytest.mark.slow
def test_a_comparison_is_repeated_from_its_recipe(done, here, specimen):
    done("fit", specimen, *TWO, *ALONE, "--no-figures", "--out", "first")
    recipe = tomllib.loads((here / "first" / "run.toml").read_text())
    assert recipe["laws"] == ["neo-hookean", "mooney-rivlin"]
    assert "material" not in recipe
    done("fit", "--config", "first/run.toml", "--no-figures", "--out", "again")
    first, again = (laws_in(here / folder) for folder in ("first", "again"))
    for name, row in first.items():
        assert row | {"seconds": ""} == again[name] | {"seconds": ""}


@pytest.mark.slow
def test_laws_that_are_divided_among_processes_are_written_alike(done, here, specimen):
    for workers in (1, 2):
        done("fit", specimen, *TWO, *ALONE, "--no-figures", "--workers", workers, "--out", str(workers))
    one, two = (laws_in(here / folder) for folder in ("1", "2"))
    assert [row | {"seconds": ""} for row in one.values()] == [row | {"seconds": ""} for row in two.values()]


def test_a_process_that_is_ended_from_outside_is_one_message(cli, here, specimen, monkeypatch):
    class Lost(Executor):
        def submit(self, *_):
            future = Future()
            future.set_exception(BrokenProcessPool())
            return future

    monkeypatch.setattr(laws, "open_pool", lambda _: nullcontext(Lost()))
    said = cli("fit", specimen, *TWO, *ALONE, "--workers", 2)
    assert (said.status, "ended from outside" in said.err, "--workers 1" in said.err) == (2, True, True)
    assert not (here / "runs" / "specimen").exists()


@pytest.mark.slow
def test_a_law_of_ones_own_takes_part(cli, done, here, specimen):
    (here / "law.py").write_text(LAW)
    done("fit", specimen, "--material", "law.py:softening", "--material", "neo-hookean", *ALONE, "--no-figures")
    folder = here / "runs" / "specimen"
    assert set(laws_in(folder)) == {"softening", "neo-hookean"}
    assert (folder / "input" / "law.py").read_text() == LAW
    options = ("--mode", "planar", "--no-figures", "--out")
    for number, named in enumerate((["--user-law", "law.py:softening"], ["--material", "law.py:softening"])):
        predicted = done("predict", "runs/specimen", *named, *options, f"p{number}")
        assert "softening" in predicted.out
    two = ["--material", "neo-hookean", "--user-law", "law.py:softening"]
    refused = cli("predict", "runs/specimen", *two, *options, "p2")
    assert (refused.status, "give one law" in refused.err) == (2, True)


def test_a_law_in_a_class_of_ones_own_is_fitted_where_it_is_known(done, here, specimen):
    (here / "laws.py").write_text(f"from tissuq import Material, Parameter\n\n\n{SIMPLE}")
    done("fit", specimen, "--material", "laws.py:Simple", *TWO, *ALONE, "--workers", 2, "--no-figures")
    assert len(laws_in(here / "runs" / "specimen")) == 3


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([*TWO, "--discrepancy", "all"], ["laws are compared with one discrepancy"]),
        ([*TWO, "--held-out"], ["held_out"]),
        (["--material", "all", "--material", "gent"], ["'all' cannot be combined"]),
        (["--material", "gent", "--material", "no-such-law"], ["no-such-law"]),
        ([*TWO, "--prior", "Jm=uniform(1,2)"], ["Jm"]),
    ],
)
def test_bad_input_is_one_message_and_leaves_nothing(refused, specimen, options, words):
    refused(words, "fit", specimen, *options)
