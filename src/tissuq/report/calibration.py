"""The result of a calibration: the parameters, tables, forward runs, draws and figures."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import numpy as np

from tissuq.decks.model_files import MODEL, extra_files, stored_place
from tissuq.decks.quantity import located
from tissuq.emulation import DeckForward, SeveralModels
from tissuq.emulation.problem import symbol_of
from tissuq.experiments.units import stress_unit
from tissuq.model.discrepancy import NoDiscrepancy
from tissuq.model.noise import NOISE_SD
from tissuq.report.calibration_figures import band_figure, check_figure, marginals_figure
from tissuq.report.calibration_in_words import (
    SUM_OF_PARTS,
    finding_of,
    methods_of_calibration,
    names_of,
    next_step_of,
    noises_in_words,
    uses_of_calibration,
)
from tissuq.report.inputs import Copies
from tissuq.report.result import MAX_NUMBERS, Block, Number, Picture, Result, Section, Table
from tissuq.report.tables import Row, interval, known_number, rows_of, significant
from tissuq.report.writer import posterior_files
from tissuq.studies.calibration import CalibrationStudy, Measured
from tissuq.studies.calibration_settings import CalibrationSettings
from tissuq.studies.settings import INPUT

WORST_RUNS = 8
"""Rows of the page's table of runs that were left out."""
BY_EMULATOR = (
    "Intervals are the shortest that hold 95 %. By emulator: share of the posterior variance caused by the error of "
    "the emulator."
)
PARAMETER = "of the forward model"
OF_ERRORS = {"c": "sd of the discrepancy", "psi": "length of the discrepancy", NOISE_SD.symbol: "sd of the noise"}
"""What the parameters of a process and of the noise are."""
DISCREPANCY = (
    "The discrepancy is the error of the forward model: a curve over the control with this sd, which bends over this "
    "length."
)
EMULATOR = (
    "A Gaussian process replaces the model: its prediction and the variance of its error are part of the likelihood. "
    "Checks on runs that were not used to build it:"
)
WORST = (
    "The runs that are predicted worst from the others. Error and sd: root mean square over the outputs, as a share of "
    "that of all runs; standardised: error in standard deviations of the emulator, about 1."
)
SOBOL = (
    "Share of the variance of the outputs, where all parameters vary over their priors, that a parameter explains "
    "alone (first) and with its interactions (total): Sobol's indices from the emulator."
)


def calibration_result(study: CalibrationStudy, beside: Path = Path()) -> Result:
    """Return what a calibration says.

    Parameters
    ----------
    study : CalibrationStudy
    beside : Path
        Where the file of the settings lies, unless it is absolute.
    """
    calibration, settings = study.calibration, study.settings
    copies, relocated = _copies(study, beside)
    files = copies | _tables(study) | {"calibration.nc": calibration.save}
    if study.posterior is not None:
        files |= posterior_files({NoDiscrepancy.name: study.posterior})
    model, runs = study.forward.name, len(calibration.runs)
    has_discrepancy = calibration.problem.discrepancy.is_correlated
    inside_alone = calibration.predictive_coverage(discrepancy=False)
    remark = f"of the forward model alone: {100 * inside_alone:.0f} %" if has_discrepancy else ""
    of_law = study.posterior.answer.estimates[:1] if study.posterior is not None else ()
    to_mpa = stress_unit(settings.unit).to_mpa
    numbers = [
        Number(name, mean / to_mpa, low / to_mpa, high / to_mpa, settings.unit) for name, mean, low, high in of_law
    ]
    numbers += [
        Number(symbol, marginal.mean, *marginal.hdi(), study.units.get(symbol, ""))
        for symbol, marginal in calibration.marginals.items()
        if symbol in calibration.problem.forward_symbols
    ]
    inside, uses = f"{100 * calibration.predictive_coverage():.0f} % of the measurements", uses_of_calibration(study)
    return Result(
        command=_repeated(settings.model_copy(update=relocated)),
        title=f"Forward model {model}: {names_of(study)}",
        subject=(
            f"{len(calibration.problem.measured)} measurements · {runs} runs · discrepancy "
            f"{calibration.problem.discrepancy.name}"
        ),
        numbers=(*numbers[:MAX_NUMBERS], Number("inside the band", inside, remark=remark)),
        finding=finding_of(study),
        uses=uses,
        next_step=next_step_of(study, uses),
        picture=Picture(
            "answer", lambda: band_figure(calibration, study.data, is_narrow=True),
            "Predictive band over the measurements", "95 % predictive band of a new measurement, including noise.",
        ),
        tables=(_parameters(study),),
        sections=(*_sections(study), methods_of_calibration(study, numbers)),
        warnings=tuple(calibration.warnings),
        files=files,
        recipe=settings.model_copy(update=relocated),
    )  # fmt: skip


