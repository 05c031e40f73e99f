"""What a simulation of a case of finite elements depends on."""

from __future__ import annotations

import re
from dataclasses import fields
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

from tissuq.errors import InputError
from tissuq.registry import find
from tissuq.studies.option import option
from tissuq.studies.option_texts import number_or_text, pairs_of
from tissuq.studies.shared_options import RunSettings, seed

if TYPE_CHECKING:
    from tissuq.finite_elements.case import Case

__all__ = ["SimulationSettings"]


BODY = "A body of your own"
MOVEMENT = re.compile(r"(?P<set>.+)=(?P<axis>[xyz]):(?P<distance>[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?)", re.IGNORECASE)


def _bulk_ratio() -> float:
    from tissuq.finite_elements.response import BULK_RATIO

    return BULK_RATIO


class SimulationSettings(RunSettings):
    """Everything that a simulation depends on.

    ``sizes`` are fields of the case (mm); ``force_noise`` is in N.
    """

    case: str = option(
        "indentation", "indentation (flat punch, disc), sphere (pressed on a disc), bar (clamped, in tension) or plate "
        "(with a hole)."
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
        help="Bulk modulus in initial shear moduli [2000].", default_factory=_bulk_ratio, gt=0, lt=inf
    )

    mesh: str | None = option(
        None, "Instead of a case: a file of a mesh (.msh, .inp, .vtu and others that meshio reads; in mm).",
        takes=Path, parse=str, group=BODY,
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
    shape: str | None = option(None, "axisymmetric (around y) or plane (strain), of a mesh in a plane.", group=BODY)
    parts: float = option(1.0, "Such bodies, by symmetry, that bear the force side by side.", gt=0, lt=inf, group=BODY)

    def sized_case(self, beside: Path = Path()) -> Case:
        """Return the case with its sizes, or the body of a mesh that lies beside a recipe.

        Raises
        ------
        InputError
            When there is no such case or size, a size is not possible, or the mesh cannot be used.
        """
        from tissuq.finite_elements.case import Case
        from tissuq.finite_elements.mesh_file import BodyFromFile

        if self.mesh is not None:
            return self._body(beside / self.mesh)
        if self.hold or self.move or self.press or self.case == BodyFromFile.name:
            raise InputError("give the mesh of the body, too: --mesh FILE --hold ymin=xyz --move ymax=y:-0.4.")
        kind = find(Case, "case", self.case, InputError)
        sizes = {field.name: field.default for field in fields(kind)}
        for name, value in self.sizes.items():
            if name not in sizes:
                defaults = ", ".join(f"{size}={default}" for size, default in sizes.items())
                raise InputError(f"case '{self.case}' has no size '{name}'; its sizes are {defaults}.")
            if isinstance(value, str) != isinstance(sizes[name], str):
                wanted = "a word" if isinstance(sizes[name], str) else "a number"
                raise InputError(f"case '{self.case}': {name} must be {wanted} like {sizes[name]}, not '{value}'.")
        return kind(**self.sizes)

    def _body(self, file: Path) -> Case:
        from tissuq.finite_elements.mesh_file import BodyFromFile

        if bool(self.move) == bool(self.press) or self.sizes:
            raise InputError(
                "a body from a mesh has no --size, and needs either --move SET=AXIS:DISTANCE or --press "
                "SET=AXIS:DISTANCE, as in --move ymax=y:-0.4."
            )
        match = MOVEMENT.fullmatch((self.move or self.press or "").strip())
        if match is None:
            option_name, text = ("--move", self.move) if self.move else ("--press", self.press)
            raise InputError(f"'{text}' is not a movement ({option_name}); write SET=AXIS:DISTANCE, as in ymax=y:-0.4.")
        return BodyFromFile(
            str(file), self.hold, match["set"] if self.move else "", match["set"] if self.press else "", match["axis"],
            float(match["distance"]), self.tip_radius, self.shape or "", self.parts,
        )  # fmt: skip
