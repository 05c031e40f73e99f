"""The data in the directions in which their errors are independent: what a likelihood is computed from."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import islice
from typing import Any

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.experiments.modes import States
from tissuq.inference.threads import one_thread
from tissuq.mechanics.material import Material
from tissuq.mechanics.stress import MAX_COMPLEX_STEP_VALUES
from tissuq.model.discrepancy import Discrepancy
from tissuq.model.statistical_model import StatisticalModel
from tissuq.model.statistics import CHUNK, upper_triangle

TRUNCATED_VARIANCE_SHARE = 1e-14
"""Share of the process's variance at all points that the factor of many may leave out."""
MIN_RELATIVE_EIGENVALUE = 1e-17
"""Eigenvalue, relative to that, below which the decomposition of few points gives only rounding errors."""
FEW_POINTS = 128
"""Measurements up to which a correlation is decomposed directly."""
MAX_REMEMBERED_VALUES = 16_000_000
"""Stresses of unit parameters that are remembered: 128 MB."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Leading eigenvectors (n, r), orthonormal, and eigenvalues (r,) of a correlation matrix."""

    vectors: FloatArray
    values: FloatArray


def correlation_spectrum(model: StatisticalModel, shape: tuple[float, ...]) -> Spectrum:
    """Return the spectrum of a model's correlation at its measurements, at a cost of n r^2 for numerical rank r.

    Few points are decomposed directly, and remembered, because many data sets share their stretches. For many,
    pivoted Cholesky finds a root of the matrix without forming it, and its singular values give the rest. Smooth
    kernels have a small numerical rank: about ten for a squared exponential as wide as half the data's range.

    Parameters
    ----------
    model : StatisticalModel
    shape : tuple of float
        Values of the parameters on which the correlation depends.
    """
    states = model.experiment.states
    if model.is_repeated:
        return _of_repeats(states.abscissa)
    if model.whitening is None and len(states) <= FEW_POINTS:
        return _remembered(model.discrepancy, states, shape)
    return _decompose(model.discrepancy, states, shape, model.white)


def scaled_spectrum(model: StatisticalModel, shape: Mapping[str, float], scale: FloatArray) -> Spectrum:
    """Return the spectrum of a model's correlation at its measurements, rows and columns divided by a scale (n,)."""
    states = model.experiment.states
    correlation = model.white(model.white(model.correlation(states, states, shape)).T)
    correlation = correlation / np.multiply.outer(scale, scale)
    values, vectors = np.linalg.eigh(correlation)
    is_positive = values > MIN_RELATIVE_EIGENVALUE * np.trace(correlation)
    return Spectrum(vectors[:, is_positive], values[is_positive])


def _of_repeats(stretch: FloatArray) -> Spectrum:
    """Return the spectrum of the correlation that is one at equal stretches (n,) and zero elsewhere."""
    _, group, count = np.unique(stretch, return_inverse=True, return_counts=True)
    vectors = np.zeros((len(stretch), len(count)))
    vectors[np.arange(len(stretch)), group] = 1 / np.sqrt(count[group])
    return Spectrum(vectors, count.astype(np.float64))


@lru_cache(maxsize=512)
def _remembered(discrepancy: Discrepancy, states: States, shape: tuple[float, ...]) -> Spectrum:
    return _decompose(discrepancy, states, shape)


def _decompose(
    discrepancy: Discrepancy,
    states: States,
    shape: tuple[float, ...],
    white: Callable[[FloatArray], FloatArray] = lambda columns: columns,
) -> Spectrum:
    values = dict(zip(discrepancy.shape_symbols, shape, strict=True))
    if len(states) <= FEW_POINTS:
        with one_thread():
            spectrum, vectors = np.linalg.eigh(white(white(discrepancy.correlation(states, states, values)).T))
        is_positive = spectrum > MIN_RELATIVE_EIGENVALUE * spectrum.sum()
        return Spectrum(vectors[:, is_positive], spectrum[is_positive])
    variance = np.asarray(discrepancy.relative_variance(states, values))
    root = _pivoted_root(lambda a, b: discrepancy.correlation(a, b, values), states, variance)
    vectors, singular, _ = np.linalg.svd(white(root), full_matrices=False)
    return Spectrum(vectors, singular**2)


