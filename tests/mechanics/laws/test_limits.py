"""What laws become at the ends of their parameters, sums, families by name, and materials that lock."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np
import pytest

import tissuq as tq
from loading import MEASURED
from tissuq.experiments.modes import Uniaxial
from tissuq.mechanics import engineering_stress, initial_shear_modulus, material_named, stress_basis
from tissuq.mechanics.stress import differentiator, path_energy, traced_stress_basis

STRETCH = np.array([0.5, 0.8, 1.05, 1.6, 2.4, 3.0])
EVERY_STRESS = pytest.mark.parametrize("measured", MEASURED, ids=str)
LOCKING = {"gent": [0.7], "gent-gent": [0.7, 0.2], "arruda-boyce": [0.7], "van-der-waals": [0.7, 0.1]}
EVERY_LOCKING = pytest.mark.parametrize("name", [*LOCKING, "extended-tube"])


def with_limit(name, limit):
    return [0.7, 0.2, limit, 0.5] if name == "extended-tube" else [*LOCKING[name], limit]


@EVERY_STRESS
@pytest.mark.parametrize(
    ("name", "values", "limit", "of_limit"),
    [
        ("gent", [0.7, 1e9], "neo-hookean", [0.35]),
        ("gent-gent", [0.7, 0.0, 1e9], "neo-hookean", [0.35]),
        ("arruda-boyce", [0.7, 1e9], "neo-hookean", [0.35]),
        ("van-der-waals", [0.7, 0.0, 1e18], "neo-hookean", [0.35]),
        ("extended-tube", [0.7, 0.2, 1e9, 1.0], "ogden-2", [0.7, 0.2, 2.0, -1.0]),
        ("demiray", [0.7, 1e-9], "neo-hookean", [0.35]),
        ("veronda-westmann", [0.7, 1e-9], "mooney-rivlin", [0.7, -0.35]),
        ("fung", [0.7, 1e-10], "rivlin:C20,C10,C01", [0.175, 0.7, -0.35]),
        ("knowles", [0.7, 0.3, 1.0], "neo-hookean", [0.35]),
        ("knowles", [0.7, 0.3, 1e9], "demiray", [0.7, 0.3]),
        ("hencky", [0.7], "ogden-2", [0.35, 0.35, 1e-4, -1e-4]),
        ("isihara", [0.7, 0.2, 0.0], "mooney-rivlin", [0.7, 0.2]),
        ("biderman", [0.7, 0.0, -0.1, 0.02], "yeoh", [0.7, -0.1, 0.02]),
        ("rivlin:C20,C01,C10", [-0.1, 0.2, 0.7], "isihara", [0.7, 0.2, -0.1]),
        ("ogden-4", [0.7, 0.2, 0.1, 0.0, 1.3, 5.0, -2.0, -9.0], "ogden-3", [0.7, 0.2, 0.1, 1.3, 5.0, -2.0]),
        ("demiray+rivlin:C01", [1.4, 0.3, -0.35], "veronda-westmann", [0.7, 0.3]),
        ("neo-hookean+rivlin:C01", [0.7, 0.2], "mooney-rivlin", [0.7, 0.2]),
    ],
)
def test_a_law_becomes_another_one(measured, name, values, limit, of_limit):
    found = engineering_stress(material_named(name), measured.path, measured.points, values)
    expected = engineering_stress(material_named(limit), measured.path, measured.points, of_limit)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize(
    ("name", "values", "modulus"),
    [
        ("gent", [0.7, 30.0], 0.7),
        ("gent-gent", [0.7, 0.2, 30.0], 0.9),
        ("arruda-boyce", [0.7, 12.0], 0.7),
        ("van-der-waals", [0.7, 0.2, 30.0], 0.7),
        ("extended-tube", [0.7, 0.2, 10.0, 0.5], 0.7 * (1 - 2 / 10) + 0.2),
        ("demiray", [0.7, 3.0], 0.7),
        ("fung", [0.7, 3.0], 0.7),
        ("veronda-westmann", [0.7, 3.0], 0.7),
        ("knowles", [0.7, 3.0, 2.0], 0.7),
        ("valanis-landel", [0.7], 0.7),
        ("peng-landel", [0.7], 0.7),
        ("hencky", [0.7], 0.7),
        ("rivlin:C10,C01,C11", [0.7, 0.2, 5.0], 1.8),
        ("gent+mooney-rivlin", [0.7, 30.0, 0.2, 0.1], 1.3),
    ],
)
def test_the_initial_shear_modulus_is_what_the_documentation_says(name, values, modulus):
    assert initial_shear_modulus(material_named(name), values) == pytest.approx(modulus, rel=1e-9)


def test_a_sum_has_the_parameters_of_its_parts_and_their_places_where_symbols_are_the_same():
    total = material_named("demiray") + material_named("veronda-westmann")
    assert [p.symbol for p in total.parameters] == ["mu_1", "b_1", "mu_2", "b_2"]
    assert total == material_named("demiray + veronda-westmann")
    alone = [engineering_stress(part, Uniaxial(), STRETCH, [0.7, 0.3]) for part in total.summands]
    found = engineering_stress(total, Uniaxial(), STRETCH, [0.7, 0.3, 0.7, 0.3])
    np.testing.assert_allclose(found, sum(alone), rtol=1e-13)
    assert len((total + material_named("hencky")).summands) == 3
    assert total.strain_energy(5.0, 4.0, [0.7, 0.3, 0.7, 0.3]) == pytest.approx(
        sum(part.strain_energy(5.0, 4.0, [0.7, 0.3]) for part in total.summands), rel=1e-14
    )


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("neo-hookean+yeoh", "would have C10 twice, of 'neo-hookean' and of 'yeoh'"),
        ("gent+arruda-boyce", "would have Jm twice"),
        ("ogden-1+ogden-1", "would have mu1, alpha1 twice"),
        ("gent+gnt", "no material named 'gnt'. Did you mean 'gent'"),
        ("rivlin:C10,C10", "each once"),
        ("rivlin:C00", "needs its coefficients"),
        ("rivlin:", "it was given ''"),
        ("ogden-0", "1 to 20 terms, not 0"),
        ("ogden-21", "1 to 20 terms, not 21"),
    ],
)
def test_names_that_are_no_material_are_refused_in_words(name, words):
    with pytest.raises(tq.ModelError, match=words):
        material_named(name)


def test_families_have_the_names_by_which_they_are_found():
    for name in ("rivlin:C10,C01,C11", "ogden-4", "gent+rivlin:C01"):
        assert material_named(name).name == name
    assert type(material_named("ogden-2")) is tq.materials()["ogden-2"]
    intervals = sorted(p.relative_prior.support for p in material_named("ogden-5").parameters if not p.is_linear)
    assert (intervals[0][0], intervals[-1][1]) == (-40.0, pytest.approx(40.0))
    assert all(one[1] <= other[0] + 1e-12 for one, other in pairwise(intervals))


@EVERY_LOCKING
def test_a_material_that_has_locked_has_no_stress_and_says_so(name):
    material, values = material_named(name), with_limit(name, 6.0)  # an uniaxial stretch of 2.9
    assert np.isfinite(engineering_stress(material, Uniaxial(), [0.5, 1.0, 2.5], values)).all()
    assert np.isnan(path_energy(material, Uniaxial().path, np.array([3.2, 5.0]), values)).all()
    bent = [v for v, p in zip(values, material.parameters, strict=True) if not p.is_linear]
    assert np.isnan(stress_basis(material, Uniaxial().at([2.5, 3.2, 5.0]), bent)[1:, 0]).all()
    compiled = differentiator().jit(partial(traced_stress_basis, material, Uniaxial().at(np.array([3.2, 5.0]))))
    assert np.isnan(compiled(np.array(bent))[:, 0]).all()
    with pytest.raises(tq.ModelError, match=r"no finite stress at a stretch of 3.2 .* locked"):
        engineering_stress(material, Uniaxial(), [2.5, 3.2, 5.0], values)


@pytest.mark.parametrize(
    ("name", "values", "stretch", "reason"),
    [
        ("ogden-1", [1.0, 0.0], 1.1, r"divides zero by zero where alpha1 = 0. Give a small number instead \(0.001\)"),
        ("ogden-2", [1.0, 1.0, 2.0, 0.0], 1.1, "divides zero by zero where alpha2 = 0"),
        ("fung", [1.0, 0.0], 1.1, "divides zero by zero where b = 0"),
        ("ogden-1", [1.0, 40.0], 1e20, "given: its energy is too large for a number"),
    ],
)
def test_a_material_that_cannot_lock_is_not_said_to_have_locked(name, values, stretch, reason):
    with pytest.raises(tq.ModelError, match=reason) as raised:
        engineering_stress(material_named(name), Uniaxial(), [stretch], values)
    assert "locked" not in str(raised.value)


def test_an_ogden_term_becomes_henckys_law_as_its_exponent_goes_to_zero():
    small, limit = (
        engineering_stress(material_named(name), Uniaxial(), [0.5, 1.1, 2.0], values)
        for name, values in (("ogden-1", [1.0, 1e-3]), ("hencky", [1.0]))
    )
    np.testing.assert_allclose(small, limit, rtol=1e-3)


@pytest.mark.parametrize(
    "name",
    ["gent", *(pytest.param(name, marks=pytest.mark.slow) for name in [*LOCKING, "extended-tube"] if name != "gent")],
)
def test_the_limit_lies_beyond_the_data_whatever_the_prior(name):
    data = tq.simulate("yeoh", {"C10": 0.3, "C20": 0.01, "C30": 1e-4}, np.linspace(0.6, 3.0, 12), 0.02, seed=1)
    strain = 3.0**2 + 2 / 3.0 - 3
    default = tq.fit(data, material=name, discrepancy="none", noise_sd=0.02)
    assert default.model.priors["Jm"].support[0] > strain
    assert np.isfinite(default.log_evidence)
    assert default.data.posterior["Jm"].min() > strain
    with pytest.raises(tq.InputError, match=r"Jm: the prior uniform\(5, 100\) reaches beyond .* 6.66667 to inf"):
        tq.fit(data, material=name, discrepancy="none", priors={"Jm": tq.Uniform(5, 100)})
    cut = tq.fit(data, material=name, discrepancy="none", noise_sd=0.02, priors={"Jm": tq.Normal(8, 5)})
    assert cut.model.priors["Jm"].support[0] == pytest.approx(strain)
    assert np.isfinite(cut.log_evidence)


def test_a_prediction_beyond_the_limit_is_refused_in_words():
    truth = {"mu": 0.5, "Jm": 9.0}
    data = tq.simulate("gent", truth, np.linspace(0.6, 3.0, 15), noise_sd=0.01, seed=1)
    posterior = tq.fit(data, material="gent", discrepancy="none", noise_sd=0.01)
    assert np.isfinite(posterior.predict([3.0, 3.1]).to_numpy()).all()
    for beyond in ({"stretch": [1.5, 4.0]}, {"stretch": [1.5, 4.0], "mode": "equibiaxial"}):
        with pytest.raises(tq.ModelError, match=r"'gent' has no stress at a stretch .*of 4: its Jm .* locks before"):
            posterior.predict(**beyond)