def _repeated(settings: CalibrationSettings) -> str:
    """Return the command that repeats a run of stored settings, with what must be named again."""
    return shlex.join(["calibrate", *(word for _, option, text in settings.run_by_name() for word in (option, text))])


def _copies(study: CalibrationStudy, beside: Path) -> tuple[Copies, dict[str, Any]]:
    """Return copies of the user's files, so that the run can be repeated, and the settings that name them."""
    settings, copies, decks = study.settings, Copies(), _decks(study)
    folders = _folders(len(settings.files))
    files = [copies.of_file(beside / file, folder) for file, folder in zip(settings.files, folders, strict=True)]
    relocated: dict[str, Any] = {"files": tuple(files)}
    if not decks:
        return copies, relocated | ({"forward": copies.of_code(settings.forward)} if settings.forward else {})
    models, also_copies = list[str](), list[str]()
    for folder, (_, forward) in zip(_folders(len(decks)), decks, strict=True):
        deck, stored = forward.read_deck, f"{folder}/{MODEL}"
        of_model = {name: deck.root / name for name in deck.files} | extra_files(deck, forward.also, Path())
        copies.update({f"{stored}/{name}": file for name, file in of_model.items()})
        models.append(f"{stored}/{deck.main}")
        also = [stored_place(deck, Path(file)) for file in forward.also]
        also_copies += [file if Path(file).is_absolute() else f"{folder}/{file}" for file in also]
    relocated |= {"models": tuple(models), "also": list(dict.fromkeys(also_copies))}
    for setting in ("quantities", "along"):
        texts = getattr(settings, setting)
        relocated[setting] = {name: copies.of_code(located(text, beside)) for name, text in texts.items()}
    return copies, relocated


def _folders(count: int) -> list[str]:
    """Return the folders of the input of each of several experiments."""
    return [INPUT] if count == 1 else [f"{INPUT}/{number}" for number in range(1, count + 1)]


def _decks(study: CalibrationStudy) -> list[tuple[tuple[str, ...], DeckForward]]:
    """Return the finite-element models, each with the names of what it gives; none of other forward models."""
    if isinstance(study.forward, DeckForward):
        return [(tuple(study.data), study.forward)]
    models = study.forward.models if isinstance(study.forward, SeveralModels) else ()
    return [(names, model) for names, model in models if isinstance(model, DeckForward)]


def _tables(study: CalibrationStudy) -> dict[str, Any]:
    calibration, problem = study.calibration, study.calibration.problem
    rows: list[Row] = [
        {
            "parameter": str(symbol),
            "unit": study.units.get(str(symbol), ""),
            "prior": str(calibration.problem.priors[str(symbol)]),
        }
        | {str(name): known_number(value) for name, value in estimates.items()}
        for symbol, estimates in calibration.summary().iterrows()
    ]
    bands = {name: calibration.predict(discrepancy=kind) for name, kind in (("", True), ("_model_alone", False))}
    table: dict[str, Any] = {"control": problem.control, "measured": problem.measured}
    for suffix, band in bands.items():
        table |= {f"{name}{suffix}": band[name].to_numpy() for name in ("mean", "low", "high")}
    names = [name for name, (start, stop) in problem.quantities.items() for _ in range(stop - start)]
    named = [{"quantity": name} if name else {} for name in names]
    runs = calibration.runs
    parameters = dict(zip(runs.symbols, runs.points.T, strict=True))
    outputs = {f"output_{number}": column for number, column in enumerate(runs.outputs.T, 1)}
    numbers = rows_of(parameters | {"seconds": runs.seconds} | outputs)
    return {
        "summary.csv": rows,
        "summary.json": rows,
        "prediction.csv": [name | row for name, row in zip(named, rows_of(table), strict=True)],
        "leave_one_out.csv": calibration.leave_one_out.to_dict("records"),
        "sensitivity.csv": calibration.sensitivity.reset_index().to_dict("records"),
        "forward_runs.csv": [{**row, "error": error} for row, error in zip(numbers, runs.errors, strict=True)],
    }


