"""An extensometer or a camera beside the displacement of the machine: which is read is asked, and both can be."""

from __future__ import annotations

import numpy as np
import pytest

import tissuq as tq
from machine_files import neo_hookean
from tissuq.errors import InputError

STRETCH = np.linspace(1, 1.3, 50)
SIZES = {"length": "10 mm", "area": "6 mm2"}
MACHINE_STRAIN = 1.5
"""Displacement of the machine over that of the specimen, whose grips slip."""


def written(folder, machine, local):
    strain = STRETCH - 1
    values = 100 * strain if "%" in local else 10 * strain
    rows = zip(10 * MACHINE_STRAIN * strain, values, 6 * neo_hookean(STRETCH), strict=True)
    path = folder / "test.csv"
    path.write_text(f"{machine},{local},Load (N)\n" + "".join(f"{a:.9f},{b:.9f},{c:.9f}\n" for a, b, c in rows))
    return path


@pytest.mark.parametrize("machine", ["Crosshead (mm)", "Extension (mm)"])
@pytest.mark.parametrize(
    ("local", "role"),
    [
        ("Extensometer (mm)", "displacement"),
        ("Video extension (mm)", "displacement"),
        ("LVDT (mm)", "displacement"),
        ("Video Axial Strain (%)", "strain"),
        ("Optical strain (%)", "strain"),
        ("Dehnung Feinwegaufnehmer (%)", "strain"),
    ],
)
def test_the_measurement_on_the_specimen_is_offered_in_the_form_that_reads_it(tmp_path, machine, local, role):
    path = written(tmp_path, machine, local)
    with pytest.raises(InputError, match="They give different stretches") as error:
        tq.read_experiment(path, dimensions=SIZES)
    assert f'--column {role}="{local}"' in str(error.value)
    assert f'--column displacement="{machine}"' in str(error.value)
    sizes = SIZES if role == "displacement" else {"area": SIZES["area"]}
    of_specimen = tq.read_experiment(path, dimensions=sizes, columns={role: local})
    np.testing.assert_allclose(of_specimen.stretch, STRETCH, atol=1e-8)
    of_machine = tq.read_experiment(path, dimensions=SIZES, columns={"displacement": machine})
    np.testing.assert_allclose(of_machine.stretch - 1, MACHINE_STRAIN * (STRETCH - 1), atol=1e-8)


@pytest.mark.parametrize("local", ["Temperature (C)", "Gauge length (mm)"])
def test_what_is_no_deformation_raises_no_question(tmp_path, local):
    path = written(tmp_path, "Crosshead (mm)", "Extensometer (mm)")
    lines = path.read_text().replace("Extensometer (mm)", local).splitlines()
    rows = [f"{a},20.0,{c}" for a, _, c in (line.split(",") for line in lines[1:])]
    path.write_text("\n".join([lines[0], *rows]))
    data = tq.read_experiment(path, dimensions=SIZES)
    np.testing.assert_allclose(data.stretch - 1, MACHINE_STRAIN * (STRETCH - 1), atol=1e-8)
