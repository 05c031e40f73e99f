"""``tissuq predict``, ``design`` and ``export``: stresses, next tests and material cards from a fit."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, cast

from tissuq.cli.call import Call, IntoFolder, LawOfRun, OfRun, not_converged
from tissuq.cli.command import command
from tissuq.errors import InputError
from tissuq.studies.files_of_tests import resolve
from tissuq.studies.finite_element_settings import CardOptions
from tissuq.studies.option import option, sampling
from tissuq.studies.run_settings import DesignSettings, PredictionSettings, RunSettings
from tissuq.studies.settings import seen_from

if TYPE_CHECKING:
    from tissuq.posterior.drawn_materials import Sampling


@command(PredictionSettings, OfRun, out="Folder for the prediction [RUN-MODE, beside the run].")
def predict(call: Call[PredictionSettings, OfRun]) -> None:
    """Predict the stress in any loading mode from a fit, and compare it with measurements."""
    from tissuq.report.prediction import prediction_result
    from tissuq.studies.predict_run import run_prediction

    call.check_source("run", "the RUN folder of a fit", "prediction")
    data = call.stated.get("data", {})
    if data and not ("file" in data or call.config):
        typed = [words for path, words in call.typed.items() if path.startswith("data.")]
        raise InputError(f"{', '.join(typed)} can only be used with --data FILE.")
    if "file" in data:
        data["file"] = str(resolve(data["file"]))
    settings, beside, law = call.settings, call.beside, call.law
    source = beside / settings.run
    named = source if source.name.strip(".") else source.resolve()  # "." and ".." have no name of their own
    target = call.target(named.parent / f"{named.name}-{settings.mode_in(beside, law)}", apart_from=source)
    prediction = call.carried_out(
        target,
        lambda step: run_prediction(settings, beside, step, law),
        partial(prediction_result, settings=settings, target=target, beside=beside, law=call.how.user_law),
    )
    not_converged(["the fit"] if prediction.posterior.solution.is_approximate else [])


@command(DesignSettings, OfRun, out="Folder for the ranking [runs/RUN-design].")
def design(call: Call[DesignSettings, OfRun]) -> None:
    """Rank tests that could be made next by how much less uncertain they make a parameter or a prediction."""
    from tissuq.report.design import design_result
    from tissuq.report.source_run import said_by
    from tissuq.studies.design import run_design, with_folder

    stated = call.stated.get("run")
    if not (call.config or stated):
        raise InputError("give the RUN folder of a fit, or --config run.toml.")

    def beside_settings(name: str) -> str:  # where all names of the settings count from
        is_from_here = not call.config or Path(name).is_absolute()
        return str(name) if is_from_here else seen_from(call.beside, name)

    typed = tuple(with_folder(name, beside_settings) for name in call.stated.get("targets", ()))
    settings = call.loaded(run=beside_settings(stated) if stated else None, targets=typed or None)
    run = (call.beside / settings.run).resolve()
    target = call.target(Path("runs") / f"{run.name}-design", apart_from=call.beside / settings.run)

    def from_target(name: str) -> str:
        return seen_from(target, call.beside / name)

    targets = tuple(with_folder(name, from_target) for name in settings.targets)
    recipe = settings.model_copy(update={"run": from_target(settings.run), "targets": targets})

    said_by(run)  # refused before the ranking where it is damaged
    call.carried_out(
        target,
        lambda step: run_design(settings, call.beside, step, call.law),
        partial(design_result, recipe=recipe, run=run),
    )


class ExportSettings(CardOptions, RunSettings):
    """Everything that material cards depend on."""

    format: str = option("abaqus", "abaqus, calculix, ansys, febio, ls-dyna, or table (W1 and W2 as CSV).")
    draws: int = option(20, "Number of draws, a card each.")
    sampling: str = sampling()
    all_draws: bool = option(False, "Keep draws that are not stable over the measured range.")
    name: str = option("TISSUE", "Name of the material in the cards.")
    number: int = option(1, "Number of the material in the model (FEBio, LS-DYNA, ANSYS).")
    seed: int = option(0, "Seed of the draws.")


class ExportOptions(LawOfRun, IntoFolder):
    """Where cards are written."""


@command(ExportSettings, ExportOptions, out="Folder for the cards [cards/RUN-FORMAT].")
def export(call: Call[ExportSettings, ExportOptions]) -> None:
    """Write draws of a posterior, discrepancy included, as material cards for finite-element codes."""
    from tissuq.export import card_format
    from tissuq.export.cards import calibrated_stretches
    from tissuq.report.cards import INDEX, write_cards
    from tissuq.report.source_run import said_by
    from tissuq.report.terminal import print_explanations, print_next, print_uses
    from tissuq.studies.earlier_run import load

    settings = call.settings
    run = Path(settings.run)
    code = card_format(settings.format)
    if idle := [f"--{name}" for name in code.unused if name in call.stated]:
        raise InputError(f"{' and '.join(idle)}: {code.kind} of the format '{code.name}' have none; leave it out.")
    target = call.target(Path("cards") / f"{run.resolve().name}-{settings.format}", apart_from=run)
    of_cards = vars(settings.card_settings(name=settings.name, number=settings.number))
    posterior = load(run, settings.discrepancy, settings.law_of(call.law))
    spread = cast("Sampling", settings.sampling)
    ensemble = posterior.ensemble(settings.draws, settings.seed, spread, admissible=not settings.all_draws)
    said = said_by(run, posterior.model)
    source = said.source_of_cards(run, spread, settings.seed)
    cards = write_cards(ensemble, target, settings.format, force=call.how.force, **of_cards | {"source": source})
    if use := said.use:
        print_uses([{"purpose": use.purpose, "verdict": use.verdict, "reason": use.reason}])
    print_explanations([*cards.warnings, f"In the {code.kind}: {calibrated_stretches(ensemble)}."])
    files, distances = list(cards.files), [row["from_median"] for row in cards.index]
    last = f" to {files[-1]}" if len(files) > 1 else ""
    print(f"{code.kind.capitalize()}: {target / files[0]}{last}, {INDEX}")
    print(f"The most typical draw, nearest to the median stresses: {files[distances.index(min(distances))]}")
    if said.advice:
        print_next(said.advice)