def _parameters(study: CalibrationStudy) -> Table:
    """Return the parameters in the units of the forward model, and what each of them is."""
    calibration, rows = study.calibration, []
    of_errors = {
        symbol_of(symbol, name): f"{words}{f' of {name}' * bool(name)}"
        for name in calibration.problem.quantities
        for symbol, words in OF_ERRORS.items()
    }
    for symbol, marginal in calibration.marginals.items():
        mean, sd = (interval(number, number, marginal.sd)[0] for number in (marginal.mean, marginal.sd))
        ends = "[{}, {}]".format(*interval(*marginal.hdi(), marginal.sd))
        words = PARAMETER if symbol in calibration.problem.forward_symbols else of_errors[symbol]
        rows.append([study.label(symbol), words, mean, sd, ends, f"{100 * calibration.emulator_share[symbol]:.0f} %"])
    headers = ["parameter", "what it is", "mean", "sd", "95 % interval", "by emulator"]
    of_discrepancy = f" {DISCREPANCY}" * calibration.problem.discrepancy.is_correlated
    note = f"{BY_EMULATOR}{of_discrepancy} Emulator, {calibration.check}."
    return Table(headers, rows, f"{study.forward.name}: {len(calibration.runs)} runs", (1,), note)


def _sections(study: CalibrationStudy) -> tuple[Section, ...]:
    """Return what a page folds: posteriors, the emulator, what outputs depend on, failures, how it was computed."""
    calibration, runs = study.calibration, study.calibration.runs
    labels, held_out = list(map(study.label, runs.symbols)), calibration.held_out
    has_discrepancy = calibration.problem.discrepancy.is_correlated
    panel_words = (
        " Left: forward model and discrepancy. Right: the forward model alone; where it misses, the model is wrong."
        if has_discrepancy
        else ""
    )
    band = Picture(
        "band", lambda: band_figure(calibration, study.data), "Predictive bands over the measurements",
        f"95 % predictive band of a new measurement, including noise.{panel_words}", not has_discrepancy,
    )  # fmt: skip
    marginals = Picture(
        "marginals", lambda: marginals_figure(study), "Marginal posteriors",
        "Blue: marginal posterior and its 95 % interval. Dashed: without the error of the emulator. Dotted: prior.",
    )  # fmt: skip
    inside_alone = (
        f", and {100 * calibration.predictive_coverage(discrepancy=False):.0f} % inside that of the forward model alone"
        if has_discrepancy
        else ""
    )
    coverage = (
        f"{100 * calibration.predictive_coverage():.0f} % of the measurements lie inside the band{inside_alone}. A "
        "good predictive check does not mean that the parameters are right."
    )
    placed = ", and runs placed in the posterior, before they were added to the emulator (orange)" if held_out else ""
    errors = Picture(
        "emulator", lambda: check_figure(calibration), "Errors of the emulator",
        f"Every run predicted from the others (blue){placed}. Bars: 95 %.",
    )  # fmt: skip
    checks = (
        f"{calibration.check}.",
        *(f"Batch {number} in the posterior, {check}." for number, check in enumerate(held_out, 1)),
        f"The emulator's error is at most {calibration.error_ratio:.2g} of noise and discrepancy (variances, in the "
        "worst direction of the data, mean over the posterior).",
    )
    worst = [
        [*(f"{value:.4g}" for value in point), f"{error:.2g}", f"{sd:.2g}", f"{standardised:.1f}"]
        for *point, error, sd, standardised in calibration.leave_one_out.to_numpy()[:WORST_RUNS]
    ]
    sensitivity = [
        [str(symbol), f"{100 * first_order:.0f} %", f"{100 * total:.0f} %"]
        for symbol, first_order, total in calibration.sensitivity.itertuples()
    ]
    sections = [
        Section("Posteriors and predictive checks", (band, coverage, marginals)),
        Section("The emulator", (EMULATOR, checks, errors, WORST,
                Table([*labels, "error", "sd", "standardised"], worst))),
        Section("What the outputs depend on", (SOBOL, Table(["parameter", "first", "total"], sensitivity))),
    ]  # fmt: skip
    if runs.failure_summary:
        failures = [
            [*(significant(float(value), 4) for value in point), error]
            for point, error in zip(runs.points, runs.errors, strict=True)
            if error
        ]
        table = Table([*labels, "reason"], failures)
        sections.append(Section("Runs that failed", (str(runs.failure_summary), table)))
    return (*sections, Section("How it was computed", _computed(study)))


