"""Simulation-based calibration: whether posteriors are what their priors and the data make them."""

from tissuq.studies.sbc.campaign import run_sbc
from tissuq.studies.sbc.settings import SbcSettings
from tissuq.studies.sbc.summary import summarise_ranks

__all__ = ["SbcSettings", "run_sbc", "summarise_ranks"]
