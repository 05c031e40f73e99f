"""The posterior under energy discrepancies, against full covariance matrices and dense sums over the amplitudes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import factorial
from scipy.stats import halfcauchy

import tissuq as tq
from marks import slow_but
from tissuq.errors import TissuqError
from tissuq.inference.enumerators.amplitude_lattice import AmplitudeLattice
from tissuq.inference.enumerators.lattice import Lattice
from tissuq.model.discrepancy import discrepancy_named

STRETCH = np.array([0.7, 0.8, 0.9, 0.95, 1.1, 1.2, 1.35, 1.5, 1.7, 1.9, 2.1, 2.4])
X = STRETCH**2 + 2 / STRETCH - 3
UNIT = 2 * (STRETCH - STRETCH**-2)
NOISE_SD = 0.05


def bell(score):
    return np.exp(-0.5 * score**2)


def by_invariant(covariance):
    """The covariance of the stress when W1 has a covariance."""
    return np.outer(UNIT, UNIT) * covariance


def taylor(length):
    return by_invariant(np.exp(np.outer(X, X) / (length * X.max()) ** 2) - 1)


def log(length):
    t = np.log(1 + X)
    scale = length * t.max()
    return by_invariant(bell((t[:, None] - t) / scale) - np.outer(bell(t / scale), bell(t / scale)))


def small_strain(length):
    t = np.log1p(X / (length * X.max())) / 4
    return by_invariant(bell(t[:, None] - t) - np.outer(bell(t), bell(t)))


def zero_modulus(length):
    stress = 2 * (1 - STRETCH**-3) - UNIT
    return np.outer(stress, stress)


def valanis_landel(length):
    """The stress is (q(e) - q(-e / 2)) / l; a process given its value and slope at zero."""
    e = np.log(STRETCH)
    ends = np.concatenate([e, -0.5 * e])
    scale = length * (ends.max() - ends.min())
    z = ends / scale
    prior = bell(z[:, None] - z)
    known = np.column_stack([bell(z), z * bell(z)])  # covariance with q(0), and with scale q'(0)
    given = prior - known @ known.T
    return separable(given)


def separable(covariance):
    """The covariance of the stress (q(e) - q(-e / 2)) / l when q has a covariance (2n, 2n) at these places."""
    take = np.hstack([np.diag(1 / STRETCH), -np.diag(1 / STRETCH)])
    return take @ covariance @ take.T


def hencky(length):
    """Normal Taylor coefficients of q from the second power on: the sum of (e e' / L^2)^k / k!."""
    e = np.log(STRETCH)
    ends = np.concatenate([e, -0.5 * e])
    z = ends / (length * (ends.max() - ends.min()))
    terms = [np.outer(z, z) ** k / factorial(k) for k in range(2, 60)]
    return separable(sum(terms))


def second_invariant(length):
    """W2 = g(y), W1 = -g(0)."""
    y = 2 * STRETCH + STRETCH**-2 - 3
    of_second = 2 * (1 - STRETCH**-3)
    z = y / (length * y.max())
    covariance = np.exp(np.outer(z, z)) * np.outer(of_second, of_second)
    return covariance - np.outer(of_second, UNIT) - np.outer(UNIT, of_second) + np.outer(UNIT, UNIT)


KERNELS = {
    "taylor": taylor,
    "log": log,
    "small-strain": small_strain,
    "zero-modulus": zero_modulus,
    "valanis-landel": valanis_landel,
    "hencky": hencky,
    "second-invariant": second_invariant,
}


def measured(seed=0, noise=NOISE_SD):
    truth = {"C10": 0.4, "C20": 0.03, "C30": 0.002}
    return tq.simulate("yeoh", truth, STRETCH, noise_sd=noise, seed=seed)


def dense(names, data, noise_sd, columns=UNIT[:, None], log_noise_prior=None):
    """Return log evidence, and mean and sd of the first linear parameter; noise_sd may be several with weights."""
    blocks = [block() for block in discrepancy_sum(names)]
    scale = np.median(np.abs(data.stress / UNIT))
    grid = np.exp(np.arange(-16, 10, 0.25)) * scale
    log_prior = halfcauchy.logpdf(grid, scale=scale) + np.log(0.25 * grid)
    log_weight, means, variances = [], [], []
    noise = np.atleast_1d(noise_sd)
    for lengths in np.ndindex(*(len(block.lengths) for block in blocks)):
        kernels = [KERNELS[b.name](b.lengths[k]) for b, k in zip(blocks, lengths, strict=True)]
        share = -sum(np.log(len(block.lengths)) for block in blocks)
        amplitudes = np.stack(np.meshgrid(*[grid] * len(kernels), indexing="ij"), -1).reshape(-1, len(kernels))
        prior = sum(np.meshgrid(*[log_prior] * len(kernels), indexing="ij")).ravel()
        for j, sd in enumerate(noise):
            total = np.einsum("mk,kij->mij", amplitudes**2, np.array(kernels)) + sd**2 * np.eye(len(UNIT))
            white = np.linalg.inv(np.linalg.cholesky(total))
            left, right = white @ columns, white @ data.stress
            precision = left.swapaxes(1, 2) @ left
            covariance = np.linalg.inv(precision)
            mean = (covariance @ (left.swapaxes(1, 2) @ right[:, :, None]))[:, :, 0]
            rest = right - (left @ mean[:, :, None])[:, :, 0]
            log_determinant = np.log(np.einsum("mii->mi", white)).sum(axis=1)
            value = log_determinant - 0.5 * (rest**2).sum(axis=1) - 0.5 * np.linalg.slogdet(precision)[1]
            value += -0.5 * (len(UNIT) - columns.shape[1]) * np.log(2 * np.pi) + prior + share
            log_weight.append(value + (0 if log_noise_prior is None else log_noise_prior[j]))
            means.append(mean[:, 0])
            variances.append(covariance[:, 0, 0])
    log_weight, means, variances = map(np.concatenate, (log_weight, means, variances))
    top = log_weight.max()
    weight = np.exp(log_weight - top)
    evidence = top + np.log(weight.sum()) - columns.shape[1] * np.log(50)  # the width of every prior
    weight /= weight.sum()
    mean = weight @ means
    return evidence, mean, np.sqrt(weight @ (variances + (means - mean) ** 2))


def assert_is(posterior, evidence, mean, sd):
    """Hold log evidence, and mean and sd of C10, against those of dense covariances."""
    assert abs(posterior.log_evidence - evidence) < posterior.log_evidence_error + 1e-3
    c10 = posterior.summary().loc["C10"]
    assert abs(c10["mean"] - mean) < 2e-3 * sd
    assert abs(c10["sd"] / sd - 1) < 2e-3


def discrepancy_sum(names):
    return [type(block) for block in discrepancy_named(names).sums[0].blocks]


EACH = [*KERNELS, "taylor+zero-modulus", "log+zero-modulus", "taylor+second-invariant"]


@pytest.mark.parametrize("names", EACH)
def test_an_energy_or_a_sum_of_two_is_its_dense_covariance(names):
    noise_sd = NOISE_SD / 20 if names == "small-strain" else NOISE_SD  # C10 is not to be cut off at zero
    data = measured(noise=noise_sd)
    posterior = tq.fit(data, discrepancy=names, noise_sd=noise_sd, priors={"C10": tq.Uniform(0, 50)})
    assert_is(posterior, *dense(names, data, noise_sd))


def test_unknown_noise_is_integrated_too():
    data = measured(seed=2)
    priors = {"C10": tq.Uniform(0, 50), "noise_sd": tq.Uniform(0, 2)}
    posterior = tq.fit(data, discrepancy="taylor", priors=priors, tolerances="as-tested")
    noise = np.exp(np.arange(np.log(0.005), np.log(1.9), 0.08))
    evidence, mean, sd = dense("taylor", data, noise, log_noise_prior=np.log(0.08 * noise / 2))
    assert abs(posterior.log_evidence - evidence) < posterior.log_evidence_error + 2e-3
    c10 = posterior.summary().loc["C10"]
    assert abs(c10["mean"] - mean) < 3e-3 * sd
    assert abs(c10["sd"] / sd - 1) < 3e-3


def test_a_material_with_three_parameters_keeps_them_apart():
    data = measured(seed=3)
    columns = np.column_stack([UNIT, 2 * X * UNIT, 3 * X**2 * UNIT])
    priors = {"C10": tq.Uniform(0, 50)} | dict.fromkeys(("C20", "C30"), tq.Uniform(-25, 25))
    posterior = tq.fit(data, material="yeoh", discrepancy="zero-modulus", noise_sd=NOISE_SD, priors=priors)
    assert_is(posterior, *dense("zero-modulus", data, NOISE_SD, columns))


def test_auto_is_the_mixture_of_its_sums():
    data = measured(seed=4)
    priors = {"C10": tq.Uniform(0, 50)}
    auto = tq.fit(data, discrepancy="auto", noise_sd=NOISE_SD, priors=priors)
    names = ["taylor", "log", "small-strain", "second-invariant", "hencky"]
    names += [f"{first}+{second}" for first in names[:3] for second in names[3:]]
    odds = np.array([0.25, 0.25, 0.0125, 0.25, 0.25, 1.0, 1.0, 1.0, 1.0, 0.05, 0.05])
    parts = [tq.fit(data, discrepancy=name, noise_sd=NOISE_SD, priors=priors) for name in names]
    evidence = np.array([part.log_evidence for part in parts])
    weights = odds / odds.sum() * np.exp(evidence - evidence.max())
    assert auto.log_evidence == pytest.approx(np.log(weights.sum()) + evidence.max(), abs=1e-6)
    weights /= weights.sum()
    assert [auto.solution.members[name] for name in names] == pytest.approx(list(weights), abs=1e-5)
    mean = weights @ [part.summary().loc["C10", "mean"] for part in parts]
    assert auto.summary().loc["C10", "mean"] == pytest.approx(mean, rel=1e-5)


@pytest.mark.parametrize("largest", [0.1, 100.0])
def test_a_lattice_that_ends_too_soon_is_made_again(monkeypatch, largest):
    data = measured(seed=4)
    evidence, whole = (fitted := tq.fit(data, discrepancy="taylor", noise_sd=NOISE_SD)).log_evidence, fitted.summary()
    monkeypatch.setattr("tissuq.inference.enumerators.nodes.MAX_RATIO_TO_DATA", largest)
    again = tq.fit(data, discrepancy="taylor", noise_sd=NOISE_SD)
    assert again.log_evidence == pytest.approx(evidence, abs=1e-6)
    np.testing.assert_allclose(again.summary().loc["C10"], whole.loc["C10"], rtol=1e-6)


def test_a_similar_fit_begins_with_the_longer_lattice_and_finds_the_same(monkeypatch):
    model = tq.fit(measured(seed=4), discrepancy="taylor", noise_sd=NOISE_SD).model
    shorter = AmplitudeLattice().solve([model])[0].log_evidence
    monkeypatch.setattr("tissuq.inference.enumerators.nodes.MAX_RATIO_TO_DATA", 0.1)
    made, lattice = [], AmplitudeLattice()
    monkeypatch.setattr("tissuq.inference.enumerators.nodes.Lattice", lambda *args: made.append(0) or Lattice(*args))
    evidences, counts = [], []
    for _ in range(2):
        evidences.append(lattice.solve([model])[0].log_evidence)
        counts.append(len(made))
    assert evidences == pytest.approx([shorter, shorter], abs=1e-6)
    assert counts[1] - counts[0] == counts[0] / 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("noise", "scale"),
    slow_but(
        [("known", 1e3), ("unknown", 1e-3)], [("known", 1e-3), ("known", 1e3), ("unknown", 1e-3), ("unknown", 1e3)]
    ),
)
def test_the_unit_of_the_data_does_not_matter(noise, scale):
    data = measured(seed=5)
    other = tq.Experiment(mode="uniaxial", stretch=STRETCH, stress=scale * data.stress)
    sds = ("unknown", "unknown") if noise == "unknown" else (NOISE_SD, scale * NOISE_SD)
    first, second = (
        tq.fit(d, discrepancy="auto", noise_sd=sd).summary() for d, sd in zip((data, other), sds, strict=True)
    )
    assert np.allclose(scale * first.loc["C10"], second.loc["C10"], rtol=1e-6)