def _computed(study: CalibrationStudy) -> tuple[Block, ...]:
    calibration, settings = study.calibration, study.settings
    runs, emulator = calibration.runs, calibration.emulator
    directions = emulator.basis.directions.shape[1]
    refined = ", then points in the posterior" if calibration.held_out else ""
    whose = "The logarithms of the outputs" if emulator.basis.is_log else "The outputs"
    logarithms = f"; taken by logarithm: {', '.join(emulator.logarithms)}" if emulator.logarithms else ""
    evidence = "" if calibration.log_evidence is None else f" Log evidence {calibration.log_evidence:.2f}."
    sentences = (
        f"Read: {'; '.join(map(_read, study.data.values()))}.",
        f"measured = {SUM_OF_PARTS}, all Gaussian given the parameters; noise sd {noises_in_words(settings)}.",
        f"{len(runs)} runs ({settings.design} design{refined}), {significant(float(np.median(runs.seconds)))} s each. "
        f"{whose} vary in {directions} direction{'s' * (directions != 1)}, each a process with the kernel "
        f"{settings.kernel} and a {settings.trend} mean{logarithms}. The variation outside these directions is part of "
        "the error.",
        f"Posterior by {calibration.posterior.method}, effective size {min(calibration.posterior.ess.values()):.0f}. "
        f"{calibration.posterior.verdict}{evidence} {study.seconds:.0f} s in all.",
    )
    priors = [[study.label(symbol), str(prior)] for symbol, prior in calibration.problem.priors.items()]
    blocks: list[Block] = [sentences, Table(["parameter", "prior"], priors, text_columns=(1,))]
    if settings.prior_correlations:
        named = (f"{pair.replace(',', ' and ')} {value:.2f}" for pair, value in settings.prior_correlations.items())
        blocks.append(f"Correlations of priors (of log-normal ones: of the logarithms): {'; '.join(named)}.")
    if study.prior_run is not None:
        blocks.append(
            f"These are the posterior of the run {Path(study.prior_run).name}, as normal and log-normal priors with "
            "its means, sds and correlations; that run's discrepancy is left out."
        )
    blocks += [_model_run(forward, names, study) for names, forward in _decks(study)]
    if study.posterior is not None:
        blocks.append(
            f"The posterior of the material {study.posterior.model.material.name} is in posterior/none.nc: tissuq "
            "predict, export and structure take this run."
        )
    return tuple(blocks)


def _read(data: Measured) -> str:
    """Return what was read of a file: the columns, and how many rows over which range."""
    ends = f"{significant(float(data.control.min()), 4)} to {significant(float(data.control.max()), 4)}"
    return f"{len(data.control)} rows, '{data.measured_label}' against '{data.control_label}', {ends}"


def _model_run(forward: DeckForward, names: tuple[str, ...], study: CalibrationStudy) -> tuple[str, ...]:
    """Return how a finite-element model was run, and how its numbers became those of the file."""
    settings, solver = study.settings, forward.program
    named = [name or next(iter(settings.quantities)) for name in names]
    of_file = (
        f"{study.data[name].measured_label} of the file is {factor:.6g} times {quantity} "
        f"({settings.quantities[quantity]})"
        for name, quantity, factor in zip(names, named, forward.factors.values(), strict=True)
    )
    control = study.data[names[0]].control_label
    controlled = forward.along or "the time of the model"
    return (
        f"The material '{forward.replaced}' of {forward.read_deck.main} got the card of {forward.material} for every "
        f"run. Solver: {solver.name}, `{solver.command or solver.template}`. Unit of stress of the model: "
        f"{settings.unit} ({forward.cards.system.units}).",
        f"{', '.join(of_file)}, {control} is {forward.along_factor:.6g} times {controlled}: units, signs and symmetry "
        "together. Between the increments of the solver they are interpolated by monotone cubics.",
    )
