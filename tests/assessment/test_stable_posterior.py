"""Posteriors of stable materials alone, against sums over a grid with closed forms of the Mooney-Rivlin material."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from tissuq.assessment.stable_posterior import modes_named
from tissuq.errors import InputError, ModelError

STRETCH = np.linspace(0.7, 1.6, 12)
NOISE = 0.1
PRIORS = {"C10": tq.Uniform(0, 2), "C01": tq.Uniform(-1, 1)}
CELLS = 500


def measured():
    return tq.simulate("mooney-rivlin", {"C10": 0.3, "C01": -0.12}, STRETCH, noise_sd=NOISE, seed=4)


def is_stable(C10, C01):
    """Return whether the criteria hold in uniaxial loading, at the stretches at which they are looked at."""
    found = np.ones(np.broadcast_shapes(C10.shape, C01.shape), dtype=bool)
    for l in {*np.linspace(1, 0.7, 31), *np.linspace(1, 1.6, 31)}:  # noqa: E741 (the symbol of the formulas)
        squares = [l**2, 1 / l, 1 / l]
        own = [4 * (C10 * each + C01 / each) for each in squares]  # second derivatives of W by logarithmic strains
        found &= (own[0] + own[2] > 0) & ((own[0] + own[2]) * (own[1] + own[2]) > own[2] ** 2)
        if l != 1:
            found &= C10 + C01 / l > 0  # Baker-Ericksen: the axes that differ have a third one of 1 / sqrt(l)
        found &= (1 + 2 / l**3) * (C10 + C01 / l) - (l - l**-2) * C01 / l**2 > 0  # the stress rises
    return found


def middles(low, high):
    return low + (high - low) * (np.arange(CELLS) + 0.5) / CELLS


def test_it_is_the_posterior_under_the_prior_cut_to_what_is_stable():
    data = measured()
    posterior = tq.fit(
        data, material="mooney-rivlin", discrepancy="none", noise_sd=NOISE, priors=PRIORS, stable_in="uniaxial"
    )
    basis = 2 * (STRETCH - STRETCH**-2)[:, None] * np.column_stack([np.ones(12), 1 / STRETCH])
    whole = is_stable(middles(0, 2)[:, None], middles(-1, 1)).mean()
    sd = NOISE * np.sqrt(np.diag(np.linalg.inv(basis.T @ basis)))
    best = np.linalg.lstsq(basis, data.stress, rcond=None)[0]
    C10, C01 = np.meshgrid(
        *(middles(max(mid - 6 * s, low), min(mid + 6 * s, high))
          for mid, s, low, high in zip(best, sd, (0, -1), (2, 1), strict=True)),
        indexing="ij",
    )  # fmt: skip
    residual = data.stress - np.stack([C10, C01], axis=-1) @ basis.T
    log_density = -0.5 * (residual**2).sum(axis=-1) / NOISE**2 - 12 * np.log(NOISE * np.sqrt(2 * np.pi))
    weights = np.exp(log_density) * is_stable(C10, C01)
    cell = (C10[1, 0] - C10[0, 0]) * (C01[0, 1] - C01[0, 0])
    solution, count = posterior.solution, len(posterior.solution.mixture.weights)
    # Tolerances: four standard errors of what is known by draws, so that 1 of 4000 such tests fails by chance.
    share = weights.sum() / np.exp(log_density).sum()
    assert 0.05 < share < 0.7
    assert solution.stable_share == pytest.approx(share, rel=4 * np.sqrt((1 - share) / count))
    assert solution.stable_prior_share == pytest.approx(whole, abs=4 * np.sqrt(whole * (1 - whole) / 10_000))
    log_evidence = np.log(weights.sum() * cell / 4 / whole)  # the box has density 1 / 4
    assert posterior.log_evidence == pytest.approx(log_evidence, abs=4 * posterior.log_evidence_error)
    assert posterior.log_evidence_error < 0.1
    for symbol, values in (("C10", C10), ("C01", C01)):
        mean = (weights * values).sum() / weights.sum()
        sd = np.sqrt((weights * (values - mean) ** 2).sum() / weights.sum())
        assert posterior.marginals[symbol].mean == pytest.approx(mean, abs=4 * sd / np.sqrt(count))
        assert posterior.marginals[symbol].sd == pytest.approx(sd, rel=0.15)


def test_nothing_changes_where_everything_is_stable():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=NOISE, seed=1)
    options = {"discrepancy": "none", "noise_sd": NOISE}
    stable, other = tq.fit(data, **options, stable_in="all"), tq.fit(data, **options)
    assert (stable.solution.stable_share, stable.solution.stable_prior_share) == (1, 1)
    assert stable.log_evidence == other.log_evidence
    assert stable.marginals["C10"].mean == pytest.approx(
        other.marginals["C10"].mean, abs=0.1 * other.marginals["C10"].sd
    )
    assert stable.warnings == other.warnings


@pytest.mark.slow
def test_a_negative_modulus_is_left_out_and_the_data_are_said_to_contradict():
    data = tq.datasets.load("rubber-treloar-uniaxial")
    posterior = tq.fit(
        data, material="mooney-rivlin", discrepancy="none", stable_in=["uniaxial", "planar"], tolerances="as-tested"
    )
    values = {symbol: drawn.ravel() for symbol, drawn in posterior.solution.draws.items()}
    assert (values["C10"] + values["C01"]).min() > 0
    assert posterior.initial_shear_modulus.quantile(0.0) >= 0
    assert posterior.stable_ranges["uniaxial"].probability == 1
    assert not any("rarely stable" in text for text in posterior.warnings)
    assert any("the data contradict the stability constraint" in text for text in posterior.warnings)
    assert posterior.data.attrs["stable_in"] == "uniaxial, planar"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("discrepancy", "low", "high"),
    [("taylor", 0.98, 1.0), pytest.param("auto", 0.7, 0.95, marks=pytest.mark.slow)],
    ids=["taylor", "auto"],
)
def test_an_energy_discrepancy_is_cut_with_its_material(discrepancy, low, high):
    data = tq.datasets.load("brain-cortex-uniaxial")
    posterior = tq.fit(data, discrepancy=discrepancy, stable_in="uniaxial", tolerances="as-tested")
    solution = posterior.solution
    assert {name: found.probability for name, found in posterior.stable_ranges.items()}["uniaxial"] == 1
    assert low < solution.stable_share < high
    assert sum(solution.members.values()) == pytest.approx(1)
    assert solution.drawn_discrepancy.shape == (*solution.shape, len(data))
    assert posterior.predictive_coverage() > 0.9
    assert posterior.log_evidence_error < 0.05
    assert "boxes" not in posterior.assess().evidence_changes


def test_a_material_that_is_never_stable_is_refused_with_what_to_do():
    data = tq.simulate("mooney-rivlin", {"C10": 0.1, "C01": -0.5}, STRETCH, noise_sd=0.001, seed=1)
    with pytest.raises(ModelError, match=r"only 0 of 40000 draws.*Choose another one"):
        tq.fit(data, material="mooney-rivlin", discrepancy="none", noise_sd=0.001, stable_in="uniaxial")


def test_loading_modes_are_named_or_all():
    assert modes_named("all") == modes_named(["uniaxial", "equibiaxial", "planar"])
    assert modes_named(["planar", "planar"]) == ("planar",)
    assert modes_named(()) == ()
    with pytest.raises(InputError, match="'all' cannot be combined"):
        modes_named(["all", "planar"])
    with pytest.raises(ModelError, match="sideways"):
        modes_named("sideways")
