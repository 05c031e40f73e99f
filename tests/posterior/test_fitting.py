"""Many experiments at once, more measurements later, and the same bits again: the calls against each other."""

from __future__ import annotations

import re
from itertools import product

import numpy as np
import pandas as pd
import pytest

import tissuq as tq
from against import BOXES, TRUTH, columns_of, parts
from dense import TERMS
from marks import slow_but

DISCREPANCIES = list(TERMS)
FIRST, SECOND, THIRD = np.linspace(0.7, 2.0, 10), np.linspace(0.8, 2.4, 13), np.linspace(0.7, 2.0, 10)[::-1]


def experiment(stretch, seed, scale=1.0):
    generator = np.random.default_rng(seed)
    return tq.Experiment(
        "uniaxial", stretch, scale * (columns_of(TRUTH, stretch) + 0.1 * generator.standard_normal(len(stretch)))
    )


MIXED = [experiment(stretch, seed) for seed, stretch in enumerate([FIRST, SECOND, FIRST, THIRD, FIRST, SECOND])]


def fixed(discrepancy, noise_sd):
    linear, axes = parts(discrepancy)
    priors = {symbol: tq.Uniform(*BOXES[symbol]) for symbol in linear}
    priors |= {symbol: tq.Uniform(axis.low, axis.high) for symbol, axis in axes.items()}
    return priors | ({"noise_sd": tq.Uniform(0, 2)} if noise_sd is None else {})


def assert_same(first, second, evidence=1e-5, share=1e-3):
    assert abs(first.log_evidence - second.log_evidence) < evidence
    a, b = (posterior.solution.marginals["C10"] for posterior in (first, second))
    assert abs(a.mean - b.mean) < share * b.sd
    assert abs(a.sd / b.sd - 1) < share
    (low, high), (other_low, other_high) = a.hdi(), b.hdi()
    assert abs((high - low) - (other_high - other_low)) < 5 * share * b.sd
    assert max(abs(low - other_low), abs(high - other_high)) < 10 * share * b.sd


@pytest.mark.parametrize(
    ("discrepancy", "with_priors"),
    slow_but(
        [("none", True), ("constant", True), ("linear", False), ("yeoh", False), ("gp", False)],
        product(DISCREPANCIES, (True, False)),
    ),
)
def test_many_experiments_on_mixed_stretches_are_those_one_by_one(discrepancy, with_priors):
    priors = fixed(discrepancy, 0.1) if with_priors else None
    options = {"discrepancy": discrepancy, "noise_sd": 0.1, "priors": priors}
    together = tq.fit_many(MIXED, **options)
    for found, data in zip(together, MIXED, strict=True):
        assert found.model.experiment is data
        assert_same(found, tq.fit(data, **options))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("discrepancy", "with_priors"),
    slow_but([("none", True), ("constant", False)], product(["none", "constant", "yeoh"], (True, False))),
)
def test_many_experiments_with_unknown_noise_are_those_one_by_one(discrepancy, with_priors):
    options = {"discrepancy": discrepancy, "priors": fixed(discrepancy, None) if with_priors else None}
    for found, data in zip(tq.fit_many(MIXED, **options), MIXED, strict=True):
        assert_same(found, tq.fit(data, **options), evidence=1e-4)


def test_many_experiments_of_different_sizes_of_stress_do_not_disturb_each_other():
    data = [experiment(FIRST, seed, scale) for seed, scale in enumerate([1e-3, 1.0, 1e3])]
    for found, each in zip(tq.fit_many(data, discrepancy="constant"), data, strict=True):
        assert_same(found, tq.fit(each, discrepancy="constant"), evidence=1e-4)


def test_the_order_of_experiments_does_not_matter():
    order = [4, 2, 0, 5, 3, 1]
    first = tq.fit_many(MIXED, discrepancy="yeoh", noise_sd=0.1)
    second = tq.fit_many([MIXED[place] for place in order], discrepancy="yeoh", noise_sd=0.1)
    for place, found in zip(order, second, strict=True):
        assert_same(found, first[place])


