"""Blocks that are pressed or sheared: which side is their height is as the file names it, or is asked for."""

from __future__ import annotations

import re

import numpy as np
import pytest

import tissuq as tq
from machine_files import MU, neo_hookean
from tissuq.errors import InputError
from written_files import check_curve, written

LENGTH, WIDTH, HEIGHT = 12.0, 10.0, 8.0
SECTION = LENGTH * WIDTH
PRESSED = np.linspace(1, 0.7, 40)
SHEARED = np.linspace(0, 0.4, 40)
UNIAXIAL = {"mode": "uniaxial", "stretch": PRESSED, "stress": neo_hookean(PRESSED)}
SIMPLE_SHEAR = {"mode": "simple-shear", "stretch": SHEARED, "stress": MU * SHEARED}


def block(folder, head, moved, force, names="Displacement (mm),Force (N)"):
    return written(folder, "\n".join([*head, names]), moved, force)


def sides(height):
    return [f"Length: {LENGTH} mm", f"Width: {WIDTH} mm", f"{height}: {HEIGHT} mm"]


def pressed(folder, height, sign=1, head=("Test: compression",)):
    return block(folder, [*sides(height), *head], sign * HEIGHT * (1 - PRESSED), -sign * SECTION * UNIAXIAL["stress"])


def sheared(folder, height):
    names = "Shear displacement (mm),Shear force (N)"
    head = [*sides(height), "Simple shear of muscle"]
    return block(folder, head, HEIGHT * SHEARED, SECTION * SIMPLE_SHEAR["stress"], names)


def check(path, mode, stretch, stress, **options):
    (test,) = tq.read_tests(path, **options)
    assert test.mode.name == mode
    check_curve(test, stretch, stress, rtol=1e-6, atol=1e-9)


def proposed(message, side):
    """Return the sizes that a message proposes for one side as the height, and what it says that they give."""
    pattern = rf'its {side}: --length "(.*?)" --area "(.*?)", which gives .*? of ([\d.]+) and ([\d.]+) kPa'
    length, area, furthest, largest = re.search(pattern, message).groups()
    return {"length": length, "area": area}, float(furthest), float(largest)


@pytest.mark.parametrize("height", ["Height", "Specimen height", "Höhe"])
def test_a_height_is_the_length_in_compression_and_in_shear(tmp_path, height):
    with pytest.warns(UserWarning, match="the height, 8 mm in line 3, was taken for the length, which it is in comp"):
        check(pressed(tmp_path, height), **UNIAXIAL, compression_positive=True)
    with pytest.warns(UserWarning, match="the height, 8 mm in line 3, was taken for the length, which it is in shear"):
        check(sheared(tmp_path, height), **SIMPLE_SHEAR)


def test_which_side_of_a_pressed_block_is_its_height_is_asked_once_with_what_each_gives(tmp_path):
    path = pressed(tmp_path, "Thickness")
    with pytest.raises(InputError, match="along which of them the specimen was compressed") as refusal:
        tq.read_tests(path, compression_positive=True)
    sizes, strain, stress = proposed(str(refusal.value), "thickness")
    assert (strain, stress) == (pytest.approx(0.3, rel=1e-2), pytest.approx(-1e3 * neo_hookean(0.7), rel=1e-2))
    check(path, **UNIAXIAL, compression_positive=True, **sizes)
    sizes, strain, _ = proposed(str(refusal.value), "length")
    assert (sizes, strain) == ({"length": "12 mm", "area": "80 mm2"}, pytest.approx(0.2, rel=1e-2))


def test_loads_and_displacements_below_zero_are_of_compression_whatever_words_say(tmp_path):
    path = pressed(tmp_path, "Thickness", sign=-1, head=())
    with pytest.raises(InputError, match="along which of them") as refusal:
        tq.read_tests(path)
    check(path, **UNIAXIAL, **proposed(str(refusal.value), "thickness")[0])


def test_which_side_of_a_sheared_block_is_its_height_is_asked(tmp_path):
    path = sheared(tmp_path, "Thickness")
    with pytest.raises(InputError, match="lies between the sheared planes") as refusal:
        tq.read_tests(path)
    sizes, shear, stress = proposed(str(refusal.value), "thickness")
    assert (shear, stress) == (pytest.approx(0.4, rel=1e-2), pytest.approx(16, rel=1e-2))
    check(path, **SIMPLE_SHEAR, **sizes)


def test_the_area_of_two_sides_tells_the_height(tmp_path):
    path = pressed(tmp_path, "Thickness", head=("Test: compression", "Area: 120 mm2"))
    check(path, **UNIAXIAL, compression_positive=True)


def test_one_size_as_given_is_not_enough(tmp_path):
    path = pressed(tmp_path, "Thickness")
    for size in ({"length": "8 mm"}, {"area": "120 mm2"}):
        with pytest.raises(InputError, match="along which of them"):
            tq.read_tests(path, compression_positive=True, **size)
    with pytest.raises(InputError, match=r"height of 8 mm.* give --length and --area"):
        tq.read_tests(pressed(tmp_path, "Height"), compression_positive=True, thickness="8 mm")


def test_a_strip_that_is_pulled_keeps_its_length(tmp_path):
    stretch = np.linspace(1, 1.3, 40)
    head = ["Length: 12 mm", "Width: 10 mm", "Thickness: 8 mm"]
    path = block(tmp_path, head, LENGTH * (stretch - 1), 80 * neo_hookean(stretch))
    check(path, "uniaxial", stretch, neo_hookean(stretch))
