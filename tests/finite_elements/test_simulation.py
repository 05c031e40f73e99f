"""From a posterior to forces: families of draws, what fails, what is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tissuq.errors import ConvergenceError, InputError
from tissuq.finite_elements import ClampedBar, Indentation, bar_force, respond, simulate
from tissuq.finite_elements.case import felupe
from tissuq.finite_elements.first_order import FirstOrderError
from tissuq.finite_elements.response import Solve, run_in_turn, solved
from tissuq.finite_elements.warnings import simulation_warnings
from tissuq.mechanics import material_named

pytest.importorskip("felupe", reason="FElupe is not installed")

BAR = ClampedBar(elongation=1.0, fineness=0.5)


@pytest.fixture(scope="module")
def found(posterior, without):
    return simulate(posterior, BAR, draws=4, without=without, steps=2, check_mesh=False)


@pytest.mark.finite_elements
def test_every_family_has_the_forces_of_its_draws(found, posterior, without):
    draws = posterior.ensemble(4)
    for number, draw in enumerate(draws):
        np.testing.assert_allclose(found.forces["complete"][number], respond(BAR, draw, steps=2).force, rtol=1e-7)
        alone = bar_force("neo-hookean", [draw.values["C10"]], found.travel, fineness=0.5)
        np.testing.assert_allclose(found.forces["alone"][number], alone, rtol=1e-7)
        other = bar_force("neo-hookean", [without.ensemble(4)[number].values["C10"]], found.travel, fineness=0.5)
        np.testing.assert_allclose(found.forces["without"][number], other, rtol=1e-7)
    assert found.failures == ()


@pytest.mark.finite_elements
def test_materials_that_differ_by_a_factor_are_computed_once(posterior, without):
    tasks = []

    def counted(given):
        tasks.extend(given)
        return run_in_turn(given)

    simulate(posterior, BAR, draws=3, without=without, steps=1, check_mesh=False, run=counted)
    assert len(tasks) == 3 + 1  # the neo-Hookean ones, alone and without, are one


def test_a_task_is_known_by_all_its_numbers(draws):
    keys = {Solve.of(case, draw, 2, bulk).key for case in (BAR, Indentation()) for draw in draws for bulk in (1e3, 2e3)}
    assert len(keys) == 2 * len(draws) * 2
    assert Solve.of(BAR, draws[0], 2, 1e3).key == Solve.of(BAR, replace(draws[0], number=9), 2, 1e3).key


def test_the_noise_of_the_force_is_the_share_that_the_tests_noise_has_in_its_stress(found, posterior):
    largest = np.abs(posterior.model.experiment.stress).max()
    expected = 2e-5 / largest * np.abs(found.forces["complete"].mean(axis=0)).max()
    assert found.noise_sd == pytest.approx(expected)
    assert simulate(posterior, BAR, 2, steps=1, force_noise=0.5, check_mesh=False).noise_sd == 0.5


def test_the_table_has_the_moments_of_the_forces(found):
    table, last = found.table(), found.forces["complete"][:, -1]
    row = table.iloc[-1]
    assert list(table["elongation_mm"]) == [0.5, 1.0]
    assert (row["mean"], row["sd"]) == pytest.approx((last.mean(), last.std(ddof=1)))
    assert (row["low"], row["high"]) == pytest.approx((last.min(), last.max()))
    assert row["parameters"] + row["discrepancy"] + row["noise"] == pytest.approx(1)
    assert row["without_mean"] == pytest.approx(found.forces["without"][:, -1].mean())


@pytest.mark.finite_elements
def test_the_mesh_is_checked_against_one_of_twice_the_fineness(posterior, without):
    found = simulate(posterior, BAR, draws=4, without=without, steps=2)
    change, travel = found.mesh_change
    draw = found.ensembles["complete"][int(np.argsort([each.values["C10"] for each in found.ensembles["complete"]])[2])]
    coarse, fine = (respond(replace(BAR, fineness=f), draw, steps=2).force[-1] for f in (0.5, 1.0))
    assert travel == 1.0
    assert change == pytest.approx(fine / coarse - 1, abs=1e-6)


def test_the_fields_are_those_of_the_draws(found):
    own = respond(BAR, found.ensembles["complete"][2], steps=2).fields
    np.testing.assert_allclose(found.fields["displacement"][2], own.displacement, atol=1e-8)
    np.testing.assert_allclose(found.fields["von_mises"][2], own.von_mises, atol=1e-8)


def test_a_posterior_without_discrepancy_has_one_family(without):
    found = simulate(without, BAR, 3, steps=1, check_mesh=False)
    assert list(found.forces) == ["complete"]
    assert found.table()["parameters"].iloc[0] + found.table()["noise"].iloc[0] == pytest.approx(1)
    expected = [bar_force("neo-hookean", [each.values["C10"]], [1.0], fineness=0.5)[0] for each in without.ensemble(3)]
    np.testing.assert_allclose(found.forces["complete"][:, 0], expected, rtol=1e-7)


def ended_early(tasks):
    """Carry tasks out, and let the second draw with discrepancy end at the first step."""
    results = list(run_in_turn(tasks))
    place = [task.draw.number for task in tasks].index(1)
    whole = results[place]
    results[place] = whole | {
        "force": [whole["force"][0], None], "volume_beyond": [0.0, None], "energy_beyond": [0.0, None], "reached": 0.6,
        "problem": "cells turned inside out",
    }  # fmt: skip
    return results


def test_a_draw_that_ends_early_is_listed_and_counted_and_its_steps_are_kept(posterior):
    found = simulate(posterior, BAR, 4, steps=2, check_mesh=False, run=ended_early)
    (failure,) = found.failures
    assert (failure.family, failure.number, failure.reached) == ("complete", 1, 0.6)
    assert list(found.table()["draws"]) == [4, 3]
    assert len(found.fields["largest"]) == 3
    warning = simulation_warnings(found)[0]
    assert all(word in warning for word in ("1 of 4 draws", "draw 2 at 0.6 mm", "cells turned inside out"))


def test_a_reader_is_warned_of_strains_beyond_the_measurements_and_of_few_draws(found):
    texts = " ".join(simulation_warnings(replace(found, energy_beyond=np.full((4, 2), 0.4))))
    assert "with 40 % of the strain energy, is strained beyond what was measured" in texts
    assert "4 draws are too few for a 95 % band: the band is their range, which holds 60 %" in texts
    assert "compensate" in " ".join(
        simulation_warnings(replace(found, forces=found.forces | {"alone": -found.forces["complete"]}))
    )
    assert "too coarse" in " ".join(simulation_warnings(replace(found, mesh_changes=((1.0, -0.2),))))


@pytest.mark.parametrize("ratio", [0.01, 2 / 3, np.nan])
def test_a_bulk_modulus_of_no_incompressible_material_is_refused(posterior, ratio):
    with pytest.raises(InputError, match=r"Poisson's ratio that is not positive.*give 20 or more.*--bulk-ratio"):
        simulate(posterior, BAR, 4, steps=1, bulk_ratio=ratio)
    with pytest.raises(InputError, match="incompressible"):
        respond(BAR, material_named("neo-hookean"), [5e-4], steps=1, bulk_ratio=ratio)


def test_a_reader_is_warned_of_a_volume_that_changes(found):
    soft, hard = (" ".join(simulation_warnings(replace(found, bulk_ratio=ratio))) for ratio in (3.0, 20.0))
    assert "The bulk modulus is 3 times the initial shear modulus: the volume changes" in soft
    assert "the volume changes" not in hard


def test_a_reader_is_warned_of_an_sd_that_few_draws_in_full_leave_uncertain(found):
    def said(full, sd):
        """With 10 draws, of which so many are in full."""
        forces = np.linspace(1.0, 1.2, 10)[:, None] * [0.5, 1.0]
        beyond = np.where(np.arange(10)[:, None] < full, 0.0, np.nan) * np.ones(2)
        error = FirstOrderError(np.zeros(2), np.zeros(2), np.array([0.5, sd]))
        changed = replace(found, forces={"complete": forces}, volume_beyond=beyond, energy_beyond=beyond,
                          first_order_error={"complete": error})  # fmt: skip
        return " ".join(simulation_warnings(changed))

    assert "With 9 of 10 draws computed in full, the sd of the force at 1 mm may be off by 7 %" in said(9, 0.07)
    assert "in full" not in said(9, 0.03)
    assert "by more than that, which so few do not tell: compute more in full (--full-runs 12)" in said(6, 0.01)


def test_it_fails_when_no_draw_gets_anywhere(posterior):
    def nowhere(tasks):
        nothing = {"force": [None], "reached": 0.0, "problem": "it is stuck", "seconds": 0.0}
        return [nothing for _ in tasks]

    with pytest.raises(ConvergenceError, match=r"fewer than 2 reached the first elongation of 1 mm \(it is stuck\)"):
        simulate(posterior, BAR, 3, steps=1, check_mesh=False, run=nowhere)


def test_one_draw_is_too_few(posterior):
    with pytest.raises(InputError, match="2 draws or more"):
        simulate(posterior, BAR, 1)


def test_a_draw_without_initial_stiffness_is_a_failure_that_is_told(draws):
    weak = replace(draws[0], parts=((material_named("neo-hookean"), (-5e-4,)),), discrepancy=None)
    found = solved(Solve.of(BAR, weak, 1, 2e3))
    assert "has an initial shear modulus of -0.001 MPa" in found["problem"]
    assert found["force"] == [None]


def test_results_are_plain_data(draws):
    import json

    found = solved(Solve.of(BAR, draws[0], 1, 2e3))
    assert json.loads(json.dumps(found)) == found


def test_without_felupe_a_message_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "felupe", None)
    with pytest.raises(InputError, match=r"install tissuq with its extra 'fe'"):
        felupe()
