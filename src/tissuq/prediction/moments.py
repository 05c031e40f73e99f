"""Mean and variance of the stress at any stretch, for every component of a posterior."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tissuq.discrepancy import side_by_side
from tissuq.errors import ModelError
from tissuq.experiments.modes import Path
from tissuq.inference.lowrank import Spectrum, correlation_spectrum, scaled_spectrum
from tissuq.inference.solution import Components, Solution
from tissuq.model import StatisticalModel

__all__ = [
    "CorrelatedPart",
    "basis_of",
    "borne",
    "coefficients",
    "conditioned",
    "conditioned_jointly",
    "correlated_parts",
    "drawn_curves",
    "level_of_errors",
    "mean_curve",
    "mean_stress",
    "stress_moments",
    "values_of",
]

FloatArray = NDArray[np.float64]

NEXT_TO_NOTHING = 1e-6
"""Probability that the material locks before a stretch, below which a stress there is predicted."""
BLOCK = 1_000_000
"""Values of the stress at once: what bounds the memory."""


@dataclass(frozen=True, eq=False)
class CorrelatedPart:
    """The components that share one structure, and what it takes to solve with their covariance of the data.

    The covariance of the data is diag(scale) (white I + U diag(kernel) U') diag(scale); arrays of N have one row for
    each chosen component.
    """

    chosen: NDArray[np.intp]
    correlation: Spectrum
    shape: dict[str, float]
    design: FloatArray
    scale: FloatArray
    amplitude: FloatArray
    white: FloatArray

    @property
    def kernel(self) -> FloatArray:
        """Variances (N, r) of the correlated discrepancy along the eigenvectors."""
        return self.amplitude[:, None] * self.correlation.values

    def solved(self, columns: FloatArray) -> FloatArray:
        """Return the inverse of the covariance times columns (N, n, q)."""
        vectors, scale = self.correlation.vectors, self.scale[:, None]
        own, white = columns / scale, self.white[:, None, None]
        inside = vectors.T @ own
        return np.asarray(
            (vectors @ (inside / (self.kernel[..., None] + white) - inside / white) + own / white) / scale
        )

    @property
    def precision(self) -> FloatArray:
        """The diagonal (N, n) of the inverse of the covariance."""
        squares, white = self.correlation.vectors**2, self.white[:, None]
        rest = np.maximum(1 - squares.sum(axis=1), 0.0)
        return np.asarray(((1 / (self.kernel + white)) @ squares.T + rest / white) / self.scale**2)

    @property
    def log_determinant(self) -> FloatArray:
        """Log determinants (N,) of the covariance."""
        n, r = self.correlation.vectors.shape
        inside = np.log(self.kernel + self.white[:, None]).sum(axis=1)
        return np.asarray(inside + (n - r) * np.log(self.white) + 2 * np.log(self.scale).sum())


def values_of(model: StatisticalModel, components: Components, symbols: Sequence[str]) -> tuple[FloatArray, FloatArray]:
    """Return means (M, k) and roots (M, k, p) of parameters in every component of a posterior."""
    mean = np.empty((len(components.weights), len(symbols)))
    root = np.zeros((*mean.shape, components.root.shape[2]))
    for column, symbol in enumerate(symbols):
        if symbol in model.linear:
            mean[:, column] = components.mean[:, model.linear.index(symbol)]
            root[:, column] = components.root[:, model.linear.index(symbol)]
        else:
            mean[:, column] = components.settings[:, model.nonlinear.index(symbol)]
    return mean, root


def coefficients(model: StatisticalModel, components: Components) -> tuple[FloatArray, FloatArray]:
    """Return means (M, k) and roots (M, k, p) of the parameters in which the mean stress is linear."""
    return values_of(model, components, model.column_symbols)


def basis_of(
    model: StatisticalModel, stretch: FloatArray, settings: FloatArray, mode: Path | None = None
) -> FloatArray:
    """Return the mean stresses of unit coefficients: (g, k), or (M, g, k) where they depend on settings (M, d)."""
    if not model.bent_symbols:
        return model.basis(stretch, mode=mode)
    return model.basis(stretch, settings[:, [model.nonlinear.index(symbol) for symbol in model.bent_symbols]], mode)


def borne(model: StatisticalModel, at: FloatArray, basis: FloatArray, weights: FloatArray) -> FloatArray:
    """Return a basis without the components, of next to no weight, in which the material has locked.

    Raises
    ------
    ModelError
        When they have weight, so that there is no stress to predict.
    """
    is_borne = np.asarray(np.isfinite(basis).all(axis=-1))
    if is_borne.all():
        return basis
    locked = 1 - weights @ np.broadcast_to(is_borne, (len(weights), len(at)))
    if locked.max() > NEXT_TO_NOTHING:
        beyond = at[locked > NEXT_TO_NOTHING]
        bent = ", ".join(model.bent_symbols)
        why = f"its {bent} may be such that it locks before" if bent else "it is too large for a number"
        raise ModelError(
            f"material '{model.material.name}' has no stress at a stretch of {beyond[np.abs(beyond - 1).argmin()]:g}: "
            f"{why} (up to a probability of {locked.max():.2g}). Predict at stretches nearer to those of the data."
        )
    return np.where(is_borne[..., None], basis, 0.0)


def mean_stress(model: StatisticalModel, coefficients: FloatArray, settings: FloatArray) -> FloatArray:
    """Return the mean stress (M, n) at the measurements, whitened, for coefficients (M, k) and settings (M, d)."""
    if not model.bent_symbols:
        return np.asarray(coefficients @ model.design.T)
    stretch = model.experiment.stretch
    blocks = np.array_split(np.arange(len(settings)), max(1, settings.shape[0] * len(stretch) // BLOCK))
    curves = [basis_of(model, stretch, settings[block]) @ coefficients[block][:, :, None] for block in blocks]
    return np.asarray(model.white(np.concatenate(curves)[:, :, 0].T).T)


def correlated_parts(model: StatisticalModel, settings: FloatArray) -> Iterator[CorrelatedPart]:
    """Group settings (M, d) of the nonlinear parameters by the structure they imply."""
    values = dict(zip(model.nonlinear, settings.T, strict=True))
    amplitude = np.broadcast_to(model.correlated_variance(values), len(settings))
    shared = model.nonlinear if model.noise.depends_on_level else model.structure
    keys = np.column_stack([np.zeros(len(settings)), *(values[symbol] for symbol in shared)])
    distinct, group = np.unique(keys, axis=0, return_inverse=True)
    one = np.ones(len(model.experiment))
    for index, row in enumerate(distinct):
        own = dict(zip(shared, map(float, row[1:]), strict=True))
        chosen = np.flatnonzero(group.ravel() == index)
        shape = {symbol: own[symbol] for symbol in model.discrepancy.shape_symbols}
        bent = np.array([own[symbol] for symbol in model.bent_symbols])
        design = model.design_at(bent) if len(bent) else model.design
        if model.noise.depends_on_level:
            scale = np.sqrt(model.white_variance(own, model.levels))
            spectrum, white = scaled_spectrum(model, shape, scale), np.ones(len(chosen))
        else:
            scale, spectrum = one, correlation_spectrum(model, tuple(shape.values()))
            own_values = {symbol: column[chosen] for symbol, column in values.items()}
            white = np.broadcast_to(model.white_variance(own_values), len(chosen)).astype(float)
        yield CorrelatedPart(chosen, spectrum, shape, design, scale, amplitude[chosen], white)


def stress_moments(
    model: StatisticalModel,
    components: Components,
    stretch: FloatArray,
    *,
    discrepancy: bool,
    noise: bool,
    mode: Path | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return mean (M, g) and variance (M, g) of the stress at stretches (g,), for every component.

    Without the discrepancy it is the model alone (eq. 28); with it, a correlated discrepancy is conditioned on
    the data (eq. 27; differs from the source, whose GP is drawn from its prior). In another loading mode than that
    of the data only a discrepancy that is an energy has a meaning.
    """
    values = {symbol: column[:, None] for symbol, column in zip(model.nonlinear, components.settings.T, strict=True)}
    mean_b, root_b = coefficients(model, components)
    at = (mode or model.experiment.mode).abscissa(stretch)
    basis = borne(model, at, basis_of(model, stretch, components.settings, mode), components.weights)
    if not discrepancy:
        basis = basis * np.isin(model.column_symbols, model.material_symbols)
    mean = (basis @ mean_b[:, :, None])[:, :, 0]
    root = basis @ root_b
    extra = np.zeros_like(mean)
    if discrepancy and model.is_correlated:
        for part in correlated_parts(model, components.settings):
            shift, pull, variance = conditioned(model, part, stretch, mean_b[part.chosen])
            mean[part.chosen] += shift
            root[part.chosen] -= np.einsum("mgk,mkp->mgp", pull, root_b[part.chosen])
            extra[part.chosen] += variance
    if discrepancy and components.member is not None:
        for shift, spread, variance, own in _energies(model, components, stretch, mode):
            mean[own] += shift
            root[own] += spread
            extra[own] += variance
    level = np.abs(mean)
    if discrepancy and not model.is_repeated:
        extra += model.discrepancy.independent_variance(values)
    if noise:
        extra += model.noise_variance(values, level) * model.relative_noise(stretch) ** 2
    return mean, extra + (root**2).sum(axis=2)


def mean_curve(solution: Solution, thinned: int | None = None) -> FloatArray:
    """Return the posterior mean of the stress (n,) at the measurements, without noise and errors of whole tests.

    With a number, from so many components that stand for all.
    """
    model = solution.model
    components = solution.components if thinned is None else solution.components.thinned(thinned)
    mean, _ = stress_moments(model, components, model.experiment.stretch, discrepancy=True, noise=False)
    return np.asarray(components.weights @ mean)


def level_of_errors(solution: Solution) -> float:
    """Return the root of the posterior mean variance of all independent errors, whitened, MPa."""
    model, components = solution.model, solution.components
    values = dict(zip(model.nonlinear, components.settings.T, strict=True))
    variance = np.broadcast_to(model.white_variance(values), len(components.weights))
    return float(np.sqrt(components.weights @ variance))


def drawn_curves(
    model: StatisticalModel,
    components: Components,
    stretch: FloatArray,
    seed: int = 0,
    mode: Path | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return stresses (M, g) of the material alone and of the discrepancy, one joint draw for every component.

    Scatter that is independent from point to point is no curve, and left out. Where a loading mode is given, so is a
    discrepancy that is no energy.
    """
    generator, settings = np.random.default_rng([seed, 11]), components.settings
    score = generator.standard_normal(components.mean.shape)
    linear = components.mean + np.einsum("mpq,mq->mp", components.root, score)
    drawn, _ = coefficients(model, replace(components, mean=linear))
    terms = basis_of(model, stretch, settings, mode) * drawn[:, None, :]
    own = np.isin(model.column_symbols, model.material_symbols)
    alone, other = terms[..., own].sum(axis=2), terms[..., ~own].sum(axis=2)
    if mode is not None and not model.discrepancy.is_energy:
        return alone, np.zeros_like(alone)
    if components.member is not None:
        for shift, _, _, chosen in _energies(model, replace(components, mean=linear), stretch, mode):
            other[chosen] += shift
    if model.is_correlated:
        for part in correlated_parts(model, settings):
            shift, covariance = conditioned_jointly(model, part, stretch, drawn[part.chosen])
            values, vectors = np.linalg.eigh(covariance)
            score = generator.standard_normal(shift.shape)
            other[part.chosen] += shift + np.einsum(
                "ngk,nk->ng", vectors * np.sqrt(np.maximum(values, 0))[:, None], score
            )
    return alone, other


def conditioned_jointly(
    model: StatisticalModel, part: CorrelatedPart, stretch: FloatArray, b: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return means (N, g) and covariances (N, g, g) of the correlated discrepancy given the data and coefficients b."""
    shift, _, _ = conditioned(model, part, stretch, b)
    inside = _with_data(model, part, stretch) @ part.correlation.vectors
    gain = part.amplitude[:, None] / (part.white[:, None] + part.kernel)
    explained = np.einsum("gr,nr,hr->ngh", inside, gain, inside)
    return shift, part.amplitude[:, None, None] * (model.correlation(stretch, stretch, part.shape) - explained)


def _energies(
    model: StatisticalModel, components: Components, stretch: FloatArray, mode: Path | None = None
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray, NDArray[np.intp]]]:
    """Yield means (N, g), roots (N, g, p) and further variances (N, g) of energy discrepancies, and whose they are.

    What the terms that serve the data leave of the discrepancy elsewhere is independent of the data.
    """
    mode, start = mode or model.experiment.mode, len(model.linear)
    assert components.member is not None  # noqa: S101 (the caller has looked)
    for place in np.unique(components.member):
        member, own = model.energy_members[place], np.flatnonzero(components.member == place)
        features = member.stress_features(mode, stretch)
        left = [
            np.maximum(whole - (each**2).sum(axis=1), 0.0)
            for whole, each in zip(member.stress_variances(mode, stretch), features, strict=True)
        ]
        symbols = [model.nonlinear.index(model.energy_symbols[k]) for k in member.places]
        every = side_by_side(features, len(stretch))
        chosen = slice(start, start + every.shape[1])
        variance = components.settings[own][:, symbols] ** 2 @ np.reshape(left, (-1, len(stretch)))
        yield components.mean[own, chosen] @ every.T, every @ components.root[own, chosen], variance, own


def _with_data(model: StatisticalModel, part: CorrelatedPart, stretch: FloatArray) -> FloatArray:
    """Return the correlation (g, n) of the discrepancy at stretches with that at the measurements, whitened."""
    cross = model.white(model.correlation(model.experiment.stretch, stretch, part.shape)).T
    return np.asarray(cross / part.scale)


def conditioned(
    model: StatisticalModel, part: CorrelatedPart, stretch: FloatArray, mean_b: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Condition the correlated discrepancy at new stretches on the data, given coefficients b (N, k).

    Returns its mean (N, g), the sensitivity (N, g, k) of minus that mean to b, and its variance (N, g) given b.
    """
    vectors = part.correlation.vectors
    inside = _with_data(model, part, stretch) @ vectors
    gain = part.amplitude[:, None] / (part.white[:, None] + part.kernel)
    columns = np.column_stack([part.design, model.stress]) / part.scale[:, None]
    smoothed = np.einsum("gr,nr,rk->ngk", inside, gain, vectors.T @ columns)
    pull, of_data = smoothed[:, :, :-1], smoothed[:, :, -1]
    explained = gain @ (inside**2).T
    before = model.relative_variance(stretch, part.shape)
    variance = np.maximum(part.amplitude[:, None] * (before - explained), 0.0)
    return of_data - np.einsum("ngk,nk->ng", pull, mean_b), pull, variance
