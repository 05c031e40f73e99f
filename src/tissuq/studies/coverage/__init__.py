"""Whether intervals hold: campaigns over true materials, designs, noise, formulations and replicates."""

from tissuq.studies.coverage.campaign import run_campaign
from tissuq.studies.coverage.settings import PRESETS, CoverageSettings, Design, preset
from tissuq.studies.coverage.summary import summarise, summarise_unseen

__all__ = ["PRESETS", "CoverageSettings", "Design", "preset", "run_campaign", "summarise", "summarise_unseen"]