def test_many_data_sets_are_those_one_by_one():
    every = [measured(seed=seed) for seed in range(2)]
    together = tq.fit_many(every, discrepancy="auto", noise_sd=NOISE_SD)
    for data, found in zip(every, together, strict=True):
        alone = tq.fit(data, discrepancy="auto", noise_sd=NOISE_SD)
        assert found.log_evidence == pytest.approx(alone.log_evidence, abs=1e-9)
        assert np.allclose(found.summary().loc["C10"], alone.summary().loc["C10"], rtol=1e-9)


def test_a_bound_cuts_the_posterior_and_the_draws():
    data = measured(seed=6)
    free = tq.fit(data, discrepancy="taylor", noise_sd=NOISE_SD, priors={"C10": tq.Uniform(0, 50)})
    middle = free.summary().loc["C10", "mean"]
    cut = tq.fit(data, discrepancy="taylor", noise_sd=NOISE_SD, priors={"C10": tq.Uniform(middle, 50)})
    below = float(np.interp(middle, free.solution.marginals["C10"].points, free.solution.marginals["C10"].cumulative))
    expected = free.log_evidence + np.log(1 - below) + np.log(50 / (50 - middle))
    assert cut.log_evidence == pytest.approx(expected, abs=1e-3)
    assert cut.solution.draws["C10"].min() >= middle
    assert cut.summary().loc["C10", "hdi_low"] == pytest.approx(middle, abs=1e-3)