def _pivoted_root(
    correlation: Callable[[States, States], FloatArray], states: States, remaining: FloatArray
) -> FloatArray:
    n = len(states)
    root = np.zeros((n, n if n <= 64 else 64))
    for rank in range(n):
        pivot = int(remaining.argmax())
        if remaining.sum() <= TRUNCATED_VARIANCE_SHARE * n or remaining[pivot] <= 0:
            return root[:, :rank]
        if rank == root.shape[1]:
            root = np.hstack([root, np.zeros((n, min(rank, n - rank)))])
        column = correlation(states, states.among([pivot]))[:, 0] - root[:, :rank] @ root[pivot, :rank]
        root[:, rank] = column / np.sqrt(remaining[pivot])
        remaining = np.maximum(remaining - root[:, rank] ** 2, 0.0)
        remaining[pivot] = 0.0
    return root


@dataclass(frozen=True, eq=False)
class Reduction:
    """B data sets on the same stretches, for one setting of the structure.

    The data matrix of a data set is D = [Q, F, e]: the orthonormal basis of its p linear columns, the columns of
    parameters that are linear but have no Gaussian prior, and the residual of least squares. Along r directions
    its errors are independent, with variances that are simple functions of the nonlinear parameters.

    Attributes
    ----------
    inverse : (p, p) array
        Inverse of the triangle that turns Q into the linear columns.
    log_size : float, or (K,) array of several
        Log of the absolute determinant of that triangle.
    centre : (B, p) array
        The least-squares solutions.
    squares : (B, r, q^2) array
        Sums of squares and products of D's columns along each direction.
    counts : (r,) array
        How many dimensions share a direction's variance.
    values : (r,) array
        Eigenvalues of the correlation of the discrepancy; zero where it has none.
    levels : (r,) array
        Levels of the stress, for noise that depends on them.
    """

    inverse: FloatArray
    log_size: Any
    centre: FloatArray
    squares: FloatArray
    counts: FloatArray
    values: FloatArray
    levels: FloatArray

    @classmethod
    def stacked(cls, reductions: Sequence[Reduction]) -> Reduction:
        """Return K reductions of the same data as one: all arrays begin with K, directions are padded with zeros."""
        rank = max(len(reduction.counts) for reduction in reductions)
        directions = np.zeros((3, len(reductions), rank))
        squares = np.zeros((len(reductions), len(reductions[0].squares), rank, reductions[0].squares.shape[2]))
        for index, reduction in enumerate(reductions):
            directions_of_one = slice(len(reduction.counts))
            directions[:, index, directions_of_one] = reduction.counts, reduction.values, reduction.levels
            squares[index, :, directions_of_one] = reduction.squares
        inverse, log_size, centre = (
            np.array([getattr(reduction, name) for reduction in reductions])
            for name in ("inverse", "log_size", "centre")
        )
        return cls(inverse, log_size, centre, squares, *directions)


BentSettings = Sequence[tuple[float, ...]]
"""Values of the parameters in which stresses are not linear."""
BasesOf = Callable[[StatisticalModel, BentSettings], FloatArray]
"""Returns the mean stresses (m, n, k) of unit parameters of a model at m settings of the others."""


def bases_of(model: StatisticalModel, settings: BentSettings) -> FloatArray:
    """Return the mean stresses (m, n, k) of unit parameters at m settings of those in which stresses are not linear."""
    return model.basis(model.states, np.array(settings))


class RememberedBases:
    """`bases_of` that is remembered from one model to others that differ by their errors.

    The stresses are the same then, and most of the work for laws with fibres. Those of the last material, discrepancy
    and states; what was not used for longest is forgotten first.
    """

    def __init__(self) -> None:
        self._of: tuple[Material, Discrepancy, States] | None = None
        self._bases: dict[tuple[float, ...], FloatArray] = {}

    def __call__(self, model: StatisticalModel, settings: BentSettings) -> FloatArray:
        """Return `bases_of` a model."""
        of = model.material, model.discrepancy, model.states
        if self._of != of:
            self._of, self._bases = of, {}
        distinct = [*dict.fromkeys(settings)]
        used = {setting: self._bases.pop(setting) for setting in distinct if setting in self._bases}
        if new := [setting for setting in distinct if setting not in used]:
            used |= zip(new, map(np.copy, bases_of(model, new)), strict=True)
        bases = np.array([used[setting] for setting in settings])
        self._bases |= used
        excess = len(self._bases) - MAX_REMEMBERED_VALUES // bases[0].size
        for setting in list(islice(self._bases, max(0, excess))):
            del self._bases[setting]
        return bases


