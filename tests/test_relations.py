"""Relations that hold whatever the numbers are: the same measurements in another form give the same answer."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
import pytest

import gallery
import tissuq as tq

YEOH = "yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.0}
STRETCH = np.array([0.85, 0.95, 1.05, 1.1, 1.2, 1.3, 1.4, 1.5])
NOISE_SD = 0.02
SHUFFLED = np.random.default_rng(0).permutation(len(STRETCH))
LAW = {"material": "mooney-rivlin", "discrepancy": "none"}
FITS = {"a law alone": {"material": "yeoh", "discrepancy": "none"}, "auto": {"discrepancy": "auto"}}
GRID = [0.9, 1.1, 1.3]


class Relation(NamedTuple):
    """Measurements, the same in another form with the noise of that form, and what that changes."""

    first: Any
    second: Any
    noise_sd: float = NOISE_SD
    factor: float = 1.0
    log_density: float = 0.0
    """What is added to the log evidence."""


def measured(mode="uniaxial", stretch=STRETCH):
    return tq.simulate(*YEOH, stretch, NOISE_SD, mode=mode, seed=3)


def again(data, rows=slice(None), factor=1.0, **labels):
    return tq.Experiment(data.mode, data.stretch[rows], factor * data.stress[rows], **labels)


def log_height(noise_sd):
    """Return the log of the largest density of a measurement."""
    return -0.5 * np.log(2 * np.pi * noise_sd**2)


@functools.cache
def relations():
    data, strip, shear = measured(), measured("constrained-uniaxial"), measured("simple-shear", STRETCH - 1)
    sheet = measured("biaxial", np.column_stack([STRETCH, STRETCH[::-1] ** 0.5]))
    tube = measured("thin-tube", np.column_stack([STRETCH, np.full(len(STRETCH), 1.1)]))
    count = len(STRETCH)
    with_rest = tq.Experiment("uniaxial", np.append(STRETCH, 1.0), np.append(data.stress, 0.0))
    halves = [again(data, slice(first, None, 2), specimen="A", name=str(first)) for first in (0, 1)]
    twice, root_2 = np.repeat(np.arange(count), 2), np.sqrt(2)
    pairs_of_rows = count * (2 * log_height(root_2 * NOISE_SD) - log_height(NOISE_SD))
    return {
        "stress times 1000": Relation(data, again(data, factor=1000), 1000 * NOISE_SD, 1000, -count * np.log(1000)),
        "reversed": Relation(data, again(data, slice(None, None, -1))),
        "shuffled": Relation(data, again(data, SHUFFLED)),
        "rows twice": Relation(data, again(data, twice), root_2 * NOISE_SD, log_density=pairs_of_rows),
        "a row at rest": Relation(data, with_rest, log_density=log_height(NOISE_SD)),
        "two tests of a specimen": Relation(again(data, specimen="A"), halves),
        "a strip as a sheet": Relation(
            strip, tq.Experiment("biaxial", np.column_stack([STRETCH, np.ones(count)]), strip.stress)
        ),
        "a tube as a sheet": Relation(tube, tq.Experiment("biaxial", tube.stretch, tube.stress)),
        "axes exchanged": Relation(sheet, tq.Experiment("biaxial", sheet.stretch[:, ::-1], sheet.stress[:, ::-1])),
        "shear to the other side": Relation(shear, tq.Experiment("simple-shear", 1 - STRETCH, -shear.stress)),
    }


NAMES = [
    "stress times 1000", "reversed", "shuffled", "rows twice", "a row at rest", "two tests of a specimen",
    "a strip as a sheet", "a tube as a sheet", "axes exchanged", "shear to the other side",
]  # fmt: skip
CASES = [("a law alone", name) for name in NAMES]
CASES += [("auto", name) for name in ("stress times 1000", "reversed", "two tests of a specimen")]


@pytest.mark.parametrize(("fit", "name"), CASES)
def test_the_same_measurements_in_another_form_give_the_same_answer(fit, name):
    relation, options = relations()[name], FITS[fit] | {"tolerances": "as-tested"}
    first = tq.fit(relation.first, noise_sd=NOISE_SD, **options)
    second = tq.fit(relation.second, noise_sd=relation.noise_sd, **options)
    ends = [
        [own.mean, own.sd, *own.hdi()] for own in (posterior.initial_shear_modulus for posterior in (first, second))
    ]
    assert ends[1] == pytest.approx(relation.factor * np.array(ends[0]), rel=2e-5)
    assert second.log_evidence == pytest.approx(first.log_evidence + relation.log_density, abs=1e-4)
    bands = [
        posterior.predict(GRID, mode="planar", noise=False, unit="MPa").to_numpy()[:, 1:]
        for posterior in (first, second)
    ]
    np.testing.assert_allclose(bands[1], relation.factor * bands[0], rtol=1e-6 if fit == "a law alone" else 0.02)


@pytest.mark.parametrize(
    ("material", "pinned"),
    [
        ("mooney-rivlin", {"C01": 0}),
        ("yeoh", {"C20": 0, "C30": 0}),
        ("biderman", {"C01": 0, "C20": 0, "C30": 0}),
        ("isihara", {"C01": 0, "C20": 0}),
    ],
)
@pytest.mark.parametrize("sd", [1e-8, 1e-10, 1e-12])
def test_a_law_whose_further_parameters_are_pinned_is_the_law_that_it_contains(material, pinned, sd):
    options = {"discrepancy": "none", "noise_sd": NOISE_SD}
    box = {"C10": tq.Uniform(0, 10)}
    contained = gallery.fit(measured(), material="neo-hookean", priors=box, **options)
    priors = box | {name: tq.Normal(value, sd) for name, value in pinned.items()}
    posterior = gallery.fit(measured(), material=material, priors=priors, **options)
    assert posterior.log_evidence == pytest.approx(contained.log_evidence, abs=1e-4)
    found, expected = posterior.initial_shear_modulus, contained.initial_shear_modulus
    assert [found.mean, found.sd] == pytest.approx([expected.mean, expected.sd], rel=1e-6)


@pytest.mark.parametrize("sd", [1e-8, 1e-10, 1e-12])
def test_what_is_left_beside_a_pinned_parameter_is_least_squares(sd):
    data = measured()
    columns = 2 * (STRETCH - STRETCH**-2), 2 * (1 - STRETCH**-3)
    priors = {"C10": tq.Normal(0.45, sd), "C01": tq.Uniform(-10, 10)}
    row = gallery.fit(data, noise_sd=NOISE_SD, priors=priors, **LAW).summary(unit="MPa").loc["C01"]
    square = columns[1] @ columns[1]
    expected = columns[1] @ (data.stress - 0.45 * columns[0]) / square, NOISE_SD / np.sqrt(square)
    assert (row["mean"], row["sd"]) == pytest.approx(expected, rel=1e-7)


def test_a_state_of_deformation_has_one_stress_whatever_the_mode_is_called():
    posterior = gallery.fit(measured(), noise_sd=NOISE_SD, discrepancy="auto", tolerances="as-tested")
    stretch = np.array([0.8, 0.97, 1.03, 1.2, 1.6])

    def band(points, mode, channel=0):
        return posterior.predict(points, mode=mode, channel=channel, noise=False).to_numpy()[:, -3:]

    same = [
        (band(stretch, "planar"), band(np.column_stack([stretch, np.ones(5)]), "biaxial")),
        (band(stretch, "equibiaxial"), band(np.column_stack([stretch, stretch]), "biaxial", 1)),
        (band(stretch, "uniaxial"), band(np.column_stack([stretch, stretch**-0.5]), "biaxial")),
        (band(stretch - 1, "simple-shear"), -band(1 - stretch, "simple-shear")[:, [0, 2, 1]]),
        (band(stretch, "planar")[3:4], band([1.2], "planar")),
        (band(stretch, "planar"), band(stretch[::-1], "planar")[::-1]),
    ]
    for one, other in same:
        np.testing.assert_allclose(one, other, rtol=1e-7)
