"""The call `tissuq.calibrate`: parameters of an expensive model, whose runs are on disk as soon as they are done."""

from __future__ import annotations

import json
import pickle
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, fields
from functools import partial
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from numpy.typing import ArrayLike

from tissuq.arrays import FloatArray
from tissuq.emulation.adaptive import EmulationSettings, Runner, calibrated
from tissuq.emulation.calibration import Calibration
from tissuq.emulation.emulator import Emulator
from tissuq.emulation.forward import Forward, as_forward
from tissuq.emulation.problem import Problem, pose
from tissuq.emulation.runs import FIRST_RUNS, ForwardRun, ForwardRuns, carry_out, check_first_runs, gathered
from tissuq.errors import InputError
from tissuq.model.discrepancy import Discrepancy
from tissuq.parameters.checks import check_count, checked_path
from tissuq.parameters.priors import Prior
from tissuq.studies.stream import (
    RESULTS,
    Step,
    forget_results,
    open_pool,
    read_results,
    run_tasks,
    silent,
    unfinished,
    write_whole,
)  # fmt: skip


def calibrate(
    control: ArrayLike | Mapping[str, ArrayLike],
    measured: ArrayLike | Mapping[str, ArrayLike],
    forward: Forward | Callable[..., Any] | Mapping[str | tuple[str, ...], Forward | Callable[..., Any]],
    priors: Mapping[str, Prior],
    *,
    discrepancy: str | Discrepancy = "gp-pinned",
    noise_sd: float | str | Mapping[str, float | str] = "unknown",
    zero_load: float = 0.0,
    correlations: Mapping[tuple[str, str], float] | None = None,
    emulator: Emulator | None = None,
    workers: int = 1,
    folder: str | Path | None = None,
    step: Step = silent,
    **choices: Any,
) -> Calibration:
    """Identify the parameters of an expensive forward model from what it computes, such as the force of indentation.

    The model is run at parameters that fill the priors, and a Gaussian process stands for it, whose own error is part
    of the likelihood: measured = emulator(parameters) + discrepancy(control) + noise (Kennedy & O'Hagan 2001).

    Parameters
    ----------
    control : (n,) array, or mapping of str to array
        What was set in the experiment, such as depths; in the model's units, like everything here. Where several
        quantities or experiments tell of the same parameters, one array for each by its name.
    measured : (n,) array, or mapping of str to array
        What was measured there, such as forces; of several quantities each has a noise and a discrepancy of its own.
    forward : callable or Forward
        ``forward(parameters)`` or ``forward(parameters, control)``, with a dictionary of parameters by name: returns n
        outputs; with several quantities control and outputs are dictionaries by their names. Or a
        `tissuq.UmbridgeForward`, or a `tissuq.DeckForward`. Where every experiment has a model of its own, these by the
        names of what they give: ``{"force": indentation, ("pull", "neck"): tension}``.
    priors : mapping of str to Prior
        Of every parameter of the model: together they say where it is run. And, to replace the usual ones, of the
        discrepancy's ``c`` and ``psi`` and of ``noise_sd``, as no parameter of the model can be called.
    discrepancy : str
        The model's error: ``"gp-pinned"``, a process of the control that is zero with its slope at zero load, which
        leaves the initial stiffness to the parameters; ``"gp"``, which takes a share of that; or ``"none"`` of a model
        that is right. A quantity that was measured at one control has none.
    noise_sd : float or ``"unknown"``, or mapping of str to them
        Standard deviation of the noise.
    zero_load : float
        The control at zero load.
    correlations : mapping of (str, str) to float, optional
        Of the priors of pairs of the model's parameters, where these are normal or log-normal (then of logarithms).
    emulator : Emulator, optional
        That of an earlier calibration with the same model and controls, instead of new runs.
    workers : int
        Processes that run the model; it must then be a function at the top of a file.
    folder : str or Path, optional
        Keeps every run as soon as it is done: the same call goes on there after a stop. Runs that failed are tried
        again.
    step : callable
        Told of every run that is done: its label, and whether it was done now or before.
    **choices
        ``runs`` (40) and ``refine`` (0): runs over the priors, and at most so many further ones where the posterior
        is; ``design`` (``"sobol"``, ``"latin"``); ``kernel`` (``"squared-exponential"``, ``"matern-5/2"``); ``trend``
        (``"linear"``, ``"constant"``, ``"quadratic"``); ``method`` (``"auto"``, ``"importance"``, ``"nuts"``);
        ``seed``.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        When something does not fit, too many runs fail, or the folder holds runs of another model.

    References
    ----------
    Kennedy & O'Hagan (2001), Journal of the Royal Statistical Society B 63, 425-464.
    Higdon, Gattiker, Williams & Rightley (2008), Journal of the American Statistical Association 103, 570-583.

    Examples
    --------
    >>> import numpy as np
    >>> import tissuq as tq
    >>> def force(parameters, depth):
    ...     return parameters["mu"] * np.expm1(parameters["b"] * depth)
    >>> depth = np.linspace(0.1, 1, 12)
    >>> measured = force({"mu": 0.4, "b": 1.5}, depth) + 0.01 * np.random.default_rng(1).standard_normal(12)
    >>> priors = {"mu": tq.Uniform(0.1, 1), "b": tq.Uniform(0.5, 3)}
    >>> found = tq.calibrate(depth, measured, force, priors, noise_sd=0.01, runs=12)
    >>> low, high = found.marginals["b"].hdi()
    >>> bool(low < 1.5 < high), found.check.relative_error < 0.01
    (True, True)
    """
    problem = pose(control, measured, priors, discrepancy, noise_sd, zero_load, correlations)
    unknown = set(choices) - {field.name for field in fields(EmulationSettings)}
    if unknown:
        names = ", ".join(field.name for field in fields(EmulationSettings))
        raise InputError(f"tissuq.calibrate has no option '{sorted(unknown)[0]}'; further options are {names}.")
    selected = EmulationSettings(**choices)
    if emulator is not None and not selected.refine:
        return calibrated(problem, _no_runs, selected, emulator)
    model = as_forward(forward).of_quantities(problem.quantities)
    model.check(problem.forward_symbols)
    with runs_of(model, problem, folder, workers, step) as run:
        return calibrated(problem, run, selected, emulator)


