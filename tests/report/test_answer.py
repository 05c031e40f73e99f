"""What stands at the head of a run: numbers in the user's unit, problems always, three warnings, no notes."""

from dataclasses import replace

from tissuq.assessment.answer import Answer, Estimate, Step, Use, Verdict
from tissuq.experiments.units import stress_unit
from tissuq.report.answer import answer_record, readable_estimates, shown_and_folded
from tissuq.result_warning import ResultWarning, Severity

ANSWER = Answer(
    (Estimate("initial shear modulus", 0.00146, 0.00123, 0.00169), Estimate("C10", 0.00073, 0.000617, 0.000844)),
    "this specimen",
    (Use("report the modulus", Verdict.YES, "known to ± 15 %"),),
    Step("tissuq design {run}", "posterior.design()"),
)


def record(*severities):
    warnings = [ResultWarning(str(number), severity=severity) for number, severity in enumerate(severities)]
    return answer_record("brain", "auto", ANSWER, stress_unit("kPa"), warnings)


def test_numbers_are_in_the_unit_and_rounded_by_their_interval():
    assert readable_estimates(record()) == [
        {"name": "initial shear modulus", "value": "1.46 kPa", "interval": "1.23 to 1.69"},
        {"name": "C10", "value": "0.730 kPa", "interval": "0.617 to 0.844"},
    ]
    assert record()["next"] == "tissuq design {run}"


def test_three_warnings_are_shown_and_notes_folded():
    shown, folded = shown_and_folded(record(*[Severity.CAUTION] * 4, Severity.NOTE))
    assert [warning["text"] for warning in shown] == ["0", "1", "2"]
    assert [warning["text"] for warning in folded] == ["3", "4"]
    assert shown_and_folded(record(Severity.NOTE))[0] == []


def test_a_note_is_shown_where_the_modulus_cannot_be_reported():
    vague = record(Severity.NOTE)
    vague["uses"][0]["verdict"] = "with care"
    shown, folded = shown_and_folded(vague)
    assert (len(shown), folded) == (1, [])


def test_an_answer_prints_itself_in_its_unit():
    lines = str(replace(ANSWER, unit="kPa")).splitlines()
    assert lines[0] == "initial shear modulus 1.46 kPa, 95 % interval 1.23 to 1.69"
    assert lines[-1] == "Next: posterior.design()"


def test_every_problem_is_shown():
    shown, folded = shown_and_folded(record(*[Severity.PROBLEM] * 5, Severity.CAUTION))
    assert len(shown) == 5
    assert len(folded) == 1
