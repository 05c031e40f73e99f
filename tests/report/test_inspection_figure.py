"""The figure of an inspection marks on the recorded curve what happened in the test."""

import matplotlib.colors
import numpy as np
import pytest

import tissuq as tq
from planted import PLANTED, Planting
from tissuq.report.inspection import REGIONS, curve_figure

KINDS = ("slack over a quarter", "rupture", "hold", "slips", "saturation", "outliers", "drift")


@pytest.mark.parametrize("name", KINDS)
def test_every_region_is_marked_where_its_rows_were_recorded(tmp_path, name):
    planting = Planting(np.random.default_rng(3), "neo-Hookean", 1e-3)
    planting.count = 201
    stretch, stress = PLANTED[name][1](planting)
    path = tmp_path / "test.csv"
    np.savetxt(path, np.column_stack([stretch, stress]), "%.6f", ",", header="stretch,stress [kPa]", comments="")
    inspection = tq.inspect(path)
    regions = inspection.reading.tested[0].regions
    assert regions
    recorded = curve_figure(inspection).axes[0]
    lines = {line.get_label(): line for line in recorded.lines}
    for region in regions:
        marked = np.flatnonzero(np.isfinite(lines[region.kind].get_ydata()))
        np.testing.assert_array_equal(marked, region.rows)
        np.testing.assert_allclose(lines[region.kind].get_ydata()[marked], stress[marked], atol=1e-6)
        assert lines[region.kind].get_color() == REGIONS[region.kind]["color"]


def test_kinds_differ_in_colour_or_in_form():
    looks = {(matplotlib.colors.to_hex(style["color"]), style.get("marker")) for style in REGIONS.values()}
    assert len(looks) == len(REGIONS)
