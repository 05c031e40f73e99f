"""Simulation-based calibration: whether posteriors are what their priors and the data make them."""

from tissuq.validation.sbc.campaign import run_sbc
from tissuq.validation.sbc.settings import SbcSettings
from tissuq.validation.sbc.summary import summarise_ranks

__all__ = ["SbcSettings", "run_sbc", "summarise_ranks"]
