"""Lateral strains beside a uniaxial test: Poisson's ratio is told, and what changes its volume is refused."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import tissuq as tq
from tissuq.errors import InputError

STRETCH = np.linspace(0.85, 1.3, 24)
SCATTER = 2e-3 * np.random.default_rng(4).standard_normal(len(STRETCH))
FORMS = {
    "lateral stretch": lambda ratio: STRETCH**-ratio + SCATTER,
    "Transverse strain [%]": lambda ratio: 100 * (STRETCH**-ratio - 1 + SCATTER),
    "Querdehnung": lambda ratio: STRETCH**-ratio - 1 + SCATTER,
    "radial strain": lambda ratio: 1 - STRETCH**-ratio + SCATTER,
}


def _table(ratio, form):
    return pd.DataFrame({"stretch": STRETCH, "stress_kPa": STRETCH - STRETCH**-2, form: FORMS[form](ratio)})


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("ratio", [0.5, 0.46, 0.7])
def test_a_ratio_of_a_half_or_more_is_told(form, ratio):
    source = tq.read(_table(ratio, form)).source
    found = float(source.split("Poisson's ratio ")[1].split(" ")[0])
    assert found == pytest.approx(ratio, abs=0.012)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("ratio", [0.3, 0.42])
def test_a_volume_that_changes_is_refused_with_its_ratio(form, ratio):
    with pytest.raises(InputError, match="does not keep its volume") as refusal:
        tq.fit(_table(ratio, form))
    said = str(refusal.value)
    assert form in said
    assert abs(float(said.split("Poisson's ratio ")[1].split(" ")[0]) - ratio) < 0.012
    change = float(said.split("it changes by ")[1].split("%")[0])
    assert change == pytest.approx(100 * (1.3 ** (1 - 2 * ratio) - 1), abs=1.2)
    assert "give incompressible=True." in said
    taken = tq.read(_table(ratio, form), incompressible=True)
    assert "taken as incompressible, though Poisson's ratio" in taken.source
    assert taken.has_measurements_of(tq.read(_table(ratio, form).drop(columns=form)))


def test_a_ratio_that_the_scatter_hides_is_not_refused():
    noisy = _table(0.4, "lateral stretch")
    noisy["lateral stretch"] += 60 * SCATTER
    assert "Poisson's ratio" in tq.read(noisy).source


@pytest.mark.parametrize("cell", ["", "-"])
def test_a_column_with_faulty_cells_is_passed_over(cell, tmp_path):
    rows = [f"{x:.4f},{x - x**-2:.5f},{'' if n == 3 else f'{x**-0.3:.4f}'}" for n, x in enumerate(STRETCH)]
    rows[5] = rows[5].rpartition(",")[0] + f",{cell}"
    (tmp_path / "test.csv").write_text("stretch,stress_kPa,lateral stretch\n" + "\n".join(rows), encoding="utf-8")
    assert "Poisson" not in tq.read(tmp_path / "test.csv").source


def test_other_modes_are_not_asked():
    planar = _table(0.3, "lateral stretch").assign(stretch=np.linspace(1.01, 1.3, len(STRETCH)))
    assert "Poisson" not in tq.read(planar, mode="planar").source
