"""``tissuq inspect --ask``: questions with answers, what each gives, and the study file that the answers make."""

from __future__ import annotations

import os
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import tissuq as tq
from thick_tubes import fibres, rows_of, written
from tissuq.cli.app import app
from tissuq.errors import InputError
from tissuq.studies.answers import answers_in, options_in, with_options
from tissuq.studies.settings import load_settings
from tissuq.studies.specimen import SpecimenSettings

STRETCH = np.linspace(1, 1.3, 31)
STRESS = 0.05 * (STRETCH - STRETCH**-2)


@pytest.fixture
def negative(here):
    """Tension of a specimen of 20 mm and 10 mm², in which the load cell counts tension as negative."""
    rows = map("{:.9f},{:.9f}".format, 20 * (STRETCH - 1), -10 * STRESS)
    (here / "test.csv").write_text("\n".join(["Displacement (mm),Force (N)", *rows]))
    return here / "test.csv"


def answered(*typed, arguments=("test.csv",)):
    said = CliRunner().invoke(app, ["inspect", *arguments, "--ask"], input="".join(f"{line}\n" for line in typed))
    return said, " ".join(said.output.split())


def fitted_data(file="study.toml"):
    """Return what ``tissuq fit`` reads by a study file."""
    return load_settings(SpecimenSettings, Path(file), {}).experiment(Path())


def test_sizes_sign_and_mode_are_asked_for_and_the_study_reads_the_file(negative):
    said, text = answered("1", "20", "20 mm", "2", "5 mm", "2 mm", "--turn load", "")
    assert said.exit_code == 0, said.output
    assert "the length '20' has no unit" in text
    assert "--turn load: test: uniaxial (nothing says otherwise), 31 rows, stretch 1 to 1.3, stress 0 to 35.4" in text
    assert "--compression-positive: test: uniaxial (nothing says otherwise), 31 rows, stretch 0.7 to 1" in text
    assert "in which loading mode" in text
    assert "--mode planar: test: planar (as given)" in text
    study = tomllib.loads((negative.parent / "study.toml").read_text())["tests"][0]
    assert (study["turn"], study["dimensions"]["width"]) == ("load", "5 mm")
    data = fitted_data()
    np.testing.assert_allclose(data.stretch, STRETCH, atol=1e-8)
    np.testing.assert_allclose(data.stress, STRESS, atol=1e-8)


def test_columns_that_one_of_several_files_has_do_not_hinder_the_others(here):
    for name, head, times in (("odd", "alpha,beta [kPa]", 1), ("plain", "stretch,stress [kPa]", 2)):
        rows = map("{:.9f},{:.9f}".format, STRETCH, 1e3 * times * STRESS)
        (here / f"{name}.csv").write_text("\n".join([head, *rows]))
    columns = ["--column", "stretch=alpha", "--column", "stress=beta [kPa]"]
    said, text = answered(arguments=("odd.csv", "plain.csv", "--mode", "uniaxial", *columns))
    assert said.exit_code == 0, said.output
    assert "plain" in text
    np.testing.assert_allclose(fitted_data().measured, np.concatenate([STRESS, 2 * STRESS]), atol=1e-8)


@pytest.mark.parametrize(("number", "shown", "sign"), [("1", "--compression-positive", -1), ("2", "--turn load", 1)])
def test_every_answer_that_is_listed_gives_what_it_says(negative, number, shown, sign):
    sizes = ("--length", "20 mm", "--area", "10 mm2")
    _, text = answered(number, "", arguments=("test.csv", *sizes, "--write", "a.toml"))
    assert f" {number} {shown}: test: uniaxial" in text
    data = fitted_data("a.toml")
    np.testing.assert_allclose(data.stretch, 1 + sign * (STRETCH - 1), atol=1e-8)
    np.testing.assert_allclose(data.stress, sign * STRESS, atol=1e-8)


def test_units_and_columns_are_asked_for(here):
    rows = (f"{x:.9f},{1e3 * y:.9f},{2e3 * y:.9f}" for x, y in zip(STRETCH, STRESS, strict=True))
    (here / "test.csv").write_text("\n".join(["Stretch,Quantity A,Quantity B", *rows]))
    said, text = answered("--column 'stress=Quantity A'", "1", "")
    assert said.exit_code == 0, said.output
    assert "--column 'stress=Quantity B': test: uniaxial" in text
    assert (
        "--stress-unit kPa: test: uniaxial (nothing says otherwise), 31 rows, stretch 1 to 1.3, stress 0 to 35.4"
        in text
    )
    np.testing.assert_allclose(fitted_data().stress, STRESS, atol=1e-8)


def test_what_needs_no_answer_is_not_asked(here):
    rows = map("{:.9f},{:.9f}".format, STRETCH, 1e3 * STRESS)
    (here / "planar.csv").write_text("\n".join(["Stretch,Stress (kPa)", *rows]))
    said, text = answered(arguments=("planar.csv", "--write", "planar.toml"))
    assert (said.exit_code, "Number" in text) == (0, False)
    assert fitted_data("planar.toml").mode.name == "planar"


