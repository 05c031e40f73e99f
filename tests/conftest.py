"""Shared fixtures: the paper's data and priors, and the oracle beside this file."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import pytest

from tissuq import registry
from tissuq.validation.paper import PaperSettings

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session", autouse=True)
def gallery():
    """The posteriors of `gallery.py`, which no test may change."""
    yield
    if "gallery" in sys.modules:
        assert not sys.modules["gallery"].changed(), "a test has changed a posterior that others look at, too"


@pytest.fixture(scope="session", autouse=True)
def installed_packages():
    """Look for entry points of other packages once: what is installed stays so while tests run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(registry, "entry_points", cache(registry.entry_points))
        yield


@pytest.fixture(scope="session")
def paper():
    """The default settings of the paper's study."""
    return PaperSettings()


@pytest.fixture
def one_range(monkeypatch):
    """Leave out the study's other stretch ranges, of which `whole_paper_run` of the command line has all."""
    monkeypatch.setattr("tissuq.validation.paper.study.RANGES", ())


@pytest.fixture(scope="session")
def boxes(paper):
    """The paper's uniform priors as (low, high)."""
    return {symbol: (prior["low"], prior["high"]) for symbol, prior in paper.priors.items()}
