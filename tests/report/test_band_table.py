"""What a table of bands says of the shares of a variance."""

import pandas as pd
import pytest

from tissuq.report.band_table import Bands


@pytest.mark.parametrize(
    ("share", "error", "words"),
    [
        (0.72, 0.09, "72 ± 9 %"),
        (1.05, 0.18, "87 to 100 %"),
        (0.95, 0.18, "77 to 100 %"),
        (0.03, 0.05, "0 to 8 %"),
        (1.30, 0.20, "100 %"),  # by two errors at the most beyond the whole
        (-0.10, 0.08, "0 %"),
        (1.60, 0.20, "160 ± 20 %"),  # of parts that compensate each other, which the page explains
        (-0.60, 0.20, "-60 ± 20 %"),
        (float("nan"), 0.0, ""),
    ],
)
def test_a_share_of_few_draws_is_a_range_within_0_and_100_percent(share, error, words):
    row = {"draws": 16, "mean": 1.0, "sd": 0.1, "low": 0.8, "high": 1.2, "parameters": share, "parameters_error": error}
    bands = Bands(pd.DataFrame([row]), is_shared=True)
    assert bands.cells(row, "1.0", ["parameters"])[-1] == words
