"""``tissuq calibrate --model`` with fibres: CalculiX in a deck of one element, the posterior against one on a grid."""

from __future__ import annotations

import json

import numpy as np
import pytest

from one_element import CCX
from tissuq.mechanics import material_named

from .conftest import rows_of
from .test_ensemble_fibres import DECK

MATERIAL = "neo-hookean+standard-fibres@30"
TRUTH, NOISE_SD = {"C10": 0.02, "k": 0.03}, 2e-4
ENDS = {"C10": (0.01, 0.03), "k": (0.0, 0.09)}
ALONG_LOAD = DECK.replace("0., 1., 0., -1., 0., 0.", "1., 0., 0., 0., 1., 0.").replace(
    "TIP, 1, 1, 0.15", "TIP, 1, 1, 0.2"
)
ELONGATIONS = np.linspace(0.02, 0.2, 10)


def forces(c10, k):
    """Return forces (..., 10) of a unit cube of C10 (I1 - 3) + k sum of <I4 - 1>^2 / 2 over two families.

    The fibres lie at 30 degrees on both sides of the load; the stretch across, where its stress is zero, is bisected.
    """
    c10, k, x, cosine, sine = np.asarray(c10)[..., None], np.asarray(k)[..., None], 1 + ELONGATIONS, 0.75, 0.25

    def slopes(y):
        pull = 4 * k * np.maximum(x**2 * cosine + y**2 * sine - 1, 0.0)
        along = 2 * c10 * (x - 1 / (x**3 * y**2)) + pull * x * cosine
        return along, 2 * c10 * (y - 1 / (x**2 * y**3)) + pull * y * sine

    low, high = np.full_like(c10 * x, 0.3), np.full_like(c10 * x, 1.2)
    for _ in range(50):
        middle = (low + high) / 2
        is_pulled = slopes(middle)[1] > 0
        low, high = np.where(is_pulled, low, middle), np.where(is_pulled, middle, high)
    return slopes(low)[0]


def written(folder, deck=ALONG_LOAD):
    """Write the deck, and forces with noise at elongations; return these forces."""
    (folder / "cube.inp").write_text(deck)
    measured = forces(*TRUTH.values()) + NOISE_SD * np.random.default_rng(5).standard_normal(len(ELONGATIONS))
    rows = "".join(f"{at:.4f},{value:.7f}\n" for at, value in zip(ELONGATIONS, measured, strict=True))
    (folder / "pull.csv").write_text(f"elongation (mm),force (N)\n{rows}")
    return measured


def words(material=MATERIAL, replaced="ELASTIC_FIBER_WALL", ends=ENDS, stretch="0.9:1.25"):
    priors = [word for name, (low, high) in ends.items() for word in ("--prior", f"{name}=uniform({low},{high})")]
    return [
        "calibrate", "pull.csv", "--model", "cube.inp", "--replace", replaced, "--material", material, "--range",
        stretch, "--qoi", "force=RF1@TIP", "--along", "elongation=U1@TIP", "--noise-sd", NOISE_SD, *priors,
        "--discrepancy", "none", "--runs", 16, "--max-jobs", 1, "--no-figures", "--out", "out",
    ]  # fmt: skip


@pytest.mark.slow
@pytest.mark.skipif(CCX is None, reason="CalculiX (ccx) is not installed: make system")
def test_fibres_of_a_deck_have_the_posterior_of_a_grid_and_go_on_to_cards(done, here):
    measured = written(here)
    done(*words())
    axes = [np.linspace(*ends, 301) for ends in ENDS.values()]
    grid = np.array(np.meshgrid(*axes, indexing="ij")).reshape(2, -1)
    weight = np.exp(-0.5 * (((forces(*grid) - measured) / NOISE_SD) ** 2).sum(axis=1))
    means = grid @ weight / weight.sum()
    sds = np.sqrt((grid - means[:, None]) ** 2 @ weight / weight.sum())
    rows = {row["parameter"]: row for row in json.loads((here / "out" / "summary.json").read_text())}
    for symbol, mean, sd in zip(ENDS, means, sds, strict=True):
        assert rows[symbol]["mean"] == pytest.approx(mean, abs=0.1 * sd)
        assert rows[symbol]["sd"] == pytest.approx(sd, rel=0.05)
    done("export", "out", "--format", "calculix", "--draws", 64, "--out", "cards")
    drawn = [float(row["C10"]) for row in rows_of(here / "cards" / "index.csv")]
    assert np.mean(drawn) == pytest.approx(means[0], abs=0.3 * sds[0])
    done("ensemble", "out", "cube.inp", "--replace", "ELASTIC_FIBER_WALL", "--qoi", "force=RF1@TIP", "--dry-run")


@pytest.mark.skipif(CCX is None, reason="CalculiX (ccx) is not installed: make system")
@pytest.mark.parametrize(
    ("matrix", "name", "stretch", "advice"),
    [
        ("neo-hookean", "Wall", "0.9:1.25", "rename 'Wall' to 'ELASTIC_FIBER_Wall'"),
        ("yeoh", "ELASTIC_FIBER_WALL", "0.9:1.25", "in a neo-Hookean matrix, with nothing beside"),
        ("gent", "ELASTIC_FIBER_WALL", "0.7:1.25", "in a neo-Hookean matrix, with nothing beside"),
        ("neo-hookean", "ELASTIC_FIBER_WALL", "0.7:1", "goes beyond 1, not 0.7:1"),
    ],
)
def test_fibres_that_a_deck_cannot_have_are_refused_before_anything_is_run(
    refused, here, matrix, name, stretch, advice
):
    written(here, ALONG_LOAD.replace("ELASTIC_FIBER_WALL", name))
    material = f"{matrix}+standard-fibres@30"
    ends = {parameter.symbol: (0.01, 1) for parameter in material_named(material).parameters}
    refused([advice], *words(material, name, ends, stretch))
    assert not (here / "out").exists()
