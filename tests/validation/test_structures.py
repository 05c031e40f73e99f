"""The campaign on forces of structures: its tests have the stated errors, and its counts are those of the rows."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.emulation.material_posterior import card_material
from tissuq.finite_elements.first_order import first_order_forces
from tissuq.finite_elements.response import BULK_RATIO
from tissuq.mechanics import material_named
from tissuq.validation.structures import (
    KNOWN_LAWS,
    STRUCTURES,
    StructureStudySettings,
    simulated_tests,
    summarise_structures,
    tasks_of,
)


def test_the_first_tests_of_every_truth_come_before_any_second():
    tasks = tasks_of(StructureStudySettings(replicates=2))
    assert [task.key for task in tasks] == ["gent/0", "ogden/0", "gent/1", "ogden/1"]


@pytest.mark.parametrize("truth", KNOWN_LAWS)
def test_without_errors_the_tests_are_the_closed_form(truth):
    """Gent: W1 = mu Jm / (2 (Jm - I1 + 3)); Ogden: 2 mu / alpha (l^(alpha - 1) - l^(-alpha/2 - 1)) in tension."""
    settings = StructureStudySettings(estimand="as-tested", noise=1e-12)
    uniaxial, planar = simulated_tests(settings, KNOWN_LAWS[truth], [0])
    for test, power in ((uniaxial, 2), (planar, 3)):
        x = test.stretch
        assert len(x) == settings.points
        assert x.max() == settings.high
        assert x.min() == pytest.approx(settings.low if power == 2 else 1 + 0.25 / settings.points)
        if truth == "gent":
            mu, limit = KNOWN_LAWS["gent"].values
            first = x**2 + (2 / x if power == 2 else 1 + x**-2)
            expected = mu * limit / (limit - first + 3) * (x - x ** -float(power))
        else:
            mu, alpha = KNOWN_LAWS["ogden"].values
            exponent = -alpha / 2 - 1 if power == 2 else -alpha - 1
            expected = 2 * mu / alpha * (x ** (alpha - 1) - x**exponent)
        assert test.stress == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_tests_in_shear_go_to_the_strain_of_the_others_and_their_errors_vanish_at_rest():
    settings = StructureStudySettings(modes=("simple-shear",), noise=1e-12)
    (test,) = simulated_tests(settings, KNOWN_LAWS["ogden"], [0])
    assert test.stretch.max() == pytest.approx(settings.high - 1, abs=0.02)
    assert test.stretch.min() == pytest.approx((settings.high - 1) / settings.points, abs=0.02)


@pytest.mark.slow
def test_the_errors_have_the_sizes_of_the_estimand():
    """Factors of 400 specimens: within four standard errors of an sd, 14 %."""
    settings = StructureStudySettings(noise=1e-9, points=12)
    sizes = settings.tolerances.sizes
    truth = KNOWN_LAWS["gent"]
    exact = simulated_tests(StructureStudySettings(estimand="as-tested", noise=1e-12, points=12), truth, [0])
    factors, shifts = [], []
    for seed in range(400):
        tests = simulated_tests(settings, truth, [seed])
        factors.append([np.log(test.stress[-1] / clean.stress[-1]) for test, clean in zip(tests, exact, strict=True)])
        shifts.append(tests[0].stretch[6] - exact[0].stretch[6])
    own, both = np.array(factors), sizes["stress"] ** 2
    each = sizes["test"] ** 2 + sizes["smooth"] ** 2 + sizes["resolution"] ** 2
    assert own.std(axis=0) == pytest.approx(np.sqrt(both + each), rel=0.15)
    assert np.cov(own.T)[0, 1] == pytest.approx(both, abs=4 * (both + each) / np.sqrt(400))
    near_one = abs(exact[0].stretch[6] - 1)
    assert np.std(shifts) == pytest.approx(np.hypot(sizes["slack"], sizes["length"] * near_one), rel=0.15)


def row(replicate, low, high, force=2.0, oracle=(1.9, 2.1), failure=""):
    band = {"low": low, "high": high, "mean": (low + high) / 2}
    known = {"low": oracle[0], "high": oracle[1], "mean": sum(oracle) / 2}
    structures = {} if failure else {"bar": {"force": force, "default": band, "oracle": known}}
    return {"truth": "gent", "replicate": replicate, "failure": failure, "structures": structures}


def test_counts_and_ratios_are_those_of_the_bands():
    results = [row(0, 1.8, 2.2), row(1, 2.1, 2.5), row(2, 1.5, 2.3), row(3, 0, 0, failure="stopped"), row(4, 1.9, 2.1)]
    (found,) = summarise_structures(results).to_dict("records")
    assert (found["replicates"], found["failed"]) == (4, 1)
    assert found["inside"] == pytest.approx(0.75)
    assert found["oracle_inside"] == 1
    assert found["width_ratio"] == pytest.approx(2.0)  # of 2, 2, 4 and 1
    assert found["half_width"] == pytest.approx(0.1)
    assert found["error"] == pytest.approx(np.median([0, 0.15, 0.05, 0]))


@pytest.mark.finite_elements
@pytest.mark.parametrize("structure", ["bar", "plate"])
def test_the_true_force_is_that_of_another_code_path(structure):
    """The power of the law's stresses along its own equilibria against the reaction of what moves the body."""
    law = KNOWN_LAWS["gent"]
    ensemble = card_material(material_named(law.material), law.values, (0.8, 1.25), "uniaxial")
    found = first_order_forces(STRUCTURES[structure], ensemble, ensemble[0], 4, BULK_RATIO)
    reaction = tq.finite_elements.respond(STRUCTURES[structure], material_named(law.material), law.values, steps=4)
    assert found.forces[0] == pytest.approx(reaction.force, rel=1e-3)