class Reducer:
    """Reduces the data of models with the same parts and stretches, given the structure; remembers what it did."""

    def __init__(self, models: Sequence[StatisticalModel], bases: BasesOf = bases_of) -> None:
        self._models, self._bases = models, bases
        self._known: dict[tuple[float, ...], Reduction] = {}

    def __call__(self, settings: FloatArray) -> Reduction:
        """Return the reductions at K settings (K, s) of the structure."""
        if not settings.shape[1]:
            return self._only
        keys = [*map(tuple, settings.tolist())]
        new = [key for key in dict.fromkeys(keys) if key not in self._known]
        self._known |= zip(new, self._at(new), strict=True)
        return Reduction.stacked([self._known[key] for key in keys])

    @cached_property
    def _only(self) -> Reduction:
        return Reduction.stacked(self._at([()]))

    @cached_property
    def _fit(self) -> _Fit:
        (fit,) = _Fit.of(self._models, self._models[0].design[None])
        return fit

    def _at(self, settings: Sequence[tuple[float, ...]]) -> list[Reduction]:
        """Reduce at settings of the structure; at many at once where the data are few."""
        model = self._models[0]
        n, bent = model.experiment.size, len(model.bent_symbols)
        is_plain = not model.is_correlated and not model.noise.depends_on_level
        if bent:
            blocks_of_designs = _designs(model, settings, self._bases)
            if is_plain:
                return [of_one for block in blocks_of_designs for of_one in _of_independent_errors(self._models, block)]
            fits = (fit for block in blocks_of_designs for fit in _Fit.of(self._models, block))
            pairs = zip(fits, settings, strict=True)
            return [reduction for fit, setting in pairs for reduction in _reduced(model, fit, [setting[bent:]])]
        if is_plain and (len(self._models) == 1 or n > CHUNK):
            return [_from_statistics(self._models)]
        if is_plain:
            return _of_independent_errors(self._models, model.design[None])
        together = len(settings) if n <= FEW_POINTS else 1
        blocks = (settings[start : start + together] for start in range(0, len(settings), max(1, together)))
        return [reduction for block in blocks for reduction in _reduced(model, self._fit, block)]