def test_predictions_at_the_data_are_those_of_the_dense_process():
    data = measured(seed=7)
    posterior = tq.fit(data, discrepancy="auto", noise_sd=NOISE_SD)
    band = posterior.predict(STRETCH, noise=False)
    exact = tq.simulate("yeoh", {"C10": 0.4, "C20": 0.03, "C30": 0.002}, STRETCH, noise_sd=0.0, seed=0).stress
    assert np.abs(band["median"] - exact).max() < 4 * NOISE_SD
    assert (band["high"] - band["low"] < 4 * NOISE_SD).all()
    mean = posterior.data["posterior_predictive"]["stress"].mean(("chain", "draw")).to_numpy()
    assert np.abs(mean - band["median"]).max() < 0.1 * NOISE_SD
    drawn = posterior.solution.draws["C10"][:, :, None] * UNIT + posterior.solution.drawn_discrepancy
    assert np.abs(np.quantile(drawn, 0.975, axis=(0, 1)) - band["high"]).max() < 0.15 * NOISE_SD


def test_what_lies_beyond_the_data_is_as_uncertain_as_the_prior_says():
    data = measured(seed=8)
    posterior = tq.fit(data, discrepancy="auto", noise_sd=NOISE_SD)
    width = np.diff(posterior.predict([2.4, 2.6, 3.0, 4.0], noise=False)[["low", "high"]], axis=1).ravel()
    assert (np.diff(width) > 0).all()
    assert width[-1] > 10 * width[0]


