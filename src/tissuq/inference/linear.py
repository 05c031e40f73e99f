"""What the priors of linear parameters do to Gaussians of them: factors in closed form, and bounds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tissuq.inference.box import Boxes
from tissuq.model.statistical_model import StatisticalModel
from tissuq.parameters.priors import Prior

__all__ = ["LinearPriors", "times_gaussians"]

FloatArray = NDArray[np.float64]


class LinearPriors:
    """The priors of the parameters that a model integrates in closed form.

    Attributes
    ----------
    priors : list of Prior
    supports : (p, 2) array
    box : Boxes
        Their bounds (1, p).
    is_gaussian : bool
        Whether any of them is more than a bound.
    log_height : float
        Log of the product of the uniform densities.
    """

    def __init__(self, model: StatisticalModel) -> None:
        self.priors = [model.priors[symbol] for symbol in model.linear]
        self._forms = [prior.gaussian or (0.0, 0.0, 0.0) for prior in self.priors]
        self.supports = np.reshape([prior.support for prior in self.priors], (-1, 2))
        self.box = Boxes(self.supports[None, :, 0], self.supports[None, :, 1])
        self.is_gaussian = any(precision for _, precision, _ in self._forms)
        self.log_height = float(sum(height for _, precision, height in self._forms if not precision))

    def times(self, mean: FloatArray, root: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return `times_gaussians` with these priors."""
        return times_gaussians(mean, root, self.priors)

    def log_mass(self, mean: FloatArray, root: FloatArray) -> FloatArray:
        """Return the log mass (M,) of Gaussians (M, p) times all these priors but uniform densities, within bounds."""
        mean, root, log_mass = self.times(mean, root)
        return log_mass + self.box.repeated(len(mean)).log_mass(mean, root)[0]

    def strain(self, mean: FloatArray, root: FloatArray) -> FloatArray:
        """Return by how much (M,) the sum of squares of the data grows where the parameters obey their priors.

        At most, for means (M, p) and roots (M, p, p) of unit noise: one parameter after another is moved to the
        centre of its prior, or into its bounds.
        """
        variance = np.maximum((root**2).sum(axis=2), 1e-300)
        low, high = self.supports.T
        centre = [mean for mean, _, _ in self._forms]
        is_free = np.array([not precision for _, precision, _ in self._forms], dtype=bool)
        wanted = np.clip(np.where(is_free, mean, centre), low, high)
        return np.asarray(((mean - wanted) ** 2 / variance).sum(axis=1))


def times_gaussians(
    mean: FloatArray, root: FloatArray, priors: Sequence[Prior]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Multiply Gaussians of linear parameters, and perhaps more, by the priors of the former.

    Parameters
    ----------
    mean, root : (M, q) and (M, q, q) arrays
    priors : sequence of Prior
        Of the first parameters; flat and uniform ones change nothing.

    Returns
    -------
    Means (M, q), roots (M, q, q) and the logarithms (M,) of the masses.
    """
    log_mass = np.zeros(len(mean))
    for index, prior in enumerate(priors):
        centre, precision, log_height = prior.gaussian or (0.0, 0.0, 0.0)
        if not precision:
            continue
        along = root[:, index]
        variance = (along**2).sum(axis=1) + 1 / precision
        miss = centre - mean[:, index]
        covariance = np.einsum("mij,mj->mi", root, along)
        mean = mean + covariance * (miss / variance)[:, None]
        shrink = 1 / (variance + np.sqrt(variance / precision))  # Potter's square root of the update
        root = root - shrink[:, None, None] * covariance[:, :, None] * along[:, None, :]
        log_mass += log_height - 0.5 * np.log(precision * variance) - 0.5 * miss**2 / variance
    return mean, root, log_mass
