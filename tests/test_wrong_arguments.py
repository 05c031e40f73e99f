"""Wrong arguments of public functions: one message, which names the argument."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import tissuq as tq

STRETCH = np.linspace(0.8, 1.3, 12)
DATA = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd=0.02, seed=1)
TABLE = pd.DataFrame({"stretch": STRETCH, "stress [MPa]": DATA.stress})
POSTERIOR = tq.fit(DATA, discrepancy="none", noise_sd=0.02)
DRAWS = POSTERIOR.ensemble(2)
SPECIMENS = dict.fromkeys("abc", DATA)
CONTROL = np.linspace(0.1, 1, 8)


def force(parameters, depth):
    return parameters["mu"] * depth


def calibrated(**options):
    return tq.calibrate(CONTROL, 0.4 * CONTROL, force, {"mu": tq.Uniform(0.1, 1)}, noise_sd=0.01, **options)


def pooled(**options):
    return tq.fit_population(SPECIMENS, discrepancy="none", **options)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: tq.simulate("neo-hookean", None, STRETCH), "needs the parameters C10; it was given None"),
        (lambda: tq.simulate("neo-hookean", {"C10": np.nan}, STRETCH), "C10 is nan"),
        (lambda: tq.simulate("neo-hookean", {"C10": "x"}, STRETCH), "C10 must be an array of numbers"),
        (lambda: tq.simulate("neo-hookean", {"C10": 1.0}, STRETCH, noise_sd=None), "noise_sd must be zero or positive"),
        (lambda: tq.simulate("neo-hookean", {"C10": 1.0}, STRETCH, noise_sd="1 N"), "'N' is a force"),
        (lambda: tq.simulate("neo-hookean", {"C10": 1.0}, STRETCH, seed=1.5), "seed must be a whole number"),
        (lambda: tq.engineering_stress("yeoh", "uniaxial", [1.1], [1, 0, 0]), r"tissuq.materials\(\)\['yeoh'\]"),
        (lambda: tq.initial_shear_modulus("yeoh", [1, 0, 0]), "material must be an object"),
        (lambda: tq.initial_shear_modulus(None, [1]), r"one of tissuq.materials\(\), not None"),
        (lambda: tq.engineering_stress(tq.materials()["yeoh"](), 3, [1.1], [1, 0, 0]), "loading_modes.*, not 3"),
        (lambda: tq.FunctionLaw(3), "a law is a function, not 3"),
        (lambda: tq.read_sizes(3), "the file of a table of sizes is needed, not 3"),
        (lambda: tq.read(TABLE, columns="stress"), "columns must be by name, such as .*, not 'stress'"),
        (lambda: tq.read(TABLE, columns="stress", area="3 mm2"), "columns must be by name, such as .*, not 'stress'"),
        (lambda: tq.read(TABLE, dimensions=3), "dimensions must be by name, such as .*, not 3"),
        (lambda: tq.fit(TABLE, only=["A"]), "only must be by name, such as .*, not .'A'."),
        (lambda: tq.read(TABLE, name=3), "name must be a text, not 3"),
        (lambda: tq.read(TABLE, stress_type=["cauchy"]), "stress_type must be a text, not .'cauchy'."),
        (lambda: tq.write_cards(DRAWS, "cards", ["abaqus"]), "there is no format of cards named"),
        (lambda: tq.write_cards(DRAWS, "cards", name=3), "'3' cannot name a material"),
        (lambda: tq.finite_elements.FElupeMaterial(3), "an object of tissuq.Material, not 3"),
        (lambda: DATA.averaged(None), "size must be a number of rows, one or more, not None"),
        (lambda: POSTERIOR.summary(parameters=-1), "parameters must be symbols, not -1"),
        (lambda: POSTERIOR.plot_parameters(-1), "parameters must be symbols, not -1"),
        (lambda: POSTERIOR.plot(prob="high"), "prob must be between 0 and 1, not 'high'"),
        (lambda: POSTERIOR.plot_prediction("planar", "x"), "must be an array of numbers"),
        (lambda: POSTERIOR.inside_bands(discrepancy=[]), "discrepancy must be True or False"),
        (lambda: POSTERIOR.predictive_coverage(prob=[]), "prob must be between 0 and 1"),
        (lambda: tq.Experiment("uniaxial", STRETCH, DATA.stress, name=3), "name must be a text, such as '3', not 3"),
        (lambda: DATA.labelled(specimen=None), "specimen must be a text"),
        (lambda: tq.fit_laws(DATA, None), "laws must be 'all', or names"),
        (lambda: tq.fit_laws(DATA, []), "and one at least"),
        (lambda: POSTERIOR.scores(3), "measurements are needed"),
        (lambda: POSTERIOR.update(None), "measurements are needed"),
        (lambda: POSTERIOR.design(3), "candidates must be such as 'planar 1:1.5 20', not 3"),
        (lambda: POSTERIOR.design(target=3), "target must be 'modulus'.* not 3"),
        (lambda: POSTERIOR.design(points="many"), "points must be whole numbers, not 'm'"),
        (lambda: POSTERIOR.design(seed="x"), "seed must be a whole number"),
        (lambda: POSTERIOR.ensemble(1.5), "one draw or more, not 1.5"),
        (lambda: POSTERIOR.prior_predictive(-1), "draws must be one or more, not -1"),
        (lambda: POSTERIOR.predict([1.1], prob="high"), "prob must be between 0 and 1, not 'high'"),
        (lambda: POSTERIOR.predict([1.1], channel="x"), "no number x"),
        (lambda: POSTERIOR.initial_shear_modulus.hdi(95), "prob must be between 0 and 1, not 95"),
        (lambda: POSTERIOR.initial_shear_modulus.quantile([0.5, 97.5]), "probabilities must be from 0 to 1"),
        (lambda: POSTERIOR.stability("planar", [0.9, -1.0]), "stretch -1 at position 1 is not positive"),
        (lambda: POSTERIOR.stability("planar", points=0), "points must be one or more, not 0"),
        (lambda: DATA.labelled(stress_unit="banana"), "unit 'banana' is not known"),
        (lambda: POSTERIOR.save(None), "a file is needed, not None"),
        (lambda: tq.write_cards(POSTERIOR, "cards"), "draws are needed, as posterior.ensemble"),
        (lambda: tq.write_cards(DRAWS, None), "a new folder is needed, not None"),
        (lambda: pooled(parameters=-1), "parameters to pool must be a list of C10, not -1"),
        (lambda: pooled(spread="wide"), "spread must be a positive number, not 'wide'"),
        (lambda: pooled(noise_sd=[0.02, 0.03, 0.02]), "noise_sd must be one for all, or by specimen"),
        (lambda: pooled(tolerances=0.1), "tolerances must be such as"),
        (lambda: pooled(shared_discrepancy="none"), "shared_discrepancy must be True or False"),
        (lambda: calibrated(runs="many"), "the number of runs must be 1 or more, not 'many'"),
        (lambda: calibrated(refine=None), "further runs must be 0 or more, not None"),
        (lambda: calibrated(workers="all"), "workers must be at least 1, not 'all'"),
        (lambda: calibrated(zero_load="x"), "zero load must be a finite number, not 'x'"),
        (lambda: calibrated(correlations=0.5), "correlations must be by pairs of parameters"),
        (lambda: calibrated(emulator="old"), "emulator must be that of an earlier calibration, not 'old'"),
        (lambda: calibrated(folder=3), "a folder is needed, not 3"),
        (lambda: tq.write_cards(DRAWS, "cards", bulk_modulus="2 GPa"), "a bulk modulus must be positive, not '2 GPa'"),
        (lambda: DRAWS.stress(None, [1.1]), "no loading mode named 'None'"),
        (lambda: DRAWS.stress("planar", [-0.1]), "stretch -0.1 at position 0 is not positive"),
        (lambda: DRAWS.stress("planar", "x"), "stretch must be an array of numbers"),
    ],
)
def test_the_message_names_the_argument(call, message):
    with pytest.raises(tq.TissuqError, match=message):
        call()


def test_one_value_serves_where_several_may_be_given():
    ranked = POSTERIOR.design(points=5)
    pd.testing.assert_frame_equal(ranked, POSTERIOR.design(None, None, points=[5]))
    assert 5 in ranked["points"].to_numpy()
    assert DRAWS.stress("planar", 1.1).shape == (2, 1)
    noisy = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, noise_sd="20 kPa", seed=1)
    assert noisy.stress == pytest.approx(DATA.stress, rel=1e-12)


def test_a_table_is_scored_and_joined_as_it_is_fitted():
    pd.testing.assert_frame_equal(POSTERIOR.scores(TABLE), POSTERIOR.scores(tq.read(TABLE)))
    more = tq.simulate("neo-hookean", {"C10": 0.5}, [1.05, 1.15], noise_sd=0.02, seed=2)
    table = pd.DataFrame({"stretch": more.stretch, "stress [MPa]": more.stress})
    assert POSTERIOR.update(table).summary().equals(POSTERIOR.update(more).summary())
