"""Workbooks of the old kind (xls), as rheometers write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tissuq as tq

FILE = Path(__file__).parents[3] / "shared" / "data" / "labfiles" / "fungi_shear.xls"
SIGNATURE = bytes.fromhex("d0cf11e0a1b11ae1")


@pytest.mark.skipif(not FILE.exists(), reason="the shared data are not here")
def test_a_sheet_of_a_rheometer_is_read():
    pytest.importorskip("python_calamine", reason="python-calamine is not installed")
    with pytest.raises(tq.InputError, match="several sheets hold tables: 'Axial - 1', 'Peak hold - 2'"):
        tq.read_experiment(FILE)
    options = {"dimensions": {"diameter": "8 mm"}, "compression_positive": True}
    data = tq.read_experiment(FILE, sheet="Axial - 1", **options)
    # The first and the last row: gap 8773.86 um and 7914.62 um.
    gap = np.array([8773.86, 7914.62])
    assert len(data) == 89
    np.testing.assert_allclose(data.stretch[[0, -1]], gap / gap[0], rtol=1e-5)
    np.testing.assert_allclose(np.abs(data.stress[0]), 0.0234067 / (np.pi * 16), rtol=1e-6)


def test_what_only_begins_like_a_workbook_is_refused(tmp_path):
    file = tmp_path / "letter.xls"
    file.write_bytes(SIGNATURE + bytes(600))
    with pytest.raises(tq.InputError, match="old kind"):
        tq.read_experiment(file)
