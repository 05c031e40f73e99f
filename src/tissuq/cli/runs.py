"""``tissuq predict``, ``design``, ``export``, ``compare`` and ``show``: what is done with runs of earlier fits."""

from __future__ import annotations

import json
import os
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from tissuq.cli import reading
from tissuq.cli.options import (
    Config,
    Figures,
    Force,
    RunDiscrepancy,
    RunFolder,
    RunMaterial,
    Seed,
    not_converged,
    own_law,
    progress,
)
from tissuq.errors import InputError
from tissuq.studies.settings import DAMAGE, load_settings

if TYPE_CHECKING:
    import xarray as xr

    from tissuq.posterior.ensemble import Sampling

__all__ = ["compare", "design", "export", "predict", "show"]


@partial(reading.reads_files, names={"stress_type": "data_stress_type", "stretch_range": "data_stretch"})
def predict(
    run: RunFolder = None,
    mode: Annotated[
        str | None, typer.Option(help="Loading mode to predict [that of the data, or of the run]; see tissuq modes.")
    ] = None,
    stretch: Annotated[
        str | None,
        typer.Option(help="Stretches (amounts of shear): a range 0.7:2.0, or a list 1.1,1.2,1.5 [where calibrated]."),
    ] = None,
    stretch2: Annotated[
        str | None,
        typer.Option(help="Of the second control of a mode with two, such as biaxial; one number where it is held."),
    ] = None,
    points: Annotated[int | None, typer.Option("--grid-points", help="Stretches in a range [101].")] = None,
    discrepancy: RunDiscrepancy = None,
    prob: Annotated[float | None, typer.Option(help="Probability of the bands [0.95].")] = None,
    stress_type: Annotated[str | None, typer.Option(help="Predict engineering or cauchy stress [engineering].")] = None,
    material: RunMaterial = None,
    data: Annotated[
        Path | None,
        typer.Option(
            help="Measurements of that mode to compare with: a file or a built-in data set. The options below, and "
            "--data-stress-type, say how to read it."
        ),
    ] = None,
    *,
    read_as: dict[str, Any],
    out: Annotated[Path | None, typer.Option(help="Folder for the prediction [RUN-MODE, beside the run].")] = None,
    config: Config = None,
    figures: Figures = True,
    force: Force = False,
) -> None:
    """Predict the stress in any loading mode from a fit, and compare it with measurements."""
    from tissuq.report.prediction import prediction_result
    from tissuq.report.run_folder import check_apart, check_target, run_folder
    from tissuq.report.terminal import print_result
    from tissuq.report.writer import write_result
    from tissuq.studies.prediction_settings import PredictionSettings, run_prediction

    if bool(run) == bool(config):
        raise InputError("give the RUN folder of a fit, or --config run.toml of an earlier prediction.")
    stated = {name: value for name, value in read_as.items() if value is not None}
    if stated and not (data or config):
        raise InputError(f"{', '.join(stated)} can only be used with --data FILE.")
    file = {"file": str(reading.resolve(data))} if data else {}
    options: dict[str, Any] = {
        "run": str(run) if run else None, "mode": mode, "stretch": stretch, "stretch2": stretch2, "points": points,
        "discrepancy": discrepancy, "prob": prob, "stress_type": stress_type, "data": file | stated or None,
    }  # fmt: skip
    settings = load_settings(PredictionSettings, config, options)
    beside = config.parent if config else Path()
    law = own_law(material)
    source = beside / settings.run
    named = source if source.name.strip(".") else source.resolve()  # "." and ".." have no name of their own
    target = out or named.parent / f"{named.name}-{settings.mode_in(beside)}"
    check_apart(target, source)
    check_target(target, force=force)
    with progress() as step:
        prediction = run_prediction(settings, beside, step, law)
        step("writing")
        result = prediction_result(prediction, settings, target, beside, law=material)
        with run_folder(target, force=force) as folder:
            write_result(result, folder, figures=figures)
    print_result(result.record(), target)
    not_converged(["the fit"] if prediction.posterior.solution.is_approximate else [])


