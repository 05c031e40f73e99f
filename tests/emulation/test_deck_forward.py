"""A deck of CalculiX as forward model: the posterior against one by brute force, on a grid of runs of CalculiX."""

from __future__ import annotations

import shutil
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import tissuq as tq

pytestmark = [
    pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed: make system"),
    pytest.mark.finite_elements,
]

DEPTH = np.linspace(0.05, 0.3, 8)
TRUTH = {"mu1": 0.0015, "alpha1": -9.0}
NOISE_SD = 2e-3
"""N, a hundredth of the largest force."""
PRIORS = {"mu1": tq.Uniform(0.0008, 0.003), "alpha1": tq.Uniform(-16.0, -3.0)}
GRID = 7


def write_block(path, travel=-0.3):
    """Write a quarter of a block 2 x 2 x 1 mm of eight elements, pressed by 30 % between plates: mm, N, MPa."""
    places = np.linspace(0, 1, 5)
    numbers, lines = {}, ["*NODE, NSET=ALL"]
    for i, j, k in product(range(5), repeat=3):
        if (i % 2) + (j % 2) + (k % 2) < 2:
            numbers[i, j, k] = len(numbers) + 1
            lines.append(f"{numbers[i, j, k]}, {places[i]}, {places[j]}, {places[k]}")
    corners = [(0, 0), (2, 0), (2, 2), (0, 2)]
    middles = [(1, 0), (2, 1), (1, 2), (0, 1)]
    lines.append("*ELEMENT, TYPE=C3D20R, ELSET=BLOCK")
    for number, (i, j, k) in enumerate(product((0, 2), repeat=3), start=1):
        of = [(a, b, 0) for a, b in corners] + [(a, b, 2) for a, b in corners]
        of += [(a, b, 0) for a, b in middles] + [(a, b, 2) for a, b in middles] + [(a, b, 1) for a, b in corners]
        nodes = [str(numbers[i + a, j + b, k + c]) for a, b, c in of]
        lines += [f"{number}, {', '.join(nodes[:15])},", ", ".join(nodes[15:])]
    sets = {"X": (0, None, None), "Y": (None, 0, None), "BASE": (None, None, 0), "TOP": (None, None, 4)}
    for name, wanted in (sets | {"BULGE": (4, 0, 2)}).items():
        nodes = [
            str(number)
            for place, number in numbers.items()
            if all(end in (None, at) for at, end in zip(place, wanted, strict=True))
        ]
        lines.append(f"*NSET, NSET={name}")
        lines += [", ".join(nodes[start : start + 12]) for start in range(0, len(nodes), 12)]
    path.write_text(
        "\n".join(
            [
                "*HEADING", "Block", *lines, "*MATERIAL, NAME=TISSUE", "*HYPERELASTIC, NEO HOOKE", "0.0005, 2.0",
                "*SOLID SECTION, ELSET=BLOCK, MATERIAL=TISSUE", "*STEP, NLGEOM, INC=100", "*STATIC",
                "0.1, 1., 1e-4, 0.1", "*BOUNDARY", "X, 1, 1", "Y, 2, 2", "BASE, 1, 3", "TOP, 1, 2",
                f"TOP, 3, 3, {travel}", "*NODE PRINT, NSET=TOP, TOTALS=ONLY", "RF", "*NODE PRINT, NSET=TOP", "U",
                "*NODE PRINT, NSET=BULGE", "U", "*END STEP", "",
            ]
        )
    )  # fmt: skip
    return path


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    deck = write_block(tmp_path_factory.mktemp("deck") / "block.inp")
    return tq.DeckForward(deck, "TISSUE", "ogden-1", "RF3@TOP", (0.6, 1.1), along="U3@TOP", factor=-4, along_factor=-1)


@pytest.fixture(scope="module")
def computed(block, tmp_path_factory):
    """Return the force of parameters, by a run of CalculiX in a folder of its own."""
    prepared = block.prepared_in(tmp_path_factory.mktemp("runs"))
    return lambda mu, alpha: prepared.run({"mu1": mu, "alpha1": alpha}, DEPTH)