def test_no_experiments_give_no_posteriors_and_one_of_them_may_be_repeated():
    assert tq.fit_many([], discrepancy="none", noise_sd=0.1) == []
    first, second = tq.fit_many([MIXED[0], MIXED[0]], discrepancy="none", noise_sd=0.1)
    assert first.log_evidence == second.log_evidence


def test_many_modes_and_samplers_go_through_the_same_call():
    planar = tq.Experiment("planar", FIRST, MIXED[0].stress)
    found = tq.fit_many([MIXED[0], planar, MIXED[2]], discrepancy="none", noise_sd=0.1)
    assert [p.model.experiment.mode.name for p in found] == ["uniaxial", "planar", "uniaxial"]
    assert_same(found[1], tq.fit(planar, discrepancy="none", noise_sd=0.1))


@pytest.mark.parametrize("discrepancy", ["none", "yeoh", "gp"])
def test_the_same_seed_gives_the_same_bits_and_another_seed_others(discrepancy):
    first, second, other = (tq.fit(MIXED[0], discrepancy=discrepancy, noise_sd=0.1, seed=seed) for seed in (3, 3, 4))
    many = tq.fit_many([MIXED[0]], discrepancy=discrepancy, noise_sd=0.1, seed=3)[0]
    for symbol, drawn in first.solution.draws.items():
        assert (drawn == second.solution.draws[symbol]).all()
        assert (drawn == many.solution.draws[symbol]).all()
        assert (drawn != other.solution.draws[symbol]).any()
    assert first.log_evidence == second.log_evidence == other.log_evidence


@pytest.mark.slow
@pytest.mark.parametrize("method", ["nuts", "smc", "joint"])
def test_samplers_repeat_their_bits_too(method):
    options = {"discrepancy": "constant", "noise_sd": 0.1, "method": method}
    first, second, other = (tq.fit(MIXED[0], seed=seed, **options) for seed in (3, 3, 4))
    for symbol, drawn in first.solution.draws.items():
        assert (drawn == second.solution.draws[symbol]).all()
        assert (drawn != other.solution.draws[symbol]).any()


WHOLE = experiment(np.random.default_rng(5).uniform(0.7, 2.2, 60), 9)
STEPS = [slice(0, 20), slice(20, 21), slice(21, 45), slice(45, 60)]


def part(which):
    return tq.Experiment("uniaxial", WHOLE.stretch[which], WHOLE.stress[which])


@pytest.mark.parametrize(
    ("discrepancy", "noise_sd"), [*((each, 0.1) for each in DISCREPANCIES), ("none", None), ("yeoh", None)]
)
def test_updates_in_steps_are_the_fit_of_all(discrepancy, noise_sd):
    options = {"discrepancy": discrepancy, "noise_sd": noise_sd}
    posterior = tq.fit(part(STEPS[0]), **options)
    for step in STEPS[1:]:
        posterior = posterior.update(part(step))
    whole = tq.fit(WHOLE, **options)
    assert posterior.model.priors.keys() == whole.model.priors.keys()
    # Rounding in the statistics is some 1e-14, which the noise of 0.1 and sums of squares of some 100 enlarge.
    assert posterior.log_evidence == pytest.approx(whole.log_evidence, abs=1e-9)
    found, expected = posterior.summary(), whole.summary()
    assert (np.abs(found["mean"] - expected["mean"]) < 1e-8 * expected["sd"]).all()
    assert (np.abs(found["sd"] / expected["sd"] - 1) < 1e-8).all()
    for end in ("hdi_low", "hdi_high"):  # where the density is flat, the search for the ends is less sharp
        assert (np.abs(found[end] - expected[end]) < 1e-5 * expected["sd"]).all()


def test_an_update_in_another_mode_is_refused():
    posterior = tq.fit(part(STEPS[0]), discrepancy="none", noise_sd=0.1)
    with pytest.raises(tq.InputError, match="same loading mode"):
        posterior.update(tq.Experiment("planar", [0.8, 1.2], [0.1, 0.2]))


