"""Warnings say in which form they are typed, and every code is explained."""

from __future__ import annotations

import pickle
import re
from pathlib import Path

import pytest

from tissuq.result_warning import (
    WARNING_CODES,
    ResultWarning,
    Severity,
    has_code,
    in_shell,
    merged,
    most_severe_first,
    symbols_in,
)

PAGE = Path(__file__).parents[1] / "docs" / "warnings.md"


def test_an_option_is_named_as_python_and_as_the_shell_type_it():
    warning = ResultWarning("restrict the fit ({stable_in}).", "unstable", stable_in="all")
    assert warning == 'restrict the fit (stable_in="all").'
    assert warning.shell == in_shell(warning) == "restrict the fit (--stable-in all)."
    assert in_shell("plain {text}") == "plain {text}"


def test_braces_without_options_stay_as_they_are():
    assert ResultWarning("column '{x}'").shell == "column '{x}'"


def test_a_code_is_found_among_warnings_and_never_in_a_plain_sentence():
    warnings = ["slack", ResultWarning("rows are slack.", "slack")]
    assert has_code(warnings, "slack")
    assert not has_code(warnings, "unstable")
    assert not has_code(warnings[:1], "slack")


def test_names_stand_before_both_forms():
    warning = ResultWarning("fit with {noise}.", "correlated-residuals", Severity.NOTE, noise="repeats").of(["a", "b"])
    assert (str(warning), warning.shell) == ('a, b: fit with noise="repeats".', "a, b: fit with --noise repeats.")
    assert (warning.code, warning.severity) == ("correlated-residuals", Severity.NOTE)


def test_a_copy_through_pickle_keeps_what_it_says():
    warning = ResultWarning("fit with {noise}.", "correlated-residuals", Severity.NOTE, noise="repeats")
    copy = pickle.loads(pickle.dumps(warning))
    assert (copy, copy.code, copy.severity, copy.shell) == (warning, warning.code, warning.severity, warning.shell)


def test_what_may_change_the_result_most_comes_first_within_a_severity():
    slack, apart = ResultWarning("slack.", "slack"), ResultWarning("apart.", "tests-apart")
    problem = ResultWarning("unit?", "doubtful-reading", Severity.PROBLEM)
    assert most_severe_first([slack, apart.as_note(), apart, problem]) == ["unit?", "apart.", "slack.", "apart."]


def test_problems_come_first_and_the_order_stays_within_a_code():
    texts = [ResultWarning(name, severity=severity) for name, severity in
             (("a", Severity.NOTE), ("b", Severity.CAUTION), ("c", Severity.PROBLEM))]  # fmt: skip
    assert most_severe_first([*texts, "d"]) == ["c", "b", "d", "a"]


def test_of_several_results_a_warning_stands_once_with_their_names():
    first, second = (ResultWarning(f"lag {lag}: {{noise}}.", "correlated-residuals", noise="repeats") for lag in (1, 2))
    other = ResultWarning("few.", "few-measurements")
    merged_texts = merged({"a": [first, other], "b": [], "c": [second]})
    assert merged_texts == ['a, c: lag 1: noise="repeats". (The numbers are those of the first.)', "a: few."]
    assert merged_texts[0].shell.startswith("a, c: lag 1: --noise repeats. (")
    assert merged({"a": [other], "b": [other]}, everyone="all tests") == ["all tests: few."]
    cut = [ResultWarning(f"cut by a bound of {symbol}.", "prior-bound") for symbol in ("C01", "C20")]
    assert merged({"a": [cut[0]], "b": [cut[1]]}) == ["a: cut by a bound of C01.", "b: cut by a bound of C20."]
    assert merged({"a": [first, other]}) == [first, other]
    assert merged({"a": [other]}, named=True) == ["a: few."]


def test_a_warning_keeps_the_parameters_that_it_is_about():
    one, other = (ResultWarning(f"cut: {s}.", "prior-bound", symbols=s.split()) for s in ("C10 C20", "C20"))
    warnings = [one.of(["a"]), other.as_note(), ResultWarning("few.", "few-measurements", symbols=["C30"])]
    assert symbols_in(warnings, "prior-bound") == ("C10", "C20")
    assert symbols_in(warnings, "slack") == ()


def test_a_note_says_what_the_warning_said():
    warning = ResultWarning("fit with {noise}.", "correlated-residuals", noise="repeats")
    note = warning.as_note()
    assert (note, note.shell, note.code, note.severity) == (warning, warning.shell, warning.code, Severity.NOTE)


def test_a_code_that_is_not_explained_is_refused():
    with pytest.raises(ValueError, match="no-such-code"):
        ResultWarning("text", "no-such-code")


def test_the_page_explains_every_code_in_the_words_of_the_table():
    rows = re.findall(r"^\| `([a-z-]+)` \| ([^|]+) \|", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert dict(rows) == dict(WARNING_CODES)
    assert [code for code, _ in rows] == sorted(WARNING_CODES)


def test_every_code_is_used_by_the_package():
    source = "".join(path.read_text(encoding="utf-8") for path in (PAGE.parents[1] / "src").rglob("*.py"))
    for code in WARNING_CODES:
        assert source.count(f'"{code}"') >= 2, code


def test_numbers_and_flags_are_options_as_they_are_typed():
    warning = ResultWarning("give {every} or {until_peak}.", "correlated-residuals", every=3, until_peak=True)
    assert str(warning) == "give every=3 or until_peak=True."
    assert warning.shell == "give --every 3 or --until-peak."