@pytest.fixture(scope="module")
def found(block, computed, tmp_path_factory):
    noise = NOISE_SD * np.random.default_rng(5).standard_normal(len(DEPTH))
    measured = computed(*TRUTH.values()) + noise
    folder = tmp_path_factory.mktemp("calibrated") / "runs"
    return measured, tq.calibrate(
        DEPTH, measured, block, PRIORS, discrepancy="none", noise_sd=NOISE_SD, runs=20, folder=folder
    )


def test_the_intervals_hold_the_parameters_of_the_model_that_made_the_data(found):
    """Of this seed; the chance that one of two 99 % intervals does not is 2 %."""
    _, calibration = found
    for symbol, value in TRUTH.items():
        low, high = calibration.marginals[symbol].hdi(0.99)
        assert low < value < high


def test_the_posterior_is_that_on_a_grid_of_runs(found, computed):
    """Means within 0.2 sd and sds within 10 %: runs on a grid along the axes of the posterior, to 4 sd.

    Of a Gaussian, sums over a grid with steps of 4/3 sd give the sd to 0.1 %; what lies beyond 4 sd takes 0.2 % off.
    """
    measured, calibration = found
    hold_against_grid(calibration, lambda point: ((computed(*point) - measured) ** 2).sum() / NOISE_SD**2)


def hold_against_grid(calibration, misfit):
    """Hold means and sds against those of exp(-misfit / 2) on a grid along the axes of the posterior."""
    draws = calibration.draws(4000)[:, :2]
    steps = np.linspace(-4, 4, GRID)
    root = np.linalg.cholesky(np.cov(draws.T))
    grid = np.array([point for point in product(steps, repeat=2) if np.hypot(*point) < 4.01])
    points = draws.mean(axis=0) + grid @ root.T
    misfits = np.array([misfit(point) for point in points])
    low, high = np.array([prior.support for prior in PRIORS.values()]).T
    inside = ((points > low) & (points < high)).all(axis=1)
    weights = np.exp(-0.5 * (misfits - misfits.min())) * inside
    weights /= weights.sum()
    mean = weights @ points
    sd = np.sqrt(weights @ points**2 - mean**2)
    for column, symbol in enumerate(TRUTH):
        marginal = calibration.marginals[symbol]
        assert abs(marginal.mean - mean[column]) < 0.2 * sd[column]
        assert marginal.sd == pytest.approx(sd[column], rel=0.1)


BULGE_DEPTH = DEPTH[3:]
BULGE_SD = 1e-3
"""mm."""
SOFT = PRIORS | {"alpha1": tq.Uniform(-8.0, -3.0)}
"""Where no run fails."""


def test_force_and_displacement_of_a_point_together_are_those_on_a_grid_of_runs(block, tmp_path):
    """Two curves, the second one at fewer depths."""
    both = replace(block, quantity={"force": "RF3@TOP", "bulge": "U1@BULGE"}, factor={"force": -4})
    controls = {"force": DEPTH, "bulge": BULGE_DEPTH}
    prepared = both.prepared_in(tmp_path)

    def computed(mu, alpha):
        return prepared.run({"mu1": mu, "alpha1": alpha}, controls)

    exact, generator = computed(0.0015, -5.5), np.random.default_rng(8)
    sds = {"force": NOISE_SD, "bulge": BULGE_SD}
    measured = {name: exact[name] + sds[name] * generator.standard_normal(len(at)) for name, at in controls.items()}
    calibration = tq.calibrate(
        controls, measured, both, SOFT, discrepancy="none", noise_sd=sds, runs=20, folder=tmp_path / "calibrated"
    )

    def misfit(point):
        found = computed(*point)
        return sum((((found[name] - measured[name]) / sds[name]) ** 2).sum() for name in sds)

    hold_against_grid(calibration, misfit)
    with pytest.raises(tq.InputError, match="the model gives force, bulge; what was measured is one quantity"):
        tq.calibrate(DEPTH, measured["force"], both, PRIORS)


