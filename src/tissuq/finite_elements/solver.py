"""Newton's method for one material in one case, with load steps that become smaller where they must."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.errors import ModelError
from tissuq.finite_elements.case import AXIAL, Case
from tissuq.finite_elements.material import FElupeMaterial
from tissuq.finite_elements.optional import felupe
from tissuq.mechanics import Material

__all__ = ["CellFields", "Solver"]

FloatArray = NDArray[np.float64]
State = tuple[FloatArray, FloatArray, FloatArray]

HALVINGS = 6
"""How often a load step is halved before a material is given up."""
TOLERANCE = 1e-8
"""Of the residual, relative to the reaction forces."""
ROUNDED = 1e-6
"""The same, where rounding keeps it from becoming smaller: of a small load on a nearly incompressible body."""
ITERATIONS = 20
SHARES = (1.0, 0.5, 0.25, 0.125, 0.0625)
"""Of a Newton step, the largest of which is taken that is not too bad."""
GROWN = 1.5
"""How much larger the residual may become in a step: on the way to a solution it need not always fall."""


@dataclass(frozen=True)
class CellFields:
    """Displacements, and means over cells.

    Attributes
    ----------
    displacement : (n, 2) array, mm
        Of the points, along the axis and from it.
    first, second : (c,) array
        I1 - 3 and I2 - 3 of the distortion.
    largest : (c,) array
        The largest principal stretch.
    von_mises : (c,) array, MPa
        Von Mises's equivalent of the Cauchy stress.
    """

    displacement: FloatArray
    first: FloatArray
    second: FloatArray
    largest: FloatArray
    von_mises: FloatArray


class Solver:
    """The mesh, its supports and the equilibria so far; inside, stresses are in initial shear moduli.

    Attributes
    ----------
    reached : float
        The travel of the last equilibrium, mm.
    iterations : int
        Newton iterations so far.
    """

    def __init__(self, case: Case, material: Material, values: ArrayLike | None, bulk_ratio: float) -> None:
        fem, mesh = felupe(), case.mesh()
        supports = case.supports(mesh.points)
        self._umat = FElupeMaterial(material, values=values)
        self._modulus = self._umat.unit = _stiffness(material, self._umat.energy.initial_shear_modulus)
        region = fem.RegionQuad(fem.Mesh(*mesh, "quad"))
        self._field = fem.FieldContainer([fem.FieldAxisymmetric(region, dim=2)])
        self._solid = fem.SolidBodyNearlyIncompressible(self._umat, self._field, bulk=bulk_ratio)
        self._volumes = 2 * np.pi * self._field[0].radius * region.dV
        held = supports.fixed.copy()
        held[:, AXIAL] |= supports.moved
        self._held, self._free = np.flatnonzero(held.ravel()), np.flatnonzero(~held.ravel())
        self._moved = supports.moved
        self._rate = np.zeros_like(mesh.points)
        self._rate[supports.moved, AXIAL] = supports.direction
        self._path = [(0.0, np.zeros_like(mesh.points))]
        self.iterations = 0

    @property
    def reached(self) -> float:
        """The travel of the last equilibrium, mm."""
        return self._path[-1][0]

    def advance(self, target: float) -> str:
        """Go on to a travel in as many load steps as it needs, or say why this is not possible."""
        whole = step = target - self.reached
        while self.reached < target:
            goal = min(self.reached + step, target) if step < whole else target
            problem = self._attempt(goal)
            if not problem:
                continue
            if step <= whole / 2**HALVINGS:
                return f"{problem}, also with load steps of {step:.2g} mm"
            step /= 2
        return ""

    def force(self) -> float:
        """Return the force (N) that moves the moved points on."""
        internal = self._residual(self._path[-1][1]).reshape(-1, 2)[self._moved, AXIAL]
        return float(internal.sum() * np.sign(self._rate.sum()) * self._modulus)

    def fields(self) -> CellFields:
        """Return the displacements, and means over cells weighted by volume."""
        u = self._path[-1][1]
        self._residual(u)
        F, J, squares = self._strains()
        cauchy = np.einsum("ijqc,kjqc->ikqc", self._solid.results.stress[0], F) / J * self._modulus
        deviator = cauchy - np.einsum("iiqc->qc", cauchy) / 3 * np.eye(3)[:, :, None, None]
        found = (
            squares.sum(axis=-1) - 3,
            (1 / squares).sum(axis=-1) - 3,
            np.sqrt(squares.max(axis=-1)) * J ** (1 / 3),
            np.sqrt(1.5 * (deviator**2).sum(axis=(0, 1))),
        )
        weights = self._volumes / self._volumes.sum(axis=0)
        return CellFields(u.copy(), *((each * weights).sum(axis=0) for each in found))

    def shares_beyond(self, most: tuple[float, float]) -> tuple[float, float]:
        """Return the shares of volume and of strain energy where I1 - 3 or I2 - 3 is beyond the given ones."""
        self._residual(self._path[-1][1])
        F, _, squares = self._strains()
        is_beyond = (squares.sum(axis=-1) - 3 > most[0]) | ((1 / squares).sum(axis=-1) - 3 > most[1])
        energies = self._umat.function([F, None])[0] * self._volumes
        shares = (float((each * is_beyond).sum() / each.sum()) for each in (self._volumes, energies))
        return next(shares), next(shares)

    def _strains(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return F (3, 3, q, c), J (q, c), and the squared principal stretches (q, c, 3) of the distortion."""
        F = self._solid.results.kinematics[0]
        matrices = np.moveaxis(F, (0, 1), (-2, -1))
        J = np.linalg.det(matrices)
        return F, J, (np.linalg.svd(matrices, compute_uv=False) / J[..., None] ** (1 / 3)) ** 2

    def _attempt(self, goal: float) -> str:
        """Add the equilibrium at a travel to the path, from the last one or from where the last two point."""
        state, problem = self._state(), ""
        for guess in (self._path[-1][1], self._further(goal)):
            found, problem = self._equilibrium(guess, goal)
            if found is not None:
                self._path = [self._path[-1], (goal, found)]
                return ""
            self._restore(state)
        return problem

    def _further(self, goal: float) -> FloatArray:
        """Return displacements on the straight line through the last two equilibria."""
        now, u = self._path[-1]
        before, earlier = self._path[0]
        return u if now == before else np.asarray(u + (u - earlier) * (goal - now) / (now - before))

    def _equilibrium(self, guess: FloatArray, travel: float) -> tuple[FloatArray | None, str]:
        """Return displacements in equilibrium, or why there are none found."""
        from scipy.sparse.linalg import spsolve

        u, residual, given = guess, self._residual(guess), self._rate * travel
        moved = self._rate != 0
        shares: Sequence[float] = SHARES if np.allclose(u[moved], given[moved]) else SHARES[:1]  # all the way at first
        for _ in range(ITERATIONS):
            if not np.isfinite(residual).all():
                return None, "cells turned inside out"
            tangent = self._solid.assemble.matrix().tocsr()[self._free]
            change = np.zeros(u.size)
            change[self._held] = (given - u).ravel()[self._held]
            right = -residual[self._free] - tangent[:, self._held] @ change[self._held]
            change[self._free] = spsolve(tangent[:, self._free].tocsc(), right)
            self.iterations += 1
            before = residual
            u, residual = self._step(u, residual, change.reshape(u.shape), shares)
            shares = SHARES
            if self._is_balanced(residual, before):
                return u, ""
        return None, f"Newton's method did not converge in {ITERATIONS} iterations"

    def _is_balanced(self, residual: FloatArray, before: FloatArray) -> bool:
        """Whether a residual is small, or nearly so and, by rounding, no smaller than the one before."""
        free, held, last = (
            float(np.linalg.norm(each)) for each in (residual[self._free], residual[self._held], before[self._free])
        )
        return free < TOLERANCE * held or last / 2 < free < ROUNDED * held

    def _step(
        self, u: FloatArray, residual: FloatArray, change: FloatArray, shares: Sequence[float]
    ) -> tuple[FloatArray, FloatArray]:
        """Return displacements and residual after the largest share of a change that is not too bad, or the least."""
        state, limit = self._state(), GROWN * np.linalg.norm(residual[self._free])
        for share in shares:
            self._restore(state)
            tried = u + share * change
            found = self._residual(tried)
            if np.linalg.norm(found[self._free]) < limit:
                break
        return tried, found

    def _residual(self, u: FloatArray) -> FloatArray:
        """Return the internal forces of displacements (n, 2), (2 n,), in initial shear moduli times mm^2."""
        self._field[0].values[:] = u
        try:
            found = self._solid.assemble.vector(self._field).toarray()
        except np.linalg.LinAlgError:
            return np.full(u.size, np.nan)
        return np.asarray(found[:, 0])

    def _state(self) -> State:
        """Return displacements, pressures and volumes, which Newton's method changes together."""
        state = self._solid.results.state
        return state.u.copy(), state.p.copy(), state.J.copy()

    def _restore(self, kept: State) -> None:
        """Go back to an earlier state: a step that failed leaves nothing behind that is not a number."""
        state = self._solid.results.state
        self._field[0].values[:] = kept[0]
        state.u[:], state.p[:], state.J[:] = kept
        state.F = self._field.extract()


def _stiffness(material: Material, modulus: float) -> float:
    """Return an initial shear modulus that stresses can be divided by, and a bulk modulus follows from."""
    if not modulus > 0:
        raise ModelError(
            f"material '{material.name}' has an initial shear modulus of {modulus:.3g} MPa; finite elements need a "
            "positive one."
        )
    return modulus