def test_the_reference_state_is_left_alone():
    data = measured(seed=9)
    posterior = tq.fit(data, discrepancy="auto", noise_sd=NOISE_SD)
    near = posterior.predict([1.0, 1.001], noise=False)
    alone = posterior.predict([1.0, 1.001], noise=False, discrepancy=False)
    assert near["high"][0] == pytest.approx(0.0, abs=1e-12)
    assert np.allclose(near["median"][1], alone["median"][1], rtol=2e-2)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"discrepancy": "auto", "method": "nuts"}, "exactly"),
        ({"discrepancy": "taylor", "priors": {"c1": tq.Uniform(0, 0.05)}}, "bound or is narrow"),
        ({"discrepancy": "taylor", "priors": {"c1": tq.Normal(1, 1, 0)}}, "bound or is narrow"),
        ({"discrepancy": "taylor", "priors": {"c1": tq.LogNormal(0.7, 0.05)}}, "bound or is narrow"),
        ({"discrepancy": "taylor+gp"}, "gp"),
        ({"discrepancy": "taylor+taylor"}, "different"),
    ],
)
def test_what_is_not_integrated_is_refused_in_words(options, words):
    with pytest.raises(TissuqError, match=words):
        tq.fit(measured(), **options)


def test_an_energy_among_a_hundred_thousand_points():
    stretch = np.linspace(0.7, 2.4, 100_000)
    data = tq.simulate("yeoh", {"C10": 0.4, "C20": 0.03, "C30": 0.002}, stretch, noise_sd=NOISE_SD, seed=1)
    posterior = tq.fit(data, discrepancy="taylor", noise_sd=NOISE_SD)
    c10 = posterior.summary().loc["C10"]
    assert abs(c10["mean"] - 0.4) < 5 * c10["sd"]
    assert c10["sd"] < 1e-2


