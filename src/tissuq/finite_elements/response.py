"""One material in one case: forces, displacements and strains, in load steps that become smaller where they must."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tissuq.finite_elements.case import AXIAL, Case
from tissuq.finite_elements.material import FElupeMaterial
from tissuq.finite_elements.optional import felupe
from tissuq.inference.threads import one_thread
from tissuq.mechanics import Material

__all__ = ["BULK_RATIO", "CellFields", "Response", "respond"]

FloatArray = NDArray[np.float64]

BULK_RATIO = 2000.0
"""Bulk modulus in initial shear moduli: the volume changes by a thousandth where the pressure is two shear moduli."""
HALVINGS = 6
"""How often a load step is halved before a material is given up."""
TOLERANCE = 1e-8
"""Of the residual, relative to the reaction forces."""
ITERATIONS = 12


@dataclass(frozen=True)
class CellFields:
    """Means over cells at the last step that was reached.

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


@dataclass(frozen=True)
class Response:
    """What a case gives with one material.

    Attributes
    ----------
    travel : (s,) array, mm
        Depths or elongations that were asked for.
    force : (s,) array, N
        Not a number where the solver did not get that far.
    reached : float
        The largest travel that was reached, mm.
    problem : str
        Why not all of it was; empty where it was.
    beyond : (s,) array
        The share of the volume that is strained beyond the given invariants.
    fields : CellFields
    iterations : int
        Newton iterations, all load steps together.
    """

    travel: FloatArray
    force: FloatArray
    reached: float
    problem: str
    beyond: FloatArray
    fields: CellFields
    iterations: int


def respond(
    case: Case,
    material: Material,
    values: ArrayLike | None = None,
    *,
    travel: ArrayLike | None = None,
    steps: int = 8,
    bulk_ratio: float = BULK_RATIO,
    most: tuple[float, float] = (np.inf, np.inf),
    at_step: Callable[[float, CellFields], None] | None = None,
) -> Response:
    """Return what a case gives with one material.

    Bilinear quadrilaterals with one pressure and one volume each (mean dilatation), which do not lock. A load step for
    which Newton's method fails is halved, up to six times.

    Parameters
    ----------
    case : Case
    material : Material
        A draw of an ensemble, or an isotropic material with values.
    values : (k,) array, optional
        The parameters of a material that is no draw.
    travel : (s,) array, mm, optional
        Increasing depths or elongations; otherwise equal steps of the case's own travel.
    steps : int
        How many, where they are not given.
    bulk_ratio : float
        Bulk modulus in initial shear moduli.
    most : (float, float)
        I1 - 3 and I2 - 3 beyond which volume is counted as strained too far.
    at_step : callable, optional
        Told of the travel and the fields of every step.

    Raises
    ------
    InputError, ModelError
        When FElupe is not installed, or the material is none for finite elements.

    References
    ----------
    Simo, Taylor & Pister (1985), Variational and projection methods for the volume constraint.
    """
    asked = case.steps(steps) if travel is None else np.asarray(travel, dtype=np.float64)
    with one_thread():
        return _Solver(case, material, values, bulk_ratio, most).follow(asked, at_step)


