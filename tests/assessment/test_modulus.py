"""The initial shear modulus, against draws through the strain energy's own second derivative."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tissuq as tq
from marks import slow_but
from tissuq.assessment.modulus import modulus
from tissuq.inference.solution import Representation

STRETCH = np.linspace(0.75, 1.7, 20)


def measured(seed=0):
    truth = {"C10": 0.5, "C20": 0.03, "C30": 0.0}
    return tq.simulate("yeoh", truth, STRETCH, noise_sd=0.03, seed=seed)


@pytest.mark.parametrize("discrepancy", ["none", "taylor", "constant"])
@pytest.mark.parametrize(
    "material", ["neo-hookean", "mooney-rivlin", "yeoh", "ogden-1", pytest.param("ogden-2", marks=pytest.mark.slow)]
)
def test_it_is_that_of_the_draws(material, discrepancy):
    posterior = tq.fit(measured(), material=material, discrepancy=discrepancy, noise_sd=0.03, method="exact")
    found, draws = posterior.initial_shear_modulus, posterior.solution.draws
    some = [draws[p.symbol].ravel()[::40] for p in posterior.model.material.parameters]
    material = posterior.model.material
    moduli = np.array([tq.initial_shear_modulus(material, values) for values in zip(*some, strict=True)])
    assert found.mean == pytest.approx(np.mean(moduli), abs=5 * found.sd / np.sqrt(len(moduli)))
    assert found.sd == pytest.approx(np.std(moduli), rel=0.3)  # 5 standard errors of a hundred draws
    low, high = found.hdi(0.5)
    assert 0.25 < np.mean((low < moduli) & (moduli < high)) < 0.75


def test_a_single_draw_among_gaussians_takes_their_width():
    solution = tq.fit(measured(), material="ogden-1", discrepancy="none", noise_sd=0.03).solution
    mixture, root = solution.mixture, solution.mixture.root.copy()
    root[0] = 0.0
    found = modulus(replace(solution, representation=Representation.of(replace(mixture, root=root))))
    assert found.hdi() == pytest.approx(modulus(solution).hdi(), rel=1e-3)


def test_where_one_parameter_makes_it_it_is_that_one_scaled():
    posterior = tq.fit(measured(), noise_sd=0.03)
    assert posterior.initial_shear_modulus.hdi() == pytest.approx(2 * np.array(posterior.marginals["C10"].hdi()))


@pytest.mark.parametrize(
    ("material", "words"),
    [
        ("neo-hookean", "determined by C10 alone."),
        ("yeoh", "determined by C10 alone; C20 and C30 share their meaning with the discrepancy."),
        ("mooney-rivlin", "determined by C10 and C01 together, each of which is less certain."),
    ],
)
@pytest.mark.parametrize("discrepancy", slow_but(["taylor"], ["taylor", "auto"]))
def test_the_assessment_says_which_parameters_keep_their_meaning(material, words, discrepancy):
    data = measured()
    in_kpa = tq.Experiment("uniaxial", data.stretch, data.stress).labelled(stress_unit="kPa")
    found = tq.fit(in_kpa, material=material, discrepancy=discrepancy, noise_sd=0.03).assess()
    (sentence,) = (text for text in found.sentences if "initial shear modulus" in text)
    assert sentence.endswith(words)
    assert f"is {1000 * found.modulus[0]:.3g} kPa" in sentence
    low, high = found.modulus[1:]
    assert low < 1.0 < high
