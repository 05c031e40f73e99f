"""The study of a case: posteriors of a run, and results that are the same on any number of processes."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from command_line import done_in
from tissuq.errors import InputError
from tissuq.finite_elements import ClampedBar, simulate
from tissuq.studies.stream import open_pool
from tissuq.studies.structure import SimulationSettings, load_posteriors, run_simulation

pytest.importorskip("felupe", reason="FElupe is not installed")

SIZES = {"fineness": 0.5, "elongation": 0.8}


@pytest.fixture(scope="module")
def settings(tmp_path_factory):
    """Of a run of ``tissuq fit`` with the discrepancy 'taylor'."""
    folder = tmp_path_factory.mktemp("run")
    stretch = np.array([0.8, 0.9, 0.95, 1.05, 1.1, 1.2])
    stress = tq.simulate("yeoh", {"C10": 1.0, "C20": 1.0, "C30": 0.0}, stretch, noise_sd=0.01, seed=1).stress
    rows = "".join(f"{at},{each}\n" for at, each in zip(stretch, stress, strict=True))
    (folder / "tissue.csv").write_text(f"stretch,stress_kPa\n{rows}", encoding="utf-8")
    done_in(folder, "fit", "tissue.csv", "--discrepancy", "taylor", "--no-figures")
    return SimulationSettings(run=str(folder / "runs" / "tissue"), case="bar", sizes=SIZES, draws=3, steps=2)


@pytest.mark.slow
def test_a_run_gives_its_posterior_and_the_fit_without_discrepancy(settings):
    found = load_posteriors(settings)
    assert found.fitted.model.discrepancy.name == "taylor"
    assert found.without.model.discrepancy.name == "none"
    np.testing.assert_array_equal(found.without.model.experiment.stress, found.fitted.model.experiment.stress)


@pytest.mark.slow
@pytest.mark.finite_elements
def test_processes_give_the_same_forces_as_one_and_as_the_function(settings, tmp_path):
    posteriors = load_posteriors(settings)
    forces = []
    for count in (1, 2):
        folder = tmp_path / str(count)
        folder.mkdir()
        with open_pool(count) as pool:
            forces.append(run_simulation(settings, posteriors, folder, pool=pool).simulation.forces)
    plain = simulate(
        posteriors.fitted, ClampedBar(**SIZES), 3, without=posteriors.without, steps=2, check_mesh=False
    ).forces
    for family in ("complete", "alone", "without"):
        np.testing.assert_array_equal(forces[0][family], forces[1][family])
        np.testing.assert_array_equal(forces[0][family], plain[family])


@pytest.mark.slow
@pytest.mark.finite_elements
def test_what_is_done_is_not_done_again(settings, tmp_path):
    posteriors, told = load_posteriors(settings), []

    class Progress:
        def __init__(self, total):
            self.total = total

        def __enter__(self):
            return lambda label, is_new: told.append(is_new)

        def __exit__(self, *error):
            return None

    for _ in range(2):
        run_simulation(settings, posteriors, tmp_path, progress=Progress)
    count = len(told) // 2
    assert told == [True] * count + [False] * count


def test_sizes_belong_to_the_case():
    with pytest.raises(InputError, match=r"case 'bar' has no size 'depth'; its sizes are elongation=1\.0"):
        SimulationSettings(run="run", case="bar", sizes={"depth": 0.1}).sized_case()
    assert SimulationSettings(run="run", sizes={"contact": "frictionless"}).sized_case().contact == "frictionless"
