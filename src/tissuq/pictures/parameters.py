"""Pictures of marginal posteriors: densities with their priors, and several posteriors beneath one another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tissuq.assessment.modulus import modulus
from tissuq.drawing.panels import Panels
from tissuq.drawing.pieces import density, forest, line, rows
from tissuq.drawing.style import BAND, BASE, INK, TRUTH, relative_size
from tissuq.errors import InputError
from tissuq.experiments.units import StressUnit
from tissuq.inference.marginal import Marginal
from tissuq.inference.solution import Solution
from tissuq.parameters.priors import Prior

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MODULUS = "initial shear modulus"
"""In place of a parameter's symbol."""
VALUES = 400
"""At which a density is drawn."""
TAIL = 5e-4
"""Probability beyond either end of what is drawn of a density."""
RIDGE = 0.75
"""Height of a density over the distance of two rows."""


def parameters_to_show(solution: Solution) -> list[str]:
    """Return the initial shear modulus, the material's parameters and those of the noise."""
    model = solution.model
    noise = [parameter.symbol for parameter in model.noise.parameters]
    return [MODULUS, *model.material_symbols, *(symbol for symbol in noise if symbol not in model.material_symbols)]


def marginal_of(solution: Solution, name: str) -> Marginal:
    """Return the marginal posterior of a parameter, or of the initial shear modulus; MPa.

    Raises
    ------
    InputError
        When the model has no such parameter.
    """
    if name == MODULUS:
        return modulus(solution)
    if name not in solution.model.symbols:
        raise InputError(
            f"there is no parameter '{name}' to draw: choose of {', '.join(solution.model.symbols)} and '{MODULUS}'."
        )
    return solution.marginals[name]


def marginals(solution: Solution, drawn: Panels, names: Sequence[str], unit: StressUnit, prob: float = 0.95) -> None:
    """Draw the density of every parameter on a panel of its own, with its prior and its 95 % interval."""
    for axis, name in zip(drawn.axes, names, strict=True):
        factor, label = _scale(solution, name, unit)
        marginal, prior = marginal_of(solution, name), solution.model.priors.get(name)
        values = _values(marginal)
        height = marginal.pdf(values)
        density(axis, values / factor, height * factor, label="posterior")
        top = float(height.max()) * factor
        if prior is not None:
            prior_values, prior_height = _prior(prior, values)
            line(axis, prior_values / factor, prior_height * factor, color=BASE, style=":", width=1.4, label="prior")
        low, high = (end / factor for end in marginal.hdi(prob))
        middle = float(marginal.quantile(0.5)) / factor
        interval = f"median and {100 * prob:.4g} % interval"
        forest(axis, [0.0], [low], [middle], [high], width=4, mark_color=INK, label=interval)
        axis.set_ylim(-0.04 * top, 1.1 * top)
        axis.set_yticks([])
        axis.spines["left"].set_visible(False)
        axis.locator_params(axis="x", nbins=4)
        axis.set_xlabel(label)
    drawn.explain()


def ridges(
    axis: Axes,
    solutions: Mapping[str, Solution],
    name: str,
    unit: StressUnit,
    *,
    prob: float = 0.95,
    truth: float | None = None,
) -> None:
    """Draw the marginals of one parameter beneath one another, with their intervals; a true value (MPa) as a line.

    Those whose interval misses the true value are grey.
    """
    levels, size = rows(axis, list(solutions)), relative_size()
    words = "posterior density", f"{100 * prob:.4g} % interval", "median"
    for level, solution in zip(levels, solutions.values(), strict=True):
        factor, label = _scale(solution, name, unit)
        marginal = marginal_of(solution, name)
        (low, high), values = marginal.hdi(prob), _values(marginal)
        color = BAND if truth is None or low <= truth <= high else BASE
        density(axis, values / factor, marginal.pdf(values), level=level, top=RIDGE, color=color, label=words[0])
        axis.plot([low / factor, high / factor], [level, level], color=color, lw=4 * size, solid_capstyle="butt",
                  label=words[1])  # fmt: skip
        middle = float(marginal.quantile(0.5)) / factor
        axis.plot(middle, level, "o", color="white", mec=INK, ms=5 * size, zorder=3, label=words[2], ls="")
        words = "", "", ""
        axis.set_xlabel(label)
    if truth is not None:
        shown = truth / factor
        axis.axvline(shown, color=TRUTH, ls="--", lw=1.3 * size, zorder=0)
        axis.text(
            shown, len(solutions) - 0.12, f"true value {shown:g}", color=TRUTH, ha="center", va="bottom",
            fontsize=9 * size, bbox={"color": "white", "pad": 1.5},
        )  # fmt: skip
    axis.spines["left"].set_visible(False)
    axis.set_ylim(-0.35, len(solutions) + 0.1)


def intervals(axis: Axes, marginals: Mapping[str, Marginal], average: Marginal, label: str, factor: float) -> None:
    """Draw means and 95 % intervals by name, and those of an average in black beneath; ``factor`` is that of a unit.

    Far ones may leave the axis, which shows every mean.
    """
    named = {**marginals, "all, by probability": average}
    levels = rows(axis, list(named))
    ends = np.array([(low, m.mean, high) for m in named.values() for low, high in [m.hdi()]]) / factor
    for number, color in ((slice(-1), BAND), (slice(-1, None), INK)):
        forest(axis, levels[number], *ends[number].T, color=color)
    axis.set_xlabel(label)


def _scale(solution: Solution, name: str, unit: StressUnit) -> tuple[float, str]:
    """Return what one unit of a parameter is in MPa, and the label of its axis."""
    parameter = next((p for p in solution.model.parameters if p.symbol == name), None)
    return (unit.to_mpa, f"{name} [{unit.name}]") if parameter is None or parameter.unit else (1.0, name)


def _values(marginal: Marginal) -> Any:
    low, high = marginal.quantile([TAIL, 1 - TAIL]).tolist()
    return np.linspace(low, high, VALUES)


def _prior(prior: Prior, values: Any) -> tuple[Any, Any]:
    """Return where the prior has a density, and how large it is there."""
    low, high = prior.support
    inside = values[(values > low) & (values < high)]
    return inside, np.exp(np.asarray(prior.log_density(inside), dtype=np.float64))
