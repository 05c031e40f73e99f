"""``tissuq export``: material cards of draws."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, cast

from tissuq.cli.call import Call
from tissuq.cli.command import command
from tissuq.cli.running import LawOfRun
from tissuq.studies.option import option
from tissuq.studies.shared_options import RunSettings, sampling

if TYPE_CHECKING:
    from tissuq.posterior.drawn_materials import Sampling

__all__ = ["export"]


class ExportSettings(RunSettings):
    """Everything that material cards depend on."""

    format: str = option("abaqus", "abaqus, calculix, ansys, febio, ls-dyna, or table (W1 and W2 as CSV).")
    draws: int = option(20, "Number of draws, a card each.")
    sampling: str = sampling()
    all_draws: bool = option(False, "Keep draws that are not stable over the measured range.")
    law: str | None = option(
        None,
        "Write the nearest polynomial, reduced-polynomial, ogden or (FEBio) mixture [the draws' own law where the code "
        "has it, else the best of these].",
    )
    order: int | None = option(None, "Order or number of terms of that law.")
    unit: str = option("MPa", "Unit of stress of the model: MPa, kPa or Pa.")
    bulk_modulus: float | None = option(None, "In that unit, of all draws [1000 times the mean initial shear modulus].")
    poisson: float | None = option(None, "Instead: Poisson's ratio of all draws.")
    name: str = option("TISSUE", "Name of the material in the cards.")
    number: int = option(1, "Number of the material in the model (FEBio, LS-DYNA, ANSYS).")
    seed: int = option(0, "Seed of the draws.")


class ExportOptions(LawOfRun):
    """Where cards are written."""

    out: Path | None = option(None, "Folder for the cards [cards/RUN-FORMAT].")
    force: bool = option(False, "Replace an existing folder of the same kind.")


@command(ExportSettings, ExportOptions)
def export(call: Call[ExportSettings, ExportOptions]) -> None:
    """Write draws of a posterior, discrepancy included, as material cards for finite-element codes."""
    from tissuq.export import CardSettings, card_format
    from tissuq.report.cards import INDEX, write_cards
    from tissuq.report.run_folder import check_apart, check_target
    from tissuq.report.terminal import print_explanations
    from tissuq.studies.earlier_run import load

    settings, force = call.settings, call.how.force
    run = Path(settings.run)
    target = call.how.out or Path("cards") / f"{run.resolve().name}-{settings.format}"
    check_apart(target, run)
    card_format(settings.format)
    check_target(target, call.command, force=force)
    of_cards = settings.model_dump(include={"law", "order", "unit", "bulk_modulus", "poisson", "name", "number"})
    CardSettings(**of_cards)
    posterior = load(run, settings.discrepancy, settings.law_of(call.law))
    spread = cast("Sampling", settings.sampling)
    ensemble = posterior.ensemble(settings.draws, settings.seed, spread, admissible=not settings.all_draws)
    source = f"run {run.resolve().name} of tissuq, {spread} draws from seed {settings.seed}"
    cards = write_cards(ensemble, target, settings.format, force=force, source=source, **of_cards)
    print_explanations(cards.warnings)
    files, distances = list(cards.files), [row["from_median"] for row in cards.index]
    print(f"Cards: {target / files[0]}" + (f" to {files[-1]}" if len(files) > 1 else "") + f", {INDEX}")
    print(f"The most typical draw, nearest to the median stresses: {files[distances.index(min(distances))]}")
