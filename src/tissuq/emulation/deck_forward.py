"""A user's finite-element model as forward model: its material's card for every parameter value, and what it gives."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from hashlib import sha256
from math import isclose
from pathlib import Path
from typing import Any

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.decks import Deck, Quantity, Solver, parse_quantity, solver_for
from tissuq.decks.model_files import MODEL, copy_model, extra_files
from tissuq.decks.model_run import (
    ModelRun,
    SolverRun,
    carried_out,
    check_sets,
    clear_unfinished,
    problem_of,
    run_again,
    sets_of,
)
from tissuq.decks.quantity import Component, Curve
from tissuq.decks.result_file import SAME_TIME
from tissuq.emulation.forward import Forward, UnreadableError
from tissuq.emulation.material_posterior import card_material, points_of_range
from tissuq.errors import ConvergenceError, InputError
from tissuq.experiments.units import FORCE, LENGTH, PRESSURE
from tissuq.export import CardFormat, Cards, CardSettings, FECode, card_format, check_fibres
from tissuq.mechanics import Material, material_named

SOLVED = "solver"
"""Folder with a folder for each run of the solver."""
ALLOWED_VALUE = 0.1
"""A value that every parameter of fibres in a neo-Hookean matrix may have: stress, rate, dispersion, radians."""
PLACES = 16
"""Digits of a digest that name the folder of a run."""
PHYSICAL = {"U": LENGTH, "RF": FORCE, "S": PRESSURE}
"""What fields of a model are."""


@dataclass(frozen=True)
class DeckForward(Forward):
    """A deck of which one material's card follows the parameters, as `tissuq ensemble` runs it.

    Its output at a control is the quantity there: its curve over the time of the model, or over another quantity, from
    increment to increment (monotone cubics; all but functions begin at zero).

    Parameters
    ----------
    model : str or Path
        The deck: CalculiX or Abaqus (.inp), FEBio (.feb), LS-DYNA (.k), ANSYS (.cdb).
    replaced : str
        Name (ANSYS: number) of the material in it.
    material : str
        The law, all parameters of which are calibrated under their names.
    quantity : str, or mapping of str to str
        What was measured, such as ``RF2@PUNCH`` (`tissuq.decks.parse_quantity`); of several quantities each by its
        name in the mappings that `tissuq.calibrate` gets.
    stretch : (float, float)
        Smallest and largest stretch in the model, over which the law's card is to hold where it is a projection; of a
        law with fibres along both axes of a sheet.
    along : str, optional
        What the controls are, such as ``U2@PUNCH``; the time of the model, unless given.
    factor, along_factor : float
        What quantity and controls of the model are multiplied with to be those of the file: signs, symmetry, units. Of
        several quantities ``factor`` is a mapping, too.
    mode : str
        Loading mode of that stretch.
    solver, command, deck, card_format : str, optional
        As of `tissuq ensemble`: those of the deck, unless given.
    cards : CardSettings
        Unit of stress and bulk modulus of the model, law of the cards.
    also : tuple of str
        Other files that the solver needs beside the deck.
    timeout : float, optional
        Seconds after which a run is stopped.
    retries : int
        Times that a run which failed is made again.
    keep : bool
        Keep the solver's files of every run.
    folder : Path, optional
        Where it is run; `prepared_in` sets it.
    abaqus : str
        The program that opens .odb files; unless given, the first word of the command.

    Examples
    --------
    >>> import tissuq as tq
    >>> punch = tq.DeckForward("indentation.inp", "TISSUE", "ogden-1", "RF2@PUNCH", (0.7, 1.2), along="U2@PUNCH",
    ...                        factor=-180, along_factor=-1)
    >>> found = tq.calibrate(depth, force, punch, priors, folder="runs/punch")  # doctest: +SKIP
    """

    model: str | Path
    replaced: str
    material: str
    quantity: str | Mapping[str, str]
    stretch: tuple[float, float]
    along: str | None = None
    factor: float | Mapping[str, float] = 1.0
    along_factor: float = 1.0
    mode: str = "uniaxial"
    solver: str | None = None
    command: str = ""
    deck: str | None = None
    card_format: str | None = None
    cards: CardSettings = field(default_factory=CardSettings)
    also: tuple[str, ...] = ()
    timeout: float | None = None
    retries: int = 0
    keep: bool = False
    folder: Path | None = None
    abaqus: str = ""

    @cached_property
    def read_deck(self) -> Deck:
        """The deck with the files that it includes."""
        return Deck.read(self.model, self.deck, {Path(name).absolute() for name in self.also})

    @cached_property
    def program(self) -> Solver:
        """The solver."""
        return solver_for(self.read_deck.format.name, self.solver, self.command)

    @cached_property
    def measured(self) -> Mapping[str, Quantity]:
        """What was measured, by name; the name of a single quantity is empty."""
        texts = {"": self.quantity} if isinstance(self.quantity, str) else self.quantity
        return {name: parse_quantity(f"quantity{'-' * bool(name)}{name}", text) for name, text in texts.items()}

    @cached_property
    def factors(self) -> Mapping[str, float]:
        """What the quantities of the model are multiplied with, by name."""
        factors = self.factor if isinstance(self.factor, Mapping) else dict.fromkeys(self.measured, self.factor)
        return {name: factors.get(name, 1.0) for name in self.measured}

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """What was measured, and what the controls are where that is not the time."""
        controls = () if self.along is None else (parse_quantity("along", self.along),)
        return (*self.measured.values(), *controls)

    @property
    def law(self) -> Material:
        """The law of the material."""
        return material_named(self.material)

    @property
    def identity(self) -> str:
        deck = self.read_deck
        extra = extra_files(deck, self.also, Path())
        contents = [(name, sha256(text).hexdigest()) for name, text in sorted(deck.files.items())]
        contents += [(name, sha256(file.read_bytes()).hexdigest()) for name, file in sorted(extra.items())]
        outputs = [quantity.identity for quantity in self.quantities], self.factor, self.along_factor
        of_card = self.material, self.stretch, self.mode, self.card_format, self.cards
        everything = (
            contents,
            self.replaced.upper(),
            outputs,
            of_card,
            self.program.name,
            self.program.words("job", "deck"),
        )
        return f"{deck.main}:{self.replaced} {sha256(repr(everything).encode()).hexdigest()[:PLACES]}"

    def check(self, symbols: Sequence[str]) -> None:
        wanted = [parameter.symbol for parameter in self.law.parameters]
        if set(symbols) != set(wanted):
            raise InputError(
                f"the material {self.law.name} in the model has the parameters {', '.join(wanted)}; those with priors "
                f"are {', '.join(symbols)}."
            )
        points_of_range(self.law, self.mode, self.stretch)
        name = self.read_deck.material(self.replaced).name
        if not self.law.is_isotropic:
            if isinstance(code := self._code, FECode):
                code.check_has_card(self.law)
            check_fibres(name, self._cards(dict.fromkeys(wanted, ALLOWED_VALUE)))
        self.program.check_installed()
        extra_files(self.read_deck, self.also, Path())
        for quantity in self.quantities:
            quantity.check()
        check_sets(self.read_deck, self.quantities, self.program)
        sets_of(self.read_deck, self.quantities)
        if not all(np.isfinite(factor) and factor for factor in (*self.factors.values(), self.along_factor)):
            raise InputError("a factor of a quantity must be a number other than zero.")

    def prepared_in(self, folder: Path) -> DeckForward:
        copy_model(self.read_deck, self.also, Path(), folder)
        clear_unfinished(folder / SOLVED)
        return replace(self, folder=folder.absolute())

    def of_quantities(self, ends: Mapping[str, tuple[int, int]]) -> Forward:
        if set(ends) != set(self.measured):
            modelled, measured = (", ".join(filter(None, names)) or "one quantity" for names in (self.measured, ends))
            raise InputError(f"the model gives {modelled}; what was measured is {measured}.")
        return super().of_quantities(ends)

    def run(self, parameters: Mapping[str, float], control: FloatArray | Mapping[str, FloatArray]) -> Any:
        assert self.folder is not None  # noqa: S101 (where it is run, it is prepared)
        deck, block = self.read_deck, self._block(parameters)
        task = ModelRun(
            "run", 0, self.folder / MODEL, deck.main, deck.format.name, ((self.replaced, block),), self.program,
            self.quantities, (), self._place(parameters), SolverRun(self.timeout, self.retries, abaqus=self.abaqus),
        )  # fmt: skip
        try:
            return self._outputs(carried_out(task), control)
        except (ConvergenceError, UnreadableError):
            run_again(task.folder)
            raise

    def _outputs(self, result: Mapping[str, Any], control: FloatArray | Mapping[str, FloatArray]) -> Any:
        """Return what a run gave at the controls."""
        if result["misread"] and not result["problem"]:
            raise UnreadableError(result["misread"])
        if not isinstance(control, Mapping):
            return self._at(control, "", result["curves"], str(result["problem"]))
        return {
            name: self._at(values, name, result["curves"], str(result["problem"])) for name, values in control.items()
        }

    def clear(self, parameters: Mapping[str, float]) -> None:
        folder = self._place(parameters)
        if not (self.keep or problem_of(folder)):
            shutil.rmtree(folder, ignore_errors=True)

    def _place(self, parameters: Mapping[str, float]) -> Path:
        """Return the folder of a run."""
        assert self.folder is not None  # noqa: S101 (where it is run, it is prepared)
        digest = sha256(repr(sorted(parameters.items())).encode()).hexdigest()
        return self.folder / SOLVED / f"run-{digest[:PLACES]}"

    @property
    def _code(self) -> CardFormat:
        """What writes the card."""
        return card_format(self.card_format or self.program.card_format or self.read_deck.format.card_format)

    def _block(self, parameters: Mapping[str, float]) -> str:
        """Return the material with parameters in the unit of the model, as the deck has it."""
        return self._cards(parameters).blocks[0]

    def _cards(self, parameters: Mapping[str, float]) -> Cards:
        """Return the card of the material with parameters in the unit of the model."""
        law, number = self.law, self.read_deck.material(self.replaced).number
        in_mpa = {p.symbol: parameters[p.symbol] / (self.cards.factor if p.unit else 1.0) for p in law.parameters}
        drawn = card_material(law, tuple(in_mpa.values()), self.stretch, self.mode)
        settings = replace(self.cards, number=int(number) if number.isdecimal() else 1)
        cards = self._code.checked_cards(drawn, settings)
        if not cards.blocks:
            raise UnreadableError(f"cards of the format '{self._code.name}' do not go into a deck.")
        return cards

    def _at(self, control: FloatArray, name: str, curves: Mapping[str, Any], problem: str) -> FloatArray:
        """Return a quantity at its controls."""
        from scipy.interpolate import PchipInterpolator

        quantity, *controls = (
            self._from_rest(kind, Curve(*map(np.asarray, curves.get(kind.name, ([], [])))))
            for kind in (self.measured[name], *self.quantities[len(self.measured) :])
        )
        quantity, along = _paired(quantity, controls[0]) if controls else (quantity, quantity.times)
        along, values, count = self.along_factor * along, self.factors[name] * quantity.values, len(along)
        sign = -1.0 if count > 1 and along[-1] < along[0] else 1.0  # a control that falls is looked at from behind
        along, control = sign * along, sign * control
        reached = float(along[-1]) if count else 0.0
        is_short = count < 2 or reached < control.max() * (1 - 1e-9)
        has_failed = is_short and bool(problem)  # and may have ended anywhere
        back = np.flatnonzero(np.diff(along) <= 0)
        if len(back) and not has_failed and along[0] <= control.min() and control.max() <= along.max():
            raise UnreadableError(
                f"the control of the model stands still or goes back at {sign * along[back[0]]:.4g}, and must go "
                "on in one direction: leave holding and unloading out of the deck."
            )
        if count > 1 and not has_failed and (len(back) or control.min() < along[0]):
            raise UnreadableError(
                f"the control of the model goes from {sign * along[0]:.4g} to {sign * reached:.4g}, and must go "
                f"on from {sign * control.min():.4g} or before to {sign * control.max():.4g}, as was measured: give "
                "the sign, as --factor NAME=-1."
            )
        if is_short:
            why = f"{problem}; " if problem else ""
            came = f"the control came to {sign * reached:.4g}, and {sign * control.max():.4g} was measured"
            raise ConvergenceError(f"{why}{came}")
        return np.asarray(PchipInterpolator(along, values)(np.minimum(control, reached)))

    @staticmethod
    def _from_rest(quantity: Quantity, curve: Curve) -> Curve:
        """Return a curve with its beginning at rest, where that is known."""
        if not isinstance(quantity, Component) or not len(curve.times) or curve.times[0] <= 0:
            return curve
        return Curve(np.concatenate([[0.0], curve.times]), np.concatenate([[0.0], curve.values]))


def _paired(quantity: Curve, control: Curve) -> tuple[Curve, FloatArray]:
    """Return a quantity at its times that the control has, too, and the control then: both may have others."""
    if not len(control.times):
        return Curve(control.times, control.values), control.values
    first, last = control.times[0] * (1 - SAME_TIME), control.times[-1] * (1 + SAME_TIME)
    is_within = (quantity.times >= first) & (quantity.times <= last)
    times, values = quantity.times[is_within], quantity.values[is_within]
    return Curve(times, values), np.interp(times, control.times, control.values)


def units_of(cards: CardSettings) -> dict[str, str]:
    """Return the units of length, force and pressure of a model whose stresses are in the unit of its cards."""
    length, force, *_ = cards.system.units.split(", ")
    return {LENGTH.name: length, FORCE.name: force, PRESSURE.name: cards.unit}


def conversion(text: str, cards: CardSettings, unit: str) -> float:
    """Return what a quantity of a model is multiplied with to be in a unit; 1 of one whose unit is not known.

    Parameters
    ----------
    text : str
        The quantity, such as ``RF2@TOP``.
    cards : CardSettings
        With the unit of stress of the model, from which those of lengths and forces follow.
    unit : str
        That of the file; empty where it has none.

    Raises
    ------
    InputError
        When the unit is missing, or is one of another quantity.

    Examples
    --------
    >>> from tissuq.export import CardSettings
    >>> conversion("RF2@TOP", CardSettings(unit="MPa"), "mN")  # the model's are N
    1000.0
    """
    quantity = parse_quantity("quantity", text)
    kind = PHYSICAL.get(quantity.kind) if isinstance(quantity, Component) else None
    if kind is None:
        return 1.0
    if not unit:
        raise InputError(
            f"the file does not say in which unit the {kind.name} is that {text} is compared with: write it into the "
            f"heading of the column, as in {kind.name} [{units_of(cards)[kind.name]}]."
        )
    return kind.factor(units_of(cards)[kind.name]) / kind.factor(unit)


def check_unit_of_function(name: str, text: str, cards: CardSettings, unit: str) -> None:
    """Refuse to compare what a function of the user gives with measurements that are not in the units of the model.

    Parameters
    ----------
    name, text : str
        Of the quantity.
    cards : CardSettings
        With the unit of stress of the model.
    unit : str
        That of the file; of one that says nothing nothing is refused.

    Raises
    ------
    InputError
        When both are units of one kind, and not the same.
    """
    if isinstance(parse_quantity(name, text), Component):
        return  # `conversion` converts it
    for kind in PHYSICAL.values():
        of_file, of_model = kind.factor_or_none(unit), units_of(cards)[kind.name]
        ratio = kind.factor(of_model) / of_file if of_file else 1.0
        if not isclose(ratio, 1.0, rel_tol=1e-9):
            raise InputError(
                f"the {kind.name} '{name}' is measured in {unit}, and the model is in {of_model}: say in which of them "
                f"{text} gives it, --factor {name}={ratio:.6g} if in {of_model}, or --factor {name}=1 if in {unit}."
            )
