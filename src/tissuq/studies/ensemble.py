"""The study of a user's own finite-element model with draws of the posteriors of one or several materials."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from tissuq.decks import Deck, FunctionQuantity, Quantity, Solver, parse_quantity, solver_for
from tissuq.decks.model_ensemble import ModelEnsemble, gathered
from tissuq.decks.model_files import MODEL, extra_files
from tissuq.decks.model_run import USUALLY, ModelRun, SolverRun, carried_out, check_sets, clear_unfinished, sets_of
from tissuq.decks.quantity import located
from tissuq.errors import InputError
from tissuq.export import Cards, card_format, check_fibres
from tissuq.finite_elements.simulation import COMPLETE, FINE_MESH, MATERIAL_ONLY
from tissuq.mechanics import Material
from tissuq.posterior.ensemble import Ensemble
from tissuq.studies.earlier_run import load
from tissuq.studies.finite_element_settings import EnsembleSettings
from tissuq.studies.stream import RESULTS, Step, forget_results, read_results, run_tasks, silent

if TYPE_CHECKING:
    from tissuq.posterior.drawn_materials import Sampling

DRAWS = "draws"
"""Folder with a folder for each run."""
RUN_FOLDER = re.compile(r"[a-z]+-[0-9]+")
"""What folders of runs are called."""


@dataclass(frozen=True)
class PreparedEnsemble:
    """All that is known before a solver runs.

    Attributes
    ----------
    settings : EnsembleSettings
    deck : Deck
    solver : Solver
    quantities : tuple of Quantity
    ensembles : mapping of str to Ensemble
        By material.
    cards : mapping of str to mapping of str to Cards
        By family, and by material.
    finer : FinerModel or None
        The same model with a finer mesh.
    """

    settings: EnsembleSettings
    deck: Deck
    solver: Solver
    quantities: tuple[Quantity, ...]
    ensembles: Mapping[str, Ensemble]
    cards: Mapping[str, Mapping[str, Cards]]
    finer: FinerModel | None = None

    def blocks(self, family: str, number: int) -> dict[str, str]:
        """Return the blocks of cards of a draw, by material."""
        return {material: cards.blocks[number] for material, cards in self.cards[family].items()}

    def diff(self) -> str:
        """Return the difference between the model and that of the first draw."""
        return self.deck.diff(self.deck.with_materials(self.blocks(COMPLETE, 0)))

    def tasks(self, folder: Path, running: SolverRun = USUALLY) -> list[ModelRun]:
        """Return the runs: the complete draws first, that on a finer mesh last."""
        limits = tuple(
            (self.deck.material(name).name.upper(), ensemble.most) for name, ensemble in self.ensembles.items()
        )
        width = len(str(self.settings.draws))

        def task(family: str, number: int, deck: Deck, model_folder: Path, cards_of: str) -> ModelRun:
            return ModelRun(
                family, number, model_folder / MODEL, deck.main, deck.format.name,
                tuple(self.blocks(cards_of, number).items()), self.solver, self.quantities, limits,
                folder / DRAWS / f"{family}-{number + 1:0{width}d}", running,
                "" if deck is self.deck else deck.digest,
            )  # fmt: skip

        draws = range(self.settings.draws)
        tasks = [task(family, number, self.deck, folder, family) for family in self.cards for number in draws]
        if self.finer is not None:
            tasks.append(task(FINE_MESH, self.finer.number, self.finer.deck, folder / FINER, COMPLETE))
        return tasks

    @property
    def card_warnings(self) -> list[str]:
        """What is to be known of the cards, by material where there are several."""
        prefix = "{}: " if len(self.ensembles) > 1 else ""
        complete = self.cards[COMPLETE]
        return [prefix.format(name) + text for name, cards in complete.items() for text in cards.warnings]


@dataclass(frozen=True)
class EnsembleStudy:
    """Results of an ensemble."""

    prepared: PreparedEnsemble
    result: ModelEnsemble

    @property
    def warnings(self) -> list[str]:
        """Warnings about the result."""
        unstable = [text for text in self.prepared.card_warnings if "NOT stable" in text or "volume changes" in text]
        return [*self.result.warnings, *unstable]


def prepare_ensemble(
    settings: EnsembleSettings,
    beside: Path = Path(),
    law: Material | None = None,
    step: Callable[[str], None] = lambda text: None,
    *,
    runs_here: bool = True,
    is_dry: bool = False,
) -> PreparedEnsemble:
    """Return deck, solver, quantities and cards of an ensemble; nothing is run.

    Parameters
    ----------
    settings : EnsembleSettings
    beside : Path
        Where its files lie, unless their names are absolute.
    law : Material, optional
        The material of the runs, where it is a law in a file.
    step : callable
        Told what is being done.
    runs_here : bool
        Whether the solver is to be run by this machine.
    is_dry : bool
        Whether nothing is to be run at all, functions of the user's included.

    Raises
    ------
    InputError, ModelError
        When the model has no such material, the solver is not there, a quantity is not understood, or a run cannot be
        used.
    """
    settings.card_settings()
    named = {Path(os.path.abspath(beside / name)) for name in settings.also}
    deck = Deck.read(beside / settings.model, settings.deck, named)
    solver = solver_for(deck.format.name, settings.solver, settings.command)
    if runs_here:
        solver.check_installed()
    extra_files(deck, settings.also, beside)
    quantities = tuple(parse_quantity(name, located(text, beside)) for name, text in settings.quantities.items())
    replaced = {name: deck.material(name) for name in settings.materials}
    if len(set(replaced.values())) < len(replaced):
        raise InputError(f"--replace names one material of the model twice: {', '.join(replaced)}.")
    formatting = card_format(settings.card_format or solver.card_format or deck.format.card_format)
    ensembles = drawn_materials(settings, beside, law, step)
    cards: dict[str, dict[str, Cards]] = {COMPLETE: {}}
    all_draws = [draw for ensemble in ensembles.values() for draw in ensemble]
    is_shared = settings.shares and any(draw.discrepancy or len(draw.parts) > 1 for draw in all_draws)
    if is_shared:
        cards[MATERIAL_ONLY] = {}
    for name, ensemble in ensembles.items():
        step(f"cards of {name}")
        number = replaced[name].number
        card_settings = settings.card_settings(number=int(number) if number.isdecimal() else 1)
        cards[COMPLETE][name] = formatting.checked_cards(ensemble, card_settings)
        if not cards[COMPLETE][name].blocks:
            raise InputError(f"cards of the format '{settings.card_format}' do not go into a deck.")
        check_fibres(replaced[name].name, cards[COMPLETE][name])
        if is_shared:
            cards[MATERIAL_ONLY][name] = formatting.checked_cards(ensemble.alone, card_settings)
    _check_names(quantities, ensembles)
    _check_functions(quantities)
    check_sets(deck, quantities, solver)
    sets_of(deck, quantities)
    finer = _finer_model(settings, beside, deck, quantities, ensembles.values())
    prepared = PreparedEnsemble(settings, deck, solver, quantities, ensembles, cards, finer)
    for quantity in quantities if not is_dry else ():
        quantity.check()
    return prepared


def drawn_materials(
    settings: EnsembleSettings,
    beside: Path = Path(),
    law: Material | None = None,
    step: Callable[[str], None] = lambda text: None,
) -> dict[str, Ensemble]:
    """Return the draws of an ensemble by material, from runs in ``beside`` unless their names are absolute."""
    runs, ensembles = list(dict.fromkeys(settings.materials.values())), {}
    for name, run in settings.materials.items():
        step(f"draws of {name}")
        posterior = load(beside / run, settings.discrepancy, law)
        number, sampling = runs.index(run), cast("Sampling", settings.sampling)
        seed = settings.seed + number
        ensemble = posterior.ensemble(settings.draws, seed, sampling, admissible=not settings.all_draws)
        # Materials of different runs are independent: draws that are spread alike are paired at random.
        ensembles[name] = ensemble.shuffled([settings.seed, number]) if number else ensemble
    return ensembles


def forget_failures(runs: Sequence[ModelRun], folder: Path) -> None:
    """Take the results of runs that failed off the file of results, and their folders away."""
    folder_names = {run.key: run.folder.name for run in runs}
    failed = forget_results(folder / RESULTS, lambda result: bool(result.get("problem") or result.get("misread")))
    for key, result in failed.items():
        name = folder_names.get(key) or str(result.get("folder", ""))  # the latter where quantities are others
        if RUN_FOLDER.fullmatch(name):
            shutil.rmtree(folder / DRAWS / name, ignore_errors=True)


def run_ensemble(
    prepared: PreparedEnsemble,
    folder: Path,
    *,
    pool: Executor | None = None,
    limit: int | None = None,
    running: SolverRun = USUALLY,
    progress: Callable[[int], AbstractContextManager[Step]] = lambda total: nullcontext(silent),
) -> EnsembleStudy:
    """Run the solver for every draw, those in ``folder`` not again, and gather what they give.

    The first draw is run by itself, and after it one on the finer mesh, where there is such a mesh: where a quantity is
    not in their results, no other has been run in vain.

    Parameters
    ----------
    prepared : PreparedEnsemble
    folder : Path
        Holds the files of the model (`copy_model`), and the results so far, if any.
    pool : Executor, optional
        From `tissuq.studies.stream.open_pool`.
    limit : int, optional
        Runs at the same time.
    running : SolverRun
        How the solver is run.
    progress : callable
        Gives, for a number of tasks, a context with the function that is told of each.

    Raises
    ------
    InputError, ConvergenceError
        When a quantity cannot be read, or hardly any draw gets anywhere.
    """
    clear_unfinished(folder / DRAWS)
    tasks = prepared.tasks(folder.absolute(), running)
    unique = list({task.key: task for task in tasks}.values())
    with progress(len(unique)) as step:
        for task in unique[:1] if prepared.finer is None else (unique[0], unique[-1]):
            if task.key not in read_results(folder / RESULTS):
                run_tasks([task], carried_out, folder, pool=pool, others_stay=True)
            result = read_results(folder / RESULTS)[task.key]
            if result["misread"] and not result["problem"]:
                raise InputError(
                    f"{result['misread']} This is kept as the result of {task.label}: when the reason is gone, the "
                    "same command with --again makes it again."
                )
        results = run_tasks(unique, carried_out, folder, pool=pool, limit=limit, step=step)
    by_key = {task.key: {**result, "folder": task.folder.name} for task, result in zip(unique, results, strict=True)}
    finer = 2.0 if prepared.finer is None else prepared.finer.finer
    in_order = [by_key[task.key] for task in tasks]
    return EnsembleStudy(prepared, gathered(tasks, in_order, prepared.ensembles.values(), finer))


def _check_names(quantities: tuple[Quantity, ...], ensembles: Mapping[str, Ensemble]) -> None:
    """Refuse quantities that are called as another column of the table of draws."""
    symbols = [symbol for ensemble in ensembles.values() for symbol in ensemble[0].values]
    for quantity in quantities:
        if quantity.name in ("draw", "problem", *symbols):
            raise InputError(f"a quantity cannot be called '{quantity.name}', as a column of the draws: rename it.")


def _check_functions(quantities: tuple[Quantity, ...]) -> None:
    """Refuse functions in different files of one name, which a recipe could not tell apart."""
    files: dict[str, Path] = {}
    for quantity in quantities:
        if isinstance(quantity, FunctionQuantity):
            file = Path(quantity.location.rpartition(":")[0])
            earlier_file = files.setdefault(file.name, file)
            if earlier_file.resolve() != file.resolve():
                raise InputError(
                    f"two files of quantities are called '{file.name}' (--qoi): '{earlier_file}' and '{file}'; "
                    "rename one."
                )


FINER = "finer"
"""Folder with copies of its files, in the folder of the ensemble."""


@dataclass(frozen=True)
class FinerModel:
    """The same model with a finer mesh.

    Attributes
    ----------
    deck : Deck
    number : int
        The draw that is run on it: of all, its stresses in the test are in the middle.
    ratio : float
        How many times smaller its elements are.
    order : float
        Of convergence: the power of their size with which the error falls.
    counts : (int, int) or None
        Elements of the model and of this one, where the ratio is taken from these.
    """

    deck: Deck
    number: int
    ratio: float
    order: float
    counts: tuple[int, int] | None = None

    @property
    def finer(self) -> float:
        """What the error of the mesh is divided by on this one."""
        return float(self.ratio**self.order)

    @property
    def words(self) -> str:
        """What is assumed, as a sentence."""
        by_count = f" (by {self.counts[0]} and {self.counts[1]} elements)" if self.counts else " (as given)"
        return (
            f"Draw {self.number + 1} was run on '{self.deck.main}', too, whose elements are {self.ratio:.3g} times "
            f"smaller{by_count}; the error is assumed to fall with the power {self.order:g} of their size everywhere, "
            "and to be the same share of every draw's quantity."
        )


def _finer_model(
    settings: EnsembleSettings,
    beside: Path,
    deck: Deck,
    quantities: Sequence[Quantity],
    ensembles: Collection[Ensemble],
) -> FinerModel | None:
    """Return the model with the finer mesh that settings name; None where they name none.

    Raises
    ------
    InputError
        When it lacks a material or a set of the model, is of another format, or has no finer mesh.
    """
    if settings.finer_model is None:
        if settings.cell_ratio is not None or settings.mesh_order is not None:
            raise InputError("--cell-ratio and --mesh-order are of a finer model: give --finer-model FILE, too.")
        return None
    finer = Deck.read(beside / settings.finer_model, deck.format.name, frozenset())
    try:
        for name in settings.materials:
            finer.material(name)
        check_sets(finer, quantities)
    except InputError as error:
        raise InputError(
            f"the finer model (--finer-model) must have the materials and sets of the model: {error}"
        ) from error
    if list(finer.files.values()) == list(deck.files.values()):
        raise InputError(
            f"the finer model (--finer-model) '{finer.main}' is the model itself: give one with a finer mesh."
        )
    number, order = _middle_draw(ensembles), settings.mesh_order or 1.0
    if settings.cell_ratio is not None:
        return FinerModel(finer, number, settings.cell_ratio, order)
    sizes = [
        model.format.mesh_size(list(model.files.values())) if not model.outside else None for model in (deck, finer)
    ]
    coarse, fine = sizes
    if coarse is None or fine is None or coarse.dimensions != fine.dimensions:
        raise InputError(
            f"how much finer the mesh of '{finer.main}' is cannot be told from its elements and those of "
            f"'{deck.main}': give --cell-ratio, such as 2 where its elements are half as long."
        )
    if fine.elements <= coarse.elements:
        raise InputError(
            f"the finer model '{finer.main}' has {fine.elements} elements, and the model {coarse.elements}: give a "
            "finer mesh with --finer-model."
        )
    ratio = float((fine.elements / coarse.elements) ** (1 / coarse.dimensions))
    return FinerModel(finer, number, ratio, order, (coarse.elements, fine.elements))


def _middle_draw(ensembles: Collection[Ensemble]) -> int:
    """Return the draw whose stress in the tests is in the middle of all, in all materials together."""
    stresses = [np.abs(ensemble.stresses_at(ensemble.model.experiment.states)).mean(axis=1) for ensemble in ensembles]
    ranks = np.array([np.argsort(np.argsort(of_material)) for of_material in stresses])
    return int(np.argmin(((ranks - ranks.shape[1] // 2) ** 2).sum(axis=0)))
