"""Newton's method for one material in one case, with load steps that become smaller where they must."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import FloatArray
from tissuq.errors import InputError, ModelError
from tissuq.export.cards import NEARLY
from tissuq.finite_elements.case import AXIAL, Case, felupe
from tissuq.finite_elements.loads import Action, load_on
from tissuq.finite_elements.material import FElupeMaterial, distortional_energy
from tissuq.mechanics import Material

State = tuple[FloatArray, FloatArray, FloatArray]

MAX_HALVINGS = 6
"""Largest number of halvings of a load step."""
TOLERANCE = 1e-8
"""Largest residual of an equilibrium, relative to the reaction forces."""
ROUNDING_TOLERANCE = 1e-6
"""The same where rounding keeps the residual from falling further: small loads on a nearly incompressible body."""
MAX_ITERATIONS = 20
STEP_FRACTIONS = (1.0, 0.5, 0.25, 0.125, 0.0625)
"""Fractions of a Newton step; the largest that keeps the residual within its limit is taken."""
MAX_RESIDUAL_GROWTH = 1.5
"""Largest factor by which the residual may grow in a step: on the way to a solution it need not always fall."""


def check_bulk_ratio(ratio: float) -> None:
    """Refuse a bulk modulus, in initial shear moduli, that would make Poisson's ratio negative: as cards do.

    Raises
    ------
    InputError
        When it is so small, or no finite number.
    """
    if not 2 < 3 * ratio < np.inf:
        raise InputError(
            f"a bulk modulus of {ratio:g} initial shear moduli gives a Poisson's ratio that is not positive, and the "
            f"measurements are taken as those of an incompressible material: give {NEARLY:g} or more, or none "
            "(--bulk-ratio)."
        )


@dataclass(frozen=True)
class CellFields:
    """Displacements, and means over cells.

    Attributes
    ----------
    displacement : (n, 2) or (n, 3) array, mm
        Displacements of the points, with the axes of the mesh.
    first_invariant, second_invariant : (c,) array
        I1 - 3 and I2 - 3 of the distortion.
    largest : (c,) array
        The largest principal stretch.
    von_mises : (c,) array, MPa
        Von Mises's equivalent of the Cauchy stress.
    """

    displacement: FloatArray
    first_invariant: FloatArray
    second_invariant: FloatArray
    largest: FloatArray
    von_mises: FloatArray


@dataclass(frozen=True, eq=False)
class StrainPath:
    """How a body deforms while what moves it goes on by a unit: the power on it is the force.

    Attributes
    ----------
    logs, rates : (n, 3) arrays
        Principal logarithmic strains of the distortion at the points of quadrature, and their rates, 1/mm.
    volumes : (n,) array, mm^3
        Of the points, over the part of a unit by which the points move.
    volumetric_power : float
        The power on the change of volume, for an initial shear modulus of one.
    """

    logs: FloatArray
    rates: FloatArray
    volumes: FloatArray
    volumetric_power: float


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
        check_bulk_ratio(bulk_ratio)
        fem, mesh = felupe(), case.mesh()
        supports = case.supports(mesh.points)
        self._bulk_ratio = bulk_ratio
        energy = distortional_energy(material, values)  # which refuses fibres: a case has no directions for them
        self._umat = FElupeMaterial(material, values=values)
        self._modulus = self._umat.unit = _stiffness(material, energy.initial_shear_modulus)
        region = mesh.region()
        field = mesh.field_on(region)
        width = 1.0 if mesh.is_solid or mesh.is_plane else 2 * np.pi * field.radius
        self._field = fem.FieldContainer([field])
        self._solid = fem.SolidBodyNearlyIncompressible(self._umat, self._field, bulk=bulk_ratio)
        self._volumes, self._parts = supports.parts * width * region.dV, supports.parts
        held = supports.fixed.copy()
        held[:, AXIAL] |= supports.moved
        self._held, self._free = np.flatnonzero(held.ravel()), np.flatnonzero(~held.ravel())
        self._moved = supports.moved
        self._load = load_on(mesh, supports, width * region.dV, self._modulus)
        self._travel_unit = case.travel_unit
        self._gives_force = case.response == Case.response
        self._rate = np.zeros_like(mesh.points)
        self._rate[supports.moved, AXIAL] = supports.direction
        self._path = [(0.0, np.zeros_like(mesh.points))]
        self.iterations = 0

    @property
    def reached(self) -> float:
        """The travel of the last equilibrium, mm."""
        return self._path[-1][0]

    def advance(self, target: float) -> str:
        """Advance to a travel in as many load steps as needed; return the reason if this fails, else an empty text."""
        full_step = step = target - self.reached
        while self.reached < target:
            goal = min(self.reached + step, target) if step < full_step else target
            problem = self._attempt(goal)
            if not problem:
                continue
            if step <= full_step / 2**MAX_HALVINGS:
                return f"{problem}, also with load steps of {step:.2g} {self._travel_unit}"
            step /= 2
        return ""

    def force(self) -> float:
        """Return the force (N) that moves the moved points on, or the displacement (mm) by a pressure."""
        travel, u = self._path[-1]
        if self._load:
            return self._load.at(u, travel).response * (self._parts * self._modulus if self._gives_force else 1.0)
        internal = self._residual(u, travel).reshape(self._rate.shape)[self._moved, AXIAL]
        return float(self._parts * internal.sum() * np.sign(self._rate.sum()) * self._modulus)

    def fields(self) -> CellFields:
        """Return the displacements, and means over cells weighted by volume."""
        travel, u = self._path[-1]
        self._residual(u, travel)
        F, J, squares = self._strains()
        cauchy = np.einsum("ijqc,kjqc->ikqc", self._solid.results.stress[0], F) / J * self._modulus
        deviator = cauchy - np.einsum("iiqc->qc", cauchy) / 3 * np.eye(3)[:, :, None, None]
        values = (
            squares.sum(axis=-1) - 3,
            (1 / squares).sum(axis=-1) - 3,
            np.sqrt(squares.max(axis=-1)) * J ** (1 / 3),
            np.sqrt(1.5 * (deviator**2).sum(axis=(0, 1))),
        )
        weights = self._volumes / self._volumes.sum(axis=0)
        return CellFields(u.copy(), *((value * weights).sum(axis=0) for value in values))

    def shares_beyond(self, max_invariants: tuple[float, float]) -> tuple[float, float]:
        """Return the shares of volume and of strain energy where I1 - 3 or I2 - 3 is beyond the given ones."""
        self._residual(*self._path[-1][::-1])
        F, _, squares = self._strains()
        max_1, max_2 = max_invariants
        is_beyond = (squares.sum(axis=-1) - 3 > max_1) | ((1 / squares).sum(axis=-1) - 3 > max_2)
        energies = self._umat.function([F, None])[0] * self._volumes
        fractions = (float((weights * is_beyond).sum() / weights.sum()) for weights in (self._volumes, energies))
        return next(fractions), next(fractions)

    def strain_path(self) -> StrainPath:
        """Return how the body deforms around the last equilibrium."""
        travel, u = self._path[-1]
        self._residual(u, travel)
        action = self._load.at(u, travel) if self._load else None
        rates = self._rates(action)
        F, J, _ = self._strains()
        self._field[0].values[:] = rates.reshape(u.shape)
        F_rate = self._field.extract()[0] - np.eye(3)[:, :, None, None]
        self._field[0].values[:] = u
        matrices, matrix_rates = (
            np.moveaxis(gradients, (0, 1), (-2, -1)).reshape(-1, 3, 3) for gradients in (F, F_rate)
        )
        left_vectors, stretches, right_vectors = np.linalg.svd(matrices)
        log_rates = np.einsum("nia,nij,naj->na", left_vectors, matrix_rates, right_vectors) / stretches
        share = np.abs(self._rate).max() if action is None else 1.0
        cells = self._volumes.sum(axis=0)
        J_rate = J * log_rates.sum(axis=1).reshape(J.shape)
        J_mean, J_mean_rate = ((values * self._volumes).sum(axis=0) / cells for values in (J, J_rate))
        volumetric = self._bulk_ratio * ((J_mean - 1) * J_mean_rate * cells).sum() / share
        if action:  # what the tip's own elasticity takes
            volumetric += self._parts * (action.residual @ rates + action.response)
        logs = np.log(stretches)
        return StrainPath(
            logs - logs.mean(axis=1, keepdims=True),
            log_rates - log_rates.mean(axis=1, keepdims=True),
            self._volumes.ravel() / share,
            float(volumetric),
        )

    def _strains(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return F (3, 3, q, c), J (q, c), and the squared principal stretches (q, c, 3) of the distortion."""
        F = self._solid.results.kinematics[0]
        matrices = np.moveaxis(F, (0, 1), (-2, -1))
        J = np.linalg.det(matrices)
        return F, J, (np.linalg.svd(matrices, compute_uv=False) / J[..., None] ** (1 / 3)) ** 2

    def _attempt(self, goal: float) -> str:
        """Add the equilibrium at a travel to the path, from the last one or from where the last two point."""
        state, problem = self._state(), ""
        for guess in (self._predicted(goal), self._extrapolated(goal)):
            displacement, problem = self._equilibrium(guess, goal)
            if displacement is not None:
                self._path = [self._path[-1], (goal, displacement)]
                return ""
            self._restore(state)
        return problem

    def _predicted(self, goal: float) -> FloatArray:
        """Return the last displacements, or where the load would carry them if all points in touch stayed so."""
        travel, u = self._path[-1]
        if self._load is None:
            return u
        self._residual(u, travel)
        return np.asarray(u + (goal - travel) * self._rates(self._load.at(u, travel)).reshape(u.shape))

    def _rates(self, action: Action | None) -> FloatArray:
        """Return the displacements (d n,) by a unit of travel around the state that was computed last."""
        from scipy.sparse.linalg import spsolve

        rates, tangent = self._rate.ravel().copy(), self._tangent(action)
        right = -tangent[:, self._held] @ rates[self._held] - (action.residual_rate[self._free] if action else 0.0)
        rates[self._free] = spsolve(tangent[:, self._free].tocsc(), right)
        return rates

    def _extrapolated(self, goal: float) -> FloatArray:
        """Return displacements on the straight line through the last two equilibria."""
        travel, u = self._path[-1]
        travel_0, u_0 = self._path[0]
        return u if travel == travel_0 else np.asarray(u + (u - u_0) * (goal - travel) / (travel - travel_0))

    def _equilibrium(self, guess: FloatArray, travel: float) -> tuple[FloatArray | None, str]:
        """Return displacements in equilibrium, or the reason why Newton's method found none."""
        from scipy.sparse.linalg import spsolve

        u, residual, prescribed = guess, self._residual(guess, travel), self._rate * travel
        moved = self._rate != 0
        fractions: Sequence[float] = STEP_FRACTIONS
        if not np.allclose(u[moved], prescribed[moved]):
            fractions = STEP_FRACTIONS[:1]  # the first iteration imposes all of the prescribed displacement
        for _ in range(MAX_ITERATIONS):
            if not np.isfinite(residual).all():
                return None, "cells turned inside out"
            tangent = self._tangent(self._load.at(u, travel) if self._load else None)
            change = np.zeros(u.size)
            change[self._held] = (prescribed - u).ravel()[self._held]
            right = -residual[self._free] - tangent[:, self._held] @ change[self._held]
            change[self._free] = spsolve(tangent[:, self._free].tocsc(), right)
            self.iterations += 1
            previous = residual
            u, residual = self._step(u, travel, residual, change.reshape(u.shape), fractions)
            fractions = STEP_FRACTIONS
            if self._is_balanced(residual, previous):
                return u, ""
        return None, f"Newton's method did not converge in {MAX_ITERATIONS} iterations"

    def _is_balanced(self, residual: FloatArray, previous: FloatArray) -> bool:
        """Whether a residual is small, or nearly so and, by rounding, no smaller than the one before."""
        forces = residual[self._free], residual[self._held], previous[self._free]
        free, held, previous_free = (float(np.linalg.norm(values)) for values in forces)
        return free < TOLERANCE * held or previous_free / 2 < free < ROUNDING_TOLERANCE * held

    def _step(
        self, u: FloatArray, travel: float, residual: FloatArray, change: FloatArray, fractions: Sequence[float]
    ) -> tuple[FloatArray, FloatArray]:
        """Return displacements and residual after the largest fraction of a change that is within the limit."""
        state, limit = self._state(), MAX_RESIDUAL_GROWTH * np.linalg.norm(residual[self._free])
        for share in fractions:
            self._restore(state)
            tried = u + share * change
            tried_residual = self._residual(tried, travel)
            if np.linalg.norm(tried_residual[self._free]) < limit:
                break
        return tried, tried_residual

    def _tangent(self, action: Action | None) -> Any:
        """Return the rows of the stiffness matrix of what is free."""
        stiffness = self._solid.assemble.matrix().tocsr()
        return (stiffness if action is None else stiffness + action.stiffness())[self._free]

    def _residual(self, u: FloatArray, travel: float) -> FloatArray:
        """Return the forces of displacements (n, d) at a travel, (d n,), in initial shear moduli times mm^2."""
        self._field[0].values[:] = u
        try:
            internal = self._solid.assemble.vector(self._field).toarray()
        except np.linalg.LinAlgError:
            return np.full(u.size, np.nan)
        return np.asarray(internal[:, 0] + (self._load.at(u, travel).residual if self._load else 0.0))

    def _state(self) -> State:
        """Return displacements, pressures and volumes, which Newton's method changes together."""
        state = self._solid.results.state
        return state.u.copy(), state.p.copy(), state.J.copy()

    def _restore(self, saved: State) -> None:
        """Go back to an earlier state: a step that failed leaves nothing behind that is not a number."""
        state = self._solid.results.state
        self._field[0].values[:] = saved[0]
        state.u[:], state.p[:], state.J[:] = saved
        state.F = self._field.extract()


def _stiffness(material: Material, modulus: float) -> float:
    """Return an initial shear modulus that stresses can be divided by, and a bulk modulus follows from."""
    if not modulus > 0:
        raise ModelError(
            f"material '{material.name}' has an initial shear modulus of {modulus:.3g} MPa; finite elements need a "
            "positive one."
        )
    return modulus
