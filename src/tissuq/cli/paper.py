"""``tissuq paper``: the study of the paper."""

from __future__ import annotations

from pathlib import Path

from tissuq.cli.call import Call, not_converged
from tissuq.cli.command import command
from tissuq.cli.running import Written
from tissuq.studies.campaign_settings import PaperOptions
from tissuq.studies.option import option
from tissuq.studies.option_texts import range_of

__all__ = ["paper"]


class PaperRunning(Written):
    """How the study is written."""

    stretch_range: tuple[float, float] | None = option(
        None, "Stretches LOW:HIGH [0.5:4.25].", takes=str, parse=range_of("--stretch-range", "0.5:4.25")
    )
    out: Path = option(Path("runs/paper"), "Folder for the run [runs/paper].")


@command(PaperOptions, PaperRunning, "tissuq.validation.paper:PaperSettings")
def paper(call: Call[PaperOptions, PaperRunning]) -> None:
    """Carry out the study of Zeraatpisheh, Bordas & Beex (2021) and check its claims."""
    from tissuq.report.paper import paper_result
    from tissuq.validation.paper import PaperSettings, run_paper
    from tissuq.validation.paper.study import steps_of

    low, high = call.how.stretch_range or (None, None)
    settings = call.loaded_as(PaperSettings, stretch_low=low, stretch_high=high)
    target = call.target(call.how.out)
    study = call.carried_out(target, lambda step: run_paper(settings, step), paper_result, steps_of(settings))
    not_converged(study.not_converged)
