"""Simulation-based calibration as a study: its tests have the size they say, and see a planted fault."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.special import ndtr, ndtri
from scipy.stats import binomtest, kstest

from tissuq.inference.marginal import Marginal
from tissuq.mechanics import engineering_stress
from tissuq.model.discrepancy import discrepancies
from tissuq.model.prior_draws import draw_from_prior
from tissuq.studies.stream import RESULTS, open_pool
from tissuq.validation.sbc import (
    SbcSettings,
    carry_out,
    ecdf_band,
    probability_below,
    run_sbc,
    shape_p_value,
    spread_p_value,
    summarise_ranks,
    tasks_of,
)

SIZE = 1e-4


def settings_of(**changes):
    return SbcSettings.model_validate({"formulations": ["constant"], "noise": "known", "replicates": 20} | changes)


@pytest.mark.slow
@pytest.mark.parametrize("test", [shape_p_value, spread_p_value])
def test_the_tests_have_the_size_that_they_say(test):
    generator, repeats = np.random.default_rng(0), 1500
    rejected = sum(test(generator.uniform(size=60)) <= 0.05 for _ in range(repeats))
    assert binomtest(rejected, repeats, 0.05).pvalue > SIZE


def test_the_band_holds_uniform_values_as_a_whole_as_often_as_it_says():
    generator = np.random.default_rng(1)
    places, low, high = ecdf_band(80, 0.9)
    shares = (generator.uniform(size=(2000, 80, 1)) <= places).mean(axis=1)
    held = ((low <= shares) & (shares <= high)).all(axis=1).sum()
    assert 0.9 - 4 * np.sqrt(0.09 / 2000) < held / 2000 < 0.93  # counts are whole: it may hold a little more


@pytest.mark.parametrize("factor", [0.7, 1.5])
def test_posteriors_too_narrow_and_too_wide_are_seen(factor):
    scores = ndtri(np.random.default_rng(2).uniform(size=300)) / factor
    assert spread_p_value(ndtr(scores)) < SIZE
    assert shape_p_value(ndtr(scores)) < 0.01


def test_shifted_posteriors_are_seen():
    assert shape_p_value(ndtr(np.random.default_rng(3).standard_normal(300) + 0.4)) <= SIZE


def test_the_rank_of_zero_is_drawn_within_its_probability_and_negative_values_have_theirs():
    atom = Marginal(1.0, 1.0, np.array([0.1, 1.0]), np.ones(2), np.array([0.3, 1.0]))
    assert probability_below(atom, 0.0, 0.5) == pytest.approx(0.15)
    assert probability_below(atom, 0.05, 0.5) == pytest.approx(0.3)
    plain = Marginal(0.0, 1.0, np.array([-1.0, 1.0]), np.ones(2), np.array([0.0, 1.0]))
    assert probability_below(plain, -0.5, 0.5) == pytest.approx(0.25)


@pytest.mark.parametrize("formulation", ["constant", "gp", "auto-sharp"])
def test_parameters_are_drawn_from_their_priors_and_data_from_the_model(formulation):
    model = settings_of(formulations=[formulation]).model(formulation, "known")
    drawn = [draw_from_prior(model, np.random.default_rng(seed)) for seed in range(400)]
    for symbol, prior in model.priors.items():
        values = np.array([each[symbol] for each, _ in drawn])
        values = values[values != 0]  # no block with this amplitude
        grid = prior.quantile(np.linspace(0.001, 0.999, 999))
        assert kstest(np.searchsorted(grid, values) / 1000 + 0.0005, "uniform").pvalue > SIZE
    if formulation == "auto-sharp":
        # 4 sums of two blocks, 2 single ones of each kind, and none: 3 of 9 sums have no second block.
        share = sum(each["c2"] == 0 for each, _ in drawn)
        assert binomtest(share, 400, 3 / 9).pvalue > SIZE
    else:
        # Given C10 and a mean, what is left has the variance of noise and discrepancy: chi-squared sums over points.
        left = []
        for values, stress in drawn:
            mean = model.design @ [values[symbol] for symbol in model.column_symbols]
            variance = 0.2**2 + values.get("S", values.get("c", 0.0)) ** 2
            left.append(np.mean((stress - mean) ** 2) / variance)
        assert np.mean(left) == pytest.approx(1.0, abs=4.5 * np.std(left) / 20)


@pytest.mark.statistical
def test_quick_formulations_are_calibrated(tmp_path):
    settings = settings_of(formulations=["constant", "yeoh", "taylor"], replicates=150, seed=4)
    table = summarise_ranks(settings, run_sbc(settings, tmp_path))
    assert table["calibrated"].all()  # fails with a chance of 5 % over seeds; this one is fixed
    assert not table["failed"].any()


def test_noise_told_to_be_less_than_it_is_is_caught(monkeypatch):
    settings = settings_of(formulations=["none", "zero-modulus"], replicates=100)
    true = settings.model_copy(update={"design": settings.design.model_copy(update={"noise_sd": 0.3})})
    told = SbcSettings.model
    monkeypatch.setattr(SbcSettings, "model", lambda self, *names: told(true, *names))  # data are drawn from this one
    table = summarise_ranks(settings, [carry_out(settings, task) for task in tasks_of(settings)])
    of_c10 = table[table["parameter"] == "C10"]
    assert not of_c10["calibrated"].any()
    assert of_c10["spread"].min() > 1.2


@pytest.mark.slow
def test_results_do_not_depend_on_workers_and_are_streamed(tmp_path):
    settings = settings_of(formulations=["none", "zero-modulus"], replicates=60)
    contents = []
    for workers in (1, 2):
        folder = tmp_path / str(workers)
        folder.mkdir()
        with open_pool(workers) as pool:
            run_sbc(settings, folder, pool=pool)
        contents.append((folder / RESULTS).read_bytes())
    assert contents[0] == contents[1]
    (folder / RESULTS).write_bytes(contents[0][: len(contents[0]) // 2])  # as a kill leaves it
    run_sbc(settings, folder)
    assert (folder / RESULTS).read_bytes() == contents[0]


def test_every_formulation_is_in_the_preset():
    assert set(discrepancies()) == set(SbcSettings().formulations)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"formulations": ["cubic"]}, "no discrepancy named 'cubic'"),
        ({"formulations": ["none", "none"]}, "given twice"),
        ({"priors": {"C10": {"distribution": "flat"}}}, "proper priors of C10"),
        ({"priors": {"c1": {"distribution": "uniform", "low": 0, "high": 1}}, "formulations": ["auto"]}, "has a bound"),
        ({"design": {"low": 0.7, "high": 2.0, "points": 3, "noise_sd": 0.1}, "formulations": ["yeoh"]}, "3 measure"),
        ({"priors": {"D1": {"distribution": "normal", "mean": 0, "sd": 1}}}, "no parameter 'D1'; .*C10"),
        ({"replicates": 3}, "greater than or equal to 20"),
        ({"seeds": 1}, "Extra inputs"),
    ],
)
def test_wrong_settings_are_refused(wrong, words):
    with pytest.raises(ValidationError, match=words):
        settings_of(**wrong)


def test_a_material_with_exponents_is_drawn_and_fitted_with_its_default_priors():
    settings = SbcSettings(material="demiray", formulations=("none",), noise=("known",), replicates=20, seed=2)
    model = settings.model("none", "known")
    assert model.symbols == ("mu", "b")
    assert model.priors["mu"].support == (0.5, 1.5)
    generator = np.random.default_rng(1)
    values, stress = draw_from_prior(model, generator)
    exact = engineering_stress(model.material, model.experiment.mode, model.experiment.stretch, list(values.values()))
    assert np.abs(stress - exact).max() < 5 * settings.design.noise_sd
    (task,) = tasks_of(settings)
    below = carry_out(settings, task)["below"]
    assert set(below) == {"mu", "b"}
    assert all(value is not None and 0 <= value <= 1 for each in below.values() for value in each)
