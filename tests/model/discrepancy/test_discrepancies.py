"""The six corrected equations of the paper, and what every discrepancy must satisfy."""

from __future__ import annotations

import numpy as np
import pytest

import conditioned
import tissuq as tq
from tissuq.experiments.modes import Uniaxial
from tissuq.mechanics.stress import differentiator
from tissuq.model.discrepancy import EnergyDiscrepancy, discrepancies, discrepancy_named

STRETCH = np.linspace(0.5, 4.25, 16)
VALUES = {"S": 0.7, "c": 0.9, "psi": 1.3}

MEANS = {  # eq. 20 to 24, as corrected
    "none": [],
    "constant": [lambda x: x**0],
    "linear": [lambda x: x**0, lambda x: x],
    "quadratic": [lambda x: x**0, lambda x: x, lambda x: x**2],
    "mooney-rivlin": [lambda x: 2 * (1 - x**-3)],
    "yeoh": [
        lambda x: 4 * (x**3 - 3 * x + 1 + 3 * x**-2 - 2 * x**-3),
        lambda x: 6 * (x**5 - 6 * x**3 + 3 * x**2 + 9 * x - 6 - 9 * x**-2 + 12 * x**-3 - 4 * x**-4),
    ],
    "gp": [],
    "gp-pinned": [],
    "gp-orthogonal": [],
    "gp-scaled": [],
}

PAPER = list(MEANS)[:7]
EVERY = pytest.mark.parametrize("name", list(MEANS))


def of(name):
    data = tq.Experiment("uniaxial", STRETCH, STRETCH)
    return discrepancy_named(name).adapted_to(tq.materials()["neo-hookean"](), data)


def covariance(discrepancy, stretch, values):
    total = discrepancy.independent_variance(values) * np.eye(len(stretch))
    if discrepancy.is_correlated:
        total = total + discrepancy.correlated_variance(values) * discrepancy.kernel(0, stretch, stretch, values)
    return total


def test_the_library_holds_exactly_the_papers_formulations_their_rivals_and_energies():
    energies = {name for name, kind in discrepancies().items() if issubclass(kind, EnergyDiscrepancy)}
    assert set(discrepancies()) - energies == set(MEANS)


@EVERY
def test_the_mean_is_the_corrected_equation(name):
    basis = discrepancy_named(name).mean_basis(Uniaxial().path.at(STRETCH, 0))
    assert basis.shape == (len(STRETCH), len(MEANS[name]))
    for column, mean in zip(basis.T, MEANS[name], strict=True):
        np.testing.assert_allclose(column, mean(STRETCH), rtol=1e-12, atol=1e-12)


@EVERY
def test_the_covariance_is_the_corrected_equation(name):
    expected = np.zeros((len(STRETCH), len(STRETCH)))
    if name == "gp":
        distance = STRETCH[:, None] - STRETCH[None, :]
        expected = 0.9**2 * np.exp(-(distance**2) / (2 * 1.3**2))
    elif name == "gp-pinned":
        expected = 0.9**2 * conditioned.pinned(STRETCH, 1.3)
    elif name == "gp-orthogonal":
        expected = 0.9**2 * conditioned.orthogonal(STRETCH, 1.3, (0.5, 4.25), [lambda x: 2 * (x - x**-2)])
    elif name == "gp-scaled":
        expected = 0.9**2 * conditioned.scaled(STRETCH, 1.3, (0.5, 4.25), 10 * np.sqrt(16))
    elif name != "none":
        expected = 0.7**2 * np.eye(len(STRETCH))
    tolerance = {"rtol": 1e-14} if name in PAPER else {"atol": 1e-8}
    np.testing.assert_allclose(covariance(of(name), STRETCH, VALUES), expected, **tolerance)


def test_the_covariance_of_several_curves_with_states_of_one_is_that_of_its_own():
    data = [tq.Experiment(mode, STRETCH, STRETCH) for mode in ("uniaxial", "planar")]
    states = tq.Experiment.of(data).states
    process = discrepancy_named("gp").adapted_to(tq.materials()["neo-hookean"](), tq.Experiment.of(data))
    found = process.correlation(states, Uniaxial().path.at(STRETCH[:3], 0), VALUES)
    expected = np.exp(-((STRETCH[:, None] - STRETCH[:3]) ** 2) / (2 * 1.3**2))
    np.testing.assert_allclose(found, np.concatenate([expected, np.zeros_like(expected)]), rtol=1e-14)


@EVERY
def test_there_is_one_column_for_each_linear_parameter(name):
    discrepancy = discrepancy_named(name)
    linear = [parameter for parameter in discrepancy.parameters if parameter.is_linear]
    assert discrepancy.mean_basis(Uniaxial().path.at(STRETCH, 0)).shape[1] == len(linear)


@EVERY
def test_nonlinear_parameters_have_a_default_prior_inside_their_support(name):
    for parameter in discrepancy_named(name).parameters:
        if not parameter.is_linear:
            low, high = parameter.relative_prior.support
            assert parameter.support[0] <= low < high <= parameter.support[1]


@EVERY
def test_jax_and_numpy_give_the_same_covariance(name):
    jnp = differentiator().numpy
    discrepancy = of(name)
    traced = {symbol: jnp.asarray(value) for symbol, value in VALUES.items()}
    other = covariance(discrepancy, jnp.asarray(STRETCH), traced)
    np.testing.assert_allclose(other, covariance(discrepancy, STRETCH, VALUES), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("name", ["mooney-rivlin", "yeoh"])
def test_energy_terms_carry_no_stress_at_the_reference(name):
    np.testing.assert_allclose(
        discrepancy_named(name).mean_basis(Uniaxial().path.at(np.array([1.0]), 0)), 0, atol=1e-14
    )


def test_the_yeoh_terms_carry_no_initial_stiffness_and_the_mooney_rivlin_term_does():
    near = np.array([1 - 1e-5, 1 + 1e-5])
    slopes = {
        name: np.diff(discrepancy_named(name).mean_basis(Uniaxial().path.at(near, 0)), axis=0)[0] / 2e-5
        for name in ("yeoh", "mooney-rivlin")
    }
    np.testing.assert_allclose(slopes["yeoh"], 0, atol=1e-8)
    np.testing.assert_allclose(slopes["mooney-rivlin"], 6, rtol=1e-8)


class Bump(tq.Discrepancy):
    """A bump (x - 1)^2, whose basis has no columns; its name is not kept."""

    name = property(lambda self: "bump")
    formula = "b (x - 1)^2"
    source = "a test"
    parameters = (tq.Parameter("b", "size of the bump"),)

    def mean_basis(self, states):
        return (np.asarray(states.abscissa) - 1) ** 2


class Lost(Bump):
    """A bump whose basis is no number; its name is not kept."""

    def mean_basis(self, states):
        return np.full((len(states), 1), np.nan)


def test_a_basis_that_is_not_finite_is_refused():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.01, seed=1)
    with pytest.raises(tq.ModelError, match="'bump': mean_basis is not finite everywhere"):
        tq.fit(data, discrepancy=Lost(), noise_sd=0.01)


def test_a_basis_without_a_column_for_each_linear_parameter_is_refused():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.01, seed=1)
    with pytest.raises(tq.ModelError, match=r"'bump': mean_basis has the shape \(16,\), not a column for"):
        tq.fit(data, discrepancy=Bump(), noise_sd=0.01)
