"""``tissuq fit``, ``population`` and ``calibrate``: parameters from the measured files of a user."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from filecmp import cmp
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tissuq.cli.call import Call, SolverOptions, Written, not_converged
from tissuq.cli.command import command
from tissuq.errors import InputError
from tissuq.studies.calibration_settings import CalibrationSettings
from tissuq.studies.files_of_tests import files_of, measured, run_name
from tissuq.studies.fit_settings import ALL, LawSettings, PopulationSettings, SpecimenSettings
from tissuq.studies.measured_file import READING, ReadingSettings
from tissuq.studies.option import option, table_of_sizes
from tissuq.studies.settings import setting_of

if TYPE_CHECKING:
    from tissuq.experiments.reading.experiment_file import Reading
    from tissuq.mechanics import Material
    from tissuq.studies.laws import LawStudy
    from tissuq.studies.specimen import SpecimenStudy


class FitOptions(Written):
    """How files are taken, among how many processes several laws are divided, and how the run is written."""

    specimen: tuple[str, ...] = option(
        (), "Name of the specimen, once for each of several files [each its own].", group=READING
    )
    sizes: Path | None = table_of_sizes(READING)
    workers: int | None = option(
        None, "Processes that several laws are divided among [one a core from four laws].", ge=1
    )


@command(SpecimenSettings, FitOptions)
def fit(call: Call[SpecimenSettings, FitOptions]) -> None:
    """Identify a material's parameters from files of stretches and stresses."""
    from tissuq.experiments.experiment import Experiment
    from tissuq.experiments.reading.table_of_specimens import TableOfSizes
    from tissuq.mechanics import material_named
    from tissuq.studies.specimen import priors_in_mpa

    paths: list[Path] = call.stated.pop("file", [])
    if call.config is None and [path.suffix for path in paths] == [".toml"]:
        call, paths = replace(call, how=call.how.model_copy(update={"config": paths[0]})), []
    files = files_of(paths, call.how.sizes)
    read_as = {name: call.stated.pop(name) for name in ReadingSettings.model_fields if name in call.stated}
    modes, noise = read_as.pop("mode", None), call.stated.pop("noise_sd", None)
    axial_stretches: list[float] | None = read_as.pop("axial_stretch", None)
    if call.config:
        _check_once(call.how, modes, noise, axial_stretches)
        read_as |= {"mode": modes[0]} if modes else {}
        read_as |= {"axial_stretch": axial_stretches[0]} if axial_stretches else {}
    read_as |= {"sizes": TableOfSizes.read(call.how.sizes)} if call.how.sizes else {}
    of_files = [] if call.config else files
    of_tests, read_tests = measured(of_files, read_as, modes, call.how.specimen, noise, axial_stretches, print)
    if not (paths or call.config):
        raise InputError("give a FILE of measurements, the name of a built-in data set, or --config run.toml.")
    if call.config and len(files) > 1:
        raise InputError("give FILES or --config, not both.")
    names: list[str] = call.stated.pop("material", [])
    is_comparison = len(names) > 1 or names == [ALL]
    if call.config and not names:
        is_comparison = setting_of(call.config, "laws") is not None
    law_settings = {"laws": tuple(names) or None} if is_comparison else {"material": names[0] if names else None}
    laws_of_names = {name: material_named(name, laws=True) for name in names if name != ALL}
    call = replace(call, kind=LawSettings if is_comparison else SpecimenSettings)
    settings = call.loaded(("noise", "noise_sd"), **of_tests, **law_settings)
    sources = settings.sources(call.beside)
    if files and call.config:
        _check_same(files[0], sources[0], call.config)
    readings = settings.readings(call.beside, read_tests)
    priors_in_mpa(
        settings,
        settings.fitted_laws(laws_of_names).values(),
        Experiment.of([reading.experiment for reading in readings]),
    )
    target = call.target(Path("runs") / run_name(paths, call.config, sources))
    study = _fitted(call, settings, laws_of_names, readings, target)
    for name, reason in study.skipped.items():
        print(f"Not fitted: {name}: {reason}")
    not_converged(study.not_converged)


