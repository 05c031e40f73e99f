"""The model says which parameters are linear, sets default priors that fit the data, and refuses what cannot work."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.mechanics import NeoHookean, Yeoh, material_named
from tissuq.mechanics.material import materials
from tissuq.model.discrepancy import discrepancies, discrepancy_named
from tissuq.model.statistical_model import StatisticalModel

STRETCH = np.linspace(0.8, 1.6, 20)
ALONE = [kind() for kind in materials().values() if not kind.needs_matrix]
DATA = tq.simulate("yeoh", {"C10": 1.2, "C20": -0.057, "C30": 0.004}, STRETCH, 0.1, seed=1)


def model(discrepancy="quadratic", material=None, noise_sd=0.1, **options):
    return StatisticalModel(DATA, material or NeoHookean(), discrepancy_named(discrepancy), noise_sd, **options)


def test_an_experiment_with_several_stresses_has_a_row_for_each():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, [1.1, 1.2, 1.3], 0.01, mode="constrained-uniaxial")
    model = StatisticalModel(data, NeoHookean(), discrepancy_named("none"), 0.01)
    assert (len(model.experiment), model.experiment.size) == (3, 6)
    held = 2 * (1 - model.experiment.stretch**-2)
    assert np.allclose(model.design[3:, 0], held, rtol=1e-12)


def test_linear_and_nonlinear_parameters_are_told_apart_without_names():
    assert model().linear == ("C10", "m0", "m1", "m2")
    assert model().nonlinear == ("S",)
    assert model("gp", noise_sd="unknown").nonlinear == ("psi", "c", "noise_sd")
    log_normal = {"C10": tq.LogNormal(1, 1)}
    assert model(chosen_priors=log_normal).nonlinear == ("C10", "S")


@pytest.mark.parametrize("material", ALONE, ids=lambda material: material.name)
def test_default_boxes_hold_least_squares_with_a_margin(material):
    for name in discrepancies():
        try:
            assert_boxes_hold_least_squares(name, material)
        except Exception as error:
            error.add_note(f"discrepancy {name}")
            raise


def assert_boxes_hold_least_squares(name, material):
    shared = {p.symbol for p in material.parameters} & {p.symbol for p in discrepancy_named(name).parameters}
    if shared:
        with pytest.raises(tq.ModelError, match="no data can separate the two"):
            model(name, material)
        return
    if name == "gp-orthogonal" and not all(p.is_linear for p in material.parameters):
        with pytest.raises(tq.ModelError, match="linear in the parameters"):
            model(name, material)
        return
    fitted = model(name, material)
    own = sum(parameter.is_linear for parameter in material.parameters)
    of_material, of_all = (np.linalg.lstsq(X, DATA.stress)[0] for X in (fitted.design[:, :own], fitted.design))
    for symbol, value in zip(fitted.column_symbols, [*of_material, *of_all[own:]], strict=True):
        low, high = fitted.priors[symbol].support
        assert max(abs(low), high) >= 5 * abs(value)


@pytest.mark.parametrize(
    ("name", "exponents"),
    [("ogden-1", [1.5]), ("ogden-1", [5.0]), ("ogden-1", [30.0]), ("ogden-2", [3.0, -2.0]), ("ogden-3", [1.3, 5, -2])],
    ids=str,
)
def test_default_boxes_of_moduli_hold_the_truth_whatever_the_exponents(name, exponents):
    moduli = {f"mu{i}": 0.5 for i in range(1, len(exponents) + 1)}
    truth = moduli | {f"alpha{i}": alpha for i, alpha in enumerate(exponents, start=1)}
    data = tq.simulate(name, truth, STRETCH)
    priors = StatisticalModel(data, material_named(name), discrepancy_named("none"), 0.1).priors
    assert all(priors[symbol].support[0] < value < priors[symbol].support[1] for symbol, value in truth.items())


def test_the_default_prior_of_c10_is_the_same_for_every_discrepancy():
    boxes = {name: model(name).priors["C10"] for name in discrepancies()}
    assert {box.low for box in boxes.values()} == {0.0}
    assert np.ptp([box.high for box in boxes.values()]) < 1e-13 * boxes["none"].high


def test_chosen_priors_replace_defaults():
    chosen = {"m1": tq.Normal(0, 2), "S": tq.HalfNormal(0.5)}
    assert model(chosen_priors=chosen).priors["m1"] == tq.Normal(0, 2)
    assert model(chosen_priors=chosen).priors["S"] == tq.HalfNormal(0.5)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: model(noise_sd=0.0), "noise_sd must be a positive number"),
        (lambda: model(noise_sd=-1.0), "noise_sd must be a positive number"),
        (lambda: model(noise_sd=float("nan")), "noise_sd must be a positive number"),
        (
            lambda: model(noise_sd="big"),
            "no noise named 'big': choose one of unknown, independent, proportional, repeats, autoregressive",
        ),
        (lambda: model("yeoh", Yeoh()), "adds C20, C30, which material 'yeoh' has already"),
        (lambda: model(chosen_priors={"mu": tq.Uniform(0, 1)}), "a prior for 'mu'"),
        (lambda: model(chosen_priors={"C10": tq.Uniform(-1, 1)}), "C10: .* reaches beyond"),
        (lambda: model(chosen_priors={"S": tq.Uniform(-1, 1)}), "S: .* reaches beyond"),
    ],
)
def test_what_cannot_work_is_refused_in_words(make, words):
    with pytest.raises(tq.TissuqError, match=words):
        make()


def test_a_law_of_ones_own_that_uses_the_names_of_an_amplitude_is_to_be_renamed():
    law = tq.FunctionLaw(lambda I1, I2, c1, c2: c1 * (I1 - 3) + c2 * (I1 - 3) ** 2)
    with pytest.raises(tq.ModelError, match=r"adds c1, c2, .* two things\. Rename .* c1 to c1_law"):
        model("auto", law)


@pytest.mark.parametrize(("noise", "symbol"), [("unknown", "noise_sd"), ("proportional", "noise_share")])
def test_a_law_of_ones_own_that_uses_the_name_of_the_noise_is_to_be_renamed(noise, symbol):
    """One of the two numbers stood for both, without a word."""
    law = tq.FunctionLaw({
        "noise_sd": lambda I1, I2, C10, noise_sd: C10 * (I1 - 3) + noise_sd * (I2 - 3),
        "noise_share": lambda I1, I2, C10, noise_share: C10 * (I1 - 3) + noise_share * (I2 - 3),
    }[symbol])  # fmt: skip
    with pytest.raises(tq.ModelError, match=rf"has {symbol}, .* two things\. Rename .* {symbol}_law, .* another noise"):
        model("none", law, noise_sd=noise)
    model("none", law, noise_sd=0.1)


def test_fewer_points_than_parameters_are_refused():
    few = tq.Experiment("uniaxial", [0.9, 1.1, 1.2], [-0.3, 0.3, 0.5])
    with pytest.raises(tq.InputError, match="3 measurements for 5 parameters"):
        tq.fit(few, discrepancy="quadratic", noise_sd=0.1)


def test_stretches_that_cannot_separate_the_parameters_are_refused():
    same = tq.Experiment("uniaxial", [1.2] * 6, [0.5, 0.4, 0.6, 0.5, 0.5, 0.4])
    with pytest.raises(tq.ModelError, match="cannot separate"):
        tq.fit(same, discrepancy="constant", noise_sd=0.1)


def test_data_without_any_stress_are_refused():
    nothing = tq.Experiment("uniaxial", [0.9, 1.1, 1.2], [0.0, 0.0, 0.0])
    with pytest.raises(tq.InputError, match="every stress is zero"):
        tq.fit(nothing, discrepancy="none", noise_sd=0.1)


def test_unknown_noise_beside_a_free_independent_error_is_said_to_be_confounded():
    posterior = tq.fit(DATA, discrepancy="constant")
    assert any("the data determine only noise_sd^2 + S^2" in text for text in posterior.warnings)
    assert tq.fit(DATA, discrepancy="constant", noise_sd=0.1).warnings == ()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"method": "hmc"}, "no method 'hmc'"),
        ({"seed": -1}, "whole number"),
        ({"material": "neohooke"}, "Did you mean 'neo-hookean'"),
        ({"material": "ogden"}, "Did you mean 'ogden-1' or 'ogden-2' or 'ogden-3'"),
        ({"material": "HGO"}, "Did you mean 'holzapfel-gasser-ogden'"),
        ({"material": "vw"}, "Did you mean 'veronda-westmann'"),
        ({"discrepancy": "gauss"}, "no discrepancy named 'gauss'"),
    ],
)
def test_bad_arguments_of_fit_are_refused_in_words(options, words):
    with pytest.raises(tq.TissuqError, match=words):
        tq.fit(DATA, **({"discrepancy": "none"} | options))


def test_a_posterior_that_its_prior_cuts_is_said_to_be_cut():
    wide = {"C10": tq.Uniform(0, 10)}
    narrow = {"C10": tq.Uniform(0, 1.0)}  # least squares gives about 1.2
    assert not tq.fit(DATA, discrepancy="none", noise_sd=0.1, priors=wide).warnings
    (text,) = tq.fit(DATA, discrepancy="none", noise_sd=0.1, priors=narrow).warnings
    assert "C10 (upper)" in text


def test_a_natural_bound_is_no_cause_for_a_warning():
    stretch = np.linspace(0.8, 1.5, 20)
    data = tq.Experiment("uniaxial", stretch, -0.2 * 2 * (stretch - stretch**-2) + 0.01)
    found = tq.fit(data, discrepancy="none", noise_sd=0.5, priors={"C10": tq.Uniform(0, 10)}).warnings
    assert not any("cut" in text for text in found)


def fails(enumerator, models, seed):
    raise tq.ConvergenceError("this fails")


def fails_too(enumerator, models, seed):
    raise tq.ConvergenceError("this fails, too")


def test_points_serve_where_quadrature_does_not_reach_its_tolerance(monkeypatch):
    exact = tq.fit(DATA, discrepancy="constant", noise_sd=0.1)
    monkeypatch.setattr("tissuq.inference.enumerators.adaptive_cells.AdaptiveCells.solve", fails)
    summed = tq.fit(DATA, discrepancy="constant", noise_sd=0.1, method="exact")
    assert "a sum over" in summed.solution.reason
    assert summed.log_evidence == pytest.approx(exact.log_evidence, abs=4 * summed.log_evidence_error)


def test_auto_asks_nuts_with_the_first_reason_where_nothing_is_summed(monkeypatch):
    class Asked(Exception):
        pass

    def asked(model, seed, refusal):
        raise Asked(refusal)

    monkeypatch.setattr("tissuq.inference.enumerators.adaptive_cells.AdaptiveCells.solve", fails)
    monkeypatch.setattr("tissuq.inference.enumerators.adapted_points.AdaptedPoints.solve", fails_too)
    monkeypatch.setattr("tissuq.inference.enumerators.sampled.sample_by_nuts", asked)
    with pytest.raises(Asked, match=r"this fails$"):
        tq.fit(DATA, discrepancy="constant", noise_sd=0.1)


@pytest.mark.slow
def test_auto_samples_where_nothing_is_summed(monkeypatch):
    exact = tq.fit(DATA, discrepancy="constant", noise_sd=0.1)
    monkeypatch.setattr("tissuq.inference.enumerators.adaptive_cells.AdaptiveCells.solve", fails)
    monkeypatch.setattr("tissuq.inference.enumerators.adapted_points.AdaptedPoints.solve", fails_too)
    sampled = tq.fit(DATA, discrepancy="constant", noise_sd=0.1)
    assert sampled.solution.route == "nuts"
    assert "this fails" in sampled.solution.reason
    assert sampled.log_evidence == pytest.approx(exact.log_evidence, abs=5 * sampled.log_evidence_error)
    assert 0 < sampled.log_evidence_error < 0.2
    with pytest.raises(tq.ConvergenceError):
        tq.fit(DATA, discrepancy="constant", noise_sd=0.1, method="exact")


def test_auto_turns_to_samples_of_all_parameters_where_none_is_left_to_sample_alone(monkeypatch):
    class Asked(Exception):
        pass

    def asked(model, seed=0, draws=1000, because=""):
        raise Asked(because)

    monkeypatch.setattr("tissuq.inference.enumerators.adaptive_cells.AdaptiveCells.solve", fails)
    monkeypatch.setattr("tissuq.inference.enumerators.sampled.sample_joint", asked)
    with pytest.raises(Asked, match="this fails"):
        tq.fit(DATA, discrepancy="none", noise_sd=0.1)
    with pytest.raises(tq.ModelError, match="nothing is left to sample"):
        tq.fit(DATA, discrepancy="none", noise_sd=0.1, method="nuts")


@pytest.mark.slow
def test_auto_samples_all_parameters_where_none_is_left_to_sample_alone(monkeypatch):

    monkeypatch.setattr("tissuq.inference.enumerators.adaptive_cells.AdaptiveCells.solve", fails)
    solution = tq.fit(DATA, discrepancy="none", noise_sd=0.1).solution
    assert solution.route == "joint"
    assert "this fails" in solution.reason


def test_a_material_that_is_not_linear_in_its_parameters_is_refused():
    class Squared(tq.Material):
        """W = a^2 (I1 - 3)."""

        name = "squared"
        formula = "a^2 (I1 - 3)"
        source = "this test"
        parameters = (tq.Parameter("a", "root of C10", support=(0.0, float("inf"))),)

        def strain_energy(self, I1, I2, values):
            return values[0] ** 2 * (I1 - 3)

    with pytest.raises(tq.ModelError, match="not proportional to its parameters"):
        tq.fit(DATA, material=Squared(), discrepancy="none", noise_sd=0.1)


def test_an_energy_that_jax_cannot_differentiate_is_refused_in_words():
    class WithNumpy(tq.Material):
        """W = C10 / b (exp(b (I1 - 3)) - 1), written with the wrong library."""

        name = "with-numpy"
        formula = "C10 / b (exp(b (I1 - 3)) - 1)"
        source = "this test"
        parameters = (
            tq.Parameter("C10", "half the modulus", support=(0.0, float("inf"))),
            tq.Parameter("b", "rate", "rate", (0.0, float("inf")), is_linear=False),
        )

        def strain_energy(self, I1, I2, values):
            return values[0] / values[1] * (np.exp(values[1] * (I1 - 3)) - 1)

    with pytest.raises(tq.ModelError, match=r"jax\.numpy"):
        tq.fit(
            DATA,
            material=WithNumpy(),
            discrepancy="none",
            noise_sd=0.1,
            method="joint",
            priors={"b": tq.Uniform(0.1, 1)},
        )


def test_two_materials_of_one_name_are_refused():
    import gc

    kind = type("Yeoh", (tq.Material,), {"name": "yeoh", "__module__": "elsewhere", "strain_energy": lambda *a: 0.0})
    with pytest.raises(tq.ModelError, match="two classes are named 'yeoh'"):
        tq.materials()
    del kind
    gc.collect()
    assert "yeoh" in tq.materials()


def test_an_amplitude_cut_by_its_prior_is_said_to_be_cut(paper):
    posterior = tq.fit(paper.experiment(), discrepancy="gp", noise_sd=0.5, priors=paper.priors_of("gp"))
    assert any("c (upper)" in text for text in posterior.warnings)
