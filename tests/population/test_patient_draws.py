"""A new patient's draws for other programs: predictive mean and sd, stability, and cards with their law."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from one_element import CCX, FREE, calculix, reference
from tissuq.export import CardSettings, card_format

from .test_population import MODULI, NOISE_SD, by_quadrature, neo_hookean, specimens_of

STRETCH = np.linspace(0.75, 1.3, 12)
TRUTHS = [(0.5, 0.1), (0.3, -0.05), (0.6, 0.4), (0.4, 0.2), (0.35, -0.1)]
"""C10 and C01 of Mooney-Rivlin specimens, MPa."""


RATES = {
    "uniaxial": lambda x: (x - x**-2, 1 - x**-3),
    "equibiaxial": lambda x: (x - x**-5, x**3 - x**-3),
    "planar": lambda x: (x - x**-3, x - x**-3),
}
"""Half of dI1/dl and dI2/dl by mode; of equal biaxial tension, of one axis."""


def rises(draw, ranges):
    """Return whether Mooney's stress rises with the stretch over the range of every mode."""
    curves = []
    for mode, ends in ranges.items():
        first, second = RATES[mode](np.linspace(*ends, 101))
        curves.append(draw.values["C10"] * first + draw.values["C01"] * second)
    return all((np.diff(curve) > 0).all() for curve in curves)


@pytest.fixture(scope="module")
def found():
    return neo_hookean(specimens_of(MODULI))


@pytest.mark.slow
def test_they_have_mean_and_sd_of_the_predictive_distribution(found):
    """By quadrature: the logarithm of a new C10 is m + tau z, so that its variance is Var m + E tau^2.

    Within four standard errors of 1000 effective draws, and sd within 15 %, as of the population itself.
    """
    mean, sd = by_quadrature(specimens_of(MODULI), NOISE_SD, 1.0)
    expected_sd = np.sqrt(sd[0] ** 2 + sd[1] ** 2 + mean[1] ** 2)
    logs = np.log([draw.values["C10"] for draw in found.patient.ensemble(1024)])
    assert abs(logs.mean() - mean[0]) < 4 * expected_sd / np.sqrt(1000)
    assert abs(logs.std() / expected_sd - 1) < 0.15
    assert logs.std() > 2 * np.log([draw.values["C10"] for draw in found.complete.ensemble(256)]).std()


@pytest.mark.slow
def test_they_are_stable_where_some_patients_of_the_population_are_not():
    specimens = {
        f"s{place}": tq.simulate("mooney-rivlin", {"C10": C10, "C01": C01}, STRETCH, noise_sd=0.005, seed=place)
        for place, (C10, C01) in enumerate(TRUTHS)
    }
    patient = tq.fit_population(specimens, material="mooney-rivlin", discrepancy="none", noise_sd=0.005).patient

    everyone, stable = patient.ensemble(256, admissible=False), patient.ensemble(256)
    assert not all(rises(draw, everyone.ranges) for draw in everyone)
    assert all(rises(draw, stable.ranges) for draw in stable)
    assert stable.admissible_share < 1


@pytest.mark.slow
@pytest.mark.skipif(CCX is None, reason="CalculiX (ccx) is not installed: make system")
def test_their_cards_give_the_stress_of_their_law(found, tmp_path):
    """CalculiX on one element, against W = C10 (I1 - 3) with C10 as the draw has it."""
    ensemble = found.patient.ensemble(3)
    cards = card_format("calculix").cards(ensemble, CardSettings())
    loads = [(1.3, FREE, FREE), (0.8, FREE, FREE), (1.2, 1.2, FREE)]
    for draw, text, row in zip(ensemble, cards.files.values(), cards.index, strict=True):
        modulus = draw.values["C10"]

        def energy(stretches, modulus=modulus):
            return modulus * (sum(stretch**2 for stretch in stretches) - 3)

        wanted = [reference(energy, row["bulk_modulus"], load) for load in loads]
        assert calculix(text, loads, tmp_path) == pytest.approx(wanted, rel=1e-5)
        assert "a new specimen of the population of 6 specimens" in " ".join(text.replace("**", "").split())
    assert cards.warnings[0].startswith("The draws are those of a new specimen of the population of 6 specimens")


@pytest.mark.slow
def test_it_is_said_that_the_model_error_of_the_specimens_is_left_out():
    specimens = specimens_of(MODULI)
    patient = tq.fit_population(specimens, discrepancy="constant", noise_sd=NOISE_SD).patient
    assert "their model error (constant) is left out" in patient.ensemble(2).origin
