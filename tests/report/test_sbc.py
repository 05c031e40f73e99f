"""The report of a calibration tells what is not calibrated, and how many fits failed."""

from __future__ import annotations

import numpy as np

from tissuq.report.sbc import COLUMNS, sbc_result
from tissuq.report.writer import write_result
from tissuq.studies.settings import RECIPE
from tissuq.validation.sbc import SbcSettings, summarise_ranks


def test_the_page_says_what_is_wrong_and_what_failed(tmp_path):
    settings = SbcSettings(formulations=("none", "gp"), noise=("known",), replicates=200)
    uniform = np.random.default_rng(0).uniform(size=(4, 200)).tolist()
    uniform[3] = [0.5 + 0.2 * (value - 0.5) for value in uniform[3]]
    uniform[0][7] = None
    results = [
        {"formulation": 0, "noise": 0, "below": {"C10": uniform[0]}},
        {"formulation": 1, "noise": 0, "below": dict(zip(("C10", "c", "psi"), uniform[1:], strict=True))},
    ]
    (tmp_path / RECIPE).write_text("seed = 0\n")
    write_result(sbc_result(settings, results), tmp_path)
    table = summarise_ranks(settings, results)
    assert list(table["calibrated"]) == [True, True, True, False]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "1 of 4 parameters is NOT calibrated" in page
    assert "1 fits failed" in page
    assert all(cell(row) in page for row in table.to_dict("records") for cell in COLUMNS.values())
