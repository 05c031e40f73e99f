"""The ranking as a table."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import tissuq as tq
from tissuq.next_test.ranking import TIED, _with_ties

STRETCH = np.linspace(0.8, 1.3, 12)
NOISE = 0.02


@pytest.fixture(scope="module")
def posterior():
    data = tq.simulate("neo-hookean", {"C10": 0.5}, STRETCH, NOISE, seed=1)
    return tq.fit(data, discrepancy="none", noise_sd=NOISE)


def test_tests_are_ranked_for_every_target_with_the_data_again(posterior):
    tests = ["planar 1:1.2 10", "uniaxial 0.9:1.1 10", tq.Candidate("equibiaxial", [1.1, 1.2, 1.5], "three")]
    table = posterior.design(tests, ["C10", "planar:1.4"])
    assert list(dict.fromkeys(table["target"])) == ["C10", "planar:1.4"]
    for _, own in table.groupby("target", sort=False):
        assert (np.diff(own["reduction"]) <= 0).all()
        assert set(own["candidate"]) >= {"three", "uniaxial 0.9 to 1.1, 10 points"}
        again = own[own["is_repeat"]].sort_values("points")["reduction"].to_numpy()
        np.testing.assert_allclose(again, [1 - 1 / np.sqrt(2), 1 - 1 / np.sqrt(4)], rtol=1e-8)
        np.testing.assert_allclose(own["reduction"], 1 - own["sd_after"] / own["sd_now"])
    far = table[table["candidate"] == "three"].iloc[0]
    assert far["beyond"] == pytest.approx(2 / 3)
    assert far["note"] == "67 % beyond the data"
    assert (table["stable"] == 1).all()
    single = posterior.design("planar 1:1.2 10")
    assert "planar 1 to 1.2, 10 points" in set(single["candidate"])


def test_standard_deviations_are_in_the_unit_of_the_measurements_or_another(posterior):
    of_kpa = tq.fit(posterior.model.experiment.labelled(stress_unit="kPa"), discrepancy="none", noise_sd=NOISE)
    test, names = "planar 1:1.2 10", ["sd_now", "sd_after"]
    for fitted, options, unit, factor in (
        (posterior, {}, "MPa", 1.0), (of_kpa, {}, "kPa", 1000.0), (of_kpa, {"unit": "Pa"}, "Pa", 1e6)
    ):  # fmt: skip
        table = fitted.design(test, "C10", **options)
        assert set(table["unit"]) == {unit}
        np.testing.assert_allclose(table[names], factor * posterior.design(test, "C10")[names], rtol=1e-9)
    with pytest.raises(tq.InputError, match="banana"):
        posterior.design(test, unit="banana")


def test_what_is_as_good_as_the_best_is_marked():
    """By hand: of two standard errors of a difference, or less than 1 %, and never a repeat of the data."""
    rows = [("a", 0.300, 0.004, False), ("b", 0.295, 0.003, False), ("again", 0.294, 0.0, True),
            ("c", 0.291, 0.003, False), ("d", 0.285, 0.003, False), ("e", np.nan, np.nan, False)]  # fmt: skip
    table = pd.DataFrame(rows, columns=["candidate", "reduction", "error", "is_repeat"]).assign(target="C10", note="n")
    exact = table[:3].assign(target="planar:1.1", error=0.0, reduction=[0.2, 0.191, 0.1])
    found = _with_ties(pd.concat([table, exact], ignore_index=True))
    assert found["candidate"][found["is_tied"]].tolist() == ["a", "b", "c", "a", "b"]
    assert found["note"].tolist() == ["n", f"{TIED}; n", "n", f"{TIED}; n", "n", "n", "n", f"{TIED}; n", "n"]


def test_the_usual_tests_are_ranked_where_none_is_given(posterior):
    table = posterior.design(points=(6,))
    assert set(table["mode"]) == {"uniaxial", "equibiaxial", "planar", "simple-shear"}
    assert (table["target"] == "modulus").all()
    assert (table["reduction"] > 0).all()
    with pytest.raises(tq.InputError, match="one measurement or more"):
        posterior.design(points=(0,))


@pytest.mark.slow
def test_a_material_that_may_lock_has_no_numbers_beyond(posterior):
    data = tq.simulate("gent", {"mu": 1.0, "Jm": 1.2}, np.linspace(0.75, 1.6, 16), NOISE, seed=1)
    locking = tq.fit(data, material="gent", discrepancy="none", noise_sd=NOISE)
    table = locking.design(points=(6,)).set_index("candidate")
    lost = table[table["reduction"].isna()]
    assert len(lost)
    assert lost["note"].str.contains("may be such that it locks").all()
    assert lost.index[0] == table.index[-len(lost)]
    with pytest.raises(tq.ModelError, match="locks"):
        locking.design(["uniaxial 1.1:2.5 8"])


@pytest.mark.slow
def test_few_components_are_told():
    data = tq.simulate("mooney-rivlin", {"C10": 0.5, "C01": 0.02}, STRETCH, NOISE, seed=1)
    stable = tq.fit(data, material="mooney-rivlin", discrepancy="none", noise_sd=NOISE, stable_in="all")
    table = stable.design([tq.Candidate("planar", np.linspace(1.1, 1.25, 20000))], "C01")
    worst = table[~table["is_repeat"]].iloc[0]
    assert worst["is_rough"]
    assert "inaccurate: few components" in worst["note"]
