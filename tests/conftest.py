"""Shared fixtures: the paper's data and priors, and the oracle beside this file."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tissuq.studies.paper import PaperSettings

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def paper():
    """The default settings of the paper's study."""
    return PaperSettings()


@pytest.fixture(scope="session")
def boxes(paper):
    """The paper's uniform priors as (low, high)."""
    return {symbol: (prior["low"], prior["high"]) for symbol, prior in paper.priors.items()}
