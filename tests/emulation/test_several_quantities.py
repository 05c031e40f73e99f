"""Several quantities that tell of the same parameters, each in its own unit, beside closed forms."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import tissuq as tq
from tissuq.emulation.likelihood import Likelihood
from tissuq.errors import InputError, ModelError

CONTROL = {"force": np.linspace(0.1, 1, 8), "shift": np.linspace(0.2, 0.8, 5)}
NOISE = {"force": 0.05, "shift": 2e-7}
PRIORS = {"k": tq.Uniform(0.5, 3.0), "m": tq.Uniform(0.5, 3.0)}


def linear(parameters, control):
    """Force in N and displacement in m, by which k and m are told together only."""
    k, m = parameters["k"], parameters["m"]
    return {"force": (k + m) * control["force"], "shift": 1e-6 * (k - m) * (1 + control["shift"])}


def measured(function, truth, seed=0):
    generator = np.random.default_rng(seed)
    return {name: values + NOISE[name] * generator.standard_normal(len(values))
            for name, values in function(truth, CONTROL).items()}  # fmt: skip


@pytest.mark.slow
def test_two_quantities_give_the_closed_form_together():
    data = measured(linear, {"k": 1.7, "m": 1.3})
    found = tq.calibrate(CONTROL, data, linear, PRIORS, discrepancy="none", noise_sd=NOISE, runs=10)
    columns = np.vstack([np.outer(CONTROL["force"], [1, 1]) / NOISE["force"],
                         np.outer(1e-6 * (1 + CONTROL["shift"]), [1, -1]) / NOISE["shift"]])  # fmt: skip
    standard = np.concatenate([data[name] / NOISE[name] for name in data])
    cov = np.linalg.inv(columns.T @ columns)
    for symbol, mean, sd in zip("km", cov @ columns.T @ standard, np.sqrt(np.diag(cov)), strict=True):
        assert found.marginals[symbol].mean == pytest.approx(mean, abs=0.05 * sd)
        assert found.marginals[symbol].sd == pytest.approx(sd, rel=0.05)
    band = found.predict()
    assert band["quantity"].tolist() == ["force"] * 8 + ["shift"] * 5
    assert found.predictive_coverage() > 0.8


@pytest.mark.slow
@pytest.mark.parametrize("discrepancy", ["none", "gp-pinned"])
def test_each_has_noise_and_discrepancy_of_its_own(discrepancy):
    found = tq.calibrate(CONTROL, measured(linear, {"k": 1.7, "m": 1.3}), linear, PRIORS, discrepancy=discrepancy,
                         noise_sd={"force": "unknown", "shift": 2e-7}, runs=10)  # fmt: skip
    errors = {"none": [], "gp-pinned": ["c_force", "psi_force"]}[discrepancy]
    more = {"none": [], "gp-pinned": ["c_shift", "psi_shift"]}[discrepancy]
    assert found.problem.symbols == ("k", "m", *errors, "noise_sd_force", *more)
    values = {"k": 1.6, "m": 1.2, "c_force": 0.2, "psi_force": 0.5, "noise_sd_force": 0.07, "c_shift": 3e-7,
              "psi_shift": 0.4}  # fmt: skip
    row = np.array([[values[symbol] for symbol in found.problem.symbols]])
    cov = np.diag(np.repeat([0.07**2, 4e-14], [8, 5]))
    for start, name in ((0, "force"), (8, "shift")) if errors else ():
        s = CONTROL[name][:, None] / values[f"psi_{name}"]
        kernel = np.exp(-0.5 * (s - s.T) ** 2) - np.exp(-0.5 * (s**2 + s.T**2)) * (1 + s * s.T)
        rows = slice(start, start + len(s))
        cov[rows, rows] += values[f"c_{name}"] ** 2 * kernel
    mean = np.concatenate(list(linear({"k": 1.6, "m": 1.2}, CONTROL).values()))
    scale = np.repeat([1, 1e6], [8, 5])
    expected = multivariate_normal(mean * scale, cov * np.outer(scale, scale)).logpdf(found.problem.measured * scale)
    exact = Likelihood(found.problem, found.emulator, has_error=False)
    assert exact.log_density(row)[0] == pytest.approx(expected + 5 * np.log(1e6), rel=1e-5)
    new = exact.replicates(np.repeat(row, 4000, axis=0), np.random.default_rng(0).standard_normal((4000, 13)))
    about = cov - np.diag(np.repeat([0.07**2, 4e-14], [8, 5]))  # of the discrepancy
    spread = about - about @ np.linalg.solve(cov, about) + (cov - about)
    np.testing.assert_allclose(new.std(axis=0), np.sqrt(np.diag(spread)), rtol=0.05)


def test_what_was_measured_at_one_control_has_no_discrepancy_and_is_said_to_have_none():
    control = {"force": CONTROL["force"], "shift": np.full(2, 0.5)}
    data = {"force": 3 * control["force"], "shift": [6.1e-7, 5.8e-7]}
    found = tq.calibrate(control, data, linear, PRIORS, noise_sd=NOISE, runs=10)
    assert found.problem.symbols == ("k", "m", "c_force", "psi_force")
    s = control["force"][:, None] / 0.5
    kernel = np.exp(-0.5 * (s - s.T) ** 2) - np.exp(-0.5 * (s**2 + s.T**2)) * (1 + s * s.T)
    of_force = multivariate_normal(2.8 * control["force"], 0.2**2 * kernel + NOISE["force"] ** 2 * np.eye(8))
    of_shift = multivariate_normal(0.4e-6 * np.full(2, 1.5) * 1e6, (NOISE["shift"] * 1e6) ** 2 * np.eye(2))
    expected = of_force.logpdf(data["force"]) + of_shift.logpdf(1e6 * np.array(data["shift"])) + 2 * np.log(1e6)
    exact = Likelihood(found.problem, found.emulator, has_error=False)
    assert exact.log_density(np.array([[1.6, 1.2, 0.2, 0.5]]))[0] == pytest.approx(expected, rel=1e-5)
    (text,) = [text for text in found.warnings if text.code == "no-discrepancy"]
    assert text.startswith("of shift, measured at one control, no error of the forward model is allowed for")
    assert not any("far from those" in text for text in found.warnings)
    alone = tq.calibrate(np.full(6, 0.5), 1e-6 + 1e-7 * np.arange(6), lambda p, x: 1e-6 * p["k"] * x,
                         {"k": tq.Uniform(0.5, 6)}, runs=6)  # fmt: skip
    assert alone.problem.symbols == ("k", "noise_sd")
    assert [text.code for text in alone.warnings] == ["no-discrepancy"]


@pytest.mark.slow
def test_a_quantity_of_a_small_unit_is_emulated_as_well_as_the_other():
    def curved(parameters, control):
        k, m = parameters["k"], parameters["m"]
        return {"force": np.sin(k) * control["force"], "shift": 1e-6 * np.exp(-m * control["shift"])}

    found = tq.calibrate(
        CONTROL, measured(curved, {"k": 1.2, "m": 1.5}), curved, PRIORS, discrepancy="none", noise_sd=NOISE, runs=24
    )
    points = np.random.default_rng(3).uniform(0.5, 3.0, (50, 2))
    mean, _ = found.emulator.moments(points)
    for number, (start, stop) in enumerate(found.problem.quantities.values()):
        truth = np.array([list(curved({"k": k, "m": m}, CONTROL).values())[number] for k, m in points])
        assert np.abs(mean[:, start:stop] - truth).max() < 0.02 * np.abs(truth).max()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"measured": np.ones(13)}, "must both be arrays, or both mappings"),
        ({"measured": {"force": np.ones(8)}}, "what was measured is force"),
        ({"noise_sd": {"force": 0.1}}, "noise_sd is given for force; what was measured is force, shift"),
        ({"measured": {"force": np.ones(7), "shift": np.ones(5)}}, "8 controls of force and 7 measured values"),
        ({"forward": lambda p, control: np.ones(13)}, "must return a dictionary of outputs for force, shift"),
        ({"forward": lambda p, c: {"force": np.ones(8), "shift": np.ones(4)}}, r"outputs of shift of shape \(4,\)"),
    ],
)
def test_what_does_not_belong_together_is_told(changes, words):
    usual = {"control": CONTROL, "measured": measured(linear, {"k": 1.7, "m": 1.3}), "forward": linear,
             "priors": PRIORS, "noise_sd": NOISE, "runs": 8}  # fmt: skip
    with pytest.raises((InputError, ModelError), match=words):
        tq.calibrate(**(usual | changes))
