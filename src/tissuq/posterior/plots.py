"""Pictures of a posterior as its methods, and of several posteriors beneath one another: axes in, axes out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

from numpy.typing import ArrayLike

from tissuq.assessment.named_fits import named_fits
from tissuq.drawing.panels import panels
from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode, loading_mode
from tissuq.experiments.units import StressUnit, stress_unit
from tissuq.inference.solution import Solution
from tissuq.parameters.checks import one_or_several
from tissuq.pictures.answer import answer, discrepancy_shares
from tissuq.pictures.curves import described, has_discrepancy
from tissuq.pictures.parameters import MODULUS, marginal_of, marginals, parameters_to_show, ridges
from tissuq.pictures.prediction import prediction, predictions
from tissuq.pictures.stability import stability

LETTERS_OF_NAME = 24
"""In a line of the name of a fit that is compared."""
SMALL_PANEL, ROW = 1.25, 0.32
"""Heights of a panel with a density, and of a row of a comparison, in inches."""


class PosteriorPlots:
    """The pictures of a posterior.

    Each takes ``ax``, Matplotlib's axes to draw on, or an array of them where it has several panels, and returns these;
    without it a figure that fits a column or a page of a paper is made in `matplotlib.pyplot`, which shows it. Stresses
    are in the unit of the measurements, or in ``unit``.
    """

    solution: Solution

    def plot(self, ax: Any = None, *, unit: str | None = None, prob: float = 0.95) -> Any:
        """Draw whether the model describes the tests, and how sure that is: a panel for every measured stress.

        Measurements (with standard errors where they are means of specimens), the band that holds 95 % of new
        measurements, that of the stress itself, and the material alone with its band. Beneath, in a new figure, the
        share of the stress that the discrepancy carries (`plot_discrepancy`).

        Parameters
        ----------
        ax : Axes, or array of Axes, optional
            As many as the tests measured stresses.
        unit : str, optional
            Of the stresses, such as ``"MPa"``.
        prob : float
            Probability of the bands, equal tails.

        Returns
        -------
        Axes, or (n,) array of Axes
            Of the panels; strips beneath are further axes of the figure.

        Examples
        --------
        >>> import tissuq as tq
        >>> data = tq.simulate("neo-hookean", {"C10": 0.5}, [0.8, 0.9, 1.1, 1.2, 1.3], noise_sd=0.02, seed=1)
        >>> axis = tq.fit(data, discrepancy="none", noise_sd=0.02).plot(unit="kPa")
        >>> axis.get_ylabel()
        'engineering stress [kPa]'
        >>> axis.figure.savefig("fit.pdf")  # doctest: +SKIP
        >>> import matplotlib.pyplot as plt
        >>> plt.close(axis.figure)
        """
        count = len(self.solution.model.experiment.curves)
        with panels(ax, count, has_strips=has_discrepancy(self.solution)) as drawn:
            answer(described(self.solution, prob), drawn, self.unit(unit))
        return drawn.result

    def plot_prediction(
        self,
        mode: str | LoadingMode | None = None,
        stretch: ArrayLike | None = None,
        ax: Any = None,
        *,
        unit: str | None = None,
        prob: float = 0.95,
    ) -> Any:
        """Draw the stress in a loading mode, shaded where it is extrapolated beyond the invariants that were measured.

        With the discrepancy where it is an energy, or the mode is that of the tests; of the material alone otherwise,
        as the title says. The axis follows the measured range and the medians; wide bands leave it.

        Parameters
        ----------
        mode : str or LoadingMode, optional
            That of the first test, unless given.
        stretch : (g,) array, or (g, c) for a mode with c controls, optional
            Over the measured range and beyond, unless given.
        ax, unit, prob
            As of `plot`; a panel for every stress of the mode.
        """
        loading = loading_mode(mode) if mode is not None else self.solution.model.experiment.modes[0]
        predicted = predictions(self.solution, loading, stretch, prob)
        with panels(ax, len(predicted)) as drawn:
            prediction(drawn, predicted, self.unit(unit), prob)
        return drawn.result

    def plot_parameters(
        self, parameters: Sequence[str] | None = None, ax: Any = None, *, unit: str | None = None, prob: float = 0.95
    ) -> Any:
        """Draw the marginal posteriors of parameters, each on a panel, with the outlines of their priors.

        Parameters
        ----------
        parameters : sequence of str, optional
            Symbols, and ``"initial shear modulus"``; this, the material's and the noise's, unless given.
        ax, unit, prob
            As of `plot`; the bar is the highest-density interval of this probability.
        """
        shown = parameters_to_show(self.solution) if parameters is None else parameters
        names = one_or_several(shown, str, "parameters must be symbols")
        if not names:
            raise InputError("parameters is empty: name some, or leave it out.")
        for name in names:
            marginal_of(self.solution, name)  # refuses what is no parameter before a figure is made
        with panels(ax, len(names), height=SMALL_PANEL) as drawn:
            marginals(self.solution, drawn, names, self.unit(unit), prob)
        return drawn.result

    def plot_discrepancy(self, ax: Any = None, *, prob: float = 0.95) -> Any:
        """Draw the share of the stress that the discrepancy carries along every measured curve, in percent.

        The rest is the material's. Scatter from point to point is no part of either. Where there is next to no
        stress, there is no share.
        """
        if not has_discrepancy(self.solution):
            raise InputError("this posterior has no discrepancy to draw: fit with one, such as discrepancy='auto'.")
        with panels(ax, len(self.solution.model.experiment.curves)) as drawn:
            discrepancy_shares(self.solution, drawn, prob)
        return drawn.result

    def plot_stability(self, ax: Any = None) -> Any:
        """Draw how probable it is that material and energy discrepancy are stable from the reference up to a stretch.

        A line for every loading mode of one stretch, over the range in which both invariants were measured;
        `stability` has the criteria. The dotted line is at 95 %.
        """
        with panels(ax, 1) as drawn:
            stability(self.solution, drawn)
        return drawn.result

    def unit(self, name: str | None = None) -> StressUnit:
        """Return a unit of stress by its name; without one that of the measurements, in which tables are."""
        return stress_unit(name or self.solution.model.experiment.stress_unit)


def plot_compare(
    posteriors: Mapping[str, PosteriorPlots] | Sequence[PosteriorPlots],
    parameter: str | None = None,
    ax: Any = None,
    *,
    unit: str | None = None,
    prob: float = 0.95,
    truth: float | None = None,
) -> Any:
    """Draw the marginal posteriors of one parameter from several fits beneath one another.

    Parameters
    ----------
    posteriors : mapping of str to Posterior, or sequence of Posterior
        By name; those of a sequence are named by material and discrepancy.
    parameter : str, optional
        Its symbol; the initial shear modulus, which all materials have, unless given.
    ax : Axes, optional
        Unless given, a new figure is made in `matplotlib.pyplot`.
    unit : str, optional
        Of stress; that of the measurements of the first, unless given.
    prob : float
        Of the highest-density intervals that the bars are.
    truth : float, optional
        True value, MPa, drawn as a line; intervals that miss it are grey.

    Returns
    -------
    Axes

    Examples
    --------
    >>> import tissuq as tq
    >>> import matplotlib.pyplot as plt
    >>> data = tq.simulate("neo-hookean", {"C10": 0.5}, [0.8, 0.9, 1.1, 1.2, 1.3], noise_sd=0.02, seed=1)
    >>> fits = [tq.fit(data, material=law, discrepancy="none", noise_sd=0.02) for law in ("neo-hookean", "gent")]
    >>> axis = tq.plot_compare(fits)
    >>> [label.get_text() for label in axis.get_yticklabels()]
    ['neo-hookean, none', 'gent, none']
    >>> plt.close(axis.figure)
    """
    named = {name: posterior.solution for name, posterior in named_fits(posteriors).items()}
    if not named:
        raise InputError("there is nothing to compare: give posteriors, such as {'none': tq.fit(data, ...)}.")
    symbol = parameter or MODULUS
    for solution in named.values():
        marginal_of(solution, symbol)
    first_solution = next(iter(named.values()))
    with panels(ax, 1, height=ROW * len(named) + 0.3) as drawn:
        shown = stress_unit(unit or first_solution.model.experiment.stress_unit)
        shown_names = {fill(name, LETTERS_OF_NAME): solution for name, solution in named.items()}
        ridges(drawn.axes[0], shown_names, symbol, shown, prob=prob, truth=truth)
    return drawn.result