def _no_runs(points: FloatArray) -> ForwardRuns:
    raise InputError(f"{len(points)} further runs were requested, but there is no forward model.")


ABOUT = "about.json"
"""The file that says of which model the runs in a folder are."""


@contextmanager
def runs_of(model: Forward, problem: Problem, folder: str | Path | None, workers: int, step: Step) -> Iterator[Runner]:
    """Give what runs a model at parameters (N, d).

    Parameters
    ----------
    model : Forward
    problem : Problem
    folder : str or Path, optional
        Where the runs are kept, and found again; without one they are forgotten.
    workers : int
        Processes.
    step : callable
        Told of every run that is done.

    Raises
    ------
    InputError
        When the folder holds runs of another model or at other controls, or the model cannot travel to processes.
    """
    check_count(workers, "the number of workers must be at least 1")
    if workers > 1:
        _check_travels(model)
    with TemporaryDirectory() as scratch, open_pool(workers) as pool:
        runs_folder = Path(scratch) if folder is None else checked_path(folder, "a folder")
        missing = [path for path in (runs_folder, *runs_folder.absolute().parents) if not path.exists()]
        if folder is not None:
            _open(runs_folder, model, problem)
        try:
            yield _Runs(model.prepared_in(runs_folder), problem, runs_folder, pool, step, max(FIRST_RUNS, workers))
        except BaseException:
            _remove_if_fruitless(runs_folder, missing)
            raise