def test_answers_for_one_file_go_for_the_next(negative, here):
    (here / "other.csv").write_text(negative.read_text())
    typed = "1", "20 mm", "1", "10 mm2", "--turn load", "--mode planar"
    said, text = answered(*typed, arguments=("test.csv", "other.csv"))
    assert said.exit_code == 0, said.output
    assert text.count("undeformed length") == 1
    tests = tomllib.loads((here / "study.toml").read_text())["tests"]
    assert [(test["file"], test["turn"], test["mode"]) for test in tests] == [
        ("test.csv", "load", "planar"),
        ("other.csv", "load", "planar"),
    ]


def test_input_that_ends_or_is_wrong_says_so_and_writes_nothing(negative):
    said, text = answered("7", "--nonsense 3", "--length")
    assert said.exit_code != 0
    assert "Type a number from 1 to 4" in text
    assert "--nonsense' is no option of reading" in text
    assert "--length needs a value" in text
    assert "the input ended at a question" in str(said.exception)
    assert not (negative.parent / "study.toml").exists()


def test_an_axial_stretch_is_typed(here):
    rows = rows_of(fibres, held=(1.4,), at_rest=None)[:, [0, 1, 3]]
    written(here, rows, "Pressure (mmHg),Outer diameter (um),Axial force (mN)")
    sizes = ("--diameter", "3 mm", "--thickness", "0.25 mm")
    said, text = answered("1", "long", "1", "1.4", arguments=("artery.csv", *sizes))
    assert said.exit_code == 0, said.output
    assert "1 --axial-stretch: a number to type" in text
    assert "needs a number such as 1.5, not 'long'" in text
    assert set(fitted_data().stretch[:, 1]) == {1.4}


def test_answers_are_the_options_of_a_message():
    message = (
        "Leave zero (--zero) out. Give --zero '0 mm' or --column stress=NAME (or force=), --strain-type, or --loud 3."
    )
    texts = [answer.text for answer in answers_in(message, ["A b", "C"], {"zero": "first"})]
    columns = [f"--column {role}" for role in ("'stress=A b'", "stress=C", "'force=A b'", "force=C")]
    types = [f"--strain-type {name}" for name in ("engineering", "true", "green", "almansi", "angle")]
    assert texts == ["leave --zero out", "--zero '0 mm'", *columns, *types]
    assert [answer.text for answer in answers_in('(--width "5 mm" --thickness "2 mm")', [], {})] == [
        "--width --thickness"
    ]
    texts = [answer.text for answer in answers_in("Give --mode for another, or leave --length out.", [], {})]
    assert texts == [f"--mode {name}" for name in tq.loading_modes()]
    message = "to use the relaxed stress of each step give --relaxed; to leave the hold out, --leave-out 31:90."
    assert [answer.text for answer in answers_in(message, [], {})] == ["--relaxed", "--leave-out 31:90"]
    assert with_options({}, answers_in(message, [], {})[0]) == {"relaxed": True}
    (out,) = answers_in("Leave --length out.", [], {"dimensions": {"length": "2 mm"}})
    assert out.leaves_out == "length"
    with pytest.raises(InputError, match="cannot be understood"):
        options_in("--length '20")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are of Unix")
def test_questions_are_answered_in_a_terminal(negative):
    import pty
    import subprocess

    master, slave = pty.openpty()
    code = "from tissuq.cli import main; main()"
    arguments = ["inspect", "test.csv", "--ask", "--length", "20 mm", "--area", "10 mm2"]
    process = subprocess.Popen(
        [sys.executable, "-c", code, *arguments], stdin=slave, stdout=slave, stderr=slave, cwd=negative.parent
    )
    os.close(slave)
    shown, replies = "", ["--turn load\n", "\n"]
    while True:
        try:
            chunk = os.read(master, 4096).decode()
        except OSError:
            break
        if not chunk:
            break
        shown += chunk
        if replies and shown.rstrip(" ").endswith("]:"):
            os.write(master, replies.pop(0).encode())
            shown += " "
    os.close(master)
    assert process.wait() == 0, shown
    assert "Written: study.toml" in shown
    np.testing.assert_allclose(tq.read(negative, length="20 mm", area="10 mm2", turn="load").stress, STRESS, atol=1e-8)
    assert 'turn = "load"' in (negative.parent / "study.toml").read_text()


def test_columns_that_stand_beside_one_another_in_a_message_are_one_answer():
    text = "Say all of it: --column stretch=X --column stress=Y --stress-unit kPa, or --column stress=NAME (or force=)."
    found = [answer.text for answer in answers_in(text, ["A"], {})]
    together = "--column stretch=X --column stress=Y --stress-unit kPa"
    assert found == [together, "--column stress=A", "--column force=A"]
