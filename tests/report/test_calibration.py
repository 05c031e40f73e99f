"""For what the page of a calibration says that the parameters can be used, and what it says to do next."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from tissuq.assessment.uses import Verdict
from tissuq.model.discrepancy import GaussianProcess, NoDiscrepancy, PinnedProcess
from tissuq.report.calibration_in_words import next_step_of, uses_of_calibration
from tissuq.result_warning import ResultWarning, Severity

YES, CARE, NO = Verdict
DEPTH = np.linspace(0.1, 1, 10)
PINNED = PinnedProcess(references=(0.0,))


def study(
    discrepancy=PINNED,
    *,
    half_widths=(0.1, 0.05),
    share=0.0,
    alone=1.0,
    of_band=0.02,
    inside=1.0,
    warnings=(),
    is_sure=True,
):
    """Return a calibration of mu = 2 and b = 3 whose intervals have these half widths over the mean."""
    means = dict(zip(("mu", "b"), (2.0, 3.0), strict=True))
    marginals = {
        symbol: SimpleNamespace(mean=mean, hdi=lambda mean=mean, half=half: (mean * (1 - half), mean * (1 + half)))
        for (symbol, mean), half in zip(means.items(), half_widths, strict=True)
    }
    bands = [
        pd.DataFrame({"control": DEPTH, "mean": DEPTH, "low": (1 - half) * DEPTH, "high": (1 + half) * DEPTH})
        for half in (of_band, 0.02)
    ]
    problem = SimpleNamespace(forward_symbols=("mu", "b"), discrepancy=discrepancy, quantities={"": (0, len(DEPTH))})
    calibration = SimpleNamespace(
        problem=problem, marginals=marginals, converged=is_sure, emulator_share={"mu": share, "b": 0.0},
        predict=lambda noise, discrepancy: bands[discrepancy],
        predictive_coverage=lambda discrepancy=True: inside if discrepancy else alone, warnings=list(warnings),
    )  # fmt: skip
    measured = SimpleNamespace(control=DEPTH)
    return SimpleNamespace(
        calibration=calibration, posterior=None, units={}, data={"": measured},
        settings=SimpleNamespace(zero_load=0.0),
    )  # fmt: skip


CUT = ResultWarning(
    "the posterior reaches the bound of the prior of b (upper): give a wider prior.", "prior-bound", symbols=["b"]
)
UNREAD = ResultWarning(
    "the model hardly depends on mu, and the result is the prior.", "poorly-determined", symbols=["mu"]
)
NONE_FIT = ResultWarning("no parameters that the priors allow give ...", "unmodelled-curve", Severity.PROBLEM)
EMULATOR = ResultWarning("the emulator is over-confident.", "inaccurate-emulator")


@pytest.mark.parametrize(
    ("case", "verdicts", "reason", "step"),
    [
        ({}, (YES, YES, YES), "mu known to ± 10 %, others better", "name the law of the model"),
        ({"half_widths": (0.1, 0.3)}, (CARE, YES, YES), "b known to ± 30 %", "name the law"),
        ({"half_widths": (1.5, 0.1)}, (CARE, YES, YES), "the interval of mu includes zero", "name the law"),
        ({"discrepancy": NoDiscrepancy()}, (CARE, YES, CARE), "if the model is right", "let the forward model"),
        ({"discrepancy": GaussianProcess()}, (NO, YES, NO), "takes initial stiffness", "let the forward model"),
        ({"alone": 0.4}, (YES, YES, NO), "mu known to ± 10 %", "calibrate a model that comes nearer"),
        ({"of_band": 0.3}, (YES, YES, CARE), "mu known to ± 10 %", "name the law"),
        ({"of_band": 0.6}, (YES, YES, NO), "mu known to ± 10 %", "let another test narrow the parameters"),
        ({"share": 0.2}, (CARE, YES, YES), "up to 20 % of the variance", "make the emulator"),
        ({"share": 0.7}, (NO, YES, NO), "the error of the emulator makes up to 70 %", "make the emulator"),
        ({"warnings": [EMULATOR]}, (CARE, YES, YES), "see the warning about the emulator", "name the law"),
        ({"warnings": [EMULATOR.as_note()]}, (YES, YES, YES), "mu known", "name the law"),
        ({"warnings": [CUT]}, (NO, YES, NO), "not the data, determines b", "give b a wider --prior"),
        ({"warnings": [UNREAD]}, (NO, YES, NO), "the model hardly depends on mu", "see whether the model reads"),
        ({"warnings": [NONE_FIT]}, (NO, NO, NO), "no parameters that the priors allow", "check units and signs"),
        ({"is_sure": False}, (NO, NO, NO), "sampling has not converged", "make the posterior converge"),
        ({"inside": 0.5}, (YES, NO, YES), "mu known", "name the law"),
    ],
)  # fmt: skip
def test_verdicts_on_a_calibration_say_what_stands_against_its_use_and_the_next_step_mends_it(
    case, verdicts, reason, step
):
    uses = uses_of_calibration(study(**case))
    assert [use.purpose for use in uses] == [
        "report mu and b", "predict this experiment", "use mu and b in another model"
    ]  # fmt: skip
    assert tuple(use.verdict for use in uses) == verdicts
    assert reason in uses[0].reason
    assert next_step_of(study(**case), uses).startswith(step)


def test_a_process_that_is_pinned_far_from_the_measurements_takes_stiffness_as_a_free_one():
    far = study()
    far.data[""] = SimpleNamespace(control=DEPTH + 5)
    assert [use.verdict for use in uses_of_calibration(far)] == [NO, YES, NO]
    assert "--discrepancy gp-pinned --force --zero-load C" in next_step_of(far, uses_of_calibration(far))
