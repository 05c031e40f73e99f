"""Forces of the cases as plain functions: forward models for whoever emulates or fits them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.errors import ConvergenceError
from tissuq.finite_elements.case import Case
from tissuq.finite_elements.clamped_bar import ClampedBar
from tissuq.finite_elements.indentation import Indentation
from tissuq.finite_elements.response import BULK_RATIO, respond
from tissuq.mechanics import Material, material_named

__all__ = ["bar_force", "case_forces", "indentation_force"]


def case_forces(
    case: Case,
    material: str | Material,
    values: ArrayLike | None,
    travel: ArrayLike,
    bulk_ratio: float = BULK_RATIO,
) -> NDArray[np.float64]:
    """Return the forces (n,), N, at increasing depths or elongations (n,), mm.

    Raises
    ------
    ConvergenceError
        When the solver does not get that far; the message says how far it did.
    InputError, ModelError
        As `respond`.
    """
    kind = material_named(material)
    found = respond(case, kind, values, travel=travel, bulk_ratio=bulk_ratio)
    if found.problem:
        raise ConvergenceError(
            f"case '{case.name}' with material '{kind.name}' ended at a {case.travel_name} of {found.reached:.3g} mm: "
            f"{found.problem}."
        )
    return found.force


def indentation_force(
    material: str | Material, values: ArrayLike | None, depths: ArrayLike, **sizes: Any
) -> NDArray[np.float64]:
    """Return the forces (n,), N, of a flat rigid punch at depths (n,), mm, in increasing order.

    Parameters
    ----------
    material : str or Material
        Isotropic, or a draw of an ensemble (then without values).
    values : (k,) array or None
        Its parameters in their order; MPa where they are moduli.
    depths : (n,) array, mm
    **sizes
        Of `Indentation`: punch_radius, height, radius (mm), is_bonded, fineness.

    Raises
    ------
    ConvergenceError, InputError, ModelError
        As `case_forces`.

    Examples
    --------
    >>> import tissuq as tq
    >>> force = tq.finite_elements.indentation_force("neo-hookean", [0.0005], [0.05, 0.1], fineness=0.5)
    >>> [round(1000 * float(each), 3) for each in force]  # mN
    [0.387, 0.773]
    """
    at = np.atleast_1d(np.asarray(depths, dtype=np.float64))
    return case_forces(Indentation(depth=float(at[-1]), **sizes), material, values, at)


def bar_force(
    material: str | Material, values: ArrayLike | None, elongations: ArrayLike, **sizes: Any
) -> NDArray[np.float64]:
    """Return the forces (n,), N, of a clamped bar at elongations (n,), mm, in increasing order.

    Parameters and exceptions are those of `indentation_force`, with the sizes of `ClampedBar`.
    """
    at = np.atleast_1d(np.asarray(elongations, dtype=np.float64))
    return case_forces(ClampedBar(elongation=float(at[-1]), **sizes), material, values, at)