def test_the_noise_has_the_marginal_of_its_dense_grid():
    data = measured(seed=2)
    priors = {"C10": tq.Uniform(0, 50), "noise_sd": tq.Uniform(0, 2)}
    found = tq.fit(data, discrepancy="taylor", priors=priors, tolerances="as-tested").solution.marginals["noise_sd"]
    noise = np.exp(np.arange(np.log(0.01), np.log(1.0), 0.03))
    evidences = np.array([dense("taylor", data, sd)[0] for sd in noise])
    weights = np.exp(evidences - evidences.max()) * noise
    weights /= weights.sum()
    mean = weights @ noise
    sd = np.sqrt(weights @ (noise - mean) ** 2)
    assert found.mean == pytest.approx(mean, rel=5e-3)
    assert found.sd == pytest.approx(sd, rel=2e-2)
    low, high = np.interp([0.025, 0.975], np.cumsum(weights) - 0.5 * weights, noise)
    assert found.quantile([0.025, 0.975]) == pytest.approx([low, high], rel=2e-2)


def test_the_noise_of_few_data_has_the_marginal_of_fits_with_known_noise():
    # Bounds cut C10 here, so that few of the very different points of all energies stand for the posterior.
    stretch = [0.75, 0.85, 0.95, 1.1, 1.25, 1.4, 1.6]
    data = tq.simulate("yeoh", {"C10": 0.4, "C20": 0.03, "C30": 0.002}, stretch, noise_sd=0.05, seed=0)
    priors = {"C10": tq.Uniform(0, 50)}
    unknown = priors | {"noise_sd": tq.Uniform(0, 1.2)}
    found = tq.fit(data, priors=unknown, tolerances="as-tested", noise="independent").marginals["noise_sd"]
    noise = np.exp(np.arange(np.log(0.004), np.log(1.2), 0.15))
    evidences = np.array([tq.fit(data, noise_sd=float(sd), priors=priors).log_evidence for sd in noise])
    weights = np.exp(evidences - evidences.max()) * noise
    weights /= weights.sum()
    assert found.mean == pytest.approx(weights @ noise, rel=1e-2)
    ends = np.exp(np.interp([0.025, 0.975], np.cumsum(weights), np.log(noise) + 0.075))
    assert found.quantile([0.025, 0.975]) == pytest.approx(ends, rel=3e-2)


