"""The result of a fit of one material: its answer, comparison and files."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import tissuq as tq
from tissuq.report import specimen
from tissuq.report.measured import methods_section
from tissuq.report.result import Table
from tissuq.report.specimen import _of_what, specimen_answer, specimen_result
from tissuq.report.writer import read_record, write_result


@pytest.fixture(scope="module")
def result(specimen_study):
    return specimen_result(specimen_study)


def test_the_numbers_are_those_of_the_answer_in_the_unit_of_the_file(result, specimen_study):
    marginal = specimen_study.posteriors["auto"].initial_shear_modulus
    modulus, headline, over_discrepancies = result.numbers
    low, high = marginal.hdi()
    assert (modulus.name, headline.name) == ("initial shear modulus", "C10")
    assert [modulus.value, modulus.low, modulus.high] == pytest.approx([1e3 * x for x in (marginal.mean, low, high)])
    assert {modulus.unit, headline.unit} == {"kPa"}
    means = {name: 1e3 * posterior.marginals["C10"].mean for name, posterior in specimen_study.posteriors.items()}
    low, high = (float(end) for end in over_discrepancies.value.removesuffix(" kPa").split(" to "))
    assert (low, high) == pytest.approx((min(means.values()), max(means.values())), rel=0.02)
    low, high = (1e3 * end for end in specimen_study.posteriors["auto"].marginals["C10"].hdi())
    outside = [name for name, mean in means.items() if not low <= mean <= high]
    assert outside == []
    assert over_discrepancies.remark == ""
    assert specimen_study.posteriors["auto"].model.meaning in result.finding


def test_what_is_said_before_anything_is_assessed_is_the_head_of_the_result(result, specimen_study):
    head, whole = specimen_answer(specimen_study).record(), result.record()
    assert head == whole | {"tables": [], "sections": []}


def test_several_discrepancies_stand_in_one_table_that_marks_the_one_that_answers(result, specimen_study):
    (table,) = result.tables
    assert [row[0] for row in table.rows] == list(specimen_study.posteriors)
    assert table.main == "auto"
    assert table.picture.name == "marginals"
    means = [1e3 * posterior.marginals["C10"].mean for posterior in specimen_study.posteriors.values()]
    assert [float(row[1]) for row in table.rows] == pytest.approx(means, rel=0.02)
    assert "The answer above is that of 'auto'." in table.note


def test_every_title_of_the_terminal_is_a_section_of_the_page(result, tmp_path):
    write_result(result, tmp_path, figures=False)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    titles = [section["title"] for section in read_record(tmp_path)["sections"]]
    assert titles == [
        "To what extent the material is wrong", "Predictive checks", "Where it is stable", "Every parameter",
        "How it was computed", "The data and what intervals include", "Text for the methods section of a paper",
    ]  # fmt: skip
    assert all(f"<h2>{title}</h2>" in page for title in titles)


def test_the_text_for_a_paper_has_model_data_errors_priors_and_result(result, specimen_study):
    (text,) = next(section.blocks for section in result.sections if section.title.startswith("Text for the methods"))
    posterior, modulus = specimen_study.posteriors["auto"], result.numbers[0]
    assert f"W = C10 (I1 - 3) (Treloar 1943), was fitted by Bayesian inference with tissuq {tq.__version__}" in text
    assert f"{len(specimen_study.experiment)} measurements" in text
    assert specimen_study.experiment.source
    assert f"{specimen_study.experiment.source}. The measured stress was taken as" in text
    assert "a further free energy of the invariants without initial stiffness" in text
    assert posterior.model.meaning in text
    assert "Errors of whole tests" not in text
    assert "Priors: C10 uniform(0, " in text
    assert " kPa, c1 half-cauchy(" in text
    assert posterior.how in text
    stated = re.search(r"initial shear modulus ([\d.]+) \(([\d.]+) to ([\d.]+)\) kPa", text)
    assert [float(x) for x in stated.groups()] == pytest.approx([modulus.value, modulus.low, modulus.high], rel=0.02)


@pytest.mark.parametrize(
    ("discrepancy", "words"),
    [
        ("none", "the sum of the material's stress and noise"),
        ("linear", "m0 + m1 l + S e ('linear' of tissuq; Zera"),
        ("auto", "Errors of whole tests were included with these standard deviations: 0.05 of the stress"),
    ],
)
def test_the_text_for_a_paper_says_which_discrepancy_there_was(specimen_study, discrepancy, words):
    study = replace(
        specimen_study, posteriors={discrepancy: tq.fit(specimen_study.experiment, discrepancy=discrepancy)}
    )
    assert words in methods_section(study).blocks[0]


def test_the_parameters_for_people_are_those_for_programs(result, specimen_study):
    section = next(section for section in result.sections if section.title == "Every parameter")
    table = next(block for block in section.blocks if isinstance(block, Table))
    assert len(table.rows) == sum(len(posterior.model.parameters) for posterior in specimen_study.posteriors.values())
    row = next(row for row in table.rows if row[:2] == ["yeoh", "C10"])
    marginal = specimen_study.posteriors["yeoh"].marginals["C10"]
    assert row[2] == "kPa"
    assert float(row[5]) == pytest.approx(1e3 * marginal.mean, rel=0.02)


def test_nothing_is_drawn_and_no_band_computed_where_no_figures_are_wanted(specimen_study, tmp_path, monkeypatch):
    monkeypatch.setattr("tissuq.report.specimen.described_curves", lambda _: pytest.fail("a band was computed"))
    write_result(specimen_result(specimen_study), tmp_path, figures=False)
    assert "chart-data" not in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert json.loads((tmp_path / "assessment.json").read_text())[0]["formulation"] == "constant"


def test_intervals_that_are_not_of_the_same_are_said_to_be_so():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, np.linspace(0.8, 1.3, 15), noise_sd=0.002, seed=3)
    fits = {name: tq.fit(data, discrepancy=name) for name in ("none", "constant")}
    words = _of_what(SimpleNamespace(posteriors=fits))
    assert "those of none are of this specimen, errors of the test included" in words
    assert "those of constant are of this specimen as tested" in words
    assert _of_what(SimpleNamespace(posteriors={"none": fits["none"]})) == ""


def test_discrepancies_beyond_the_interval_of_the_answer_are_named_with_what_they_change(specimen_study, monkeypatch):
    modulus = specimen_study.posteriors["auto"].marginals["C10"]
    low, high = modulus.hdi()
    means = {"auto": modulus.mean, "near": 0.9 * high + 0.1 * low, "above": 1.1 * high, "below": 0.9 * low}
    monkeypatch.setattr(specimen, "shares_of_discrepancy", lambda solution: (None, (solution, 0.0, 0.0)))
    for changes, reason in ((-0.2, " (they change the initial stiffness)"), (0.01, "")):
        fits = {name: SimpleNamespace(marginals={"C10": SimpleNamespace(mean=mean, hdi=modulus.hdi)}, solution=share,
                                      warnings=())
                for (name, mean), share in zip(means.items(), (0.0, 0.0, 0.3, changes), strict=True)}  # fmt: skip
        study = SimpleNamespace(posteriors=fits, main="auto", headline="C10", unit=specimen_study.unit)
        (number,) = specimen._over_discrepancies(study)
        assert number.remark == f"the answer is that of auto; beyond its interval: above, below{reason}"
