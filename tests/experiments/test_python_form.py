"""Messages of functions that read propose what a person in Python can type, and no options of the shell."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
import pytest

import tissuq as tq
from tissuq.experiments.reading.findings import data_warnings
from tissuq.experiments.reading.options import spelled_out
from tissuq.experiments.reading.python_form import SWITCHES, in_python
from tissuq.result_warning import ResultWarning
from tissuq.studies.answers import READING

STRETCH = np.linspace(1, 1.3, 20)
STRESS = 20 * (STRETCH - STRETCH**-2)
VALUES = {"column": "stress=NAME", "only": "'Specimen=S 1'", "stretch": "1:1.2", "axial-stretch": "1.5", "mean-of": "6"}
REFUSED = {
    "columns without names": ({"a": STRETCH, "b": STRESS}, {}, 'stress="NAME"'),
    "forces": ({"stretch": STRETCH, "Force [N]": STRESS}, {}, 'area="10 mm2"'),
    "displacements": ({"u [mm]": STRETCH - 1, "Force [N]": STRESS}, {"area": "6 mm2"}, 'length="20 mm"'),
    "percent": ({"strain": 100 * (STRETCH - 1), "stress [kPa]": STRESS}, {}, 'strain_unit="%"'),
    "signs": ({"strain": 1 - STRETCH, "stress [kPa]": STRESS}, {}, "compression_positive=True"),
    "a modulus": ({"stretch": STRETCH, "Young's modulus [kPa]": STRESS}, {}, 'stress="Young\'s modulus [kPa]"'),
    "a tube": ({"pressure [kPa]": STRESS, "diameter [mm]": STRETCH}, {}, 'mode="planar", diameter="3 mm"'),
    "two tests": (
        {"specimen": ["a"] * 10 + ["b"] * 10, "stretch": STRETCH, "stress [kPa]": STRESS}, {},
        'only={"specimen": "a"}',
    ),
}  # fmt: skip


@pytest.mark.parametrize("read", [tq.read, tq.inspect, tq.read_tests, tq.fit])
@pytest.mark.parametrize("is_file", [True, False])
@pytest.mark.parametrize("name", REFUSED)
def test_a_refusal_proposes_arguments(name, is_file, read, tmp_path):
    table, options, proposed = REFUSED[name]
    data = pd.DataFrame(table)
    if is_file:
        data.to_csv(tmp_path / "data.csv", index=False)
        data = tmp_path / "data.csv"
    if name == "two tests" and read in (tq.read_tests, tq.fit):
        return  # these read both
    with pytest.raises(tq.InputError) as refusal:
        read(data, **options)
    assert proposed in str(refusal.value)
    assert "--" not in str(refusal.value)


def test_an_inspection_proposes_arguments(tmp_path):
    pd.DataFrame({"stretch": STRETCH, "stress": STRESS}).to_csv(tmp_path / "data.csv", index=False)
    assert 'stress_unit="kPa"' in str(tq.inspect(tmp_path / "data.csv"))
    assert "--" not in str(tq.inspect(tmp_path / "data.csv"))


@pytest.mark.parametrize("option", READING)
def test_every_option_of_reading_is_an_argument_of_python(option):
    value = "" if option in SWITCHES else VALUES.get(option, "3")
    arguments = eval(f"dict({in_python(f'--{option} {value}'.strip())})")
    assert spelled_out(arguments)


def test_lines_to_leave_out_stay_together():
    text = in_python("to leave them out give --leave-out 11:71,81:141, or --cycle 2.")
    assert text == 'to leave them out give leave_out="11:71,81:141", or cycle=2.'


def test_a_tolerance_is_proposed_with_its_unit_and_is_taken_so():
    text = in_python("give --tolerance zero=0.74, or --tolerance resolution=0.002.", "kPa")
    assert text == 'give tolerances={"zero": "0.74 kPa"}, or tolerances={"resolution": 0.002}.'
    assert tq.Tolerances(zero="0.74 kPa").sizes == {"zero": pytest.approx(0.74e-3)}
    with pytest.raises(tq.InputError, match="is not a unit of stress"):
        tq.Tolerances(zero="0.74 mm")
    with pytest.raises(tq.InputError, match="has no unit"):
        tq.Tolerances(zero="0.74")


def there_and_back(drift):
    course = np.r_[STRETCH, STRETCH[::-1]]
    stress = 20 * (course - course**-2)
    return {"stretch": course, "stress [kPa]": stress + drift * np.linspace(0, stress.max(), len(course))}


@pytest.mark.parametrize("read", [tq.read, tq.read_tests, lambda data: tq.fit(data, discrepancy="none", noise_sd=1.0)])
@pytest.mark.parametrize("is_file", [True, False])
def test_python_warns_of_a_drift_when_it_reads(tmp_path, read, is_file):
    data = pd.DataFrame(there_and_back(0.3))
    if is_file:
        data.to_csv(file := tmp_path / "test.csv", index=False)
    with pytest.warns(UserWarning, match='the zero of the load cell drifts.* give branch="loading"'):
        read(str(file) if is_file else data)


@pytest.mark.parametrize(("drift", "code"), [(0.1, "measurements"), (0.2, "large-drift")])
def test_a_drift_that_takes_the_modulus_out_of_its_interval_has_a_code_of_its_own(drift, code):
    (warning, *_) = data_warnings(tq.inspect(pd.DataFrame(there_and_back(drift))).reading)
    assert "the zero of the load cell drifts" in warning
    assert warning.code == code


@pytest.mark.filterwarnings("ignore:the stress is:UserWarning")
def test_what_a_fit_can_be_used_for_does_not_forget_the_file(tmp_path):
    pd.DataFrame(there_and_back(0.3)).to_csv(tmp_path / "drift.csv", index=False)
    posterior = tq.fit(tmp_path / "drift.csv", discrepancy="none", noise_sd="1 kPa")
    posterior.save(tmp_path / "drift.nc")
    for kept in (posterior, tq.load(tmp_path / "drift.nc")):
        (warning,) = (text for text in kept.model.experiment.warnings if text.code == "large-drift")
        assert 'give branch="loading"' in warning
        assert "give --branch loading" in warning.shell
        assert kept.answer.uses[0].verdict == "no"
        assert "the load drifts" in kept.answer.uses[0].reason


@pytest.mark.filterwarnings("ignore:the stress is:UserWarning")
def test_several_tests_say_once_what_was_seen_in_all_and_by_name_what_was_in_one():
    tests = [tq.read(there_and_back(0.0), name="first"), tq.read(there_and_back(0.05), name="second")]
    both, one = ResultWarning("seen in both."), ResultWarning("seen in one.")
    tests = [tests[0].labelled(warnings=(both, one)), tests[1].labelled(warnings=(both,))]
    assert list(tq.Experiment.of(tests).warnings) == ["all tests: seen in both.", "first: seen in one."]


def test_python_does_not_warn_of_a_plain_test_or_of_notes():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tq.read({"stretch": STRETCH[5:], "stress [kPa]": STRESS[5:]})
        tq.read(pd.DataFrame(there_and_back(0.0)), branch="loading")


def test_warnings_and_notes_in_python_propose_arguments():
    turned = np.r_[STRETCH, STRETCH[::-1], STRETCH]
    with pytest.warns(UserWarning, match='stress_unit="kPa", or stress_unit="MPa"'):
        tq.read({"stretch": STRETCH, "stress": STRESS})
    seen = tq.inspect(pd.DataFrame({"stretch": turned, "stress [kPa]": 20 * (turned - turned**-2)}))
    assert 'cycle="last"' in str(seen)
    assert not any("--" in text for text in (str(seen), *seen.warnings))


def test_commands_and_sentences_stay_as_they_are():
    text = (
        "tissuq population FILE --specimen-column 'Protocol' fits each; 1--2 is none. Give --zero, or --branch loading."
    )
    assert in_python(text) == text.replace("--zero", "zero").replace("--branch loading", 'branch="loading"')


@pytest.mark.parametrize(
    ("call", "given", "words"),
    [
        (tq.load, None, "a run folder .* is needed, not None"),
        (tq.predict_run, 3, "a run folder .* is needed, not 3"),
        (tq.Posterior.load, None, "the file of a posterior .* is needed, not None"),
        (tq.load_material, None, "'None' does not name a law in a file: write path.py:Name"),
        (tq.fit_many, 3, "a list of data sets is needed, .* not int"),
        (tq.fit_many, "tests.csv", "a list of data sets is needed, .* not str"),
        (tq.held_out_tests, 3, "measurements are needed: .* Not 3"),
    ],
)
def test_what_is_no_file_folder_or_list_is_refused_in_a_sentence(call, given, words):
    with pytest.raises(tq.InputError, match=words):
        call(given)