UNUSUAL = {
    "a tenth of a percent of strain": (np.linspace(0.999, 1.001, 20), 0.01),
    "a wide range": (np.linspace(0.2, 8, 40), 0.1),
    "three stretches, many times": (np.repeat([0.8, 1.2, 1.5], 6), 0.02),
    "five points": (np.array([0.8, 0.9, 1.1, 1.2, 1.4]), 0.05),
    "far from the reference": (np.linspace(1.5, 3, 20), 0.1),
    "more noise than signal": (np.linspace(0.7, 1.8, 20), 20.0),
    "the wrong sign": (np.linspace(0.7, 1.8, 20), -0.1),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("noise", ["known", pytest.param("unknown", marks=pytest.mark.slow)])
@pytest.mark.parametrize("case", slow_but(["a tenth of a percent of strain", "five points", "the wrong sign"], UNUSUAL))
def test_unusual_data_give_finite_numbers_without_a_murmur(case, noise):
    stretch, sd = UNUSUAL[case]
    sign = np.sign(sd)
    data = tq.simulate("neo-hookean", {"C10": 1.0}, stretch, noise_sd=abs(sd), seed=1)
    data = tq.Experiment("uniaxial", stretch, sign * data.stress)
    posterior = tq.fit(data, discrepancy="auto", noise_sd=abs(sd) if noise == "known" else "unknown")
    table = posterior.summary()
    assert np.isfinite(table[["median", "hdi_low", "hdi_high"]].to_numpy()).all()
    assert np.isfinite(table.loc["C10", ["mean", "sd"]].to_numpy(dtype=float)).all()
    assert np.isfinite(posterior.predict([0.9, 1.2]).to_numpy()).all()
    low, high = posterior.summary().loc["C10", ["hdi_low", "hdi_high"]]
    assert 0 <= low < high
    assert low <= 1.0 <= high or sign < 0


def test_noise_that_is_far_too_small_is_told():
    stretch = np.linspace(0.7, 1.8, 20)
    data = tq.simulate("neo-hookean", {"C10": 1.0}, stretch, noise_sd=5.0, seed=1)
    warnings = tq.fit(data, discrepancy="auto", noise_sd=0.05).warnings
    assert any("noise is far smaller than the scatter" in text for text in warnings)


@pytest.mark.parametrize(
    "prior",
    [
        tq.Uniform(0.01, 0.02),
        tq.LogNormal(0.01, 0.05),
        tq.HalfCauchy(0.05),
        *(
            pytest.param(each, marks=pytest.mark.slow)
            for each in (tq.Uniform(0.06, 0.061), tq.Uniform(0, 2), tq.LogNormal(0.05, 0.02), tq.HalfNormal(0.01))
        ),
    ],
    ids=str,
)
def test_any_prior_of_the_noise_is_integrated(prior):
    # Against Gauss's rule in the logarithm of the noise within the prior, each with the noise known.
    data = measured(seed=2)
    fixed = {"C10": tq.Uniform(0, 50)}
    posterior = tq.fit(data, discrepancy="taylor", priors=fixed | {"noise_sd": prior}, tolerances="as-tested")
    low, high = np.log(np.clip(prior.quantile(np.array([1e-12, 1 - 1e-12])), 4e-3, 2.0))
    nodes, shares = np.polynomial.legendre.leggauss(60)
    noise = np.exp(0.5 * (low + high) + 0.5 * (high - low) * nodes)
    evidences = [tq.fit(data, discrepancy="taylor", noise_sd=float(sd), priors=fixed).log_evidence for sd in noise]
    log_weight = np.array(evidences) + prior.log_density(noise) + np.log(noise * 0.5 * (high - low) * shares)
    weight = np.exp(log_weight - log_weight.max())
    assert posterior.log_evidence == pytest.approx(log_weight.max() + np.log(weight.sum()), abs=5e-3)
    found = posterior.solution.marginals["noise_sd"]
    assert found.mean == pytest.approx(weight @ noise / weight.sum(), rel=5e-3)
    drawn = posterior.solution.draws["noise_sd"]
    assert prior.support[0] <= drawn.min()
    assert drawn.max() <= prior.support[1]


def test_a_block_without_stress_in_a_mode_changes_nothing():
    stretch = np.linspace(1.05, 2, 12)
    data = tq.simulate("neo-hookean", {"C10": 0.5}, stretch, noise_sd=0.2, seed=1, mode="planar")
    evidence = {
        name: tq.fit(data, discrepancy=name, noise_sd=0.2).log_evidence
        for name in ("none", "zero-modulus", "taylor", "taylor+zero-modulus")
    }
    assert evidence["zero-modulus"] == pytest.approx(evidence["none"], abs=2e-3)
    assert evidence["taylor+zero-modulus"] == pytest.approx(evidence["taylor"], abs=2e-3)


def test_in_much_noise_a_discrepancy_is_worth_as_much_as_none():
    data = measured(noise=1e4)
    priors = {"C10": tq.Uniform(0, 5), "c1": tq.HalfCauchy(0.5)}
    evidence = [
        tq.fit(data, discrepancy=name, noise_sd=1e4, priors=dict(list(priors.items())[:count])).log_evidence
        for name, count in (("none", 1), ("taylor", 2))
    ]
    assert evidence[1] == pytest.approx(evidence[0], abs=0.05)


@pytest.mark.parametrize("discrepancy", slow_but(["taylor"], ["taylor", "auto"]))
def test_a_toe_region_of_zero_stress_is_fitted(discrepancy):
    stress = np.array([0, 0, 0, 0, 0, 0, 0.1, 0.3, 0.6, 1.0, 1.5, 2.2])
    data = tq.Experiment("uniaxial", np.linspace(1.02, 1.4, 12), stress)
    assert np.isfinite(tq.fit(data, discrepancy=discrepancy).summary().loc["C10"]).all()


def test_a_flat_prior_leaves_no_evidence():
    posterior = tq.fit(measured(), discrepancy="taylor", noise_sd=NOISE_SD, priors={"C10": tq.Flat(0, 5)})
    assert posterior.log_evidence is None
