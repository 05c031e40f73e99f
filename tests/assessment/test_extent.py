"""To what extent a model is wrong: each number against what it must be where that is known."""

from __future__ import annotations

import numpy as np
import pytest

import gallery
import tissuq as tq
from tissuq.assessment import measurement_warnings
from tissuq.assessment.extent import assess
from tissuq.errors import ConvergenceError

STRETCH = np.array([0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 1.05, 1.1, 1.2, 1.3, 1.5, 1.7, 2.0, 2.4])
TRUTH = {"C10": 1.0, "C20": 0.2, "C30": 0.0}


@pytest.fixture(scope="module")
def data():
    return tq.simulate("yeoh", TRUTH, STRETCH, noise_sd=0.02, seed=1)


def unit(name):
    return tq.simulate(name, dict.fromkeys(TRUTH if name == "yeoh" else ("C10", "C01"), 0.0) | {"C10": 1.0}, STRETCH)


@pytest.mark.slow
def test_the_share_of_the_stress_is_that_of_the_terms_that_the_material_lacks(data):
    exact = tq.simulate("yeoh", TRUTH, STRETCH).stress
    lacking = exact - unit("yeoh").stress
    share = np.sqrt((lacking**2).mean() / (exact**2).mean())
    for discrepancy in ("yeoh", "auto"):
        mean, low, high = gallery.fit(data, discrepancy=discrepancy, noise_sd=0.02).assess().share
        assert low < share < high
        assert mean == pytest.approx(share, abs=0.1)


def test_an_energy_has_no_initial_stiffness_and_the_mooney_rivlin_term_has_what_it_has(data):
    assert np.abs(gallery.fit(data, discrepancy="auto", noise_sd=0.02).assess().initial_share).max() < 1e-5
    other = tq.simulate("mooney-rivlin", {"C10": 0.7, "C01": 0.3}, STRETCH, noise_sd=0.02, seed=2)
    mean, low, high = tq.fit(other, discrepancy="mooney-rivlin", noise_sd=0.02).assess().initial_share
    assert low < 0.3 < high
    assert mean == pytest.approx(0.3, abs=0.05)


def test_the_probability_of_none_and_the_width_are_those_of_a_fit_without(data):
    posterior = gallery.fit(data, discrepancy="taylor", noise_sd=0.02)
    without = gallery.fit(data, discrepancy="none", noise_sd=0.02, priors={"C10": posterior.model.priors["C10"]})
    found = posterior.assess()
    odds = np.exp(without.log_evidence - posterior.log_evidence)
    assert found.probability_of_none == pytest.approx(odds / (1 + odds))
    ratio = posterior.summary().loc["C10", "sd"] / without.summary().loc["C10", "sd"]
    assert found.width_against_none == pytest.approx(ratio)


def test_laws_with_many_exponents_are_compared_with_no_discrepancy(data):
    found = gallery.fit(data, material="ogden-3", discrepancy="taylor", noise_sd=0.02).assess()
    assert 0 <= found.probability_of_none < 1
    assert found.width_against_none > 0


def test_where_the_material_is_right_none_becomes_probable_and_nothing_is_carried():
    right = tq.simulate("neo-hookean", {"C10": 1.0}, STRETCH, noise_sd=0.1, seed=3)
    found = tq.fit(right, discrepancy="auto", noise_sd=0.1).assess()
    assert found.probability_of_none > 0.5
    assert found.share[1] < 0.05


def test_the_shift_is_that_of_a_fit_with_the_other_scale(data):
    posterior = gallery.fit(data, discrepancy="taylor", noise_sd=0.02)
    wider = {"c1": posterior.model.priors["c1"].scaled(4.0)}
    other = gallery.fit(data, discrepancy="taylor", noise_sd=0.02, priors=wider)
    means = [each.summary().loc["C10", "mean"] for each in (posterior, other)]
    shift = (means[1] - means[0]) / posterior.summary().loc["C10", "sd"]
    assert posterior.assess().shifts[4.0] == pytest.approx(shift, abs=1e-6)


def test_scales_that_the_method_does_not_solve_are_left_out(data):
    posterior = gallery.fit(data, discrepancy="taylor", tolerances="specimen")  # at the level of its unknown noise

    def without_end(models):
        raise ConvergenceError("few points are effective")

    found = assess(posterior.solution, posterior.solver.solve, without_end, posterior.stable_ranges)
    assert found.shifts == {}
    assert found.share == posterior.assess().share


def test_members_and_what_is_between_them(data):
    found = gallery.fit(data, discrepancy="auto", noise_sd=0.02).assess()
    assert sum(found.members.values()) == pytest.approx(1)
    assert 0 <= found.between < 1
    assert gallery.fit(data, discrepancy="gp", noise_sd=0.02).assess().between == 0


@pytest.mark.parametrize("discrepancy", ["none", "constant", "gp", "yeoh", "auto"])
def test_sentences_say_no_more_than_there_is(data, discrepancy):
    found = gallery.fit(data, discrepancy=discrepancy, noise_sd=0.02).assess()
    text = " ".join(found.sentences)
    assert ("weights" in text) == (discrepancy == "auto")
    assert ("no reason to drop" in text) == (discrepancy != "none")
    assert all(sentence[0].isupper() and sentence.endswith(".") for sentence in found.sentences)


@pytest.mark.parametrize(
    ("stretch", "words"),
    [
        (np.linspace(1.05, 2, 20), ["tension only"]),
        (np.linspace(0.5, 0.98, 20), ["compression only"]),
        (
            np.concatenate([np.linspace(0.5, 0.7, 10), np.linspace(1.5, 2, 10)]),
            ["nothing is measured between stretch 1 and 0.7"],
        ),
        (np.linspace(0.7, 1.4, 7), ["7 measurements"]),
        (np.linspace(0.7, 1.4, 30), []),
    ],
)
def test_the_design_is_judged(stretch, words):
    stretch = stretch[np.abs(stretch - 1) > 1e-9]
    data = tq.simulate("neo-hookean", {"C10": 1.0}, stretch)
    found = list(measurement_warnings(data))
    assert len(found) == len(words)
    assert all(word in text and "measure" in text for word, text in zip(words, found, strict=True))


def test_the_design_of_a_shear_test_is_judged_by_its_amounts_of_shear():
    near, far = (
        tq.simulate("neo-hookean", {"C10": 1.0}, np.linspace(*ends, 20), mode="simple-shear")
        for ends in ((0.02, 0.4), (0.2, 0.4))
    )
    assert list(measurement_warnings(near)) == []
    (found,) = measurement_warnings(far)
    assert "between amount of shear 0 and 0.2" in found
    assert "of amount of shear 0, beside it." in found


def test_a_parameter_that_is_not_linear_is_assessed_too(data):
    posterior = gallery.fit(data, discrepancy="yeoh", noise_sd=0.02, priors={"C10": tq.LogNormal(1.0, 1.0)})
    assert posterior.assess().between == 0


@pytest.mark.slow
def test_a_sampler_that_has_nothing_to_sample_without_discrepancy_gives_no_comparison(data):
    found = gallery.fit(data, discrepancy="constant", noise_sd=0.02, method="smc").assess()
    assert found.probability_of_none is None
    assert found.width_against_none is None


@pytest.mark.slow
def test_a_parameter_that_no_closed_form_integrates_is_assessed_too(data):
    found = gallery.fit(data, discrepancy="taylor", noise_sd=0.05, priors={"C10": tq.LogNormal(0.5, 0.5)}).assess()
    assert 0 <= found.between <= 1
    assert found.modulus_symbols == ("C10",)
