"""Files that count compression as positive: what is read is the stress of a neo-Hookean specimen, tension positive."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from machine_files import neo_hookean
from tissuq.errors import InputError

LENGTH, AREA = 5.0, 300.0
BOTH_WAYS = np.concatenate([np.linspace(1, 1.15, 30), np.linspace(1.15, 0.85, 60)])
COMPRESSION = np.concatenate([np.ones(20), np.linspace(1, 0.7, 60)])
SIZES = {"length": "5 mm", "area": "300 mm2"}


def read(folder, name, deformation, force, **options):
    path = folder / "test.csv"
    rows = "".join(f"{d:.9f},{f:.9f}\n" for d, f in zip(deformation, force, strict=True))
    path.write_text(f"{name},Normal Force (N)\n{rows}")
    dimensions = {"area": SIZES["area"]} if name.startswith("Gap") else SIZES
    return tq.read_experiment(path, dimensions=dimensions, **options)


@pytest.mark.parametrize("stretch", [BOTH_WAYS, COMPRESSION], ids=["both ways", "compression"])
@pytest.mark.parametrize("preload", [0.0, -0.0008], ids=["free", "preloaded"])
@pytest.mark.parametrize(
    ("name", "deformation"),
    [
        ("Gap (mm)", lambda stretch: LENGTH * stretch),
        ("Displacement (mm)", lambda stretch: LENGTH * (stretch - 1)),
        ("Displacement (mm)", lambda stretch: LENGTH * (1 - stretch)),
    ],
    ids=["gap", "displacement", "displacement of the plate"],
)
def test_a_load_that_counts_compression_as_positive_is_turned_as_a_whole(tmp_path, name, deformation, stretch, preload):
    # Rows at rest, of a preload, and those in tension change their sign, too.
    stress = neo_hookean(stretch) + preload
    data = read(tmp_path, name, deformation(stretch), -AREA * stress, compression_positive=True)
    np.testing.assert_allclose(data.stretch, stretch, atol=1e-8)
    np.testing.assert_allclose(data.stress, stress, atol=1e-8)


@pytest.mark.parametrize("name", ["Gap (mm)", "Displacement (mm)"])
def test_amounts_of_the_load_change_their_sign_in_compression_alone(tmp_path, name):
    stress = neo_hookean(BOTH_WAYS)
    deformation = LENGTH * (BOTH_WAYS - (not name.startswith("Gap")))
    data = read(tmp_path, name, deformation, np.abs(AREA * stress), compression_positive=True)
    np.testing.assert_allclose(data.stress, stress, atol=1e-8)


def test_a_gap_with_tension_positive_is_not_turned(tmp_path):
    force = AREA * neo_hookean(BOTH_WAYS)
    with pytest.raises(InputError, match=r"already negative in the file\. Leave out"):
        read(tmp_path, "Gap (mm)", LENGTH * BOTH_WAYS, force, compression_positive=True)
