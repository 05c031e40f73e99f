import gc

import numpy as np
import pytest

from tissuq.errors import ModelError
from tissuq.experiments.modes import LoadingMode, loading_mode, loading_modes


@pytest.fixture(params=list(loading_modes()))
def mode(request):
    return loading_mode(request.param)


def test_the_modes_are_uniaxial_equibiaxial_and_planar():
    assert {"uniaxial", "equibiaxial", "planar"} <= set(loading_modes())


def test_every_mode_is_undeformed_at_stretch_one(mode):
    assert mode.principal_stretches(1.0) == (1.0, 1.0, 1.0)


@pytest.mark.parametrize("stretch", [0.3, 0.9, 1.1, 4.0])
def test_every_mode_keeps_the_volume(mode, stretch):
    assert np.prod(mode.principal_stretches(stretch)) == pytest.approx(1.0, rel=1e-14)


@pytest.mark.parametrize("stretch", [0.3, 0.9, 1.1, 4.0])
def test_every_mode_has_its_stretch_along_the_loaded_axes(mode, stretch):
    assert mode.principal_stretches(stretch)[: mode.loaded_axes] == (stretch,) * mode.loaded_axes


def test_every_mode_says_what_it_is(mode):
    assert mode.description


@pytest.mark.parametrize(
    ("name", "at_four"),
    [("uniaxial", (4.0, 0.5, 0.5)), ("equibiaxial", (4.0, 4.0, 0.0625)), ("planar", (4.0, 1.0, 0.25))],
)
def test_the_principal_stretches_are_those_of_the_textbook(name, at_four):
    assert loading_mode(name).principal_stretches(4.0) == pytest.approx(at_four)


def test_a_mode_is_taken_as_it_is():
    uniaxial = loading_mode("uniaxial")
    assert loading_mode(uniaxial) is uniaxial


def test_modes_of_the_same_kind_are_equal():
    assert loading_mode("planar") == loading_mode("planar")
    assert loading_mode("planar") != loading_mode("uniaxial")


def test_an_unknown_mode_is_answered_with_the_modes_there_are():
    with pytest.raises(ModelError, match=r"no loading mode named 'uniaxal'.*Did you mean 'uniaxial'.*planar"):
        loading_mode("uniaxal")


def test_a_mode_defined_outside_the_package_is_found_by_its_name():
    class Squeeze(LoadingMode):
        name = "squeeze-for-a-test"
        description = "lateral compression"

        def principal_stretches(self, stretch):
            return stretch**-0.5, stretch**-0.5, stretch

    assert loading_mode("squeeze-for-a-test") == Squeeze()
    del Squeeze
    gc.collect()  # or the tests over all modes would see it
    assert "squeeze-for-a-test" not in loading_modes()