class _Solver:
    """The mesh, its supports and the state of a case; forces in units of the material's initial shear modulus."""

    def __init__(
        self, case: Case, material: Material, values: ArrayLike | None, bulk_ratio: float, most: tuple[float, float]
    ) -> None:
        fem = felupe()
        self.mesh, self.most = case.mesh(), most
        self.supports = case.supports(self.mesh.points)
        umat = FElupeMaterial(material, values=values)
        self.modulus = umat.energy.initial_shear_modulus
        umat.unit = self.modulus
        region = fem.RegionQuad(fem.Mesh(*self.mesh, "quad"))
        self.field = fem.FieldContainer([fem.FieldAxisymmetric(region, dim=2)])
        self.solid = fem.SolidBodyNearlyIncompressible(umat, self.field, bulk=bulk_ratio)
        self.volumes = 2 * np.pi * self.field[0].radius * region.dV
        held = self.supports.fixed.copy()
        held[:, AXIAL] |= self.supports.moved
        self.held, self.free = np.flatnonzero(held.ravel()), np.flatnonzero(~held.ravel())
        self.rigid = np.zeros_like(self.mesh.points)
        self.rigid[self.supports.moved, AXIAL] = self.supports.direction
        self.iterations = 0

    def follow(self, asked: FloatArray, at_step: Callable[[float, CellFields], None] | None) -> Response:
        """Return the response at increasing travels."""
        force, beyond = np.full(len(asked), np.nan), np.full(len(asked), np.nan)
        reached, problem, path = 0.0, "", [(0.0, np.zeros_like(self.mesh.points))]
        fields = self._fields(path[-1][1])
        for place, target in enumerate(asked):
            problem = self._advance(path, float(target))
            reached = path[-1][0]
            if problem:
                break
            force[place], fields = self._force(path[-1][1]), self._fields(path[-1][1])
            is_beyond = (fields.first > self.most[0]) | (fields.second > self.most[1])
            beyond[place] = float(self.volumes.sum(axis=0)[is_beyond].sum() / self.volumes.sum())
            if at_step is not None:
                at_step(reached, fields)
        return Response(asked, force, reached, problem, beyond, fields, self.iterations)

    def _advance(self, path: list[tuple[float, FloatArray]], target: float) -> str:
        """Add the equilibrium at a travel to a path, in as many load steps as it needs, or say why not."""
        whole = step = target - path[-1][0]
        while path[-1][0] < target:
            goal = min(path[-1][0] + step, target) if step < whole else target
            found, problem = self._equilibrium(self._guess(path, goal), goal)
            if found is not None:
                path.append((goal, found))
                del path[:-2]
            elif step > whole / 2**HALVINGS:
                step /= 2
            else:
                return f"{problem} with load steps of {step:.3g} mm"
        return ""

    def _guess(self, path: list[tuple[float, FloatArray]], goal: float) -> FloatArray:
        """Return displacements on the straight line through the last two equilibria."""
        (now, last), (before, earlier) = path[-1], path[-2] if len(path) > 1 else path[-1]
        if now == before:
            return last
        return np.asarray(last + (last - earlier) * (goal - now) / (now - before))

    def _equilibrium(self, guess: FloatArray, travel: float) -> tuple[FloatArray | None, str]:
        """Return displacements in equilibrium, or why there are none."""
        from scipy.sparse.linalg import spsolve

        u, first = guess, True
        given = self.rigid * travel
        for _ in range(ITERATIONS):
            change = np.zeros(u.size)
            change[self.held] = (given - u).ravel()[self.held]
            residual = self._residual(u)
            if not np.isfinite(residual).all():
                return None, "the mesh turned inside out"
            if not first and np.abs(residual[self.free]).sum() < TOLERANCE * np.abs(residual[self.held]).sum():
                return u, ""
            tangent = self.solid.assemble.matrix().tocsc()
            right = -residual[self.free] - tangent[self.free][:, self.held] @ change[self.held]
            change[self.free] = spsolve(tangent[self.free][:, self.free], right)
            if not np.isfinite(change).all():
                return None, "the tangent became singular"
            u, first = u + change.reshape(u.shape), False
            self.iterations += 1
        return None, f"Newton's method did not converge in {ITERATIONS} iterations"

    def _residual(self, u: FloatArray) -> FloatArray:
        """Return the internal forces of displacements (n, 2), (2 n,), in initial shear moduli times mm^2."""
        self.field[0].values[:] = u
        try:
            found = self.solid.assemble.vector(self.field).toarray()
        except np.linalg.LinAlgError:
            return np.full(u.size, np.nan)
        return np.asarray(found[:, 0])

    def _force(self, u: FloatArray) -> float:
        """Return the force (N) that moves the moved points on."""
        internal = self._residual(u).reshape(u.shape)[self.supports.moved, AXIAL]
        return float(internal.sum() * np.sign(self.supports.direction) * self.modulus)

    def _fields(self, u: FloatArray) -> CellFields:
        """Return means over the cells' quadrature points, weighted by their volume."""
        internal = self._residual(u)
        assert np.isfinite(internal).all()  # noqa: S101 (only equilibria have fields)
        F = self.solid.results.kinematics[0]
        J = np.linalg.det(np.moveaxis(F, (0, 1), (-2, -1)))
        stretches = np.linalg.svd(np.moveaxis(F, (0, 1), (-2, -1)), compute_uv=False)
        squares = (stretches / J[..., None] ** (1 / 3)) ** 2
        cauchy = np.einsum("ijqc,kjqc->ikqc", self.solid.results.stress[0], F) / J * self.modulus
        deviator = cauchy - np.einsum("iiqc->qc", cauchy) / 3 * np.eye(3)[:, :, None, None]
        found = (
            squares.sum(axis=-1) - 3,
            (1 / squares).sum(axis=-1) - 3,
            stretches.max(axis=-1),
            np.sqrt(1.5 * (deviator**2).sum(axis=(0, 1))),
        )
        weights = self.volumes / self.volumes.sum(axis=0)
        return CellFields(u.copy(), *((each * weights).sum(axis=0) for each in found))