@dataclass(frozen=True)
class _Runs:
    """Batches of runs, each in a folder of its own; the first begins with so many that are looked at by themselves."""

    model: Forward
    problem: Problem
    folder: Path
    pool: Executor | None
    step: Step
    first: int
    batches: Iterator[int] = field(default_factory=count)
    numbers: Iterator[int] = field(default_factory=lambda: count(1))

    def __call__(self, points: FloatArray) -> ForwardRuns:
        """Run the model at parameters (N, d)."""
        symbols, control = self.problem.forward_symbols, tuple(self.problem.control.tolist())
        tasks = [
            ForwardRun(self.model, tuple(zip(symbols, point.tolist(), strict=True)), control, next(self.numbers))
            for point in points
        ]
        batch = next(self.batches)
        batch_folder = self.folder / f"batch-{batch}"
        batch_folder.mkdir(exist_ok=True)
        is_begun = (batch_folder / RESULTS).exists()
        forget_results(batch_folder / RESULTS, _has_failed)
        run = partial(run_tasks, carry_out=carry_out, folder=batch_folder, pool=self.pool)
        first_tasks = [] if batch else tasks[: self.first]
        if first_tasks:
            results = run(first_tasks, step=self.step, others_stay=True)
            first_runs = gathered(symbols, results, len(control))
            try:
                check_first_runs(first_runs, self.problem.measured, self.problem.quantities)
            except InputError:
                if not (is_begun or first_runs.failed.all()):  # what solvers wrote of failed runs is to be looked at
                    (batch_folder / RESULTS).unlink()
                raise
        reported = {task.label for task in first_tasks}

        def step(label: str, is_new: bool) -> None:
            if label not in reported:
                self.step(label, is_new)

        results = run(tasks, step=step)
        return gathered(symbols, results, len(control))


def _open(folder: Path, model: Forward, problem: Problem) -> None:
    """Mark a folder as that of this model and these controls, or refuse it."""
    about = {
        "model": model.identity,
        "parameters": list(problem.forward_symbols),
        "control": problem.control.tolist(),
    }
    file = folder / ABOUT
    if file.exists():
        try:
            recorded = json.loads(file.read_text(encoding="utf-8"))
        except ValueError as error:
            raise InputError(f"'{file}' is damaged: choose another folder for the runs.") from error
        different = [name for name, value in about.items() if recorded.get(name) != value]
        if not different:
            return
        results = list(_results(folder))
        if not results or not all(map(_has_failed, results)):
            raise InputError(
                f"folder '{folder}' holds runs of another forward model or data (its {different[0]} differ): choose "
                "another one, or remove it."
            )
        shutil.rmtree(folder)
    if folder.exists() and not (folder.is_dir() and {*folder.iterdir()} <= {unfinished(file)}):
        raise InputError(f"'{folder}' is not a folder of forward runs; choose another one.")
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(file, json.dumps(about))


def _remove_if_fruitless(folder: Path, missing: Sequence[Path]) -> None:
    """Remove a folder without a run that succeeded or what a solver wrote of one, and what was made to hold it."""
    has_written = any(path.name != ABOUT and not path.match("batch-*") for path in folder.glob("*"))
    if any(not _has_failed(result) for result in _results(folder)) or (has_written and any(_results(folder))):
        return
    shutil.rmtree(folder, ignore_errors=True)
    for parent in missing[1:]:
        with suppress(OSError):
            parent.rmdir()


def _results(folder: Path) -> Iterator[dict[str, Any]]:
    """Yield what is recorded of the runs in a folder."""
    for path in folder.glob(f"batch-*/{RESULTS}"):
        yield from read_results(path).values()


def _has_failed(result: dict[str, Any]) -> bool:
    return bool(result.get("error", True))


def _check_travels(model: Forward) -> None:
    try:
        pickle.dumps(model)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InputError(
            f"the forward model cannot be sent to other processes ({error}): define it at the top of a file, or use "
            "one worker."
        ) from error
