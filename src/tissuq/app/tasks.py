"""What a process beside the page does when it is asked: read, fit, compare laws, predict, write cards."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from tissuq.app.repeat import command, fit_lines, reading_words
from tissuq.errors import InputError
from tissuq.studies.files_of_tests import measured, reading_of, run_name
from tissuq.studies.option_texts import column, columns_in, one_or_list

if TYPE_CHECKING:
    from tissuq.report.result import Result
    from tissuq.studies.specimen import SpecimenStudy

Say = Callable[[str, Any], None]
"""Is told what has come of a task so far: the kind of news, and plain data."""
RUNS, CARDS = Path("runs"), Path("cards")
SPECIMEN = "specimen"
"""What the only specimen of several tests is called."""


def choices(_: Mapping[str, Any], say: Say) -> None:
    """Say what there is to choose from."""
    from tissuq.app.account import modes_of_specimens
    from tissuq.export import card_formats
    from tissuq.mechanics import material_named
    from tissuq.mechanics.material import SUMS, materials
    from tissuq.model.discrepancy import discrepancies
    from tissuq.model.tolerances import ESTIMANDS

    say(
        "done",
        {
            "materials": [
                {"name": name, "words": law.formula, "is_isotropic": law.is_isotropic}
                for name, law in ((name, material_named(name)) for name in (*materials(), *SUMS))
            ],
            "modes": [
                {"name": mode.name, "words": mode.description, "controls": [control.name for control in mode.controls]}
                for mode in modes_of_specimens()
            ],
            "discrepancies": [{"name": name, "words": kind.formula} for name, kind in discrepancies().items()],
            "estimands": [{"name": name, "words": kind.description} for name, kind in ESTIMANDS.items()],
            "formats": sorted(card_formats(), key=lambda name: name == "table"),
        },
    )


def inspect(request: Mapping[str, Any], say: Say) -> None:
    """Say what is understood of files, and what repeats it."""
    from tissuq.app.account import account

    files, modes, reading = _files(request)
    record = account(files, reading, [mode or None for mode in modes or [""] * len(files)])
    paths, prints = list(map(Path, files)), []
    for file, mode in zip(files, modes or [""] * len(files), strict=True):
        options = reading_of(Path(file), paths, reading) | {"mode": mode}
        words = [repr(file), *(f"{name}={value!r}" for name, value in options.items() if value not in (None, ""))]
        prints.append(f"print(tq.inspect({', '.join(words)}))")
    lines = "\n".join(["import tissuq as tq", "", *prints])
    say("done", record | {"repeat": {"shell": _shell("inspect", files, modes, reading), "python": lines}})


def fit(request: Mapping[str, Any], say: Say) -> None:
    """Fit a material; say the answer as soon as it is there, then write the run."""
    from tissuq.report.result import few_and_others
    from tissuq.report.specimen import specimen_answer, specimen_result
    from tissuq.studies.fit_settings import SpecimenSettings
    from tissuq.studies.specimen import run_specimen

    say("step", "reading")
    values, readings, name = _measured(request)
    options = _options(request, ("material", "discrepancies", "noise_sd", "estimand", "stable_in"))
    settings = _settings(SpecimenSettings, values | options)
    shell = _shell("fit", *_files(request), {"specimen": _specimens(request)} | options)

    def say_answer(study: SpecimenStudy) -> None:
        record = specimen_answer(study).record()
        shown, folded = few_and_others(record)
        of_page = {
            "next": record["next"].replace("{run}", f"runs/{name}"),
            "shown": shown,
            "folded": folded,
            "run": name,
            "modes": [mode.name for mode in study.experiment.modes],
            "not_converged": study.not_converged,
            "repeat": {"shell": shell, "python": fit_lines(values | options, study.experiment.stress_unit)},
        }
        say("answer", {**record, **of_page})

    study = run_specimen(settings, Path(), lambda text: say("step", _stage(text)), found=readings, early=say_answer)
    say("done", _written("fit", RUNS / name, partial(specimen_result, study), say))


def laws(request: Mapping[str, Any], say: Say) -> None:
    """Compare laws; say their table, and write the run."""
    from tissuq.report.laws import law_lead, law_result, law_table
    from tissuq.result_warning import in_shell
    from tissuq.studies.fit_settings import LawSettings
    from tissuq.studies.laws import run_laws

    say("step", "reading")
    values, readings, name = _measured(request)
    options = _options(request, ("laws", "discrepancies", "noise_sd", "estimand", "stable_in"))
    settings = _settings(LawSettings, values | options)
    study = run_laws(settings, Path(), lambda text: say("step", text), found=readings)
    folder_name = f"{name}-laws"
    written = _written("fit", RUNS / folder_name, partial(law_result, study), say)
    values_of_run = {"specimen": _specimens(request)} | options | {"out": f"runs/{folder_name}"}
    shell = _shell("fit", *_files(request), values_of_run)
    table = law_table(study)
    say(
        "done",
        {
            "lead": law_lead(study),
            "headers": table.headers,
            "rows": table.rows,
            "skipped": dict(study.skipped),
            "warnings": [{"severity": w.severity, "text": in_shell(w)} for w in study.warnings],
            "repeat": {"shell": shell, "python": fit_lines(values | options, study.experiment.stress_unit)},
        }
        | written,
    )


def predict(request: Mapping[str, Any], say: Say) -> None:
    """Predict another loading mode from a run; say the bands, and write the folder."""
    from tissuq.report.prediction import band_table, prediction_result
    from tissuq.result_warning import in_shell
    from tissuq.studies.predict_run import run_prediction
    from tissuq.studies.run_settings import PredictionSettings

    options = _options(request, ("mode", "stretch", "stretch2"))
    run = RUNS / _run_name(request)
    settings = _settings(PredictionSettings, {"run": run.as_posix(), **options})
    prediction = run_prediction(settings, Path(), lambda text: say("step", text))
    target = RUNS / f"{run.name}-{prediction.mode.name}"
    written = _written("predict", target, partial(prediction_result, prediction, settings, target), say)
    points, table = settings.points_of(prediction.mode.name), band_table(prediction)
    python = [*["import numpy as np"] * (points is not None), "import tissuq as tq", "",
              f'prediction = tq.predict_run("{run.as_posix()}", mode={prediction.mode.name!r}'
              f"{_points_in_python(settings, points)})", "print(prediction.table)"]  # fmt: skip
    say(
        "done",
        {
            "headers": table.headers,
            "rows": table.rows,
            "title": table.title,
            "warnings": list(map(in_shell, prediction.warnings)),
            "repeat": {"shell": command("predict", [run.as_posix()], options), "python": "\n".join(python)},
        }
        | written,
    )


def export(request: Mapping[str, Any], say: Say) -> None:
    """Write draws of a run as material cards; say the files and what they are."""
    from tissuq.export.cards import calibrated_stretches
    from tissuq.report.cards import write_cards
    from tissuq.report.source_run import said_by
    from tissuq.studies.earlier_run import load

    format, draws, seed = str(request["format"]), int(request.get("draws") or 20), int(request.get("seed") or 0)
    run, unit = RUNS / _run_name(request), str(request.get("unit") or "MPa")
    keep_all = bool(request.get("all_draws"))
    target = CARDS / f"{run.name}-{format}"
    say("step", "drawing")
    posterior = load(run)
    ensemble, said = posterior.ensemble(draws, seed, admissible=not keep_all), said_by(run, posterior.model)
    say("step", "writing the cards")
    source = said.source_of_cards(run, "sobol", seed)
    cards = write_cards(ensemble, target, format, force=True, source=source, unit=unit)
    options = {"format": format, "draws": draws, "unit": unit, "seed": seed, "all_draws": keep_all}
    drawn = f"{draws}, seed={seed}" + (", admissible=False" if keep_all else "")
    python = [
        "import tissuq as tq", "", f'posterior = tq.load("{run.as_posix()}")',
        f'tq.write_cards(posterior.ensemble({drawn}), "{target.as_posix()}", "{format}", unit="{unit}")',
    ]  # fmt: skip
    say(
        "done",
        {
            "files": list(cards.files),
            "explanations": [*filter(None, [said.of_cards]), *cards.warnings, f"{calibrated_stretches(ensemble)}."],
            "example": next(iter(cards.files.values())),
            "folder": target.as_posix(),
            "repeat": {"shell": command("export", [run.as_posix()], options), "python": "\n".join(python)},
        },
    )


TASKS: dict[str, Callable[[Mapping[str, Any], Say], None]] = {
    "choices": choices,
    "inspect": inspect,
    "fit": fit,
    "laws": laws,
    "predict": predict,
    "export": export,
}
"""Every task by name."""


def warm_up() -> None:
    """Do all of a small fit once in the current folder, so that imports and compilation are over when it matters."""
    stretches = [1 + 0.01 * number for number in range(1, 41)]
    stresses = (10 * (x - x**-2) * (1 + 0.5 * (x - 1)) + 0.02 * (-1) ** n for n, x in enumerate(stretches))
    rows = "".join(f"{x},{stress}\n" for x, stress in zip(stretches, stresses, strict=True))
    Path("warm-up.csv").write_text(f"# mode: uniaxial\nstretch,stress [kPa]\n{rows}", encoding="utf-8")
    fit({"files": ["warm-up.csv"]}, lambda kind, news: None)


def _files(request: Mapping[str, Any]) -> tuple[list[str], list[str], dict[str, Any]]:
    """Return the files of a request, the mode of each where they are stated, and how they are read."""
    reading = {name: value for name, value in dict(request.get("reading") or {}).items() if value not in (None, {}, "")}
    if "columns" in reading:
        said = {role: columns_in(names) for role, names in reading["columns"].items()}
        reading["columns"] = {role: one_or_list([column(str(name)) for name in names]) for role, names in said.items()}
    if "sheet" in reading:
        reading["sheet"] = column(str(reading["sheet"]))
    modes = list(request.get("modes") or [])
    return list(request["files"]), modes if any(modes) else [], reading


def _measured(request: Mapping[str, Any]) -> tuple[dict[str, Any], Sequence[Any], str]:
    """Return the settings that say what was measured, what was read, and the name of the run."""
    files, modes, reading = _files(request)
    paths = list(map(Path, files))
    values, readings = measured(paths, reading, modes or None, _specimens(request) or None, None)
    values = {name: value for name, value in values.items() if value is not None}
    sources = [Path(test["file"]) for test in values.get("tests") or [values]]
    return values, readings, run_name(paths, None, sources)


def _specimens(request: Mapping[str, Any]) -> list[str]:
    """Return the name of the specimen that all tests are of, where a request says that it is one."""
    return [SPECIMEN] if request.get("is_one_specimen") else []


def _options(request: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """Return the options of a request that are not left to the default."""
    stated = {name: request.get(name) for name in names}
    return {name: value for name, value in stated.items() if value not in (None, "", [], ())}


def _settings(kind: Any, values: dict[str, Any]) -> Any:
    from tissuq.studies.settings import load_settings

    return load_settings(kind, None, values, rivals=("noise", "noise_sd"))


def _written(verb: str, target: Path, result_of: Callable[[], Result], say: Say) -> dict[str, str]:
    """Write what has come of a command as a run; return what the page is told of it."""
    from tissuq.report.run_folder import run_folder
    from tissuq.report.writer import write_result

    say("step", "writing the report")
    with run_folder(target, verb, force=True) as folder:
        write_result(result_of(), folder, target=target)
    return {"run": target.name, "report": f"{target.as_posix()}/report.html"}


def _shell(
    verb: str,
    files: Sequence[str],
    modes: Sequence[str],
    reading: Mapping[str, Any],
    options: Mapping[str, Any] | None = None,
) -> str:
    modes = modes[:1] if len(set(modes)) == 1 else modes
    words = [*files, *reading_words(reading), *(word for mode in modes for word in ("--mode", mode))]
    return command(verb, words, options or {})


def _stage(text: str) -> str:
    return text if text == "assessing" or ":" in text else f"fitting, discrepancy {text}"


def _run_name(request: Mapping[str, Any]) -> str:
    """Return the name of a run in the folder of runs, and of nothing else."""
    name = Path(str(request["run"])).name
    if name in ("", ".."):
        raise InputError("no run was named.")
    return name


def _points_in_python(settings: Any, points: Any) -> str:
    if points is None:
        return ""
    if points.ndim == 1 and ":" in cast("str", settings.stretch):
        low, high = points[0], points[-1]
        return f", stretch=np.linspace({low:.12g}, {high:.12g}, {len(points)})"
    if points.ndim == 1:
        return f", stretch=np.array({points.tolist()})"
    return f", stretch=np.column_stack([np.linspace({points[0, 0]:.12g}, {points[-1, 0]:.12g}, {len(points)}), " + (
        f"np.linspace({points[0, 1]:.12g}, {points[-1, 1]:.12g}, {len(points)})])"
    )
