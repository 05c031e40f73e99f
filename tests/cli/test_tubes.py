"""Files of pressure, diameter and axial force: what was simulated is found within the intervals, and shown."""

import csv

import pytest

from thick_tubes import fibres, rows_of, written, yeoh
from tissuq.app.account import account
from tissuq.errors import InputError
from tissuq.studies.answers import Answer, with_options
from tissuq.studies.files_of_tests import measured

SIZES = ["--diameter", "3 mm", "--thickness", "0.25 mm"]


@pytest.mark.parametrize(
    ("law", "material", "truth"),
    [
        (yeoh, "yeoh", {"C10": 20, "C20": 20, "C30": 0}),
        (fibres, "neo-hookean+exponential-fibres@45", {"C10": 20, "k1": 10, "k2": 1}),
    ],
)
def test_the_parameters_of_a_simulated_vessel_are_within_their_intervals(done, here, law, material, truth):
    """With noise of 1 %, of one seed: of twenty draws of the noise an interval misses its parameter in one."""
    written(here, rows_of(law, noise=0.01, seed=1))
    alone = ["--discrepancy", "none", "--estimand", "as-tested", "--no-figures"]
    done("fit", "artery.csv", *SIZES, "--material", material, *alone, "--out", "run")
    with (here / "run" / "parameters.csv").open(newline="") as lines:
        rows = {row["parameter"]: row for row in csv.DictReader(lines)}
    for name, value in truth.items():
        assert float(rows[name]["hdi_low"]) < value < float(rows[name]["hdi_high"])
        assert float(rows[name]["sd"]) < 0.05 * max(value, 20)


def test_inspect_tells_what_is_taken(cli, here):
    written(here, rows_of(fibres))
    text = " ".join(cli("inspect", "artery.csv", *SIZES).out.split())
    assert "mode thin-tube (columns of pressure, diameter and force)" in text
    assert "The force is taken as the reduced one" in text


def test_a_missing_axial_stretch_is_said_without_a_traceback(cli, here):
    written(here, rows_of(fibres)[:, [0, 1, 3]], "Pressure (mmHg),Outer diameter (um),Axial force (mN)")
    said = cli("fit", "artery.csv", *SIZES)
    assert said.status != 0
    assert "--axial-stretch 1.5" in said.err
    assert "Traceback" not in said.err


def test_an_axial_stretch_among_the_options_of_reading_holds_for_every_file(here):
    """As the page gives it."""
    rows = rows_of(fibres, held=(1.4,), at_rest=None)[:, [0, 1, 3]]
    file = written(here, rows, "Pressure (mmHg),Outer diameter (um),Axial force (mN)")
    sizes = {"diameter": "3 mm", "thickness": "0.25 mm"}
    _, (reading,) = measured([file], {"axial_stretch": 1.4, "dimensions": sizes}, None, None, None)
    assert set(reading.experiment.stretch[:, 1]) == {1.4}


def test_the_axial_stretch_that_is_missing_is_asked_for(here):
    """It is typed: the example in the message is no answer."""
    rows = rows_of(fibres, held=(1.4,), at_rest=None)[:, [0, 1, 3]]
    written(here, rows, "Pressure (mmHg),Outer diameter (um),Axial force (mN)")
    settings = {"dimensions": {"diameter": "3 mm", "thickness": "0.25 mm"}}
    answers = account(["artery.csv"], settings, [None])["error"]["answers"]
    assert "axial-stretch" in [name for answer in answers for name in answer["asked_for"]]
    assert all(answer["asked_for"] for answer in answers if "axial_stretch" in answer["settings"])
    typed = with_options(settings, Answer((("axial-stretch", "1.4"),)))
    assert account(["artery.csv"], typed, [None])["tests"][0]["mode"] == "thin-tube"
    with pytest.raises(InputError, match=r"--axial-stretch needs a number such as 1\.5, not 'x'"):
        with_options(settings, Answer((("axial-stretch", "x"),)))


def test_the_page_shows_both_stresses_and_the_role_of_every_column(here):
    written(here, rows_of(fibres))
    found = account(["artery.csv"], {"dimensions": {"diameter": "3 mm", "thickness": "0.25 mm"}}, [None])
    (test,) = found["tests"]
    assert test["mode"] == "thin-tube"
    assert list(test["roles"].values()) == ["outer_diameter", "pressure", "force", "axial_stretch"]
    assert len(test["curves"]) == 2
    assert any("taken as the reduced one" in item["text"] for item in found["findings"])
    again = {"dimensions": {"diameter": "3 mm", "thickness": "0.25 mm"}}
    again["columns"] = {role: name for name, role in test["roles"].items()}
    assert account(["artery.csv"], again, [None])["tests"][0]["curves"] == test["curves"]
