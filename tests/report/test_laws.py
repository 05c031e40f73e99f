"""What the page of a comparison of laws says."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

import tissuq as tq
from tissuq.experiments.units import stress_unit
from tissuq.report.laws import law_lead


def test_the_finding_is_said_whether_or_not_a_law_can_be_fitted_alone():
    data = tq.simulate("neo-hookean", {"C10": 0.4}, np.linspace(0.8, 1.5, 12), noise_sd=0.02, seed=1)
    comparison = tq.fit_laws(data, ["neo-hookean"], discrepancy="taylor", noise_sd=0.02)
    words = {}
    for name, of_laws in {"alone": comparison, "not alone": replace(comparison, alone={})}.items():
        settings = SimpleNamespace(discrepancies=("taylor",))
        words[name] = law_lead(SimpleNamespace(comparison=of_laws, unit=stress_unit("MPa"), settings=settings))
    assert "Alone, without discrepancy, neo-hookean comes nearest" in words["alone"]
    assert words["alone"].startswith(words["not alone"])
