"""What the page says of files is what was measured; what is doubtful becomes questions whose answers can be taken."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import tissuq as tq
from tissuq.app.account import account, modes_of_specimens


def taken(file, question, label, reading=None, mode=None):
    """Return what is understood once the answer of a label is taken, as the page takes it."""
    settings = dict(next(answer for answer in question["answers"] if answer["label"] == label)["settings"])
    mode = settings.pop("mode", mode)
    return account([file], {**(reading or {}), **settings}, [mode])


def test_the_curve_that_is_drawn_is_what_was_measured(here, write_stretches):
    write_stretches(here)
    found = account(["kidney.csv"], {}, ["uniaxial"])
    (test,) = found["tests"]
    rows = np.loadtxt("kidney.csv", delimiter=",", skiprows=1).T
    for drawn in ("used", "recorded"):
        np.testing.assert_allclose([test["curves"][0][drawn][name] for name in "xy"], rows, rtol=1e-5, atol=1e-6)
    assert (test["unit"], test["mode"], test["rows"], test["all_rows"]) == ("kPa", "uniaxial", 40, 40)
    assert test["roles"] == {"stretch": "stretch", "stress [kPa]": "stress"}
    assert found["text"] == str(tq.inspect("kidney.csv", mode="uniaxial"))
    assert (found["questions"], found["error"]) == ([], None)
    json.dumps(found, allow_nan=False)


def test_an_unstated_unit_and_mode_are_questions_and_their_answers_settle_them(here, write_stretches):
    write_stretches(here, heading="stretch,stress")
    found = account(["kidney.csv"], {}, [None])
    unit, mode = found["questions"]
    assert "MPa was assumed" in unit["plain"]
    assert "--" not in unit["plain"]
    assert [answer["label"] for answer in unit["answers"]] == ["stresses are in kPa", "stresses are in MPa"]
    mended = taken("kidney.csv", unit, "stresses are in kPa")
    assert mended["tests"][0]["unit"] == "kPa"
    assert [question["text"] for question in mended["questions"]] == [mode["text"]]
    planar = taken("kidney.csv", mode, "planar", {"stress_unit": "kPa"})
    assert (planar["tests"][0]["mode"], planar["questions"]) == ("planar", [])


def test_columns_are_said_of_the_file_that_has_them_and_the_other_is_read_by_itself(here, write_stretches):
    write_stretches(here)
    write_stretches(here, "odd.csv", heading="alpha,beta [kPa]", c10=10.0)
    files, modes, reading = ["kidney.csv", "odd.csv"], ["uniaxial"] * 2, {}
    for label in ("stretch is in column 'alpha'", "stress is in column 'beta [kPa]'"):
        error = account(files, reading, modes)["error"]
        if error is None:
            break
        answers = {answer["label"]: answer for answer in error["answers"]}
        assert error["file"] == "odd.csv"
        reading |= answers[label]["settings"]
    found = account(files, reading, modes)
    assert found["error"] is None
    assert [test["control"] for test in found["tests"]] == ["stretch", "stretch"]
    highest = [max(test["curves"][0]["used"]["y"]) for test in found["tests"]]
    assert highest[1] == pytest.approx(2 * highest[0], rel=1e-3)


def test_two_files_whose_columns_have_other_names_are_both_mended(here, write_stretches):
    files, modes, reading = ["a.csv", "b.csv"], ["uniaxial"] * 2, {}
    for name, c10 in zip("ab", (5.0, 10.0), strict=True):
        write_stretches(here, f"{name}.csv", heading=f"{name} 1,{name} 2", c10=c10)
    for label in (
        "stress is in column 'a 2",
        "stretch is in column 'a 1",
        "stress is in column 'b 2",
        "stretch is in column 'b 1",
    ):
        error = account(files, reading, modes)["error"]
        assert error["file"] == label[-3] + ".csv"
        reading |= next(answer["settings"] for answer in error["answers"] if answer["label"].startswith(label))
    found = account(files, reading, modes)
    assert found["error"] is None
    assert [max(test["curves"][0]["used"]["y"]) for test in found["tests"]] == pytest.approx([10.56, 21.06], rel=0.02)
    (other,) = account(files[1:], reading, modes[1:])["tests"]
    assert other["roles"] == {"b 1": "stretch", "b 2": "stress"}


def test_a_stress_whose_type_is_open_is_asked_about_without_the_name_of_an_option(here, write_stretches):
    write_stretches(here, heading="stretch,sigma [kPa]")
    error = account(["kidney.csv"], {}, ["uniaxial"])["error"]
    assert "Say which type it is: engineering, cauchy" in error["plain"]
    assert "_type" not in error["plain"]
    assert error["answers"][1]["label"] == "it is cauchy stress"


def test_a_strip_along_axis_2_of_the_tissue_is_a_mode_to_choose(here, write_stretches):
    write_stretches(here)
    (question,) = account(["kidney.csv"], {}, [None])["questions"]
    for mode in ("uniaxial@2", "planar@2"):
        assert taken("kidney.csv", question, mode)["tests"][0]["mode"] == mode
    assert {"uniaxial@2", "planar@2"} < {mode.name for mode in modes_of_specimens()}


def test_a_length_that_is_missing_is_asked_for_and_makes_the_stretches_right(here, write_machine):
    write_machine(here)
    error = account(["skin.csv"], {}, ["uniaxial"])["error"]
    (answer,) = error["answers"]
    assert answer["asked_for"] == ["length"]
    found = account(["skin.csv"], {"dimensions": {"length": "12 mm"}}, ["uniaxial"])
    (test,) = found["tests"]
    assert test["range"] == pytest.approx([1, 1 + 4 / 12], rel=1e-5)
    drawn = test["curves"][0]["used"]
    stretch, expected = np.array(drawn["x"][:60]), np.array(drawn["y"][:60])
    np.testing.assert_allclose(20 * (stretch - stretch**-2), expected, atol=0.3)


def test_a_finding_has_a_button_that_mends_it(here, write_machine):
    write_machine(here)
    reading = {"dimensions": {"length": "12 mm"}}
    (finding,) = account(["skin.csv"], reading, ["uniaxial"])["findings"]
    assert "loading and unloading differ" in finding["plain"]
    (answer,) = finding["answers"]
    assert answer == {"label": "take only loading", "settings": {"branch": "loading"}}
    mended = account(["skin.csv"], reading | answer["settings"], ["uniaxial"])
    assert (mended["tests"][0]["rows"], mended["findings"]) == (60, [])


def test_a_column_that_is_not_known_can_be_chosen(here, write_stretches):
    write_stretches(here, heading="stretch,result")
    error = account(["kidney.csv"], {}, ["uniaxial"])["error"]
    assert "stress is in column 'result'" in [answer["label"] for answer in error["answers"]]
    found = taken("kidney.csv", error, "stress is in column 'result'", mode="uniaxial")
    assert found["tests"][0]["roles"]["result"] == "stress"


def test_a_file_that_holds_no_measurements_is_refused_with_the_message_of_the_command_line(here):
    (here / "bad.csv").write_text("hello,world\nfoo,bar\n")
    found = account(["bad.csv"], {}, [None])
    with pytest.raises(tq.InputError) as refusal:
        tq.read("bad.csv")
    assert found["error"]["text"] == str(refusal.value)
    assert (found["tests"], found["error"]["file"]) == ([], "bad.csv")
    json.dumps(found, allow_nan=False)


def test_every_law_that_a_next_step_names_can_be_chosen():
    from tissuq.app import tasks
    from tissuq.assessment.next_step import STEPS

    said = []
    tasks.choices({}, lambda kind, record: said.append(record))
    laws = {law["name"] for law in said[0]["materials"]} | {"all"}
    named = {word for step in STEPS.values() for word in re.findall(r"--material ([\w-]+)", step.shell)}
    assert named <= laws
    assert len(named) == 2