def _fitted(
    call: Call[SpecimenSettings, FitOptions],
    settings: SpecimenSettings,
    user_laws: dict[str, Material],
    readings: list[Reading],
    target: Path,
) -> SpecimenStudy | LawStudy:
    """Fit one material, or several laws; write the run and print its summary."""
    if isinstance(settings, LawSettings):
        from tissuq.report.laws import law_result
        from tissuq.studies.laws import run_laws

        of_laws: LawStudy = call.carried_out(
            target,
            lambda step: run_laws(settings, call.beside, step, user_laws, readings, call.how.workers),
            partial(law_result, beside=call.beside),
        )
        return of_laws
    from tissuq.report.specimen import specimen_result
    from tissuq.studies.specimen import run_specimen, steps_of

    law = next(iter(user_laws.values()), None)
    of_material: SpecimenStudy = call.carried_out(
        target,
        lambda step: run_specimen(settings, call.beside, step, law, readings),
        partial(specimen_result, beside=call.beside),
        steps_of(settings) + 1,
    )
    return of_material


def _check_once(
    how: FitOptions,
    modes: Sequence[str] | None,
    noise: Sequence[float | str] | None,
    axial_stretches: Sequence[float] | None,
) -> None:
    """Refuse what is given for each of several files, which a configuration says of its tests."""
    if how.specimen:
        raise InputError("--specimen names the specimens of FILES; in a configuration, 'specimen' of a test does.")
    if how.sizes:
        raise InputError(
            "--sizes holds the sizes of the specimens of FILES; a configuration has 'dimensions' of a test."
        )
    for typed, values in (("--mode", modes), ("--noise-sd", noise), ("--axial-stretch", axial_stretches)):
        if values and len(values) > 1:
            raise InputError(f"{typed} is given {len(values)} times beside --config; give it once.")


def _check_same(file: Path, named: Path, config: Path) -> None:
    """Refuse a FILE that is not what the configuration names."""
    try:
        same = cmp(file, named, shallow=False)
    except OSError:
        same = False
    if not same:
        raise InputError(
            f"FILE '{file}' is not the file that '{config}' names, '{named}'. Leave FILE out to repeat that run, or "
            "leave --config out to fit FILE."
        )


@command(PopulationSettings, Written, out="Folder for the run [runs/population].")
def population(call: Call[PopulationSettings, Written]) -> None:
    """Identify a population from its specimens, every specimen within it, and what to expect of a new specimen."""
    from tissuq.mechanics import material_named
    from tissuq.report.population import population_result
    from tissuq.studies.population import run_population

    call.check_source("files", "the FILES of several specimens, folders of them", "run")
    settings, material = call.loaded(rivals=("noise", "noise_sd")), call.stated.get("material")
    law = material_named(material, laws=True) if material else None
    target = call.target(Path("runs") / "population")
    study = call.carried_out(
        target,
        lambda step: run_population(settings, call.beside, step, law),
        partial(population_result, beside=call.beside),
    )
    not_converged([] if study.population.converged else ["the population"])


class CalibrateOptions(SolverOptions, Written):
    """How the model is run."""

    workers: int = option(1, "Processes that run the model.", ge=1)
    keep: bool = option(False, "Keep the solver's files of every run.")
    runs_in: Path | None = option(
        None, "Folder of the runs of the model, which a repeated command reuses [OUT-forward-runs]."
    )


@command(CalibrationSettings, CalibrateOptions)
def calibrate(call: Call[CalibrationSettings, CalibrateOptions]) -> None:
    """Identify the parameters of an expensive model, using an emulator whose error is included."""
    from tissuq.report.calibration import calibration_result
    from tissuq.studies.calibration import run_calibration

    call.check_source("files", "a FILE of controls and measured values", "run")
    if not (call.config or "priors" in call.stated or "prior_run" in call.stated):
        raise InputError("give the --prior of every parameter of the model, as in C10=uniform(0.1, 5), or --prior-run.")
    settings = call.loaded(rivals=("forward", "umbridge"))
    call.check_named_again(settings)
    target = call.target(Path("runs") / Path(settings.files[0]).stem)
    runs_in = call.how.runs_in or target.with_name(f"{target.name}-forward-runs")
    how, running = call.how, dict[str, Any]()
    of_solver = ("timeout", "retries", "keep", "abaqus")
    workers = how.workers
    if settings.models:
        workers = how.max_jobs or os.cpu_count() or 1
        running = {name: getattr(how, name) for name in of_solver}
    elif idle := [f"--{name.replace('_', '-')}" for name in ("max_jobs", *of_solver) if name in how.model_fields_set]:
        raise InputError(f"{' and '.join(idle)}: only a finite-element model (--model) has a solver; leave it out.")
    with call.campaign_in(runs_in)(settings.runs + settings.refine) as step:
        study = run_calibration(settings, call.beside, runs_in=runs_in, workers=workers, step=step, **running)
    print(f"Forward runs: {runs_in}")
    call.carried_out(target, lambda step: study, lambda study: calibration_result(study, call.beside))
    not_converged([] if study.calibration.converged else ["the calibration"])