def test_an_update_of_repeats_counts_a_stretch_measured_again():
    stretch = np.linspace(0.8, 1.8, 8)
    first, second = (tq.Experiment("uniaxial", stretch, columns_of(TRUTH, stretch) + e) for e in (0.02, -0.03))
    again = tq.Experiment("uniaxial", stretch[:3], columns_of(TRUTH, stretch[:3]))
    start = tq.fit(first.joined(second), discrepancy="constant", noise="repeats")
    whole = tq.fit(first.joined(second).joined(again), discrepancy="constant", noise="repeats")
    assert start.update(again).log_evidence == pytest.approx(whole.log_evidence, abs=1e-8)


@pytest.mark.parametrize(("discrepancy", "noise"), [("yeoh", "unknown"), ("none", "proportional")])
def test_the_order_of_measurements_does_not_matter(discrepancy, noise):
    order = np.random.default_rng(1).permutation(60)
    first, second = (tq.fit(part(which), discrepancy=discrepancy, noise=noise) for which in (slice(None), order))
    assert_same(first, second, evidence=1e-5)


def test_the_order_of_measurements_does_not_matter_to_a_process():
    order = np.random.default_rng(1).permutation(60)
    first, second = (tq.fit(part(which), discrepancy="gp", noise_sd=0.1) for which in (slice(None), order))
    assert_same(first, second, evidence=1e-6)


@pytest.mark.parametrize("seed", [-1, 2**62 + 1, 2**64, 1.5, "two"])
def test_a_seed_that_not_every_generator_takes_is_refused_before_the_fit(seed):
    with pytest.raises(tq.InputError, match="seed must be a whole number from 0 to 4611686018427387904"):
        tq.fit(MIXED[0], discrepancy="none", noise_sd=0.1, seed=seed)


def test_the_largest_seed_is_sampled_and_saved(tmp_path):
    posterior = tq.fit(MIXED[0], discrepancy="none", noise_sd=0.1, seed=2**62)
    posterior.save(tmp_path / "posterior.nc")
    assert (tmp_path / "posterior.nc").stat().st_size


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"material": "all"}, "tissuq.fit_laws"),
        ({"priors": [tq.Uniform(0, 5)]}, "priors must be by parameter"),
        ({"mode": ["uniaxial", "planar"]}, "give each its own in .tissuq.read"),
    ],
)
def test_what_is_of_several_fits_or_tests_says_where_it_belongs(options, words):
    with pytest.raises(tq.InputError, match=words):
        tq.fit({"stretch": [1.0, 1.1, 1.2], "stress [kPa]": [0.0, 1.0, 2.0]}, **options)


LONG = np.linspace(1.0, 1.4, 24_000)


def long_test(noise_sd=0.02, seed=0):
    noise = np.random.default_rng(seed).normal(0, noise_sd, len(LONG))
    return tq.Experiment("uniaxial", LONG, 0.5 * (LONG - LONG**-2) + noise)


def test_a_long_file_has_the_errors_of_a_test_as_a_short_one_has():
    data = long_test(noise_sd=0.003)
    whole, few = (tq.fit(rows) for rows in (data, data.where(np.arange(0, len(LONG), 300))))
    assert (whole.model.tolerances, few.model.tolerances) == (tq.Tolerances("specimen"),) * 2
    assert whole.model.experiment.rows_name == "means of 12 measurements"
    (mean, sd), (few_mean, few_sd) = (fit.summary().loc["C10", ["mean", "sd"]] for fit in (whole, few))
    assert sd > 0.05 * mean
    assert sd == pytest.approx(few_sd, rel=0.15)
    assert abs(mean - few_mean) < 0.3 * sd