def design(
    run: RunFolder = None,
    target: Annotated[
        list[str] | None,
        typer.Option(
            help="Quantity to become less uncertain: modulus (initial shear modulus), a parameter, or a stress as "
            "MODE:STRETCH, such as planar:1.5; repeat for more [modulus]."
        ),
    ] = None,
    candidate: Annotated[
        list[str] | None,
        typer.Option(
            help="A test as 'MODE LOW:HIGH POINTS', such as 'planar 1:1.5 20'; repeat for more [every mode of one "
            "stretch, in several ranges]."
        ),
    ] = None,
    points: Annotated[
        list[int] | None,
        typer.Option(
            "--measurements",
            help="Measurements of every default test; repeat for more [as many as the data, 10 to 40].",
        ),
    ] = None,
    specimen: Annotated[
        str | None,
        typer.Option(
            "--next-specimen",
            help="The next test is of the same specimen or of the other ones [same, unless there are several].",
        ),
    ] = None,
    discrepancy: RunDiscrepancy = None,
    material: RunMaterial = None,
    seed: Seed = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the ranking [runs/RUN-design].")] = None,
    config: Config = None,
    figures: Figures = True,
    force: Force = False,
) -> None:
    """Rank tests that could be made next by how much less uncertain they make a parameter or a prediction."""
    from tissuq.report.design import design_result
    from tissuq.report.run_folder import check_apart, check_target, run_folder
    from tissuq.report.terminal import print_result
    from tissuq.report.writer import write_result
    from tissuq.studies.design import DesignSettings, run_design

    if run is None and config is None:
        raise InputError("give the RUN folder of a fit, or --config run.toml.")
    options: dict[str, Any] = {
        "run": str(run.absolute()) if run else None, "targets": target or None, "candidates": candidate or None,
        "points": points or None, "specimen": specimen, "discrepancy": discrepancy, "seed": seed,
    }  # fmt: skip
    law = own_law(material)
    settings = load_settings(DesignSettings, config, options)
    beside = config.parent if config else Path()
    run_path = (beside / settings.run).resolve()
    folder = out or Path("runs") / f"{run_path.name}-design"
    check_apart(folder, run_path)
    check_target(folder, force=force)
    with progress() as step:
        study = run_design(settings, beside, step, law)
        step("writing")
        recipe = settings.model_copy(update={"run": os.path.relpath(run_path, folder.resolve())})
        result = design_result(study, recipe)
        with run_folder(folder, force=force) as scratch:
            write_result(result, scratch, figures=figures)
    print_result(result.record(), folder)


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
    number: Annotated[int, typer.Option(help="Number of the material in the model (FEBio, LS-DYNA, ANSYS).")] = 1,
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
        "number": number,
    }  # fmt: skip
    CardSettings(**settings)
    posterior = load(run, discrepancy, own_law(material))
    ensemble = posterior.ensemble(draws, seed, cast("Sampling", sampling), admissible=not all_draws)
    source = f"run {run.resolve().name} of tissuq, {sampling} draws from seed {seed}"
    cards = write_cards(ensemble, target, format, force=force, source=source, **settings)
    print_explanations(cards.warnings)
    files, distances = list(cards.files), [row["from_median"] for row in cards.index]
    print(f"Cards: {target / files[0]}" + (f" to {files[-1]}" if len(files) > 1 else "") + f", {INDEX}")
    print(f"The most typical draw, nearest to the median stresses: {files[distances.index(min(distances))]}")


def compare(
    runs: Annotated[list[Path], typer.Argument(help="Run folders, or files of posteriors in them.")],
    out: Annotated[Path | None, typer.Option(help="Folder for table, figure and report.")] = None,
    force: Force = False,
) -> None:
    """Compare fits of the same measurements by evidence and by leave-one-out prediction."""
    from tissuq.assessment import compare as compare_fits
    from tissuq.experiments.units import stress_unit
    from tissuq.report.comparison import comparison_result
    from tissuq.report.run_folder import check_target, run_folder
    from tissuq.report.terminal import print_result
    from tissuq.report.writer import write_result

    if out is not None:
        if any(path.resolve().is_relative_to(out.resolve()) for path in runs):
            raise InputError(f"'{out}' holds one of the compared runs; choose another folder with --out.")
        check_target(out, force=force)
    trees = _trees(runs)
    table = compare_fits(trees)
    units = {str(tree.attrs.get("stress_unit", "MPa")) for tree in trees.values()}
    unit = stress_unit(units.pop() if len(units) == 1 else "MPa")
    result = comparison_result(table, [str(run) for run in runs], unit)
    if out is not None:
        with run_folder(out, force=force) as folder:
            write_result(result, folder)
    print_result(result.record(), out, details=out is None)


def _trees(runs: list[Path]) -> dict[str, xr.DataTree]:
    """Read the posteriors of runs, named by formulation, and by run where there are several."""
    import xarray as xr

    files: dict[str, Path] = {}
    for run in runs:
        paths = sorted((run / "posterior").glob("*.nc")) if run.is_dir() else [run]
        if not paths or not all(path.is_file() for path in paths):
            raise InputError(f"there is no posterior in '{run}': give the folder of a run, or an .nc file in one.")
        for path in paths:
            name = f"{run.name}/{path.stem}" if run.is_dir() and len(runs) > 1 else path.stem
            files[name if name not in files else str(path)] = path
    try:
        trees = {name: xr.open_datatree(path, engine="h5netcdf").load() for name, path in files.items()}
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"a posterior cannot be read: {error}.") from error
    for name, path in files.items():
        trees[name].attrs |= _assessed(path)
    return trees


def _assessed(path: Path) -> dict[str, float]:
    """Return what the assessment of the posterior's run says of its evidence with other priors."""
    from tissuq.report.run_folder import ASSESSMENT

    try:
        rows = json.loads((path.parent.parent / ASSESSMENT).read_text(encoding="utf-8"))
        assessment = next(row for row in rows if row["formulation"] == path.stem)
        return {f"evidence_change_{name}": float(change) for name, change in assessment["evidence_changes"].items()}
    except (OSError, *DAMAGE, StopIteration):
        return {}  # a single file, or a run without an assessment


def show(
    run_folder: Annotated[Path, typer.Argument(help="Folder of a run.")],
    details: Annotated[
        bool, typer.Option("--details", help="Also stability, what the discrepancy does, and all warnings.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Everything as one JSON object, for programs.")] = False,
) -> None:
    """Print the answer of a run and where its report lies."""
    from tissuq.cli.tables import print_json, print_summary
    from tissuq.report.terminal import print_result
    from tissuq.report.writer import read_record

    if as_json:
        print_json(run_folder)
    elif record := read_record(run_folder):
        print_result(record, run_folder, details=details)
    else:
        print_summary(run_folder, details=details)