def _designs(model: StatisticalModel, settings: BentSettings, bases_of: BasesOf) -> Iterator[FloatArray]:
    """Yield the designs (K, n, k) at the first values of settings, as many as their stresses are computed at once."""
    bent = [setting[: len(model.bent_symbols)] for setting in settings]
    together = max(1, MAX_COMPLEX_STEP_VALUES // (len(model.states) * len(model.column_symbols)))
    for start in range(0, len(bent), together):
        columns = bases_of(model, bent[start : start + together]).swapaxes(0, 1)
        rows = model.rows(columns.reshape(len(columns), -1))  # of all designs side by side
        yield np.ascontiguousarray(rows.reshape(-1, *columns.shape[1:]).swapaxes(0, 1))


@dataclass(frozen=True, eq=False)
class _Fit:
    """B data sets by least squares: the basis (n, q - 1) of the columns, and what is left of the stresses (B, n)."""

    inverse: FloatArray
    log_size: Any
    centre: FloatArray
    shared: FloatArray
    residual: FloatArray

    @classmethod
    def of(cls, models: Sequence[StatisticalModel], designs: FloatArray) -> _Fit:
        """Fit the columns of designs (K, n, k) that are integrated in closed form; all arrays begin with K."""
        free, fixed = divided_columns(models[0])
        basis, triangle = np.linalg.qr(designs[:, :, free])
        inverse = np.asarray(np.linalg.inv(triangle), dtype=np.float64)
        stresses = np.array([model.stress for model in models])
        centre = stresses @ basis @ inverse.swapaxes(1, 2)
        residual = stresses - centre @ designs[:, :, free].swapaxes(1, 2)
        log_size = np.log(np.abs(np.diagonal(triangle, 0, 1, 2))).sum(axis=1)
        return cls(inverse, log_size, centre, np.concatenate([basis, designs[:, :, fixed]], axis=2), residual)

    def __iter__(self) -> Iterator[_Fit]:
        """Iterate over the fits of several designs."""
        return (_Fit(*arrays) for arrays in zip(*vars(self).values(), strict=True))

    def reduction(
        self, squares: FloatArray, counts: FloatArray, values: FloatArray, levels: FloatArray | None = None
    ) -> Reduction:
        """Return the reduction with these sums of squares."""
        levels_of_directions = np.zeros(len(counts)) if levels is None else levels
        return Reduction(self.inverse, self.log_size, self.centre, squares, counts, values, levels_of_directions)


def _from_statistics(models: Sequence[StatisticalModel]) -> Reduction:
    """Reduce by the data's triangles alone, at a cost that does not depend on their number."""
    free, fixed = divided_columns(models[0])
    p = len(free)
    centres, squares = [], []
    for model in models:
        triangle = upper_triangle(model.statistics.triangle[:, [*free, *fixed, -1]])
        inverse = np.asarray(np.linalg.inv(triangle[:p, :p]), dtype=np.float64)
        data = triangle.copy()
        data[:p, :p] = np.eye(p)
        data[:p, -1] = 0.0
        centres.append(inverse @ triangle[:p, -1])
        squares.append((data.T @ data).reshape(1, -1))
    single = np.ones(1)
    return Reduction(
        inverse,
        float(np.log(np.abs(np.diag(triangle)[:p])).sum()),
        np.array(centres),
        np.array(squares),
        models[0].experiment.size * single,
        0 * single,
        0 * single,
    )


def _of_independent_errors(models: Sequence[StatisticalModel], designs: FloatArray) -> list[Reduction]:
    """Reduce at designs (K, n, k), all at once, where all errors have one variance."""
    fits = _Fit.of(models, designs)
    wide = np.broadcast_to(fits.shared[:, None], (len(designs), len(models), *fits.shared.shape[1:]))
    columns = np.concatenate([wide, fits.residual[..., None]], axis=3)
    squares = (columns.swapaxes(2, 3) @ columns).reshape(*fits.residual.shape[:2], 1, -1)
    counts, zero = np.array([float(models[0].experiment.size)]), np.zeros(1)
    of_designs = zip(fits.inverse, fits.log_size, fits.centre, squares, strict=True)
    return [Reduction(*of_design, counts, zero, zero) for of_design in of_designs]


def _reduced(model: StatisticalModel, fit: _Fit, shapes: Sequence[tuple[float, ...]]) -> list[Reduction]:
    """Reduce by all measurements, in the directions in which their errors are independent, for some correlations."""
    n = model.experiment.size
    if model.is_correlated:
        return _along_spectra(fit, [correlation_spectrum(model, shape) for shape in shapes])
    levels, level_index, count = np.unique(model.levels, return_inverse=True, return_counts=True)
    by_level = np.zeros((len(levels), len(fit.residual), (fit.shared.shape[1] + 1) ** 2))
    for start in range(0, n, CHUNK):
        block = slice(start, start + CHUNK)
        np.add.at(by_level, level_index[block], _products(fit.shared[block], fit.residual[:, block]).swapaxes(0, 1))
    return [fit.reduction(by_level.swapaxes(0, 1), count.astype(np.float64), np.zeros(len(levels)), levels)]


def _along_spectra(fit: _Fit, spectra: Sequence[Spectrum]) -> list[Reduction]:
    """Reduce along the eigenvectors of K correlations; all that is outside them shares one variance."""
    n, ranks = len(fit.shared), [len(spectrum.values) for spectrum in spectra]
    vectors = np.zeros((len(spectra), n, max(ranks)))
    for index, spectrum in enumerate(spectra):
        vectors[index, :, : ranks[index]] = spectrum.vectors
    shared, residual = vectors.swapaxes(1, 2) @ fit.shared, fit.residual @ vectors
    inside = _products(shared, residual)
    outside = _products(fit.shared - vectors @ shared, fit.residual - residual @ vectors.swapaxes(1, 2)).sum(axis=2)
    return [
        fit.reduction(
            np.concatenate([inside[index, :, :rank], outside[index, :, None]], axis=1),
            np.append(np.ones(rank), n - rank),
            np.append(spectra[index].values, 0.0),
        )
        for index, rank in enumerate(ranks)
    ]


def _products(shared: FloatArray, separate: FloatArray) -> FloatArray:
    """Return, along r directions, products (..., B, r, q^2) of shared (..., r, q - 1) and own (..., B, r) columns."""
    wide = np.broadcast_to(shared[..., None, :, :], (*separate.shape, shared.shape[-1]))
    columns = np.concatenate([wide, separate[..., None]], axis=-1)
    return np.asarray((columns[..., :, None] * columns[..., None, :]).reshape(*separate.shape, -1))


def divided_columns(model: StatisticalModel) -> tuple[list[int], list[int]]:
    """Return the places of the columns that are integrated in closed form, and of the others."""
    free = [model.column_symbols.index(symbol) for symbol in model.linear]
    return free, [column for column in range(len(model.column_symbols)) if column not in free]
