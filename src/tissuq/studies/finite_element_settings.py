"""What finite elements depend on: cards, how a user's own model is run, an ensemble of it, and a case."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import fields
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import field_validator, model_validator

from tissuq.errors import InputError
from tissuq.registry import find
from tissuq.studies.option import Settings, argument, mesh_order, option, sampling, seed
from tissuq.studies.option_texts import number_or_text, pairs_of
from tissuq.studies.run_settings import RunSettings
from tissuq.studies.settings import imported, there_is

if TYPE_CHECKING:
    from tissuq.export import CardSettings
    from tissuq.finite_elements.case import Case

SOLVER, CARDS = "Solver", "Cards"
MESH = "Error of the mesh"


class CardOptions(Settings):
    """What material cards are."""

    law: str | None = option(
        None,
        "Write the nearest polynomial, reduced-polynomial, ogden or (FEBio) mixture [the draws' own law where the code "
        "has it, else the best of these].",
        group=CARDS,
    )
    order: int | None = option(None, "Order or number of terms of that law.", group=CARDS)
    unit: str = option("MPa", "Unit of stress of the model: MPa, kPa or Pa.", group=CARDS)
    bulk_modulus: float | None = option(
        None, "In that unit, of all draws [1000 times the mean initial shear modulus].", gt=0, lt=inf, group=CARDS
    )
    poisson: float | None = option(None, "Instead: Poisson's ratio of all draws.", group=CARDS)

    def card_settings(self, **changes: Any) -> CardSettings:
        """Return the settings of the cards.

        Raises
        ------
        InputError
            When they have no meaning.
        """
        from tissuq.export import CardSettings

        return CardSettings(**{name: getattr(self, name) for name in CardOptions.model_fields}, **changes)


class ModelSettings(CardOptions):
    """The solver of a deck, and the cards in it."""

    solver: str | None = option(None, "ccx, febio4 or command [that of the deck].", group=SOLVER)
    command: str = option(
        "", "Command of the solver, such as 'abaqus job={job} ask=off', {deck} with suffix.", group=SOLVER
    )
    deck: str | None = option(None, "abaqus, febio, ls-dyna or ansys [what the file is].", group=SOLVER)
    card_format: str | None = option(None, "Format of cards [that of the solver].", name="format", group=CARDS)
    also: list[str] = option(
        default_factory=list,
        help="Another file that the solver needs beside the deck; repeat for more.",
        takes=list[Path],
        group=SOLVER,
    )

    def run_by_name(self) -> Iterator[tuple[str, str, str]]:
        """Yield programs, servers and functions that are run: the setting of each, its option, and what is typed."""
        from tissuq.mechanics.user_law import UserCode

        for setting in ("forward", "umbridge", "command"):
            if text := getattr(self, setting, None):
                yield setting, f"--{setting}", text
        for setting, typed in (("quantities", "--qoi"), ("along", "--along")):
            for name, text in getattr(self, setting, {}).items():
                if UserCode.named(text):
                    yield setting, typed, f"{name}={text}"


class EnsembleSettings(ModelSettings):
    """Everything that the results of an ensemble depend on.

    ``materials`` has the folder of a run for each material of the model, ``quantities`` what each quantity is.
    """

    model: str = argument(
        ...,
        "Your model: a deck of CalculiX or Abaqus (.inp), FEBio (.feb), LS-DYNA (.k), ANSYS (.cdb).",
        takes=Path,
    )
    materials: dict[str, str] = option(
        ...,
        "Name (ANSYS: number) of the material in the model that the draws replace; NAME=RUN takes them from another "
        "run. Repeat for more.",
        name="replace",
        min_length=1,
    )
    quantities: dict[str, str] = option(
        ...,
        "Quantity of interest: NAME=RF3@SET, U1@SET, S11@SET, MISES@SET:max (CalculiX), or NAME=file.py:function of "
        "the folder of a draw. Repeat for more.",
        name="qoi",
        parse=pairs_of("--qoi", "a quantity of interest", "NAME=WHAT, as in force=RF3@TOP"),
        min_length=1,
    )
    discrepancy: str | None = option(None, "Which of the discrepancies of the run [auto, or the only one].")
    draws: int = option(64, "Draws of the posterior.", ge=2)
    sampling: str = sampling()
    all_draws: bool = option(False, "Keep draws that are not stable over the measured range.")
    shares: bool = option(True, "Run the draws without their discrepancy, too, for the shares of the variance.")
    seed: int = seed()
    finer_model: str | None = option(
        None, "The same model with a finer mesh: one draw is run on it, too, for the error of the mesh.",
        takes=Path, group=MESH,
    )  # fmt: skip
    cell_ratio: float | None = option(
        None, "How many times smaller its elements are [by their number].", gt=1, lt=inf, group=MESH
    )
    mesh_order: float | None = mesh_order(MESH)


USUAL_CASE = "indentation"
BODY = "A body of your own"
NUMBER = r"(?P<size>[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?)"
MOVEMENT = re.compile(rf"(?P<set>.+)=(?P<axis>[xyz]):{NUMBER}", re.IGNORECASE)
OF_BODY = ("move", "press", "tip_radius", "inflate", "watch", "shape", "parts", "finer_mesh", "mesh_order")
"""Options, besides the sets that are held, that say nothing without a mesh."""
LOADS = {"move": MOVEMENT, "press": MOVEMENT, "inflate": re.compile(f"(?P<set>.+)={NUMBER}", re.IGNORECASE)}


class SimulationSettings(RunSettings):
    """Everything that a simulation depends on.

    ``sizes`` are fields of the case (mm); ``force_noise`` is in N.
    """

    case: str | None = option(
        None, "indentation (flat punch, disc), sphere (pressed on a disc), bar (clamped, in tension) or plate (with a "
        "hole) [indentation]."
    )  # fmt: skip
    sizes: dict[str, float | str] = option(
        default_factory=dict,
        help="Size of the case in mm, NAME=VALUE; repeat for more. Indentation: depth, punch_radius, height, radius, "
        "contact=bonded|frictionless, fineness; sphere: depth, tip_radius, height, radius, fineness; bar: elongation, "
        "bar_length, bar_radius, fineness; plate: elongation, width, thickness, hole_radius, fineness.",
        name="size",
        unit="mm",
        parse=pairs_of("--size", "a size", "NAME=VALUE, as in depth=0.4", number_or_text),
    )
    draws: int = option(64, "Draws of the posterior.", ge=2)
    steps: int = option(8, "Steps at which the force is computed.", ge=1)
    seed: int = seed()
    full_runs: int | None = option(
        None, "Draws computed in full; the others follow to first order, much faster [all].", ge=4
    )
    force_noise: float | None = option(
        None,
        "Sd of a new measurement of the force, N [same share of the force as in the test].",
        unit="N",
        ge=0,
        lt=inf,
    )
    bulk_ratio: float = option(
        help="Bulk modulus in initial shear moduli [2000].",
        default_factory=partial(imported, "tissuq.finite_elements.response:BULK_RATIO"),
        gt=0,
        lt=inf,
    )

    mesh: str | None = option(
        None, "Instead of a case: a file of a mesh (.msh, .inp, .vtu and others that meshio reads; in mm).",
        takes=Path, group=BODY,
    )  # fmt: skip
    hold: dict[str, str] = option(
        default_factory=dict,
        help="Set of points that is held, and its directions, SET=xyz; repeat for more. Sets: those of the file, xmin, "
        "xmax, ymin, ymax, zmin, zmax.",
        parse=pairs_of("--hold", "a set that is held", "SET=DIRECTIONS, as in ymin=xyz"),
        group=BODY,
    )
    move: str | None = option(None, "Set that moves, its axis and how far, mm: ymax=y:-0.4.", unit="mm", group=BODY)
    press: str | None = option(
        None,
        "Instead: set against which a rigid plane is pressed without friction, ymax=y:-0.4.",
        unit="mm",
        group=BODY,
    )
    tip_radius: float = option(
        0.0, "Instead of the plane: a sphere over the axis, of this radius, mm.", unit="mm", ge=0, lt=inf, group=BODY
    )
    inflate: str | None = option(
        None, "Instead: set whose faces are under pressure, kPa: inner=2; the answer is then what --watch names.",
        unit="kPa", group=BODY,
    )  # fmt: skip
    watch: str | None = option(
        None, "Set whose mean displacement is the answer to a pressure, and its direction: outer=x.", group=BODY
    )
    shape: str | None = option(None, "axisymmetric (around y) or plane (strain), of a mesh in a plane.", group=BODY)
    finer_mesh: str | None = option(
        None, "The same body with smaller cells: one draw is computed on it, too, for the error of the mesh.",
        takes=Path, group=BODY,
    )  # fmt: skip
    mesh_order: float | None = mesh_order(BODY)
    parts: float = option(1.0, "Such bodies, by symmetry, that bear the force side by side.", gt=0, lt=inf, group=BODY)

    @model_validator(mode="before")
    @classmethod
    def _case_unless_mesh(cls, values: Any) -> Any:
        """Name the usual case where there is no mesh, and none that recipes of earlier versions named beside one."""
        if not isinstance(values, dict):
            return values
        if values.get("mesh") is None:
            return {**values, "case": values.get("case") or USUAL_CASE}
        return {**values, "case": None if values.get("case") == USUAL_CASE else values.get("case")}

    _nearly_incompressible = field_validator("bulk_ratio")(there_is("tissuq.finite_elements.solver:check_bulk_ratio"))

    def sized_case(self, beside: Path = Path()) -> Case:
        """Return the case with its sizes, or the body of a mesh that lies beside a recipe.

        Raises
        ------
        InputError
            When there is no such case or size, a size is not possible, or the mesh cannot be used.
        """
        from tissuq.finite_elements.body_from_file import BodyFromFile
        from tissuq.finite_elements.case import Case

        if self.mesh is not None:
            return self._body(beside / self.mesh)
        assert self.case is not None  # noqa: S101 (as validated)
        kind = find(Case, "case", self.case, InputError)
        of_body = [name for name in OF_BODY if getattr(self, name) != type(self).model_fields[name].get_default()]
        if self.hold or of_body or issubclass(kind, BodyFromFile):
            raise InputError(
                "give the mesh of the body, too: --mesh FILE --hold ymin=xyz --move ymax=y:-0.4; the sizes of a case "
                "are --size NAME=VALUE."
            )
        sizes = {field.name: field.default for field in fields(kind)}
        for name, value in self.sizes.items():
            if name not in sizes:
                defaults = ", ".join(f"{size}={default}" for size, default in sizes.items())
                raise InputError(f"case '{self.case}' has no size '{name}'; its sizes are {defaults}.")
            if isinstance(value, str) != isinstance(sizes[name], str):
                wanted = "a word" if isinstance(sizes[name], str) else "a number"
                raise InputError(f"case '{self.case}': {name} must be {wanted} like {sizes[name]}, not '{value}'.")
        return kind(**self.sizes)

    def finer_case(self, beside: Path = Path()) -> Case | None:
        """Return the body of the finer mesh; None where there is none.

        Raises
        ------
        InputError
            As `sized_case`.
        """
        return None if self.finer_mesh is None else self._body(beside / self.finer_mesh)

    def _body(self, file: Path) -> Case:
        from tissuq.finite_elements.body_from_file import BodyFromFile, InflatedBody

        loads = {name: text for name in LOADS if (text := getattr(self, name)) is not None}
        if len(loads) != 1 or self.sizes or self.case or bool(self.watch) != bool(self.inflate):
            raise InputError(
                "a body from a mesh has no --case or --size, and needs one of --move ymax=y:-0.4, --press ymax=y:-0.4, "
                "and --inflate inner=2 --watch outer=x."
            )
        if self.tip_radius and not self.press:
            raise InputError(f"--tip-radius goes with --press: write --press ymax=y:-0.4, not --{next(iter(loads))}.")
        ((name, text),) = loads.items()
        match = LOADS[name].fullmatch(text.strip())
        if match is None:
            form = "SET=PRESSURE, as in inner=2" if self.inflate else "SET=AXIS:DISTANCE, as in ymax=y:-0.4"
            raise InputError(f"'{text}' is not what --{name} needs; write {form}.")
        common: dict[str, Any] = {
            "hold": self.hold,
            "distance": float(match["size"]),
            "shape": self.shape or "",
            "parts": self.parts,
        }
        if self.inflate:
            watched, _, direction = (self.watch or "").rpartition("=")
            return InflatedBody(str(file), press=match["set"], watch=watched, direction=direction, **common)
        sets: dict[str, Any] = (
            {"move": match["set"]} if self.move else {"press": match["set"], "tip_radius": self.tip_radius}
        )
        return BodyFromFile(str(file), axis=match["axis"], **sets, **common)