def test_means_of_measurements_tell_what_all_of_them_do():
    every = tq.fit(long_test(), noise_sd=0.02, discrepancy="none").summary().loc["C10"]
    options = {"tolerances": tq.Tolerances(slack=1e-7), "discrepancy": "none"}
    unknown, known = (tq.fit(long_test(), noise_sd=noise, **options) for noise in (None, 0.02))
    for fit, tolerance in ((unknown, 0.05), (known, 1e-4)):
        means = fit.summary()
        assert fit.model.experiment.size == 2000
        assert means.loc["C10", "mean"] == pytest.approx(every["mean"], abs=0.05 * every["sd"])
        assert means.loc["C10", "sd"] == pytest.approx(every["sd"], rel=tolerance)
    assert unknown.summary().loc["noise_sd", "mean"] == pytest.approx(0.02 / np.sqrt(12), rel=0.05)


def test_known_noise_of_means_is_that_of_each_test():
    long, short = long_test(), long_test(seed=1).where(np.arange(0, len(LONG), 300))
    fit = tq.fit([long, short], noise_sd=0.02, discrepancy="none")
    assert [len(curve) for curve in fit.model.experiment.curves] == [1000, 80]
    np.testing.assert_allclose(fit.model.noise_of_tests[0], [0.02 / np.sqrt(24), 0.02])


def test_measurements_without_errors_of_the_test_are_not_averaged():
    stretch, sign = np.repeat(LONG[::10], 2), (-1) ** np.arange(4_800)
    data = tq.Experiment("uniaxial", stretch, stretch - 1 + 1e-3 * sign)
    for options in ({"noise_sd": 0.02}, {"tolerances": "as-tested"}, {"noise": "repeats"}):
        assert tq.fit(data, discrepancy="none", **options).model.experiment is data


def test_a_saved_fit_of_means_says_so(tmp_path):
    posterior = tq.fit(long_test(), discrepancy="none")
    posterior.save(tmp_path / "fit.nc")
    loaded = tq.Posterior.load(tmp_path / "fit.nc")
    assert loaded.model.experiment.rows_name == "means of 12 measurements"
    assert "2000 means of 12 measurements" in repr(loaded)


def test_fewer_points_than_means_are_counted_in_rows_of_the_file():
    wave = 0.01 * np.sin(2 * np.pi * np.arange(len(LONG)) / 400)  # 33 means a period
    data = tq.Experiment("uniaxial", LONG, 0.5 * (LONG - LONG**-2) + wave)
    warnings = tq.fit(data, discrepancy="taylor", noise="independent").warnings
    (correlated,) = [warning for warning in warnings if warning.code == "correlated-residuals"]
    every = int(re.search(r"every=(\d+)", str(correlated)).group(1))
    assert (every % 12, every > 24) == (0, True)


def test_fewer_points_than_every_fifth_are_counted_in_rows_of_the_file(tmp_path):
    stretch = np.linspace(1.0, 1.5, 400)
    stress = 0.5 * (stretch - stretch**-2) + 0.01 * np.sin(2 * np.pi * np.arange(400) / 100)  # 20 of these a period
    pd.DataFrame({"stretch": stretch, "stress_MPa": stress}).to_csv(tmp_path / "test.csv", index=False)
    fit = tq.fit(tq.read(tmp_path / "test.csv", every=5), discrepancy="taylor", noise="independent")
    fit.save(tmp_path / "fit.nc")
    for posterior in (fit, tq.Posterior.load(tmp_path / "fit.nc")):
        (correlated,) = [warning for warning in posterior.warnings if warning.code == "correlated-residuals"]
        every = int(re.search(r"every=(\d+)", str(correlated)).group(1))
        assert (every % 5, every > 5) == (0, True)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"discrepancy": None}, "discrepancy must be a name, such as 'auto' or 'none', .* not None"),
        ({"material": 3}, "material must be a name, such as 'yeoh', .* not 3"),
        ({"material": tq.materials()["yeoh"]}, r"make one of the class, Yeoh\(\.\.\.\)"),
        ({"stable_in": None}, r"stable_in must be 'all' or names of loading modes, .* not None"),
    ],
    ids=["discrepancy", "number", "class", "modes"],
)
def test_what_is_neither_a_name_nor_an_object_is_refused_with_what_to_give(options, words):
    with pytest.raises(tq.TissuqError, match=words):
        tq.fit(MIXED[0], noise_sd=0.1, **({"discrepancy": "none"} | options))
