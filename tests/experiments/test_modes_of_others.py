"""A loading mode that is not from here is refused where its deformations are wrong, and used where they are right."""

from __future__ import annotations

import pytest

import tissuq as tq


def used(principal_stretches):
    """Use a mode with these principal stretches, as a script of one's own defines it, under a name that is not kept."""
    names = {
        "name": property(lambda self: "own-mode"),
        "description": "of a test",
        "principal_stretches": principal_stretches,
    }
    mode = type("OwnMode", (tq.LoadingMode,), names)()
    return tq.simulate("neo-hookean", {"C10": 0.5}, [1.1, 1.2], noise_sd=0.0001, mode=mode, seed=1)


@pytest.mark.parametrize(
    ("principal_stretches", "words"),
    [
        (lambda self, point: (point, point**-0.3, point**-0.3), "it changes the volume.*of product 1.039, not 1"),
        (lambda self, point: (point, 1 / point), "expected 3, got 2"),
        (lambda self, point: (2 * point, 0.5 / point, 1.0), "where nothing is deformed are 2, 0.5, 1, not 1"),
        (lambda self, point: (point, undefined, 1 / point), "undefined"),  # noqa: F821
    ],
)
def test_a_mode_with_wrong_deformations_is_refused(principal_stretches, words):
    with pytest.raises(tq.ModelError, match=f"loading mode 'own-mode' .*OwnMode.* cannot be used: .*{words}"):
        used(principal_stretches)


def test_a_mode_that_keeps_the_volume_is_used():
    data = used(lambda self, point: (point, point**-0.25, point**-0.75))
    energy = [0.5 * (s**2 + s**-0.5 + s**-1.5 - 3) for s in (1.1 - 1e-5, 1.1 + 1e-5)]
    assert data.stress[0] == pytest.approx((energy[1] - energy[0]) / 2e-5, abs=5e-4)
