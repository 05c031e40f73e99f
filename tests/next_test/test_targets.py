"""What a test is to tell."""

from __future__ import annotations

import pytest

import tissuq as tq
from tissuq.next_test.targets import target_named


@pytest.fixture(scope="module")
def model():
    """A material of two parameters, and noise of unknown size."""
    stretch = [0.7, 0.8, 0.9, 1.1, 1.2, 1.3, 1.4]
    data = tq.simulate("mooney-rivlin", {"C10": 0.5, "C01": 0.1}, stretch, 0.02, seed=1)
    return tq.fit(data, material="mooney-rivlin", discrepancy="taylor").model


@pytest.mark.parametrize(
    ("text", "title", "unit", "is_stiffness"),
    [
        ("C01", "C01", "MPa", True),
        ("noise_sd", "noise_sd", "MPa", False),
        ("modulus", "initial shear modulus", "MPa", True),
        ("planar:1.5", "planar stress at 1.5", "MPa", True),
        ("simple-shear:0.2", "simple-shear stress at 0.2", "MPa", True),
    ],
)
def test_a_text_names_a_target(model, text, title, unit, is_stiffness):
    target = target_named(text, model)
    assert (target.name, target.title, target.unit) == (text, title, unit)
    assert target.is_stiffness == is_stiffness


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("C30", "no target 'C30'"),
        ("planar:x", "'x' is not a stretch"),
        ("planar:-1", "not positive"),
        ("biaxial:1.5", "several controls"),
        ("c1", "no standard deviation"),
    ],
)
def test_what_is_no_target_is_refused(model, text, words):
    with pytest.raises(tq.InputError, match=words):
        target_named(text, model)


def test_a_mode_must_be_known(model):
    with pytest.raises(tq.ModelError, match="planer"):
        target_named("planer:1.5", model)