def test_two_models_of_one_tissue_together_are_those_on_a_grid_of_runs(block, found, tmp_path):
    """The block pressed, and pulled by 20 %: two decks, each with its own curve."""
    travel = np.linspace(0.04, 0.2, 5)
    deck = write_block(tmp_path / "pulled.inp", travel=0.2)
    pulled = replace(block, model=deck, along_factor=1, factor=4, stretch=(0.8, 1.4))
    controls = {"press": DEPTH, "pull": travel}
    runs = {}
    for name, model in (("press", block), ("pull", pulled)):
        (tmp_path / name).mkdir()
        runs[name] = model.prepared_in(tmp_path / name)

    def computed(mu, alpha):
        return {name: model.run({"mu1": mu, "alpha1": alpha}, controls[name]) for name, model in runs.items()}

    exact, generator = computed(0.0015, -5.5), np.random.default_rng(9)
    measured = {name: exact[name] + NOISE_SD * generator.standard_normal(len(at)) for name, at in controls.items()}
    together = {"press": block, "pull": pulled}
    sds = dict.fromkeys(controls, NOISE_SD)
    calibration = tq.calibrate(
        controls, measured, together, SOFT, discrepancy="none", noise_sd=sds, runs=20, folder=tmp_path / "both"
    )

    def misfit(point):
        return sum((((curve - measured[name]) / NOISE_SD) ** 2).sum() for name, curve in computed(*point).items())

    hold_against_grid(calibration, misfit)
    for name, model in together.items():
        folder = tmp_path / f"{name}-alone"
        alone = tq.calibrate(
            controls[name], measured[name], model, SOFT, discrepancy="none", noise_sd=NOISE_SD, runs=20, folder=folder
        )
        assert all(calibration.marginals[symbol].sd < alone.marginals[symbol].sd for symbol in TRUTH)
    with pytest.raises(tq.InputError, match="the models give press, pull; what was measured is press, neck"):
        tq.calibrate({"press": DEPTH, "neck": travel}, {"press": DEPTH, "neck": travel}, together, SOFT)


def test_the_same_call_goes_on_and_another_model_is_refused(found, block, tmp_path):
    measured, _ = found
    folder = tmp_path / "runs"
    few = {"noise_sd": NOISE_SD, "folder": folder}
    done: list[bool] = []
    for is_new in (True, False):
        done.clear()
        tq.calibrate(DEPTH, measured, block, SOFT, runs=8, step=lambda label, is_new: done.append(is_new), **few)
        assert done == [is_new] * 8
    with pytest.raises(tq.InputError, match="another forward model"):
        tq.calibrate(DEPTH, measured, replace(block, factor=-2.0), SOFT, runs=8, **few)


def test_quantities_that_the_model_writes_at_other_times_than_the_control_are_paired_by_time(tmp_path):
    """A block between plates without friction, against the closed form: P = 2 C10 (l - l^-2).

    Stress and strain have no row at rest, which displacements are given; and the function has every second increment.
    """
    deck, lines = write_block(tmp_path / "block.inp"), ["*NODE PRINT, NSET=BULGE", "U"]
    text = deck.read_text().replace("BASE, 1, 3", "BASE, 3, 3").replace("TOP, 1, 2\n", "")
    deck.write_text(text.replace("\n".join(lines), "\n".join([*lines, "*EL PRINT, ELSET=BLOCK", "S, E"])))
    (tmp_path / "results.py").write_text(
        "import re\n\n\ndef force(folder):\n"
        "    text = (folder / 'block.dat').read_text()\n"
        "    rows = re.findall(r'set TOP and time +([^ ]+)\\n\\n +[^ ]+ +[^ ]+ +([^ ]+)\\n', text)\n"
        "    return [0.0, *(float(at) for at, _ in rows[1::2])], [0.0, *(float(force) for _, force in rows[1::2])]\n"
    )
    stretch = np.array([0.95, 0.85, 0.75])
    engineering = 2 * 0.0005 * (stretch - stretch**-2)
    expected = {"S33@BLOCK": engineering * stretch, "E33@BLOCK": 0.5 * (stretch**2 - 1)}
    expected[f"{tmp_path / 'results.py'}:force"] = engineering
    for number, (quantity, values) in enumerate(expected.items()):
        model = tq.DeckForward(deck, "TISSUE", "neo-hookean", quantity, (0.7, 1.2), along="U3@TOP", along_factor=-1)
        (tmp_path / str(number)).mkdir()
        computed = model.prepared_in(tmp_path / str(number)).run({"C10": 0.0005}, 1 - stretch)
        assert computed == pytest.approx(values, rel=2e-3)
