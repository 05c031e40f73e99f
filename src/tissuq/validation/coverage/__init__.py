"""Whether intervals hold: campaigns over true materials, designs, noise, formulations and replicates."""

from tissuq.validation.coverage.campaign import run_campaign, summarise, summarise_unseen
from tissuq.validation.coverage.settings import PRESETS, CoverageSettings, Design, preset

__all__ = ["PRESETS", "CoverageSettings", "Design", "preset", "run_campaign", "summarise", "summarise_unseen"]
