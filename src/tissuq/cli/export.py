"""``tissuq export``: draws of a run's posterior as material cards."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from tissuq.cli.options import Force, RunDiscrepancy, RunMaterial, own_law

if TYPE_CHECKING:
    from tissuq.posterior.ensemble import Sampling

__all__ = ["export"]


def export(
    run: Annotated[Path, typer.Argument(help="Folder of a run of tissuq fit.")],
    format: Annotated[
        str, typer.Option(help="abaqus, calculix, ansys, febio, ls-dyna, or table (W1 and W2 as CSV).")
    ] = "abaqus",
    draws: Annotated[int, typer.Option(help="Number of draws, a card each.")] = 20,
    discrepancy: RunDiscrepancy = None,
    sampling: Annotated[str, typer.Option(help="How draws spread: sobol, latin or random.")] = "sobol",
    all_draws: Annotated[
        bool, typer.Option("--all-draws", help="Keep draws that are not stable over the measured range.")
    ] = False,
    law: Annotated[
        str | None,
        typer.Option(
            help="Write the nearest polynomial, reduced-polynomial, ogden or (FEBio) mixture [the draws' own law where "
            "the code has it, else the best of these]."
        ),
    ] = None,
    order: Annotated[int | None, typer.Option(help="Order or number of terms of that law.")] = None,
    unit: Annotated[str, typer.Option(help="Unit of stress of the model: MPa, kPa or Pa.")] = "MPa",
    bulk_modulus: Annotated[
        float | None, typer.Option(help="In that unit, of all draws [1000 times the mean initial shear modulus].")
    ] = None,
    poisson: Annotated[float | None, typer.Option(help="Instead: Poisson's ratio of all draws.")] = None,
    name: Annotated[str, typer.Option(help="Name of the material in the cards.")] = "TISSUE",
    material: RunMaterial = None,
    seed: Annotated[int, typer.Option(help="Seed of the draws.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder for the cards [cards/RUN-FORMAT].")] = None,
    force: Force = False,
) -> None:
    """Write draws of a posterior, discrepancy included, as material cards for finite-element codes."""
    from tissuq.cli.tables import print_explanations
    from tissuq.export import CardSettings, card_format
    from tissuq.report.cards import INDEX, write_cards
    from tissuq.report.run_folder import check_apart, check_target
    from tissuq.studies.earlier_run import load

    target = out or Path("cards") / f"{run.resolve().name}-{format}"
    check_apart(target, run)
    card_format(format)
    check_target(target, force=force)
    settings: dict[str, Any] = {
        "law": law, "order": order, "unit": unit, "bulk_modulus": bulk_modulus, "poisson": poisson, "name": name,
    }  # fmt: skip
    CardSettings(**settings)
    posterior = load(run, discrepancy, own_law(material))
    ensemble = posterior.ensemble(draws, seed, cast("Sampling", sampling), admissible=not all_draws)
    source = f"run {run.resolve().name} of tissuq fit, {sampling} draws from seed {seed}"
    cards = write_cards(ensemble, target, format, force=force, source=source, **settings)
    print_explanations(cards.warnings)
    files, typical = list(cards.files), min(cards.index, key=lambda row: row["from_median"])
    print(f"Cards: {target / files[0]}" + (f" to {files[-1]}" if len(files) > 1 else "") + f", {INDEX}")
    print(f"The most typical draw, nearest to the median stresses: {typical['file']}")
