"""Checks that material, discrepancy, noise and tolerances can be combined, with advice where they cannot."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError, ModelError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import States
from tissuq.mechanics import Material, stress_basis
from tissuq.mechanics.equilibrium import has_free_axis
from tissuq.mechanics.stress import stresses_at
from tissuq.model.discrepancy import Discrepancy
from tissuq.model.noise import Noise
from tissuq.model.tolerances import Tolerances

ANGLES = (0.0, np.pi / 2)
"""Between which angles of fibres lie."""
NO_STRESS = 1e-12
"""Stress over that at the usual angle up to which fibres carry none."""
MAX_CONDITION_NUMBER = 1e10
"""Largest condition number of columns of unit length whose parameters the data can separate."""


def check_parts(
    material: Material, discrepancy: Discrepancy, noise: Noise, tolerances: Tolerances, experiment: Experiment
) -> None:
    """Refuse parts that do not fit each other.

    Raises
    ------
    ModelError
        When the material does not deform as a mode says, it is no material by itself, discrepancy or noise have a
        parameter of it, the noise has no sizes that are numbers, or discrepancy, noise and tolerances take up the same
        errors.
    InputError
        When there is not one known noise for each test, or the noise needs one test, with repeats.
    """
    _check_modes(material, discrepancy, experiment)
    _check_parameters(material, discrepancy, noise)
    if noise.problem:
        raise ModelError(f"noise '{noise.name}' cannot be used: {noise.problem}.")
    _check_errors(discrepancy, noise, tolerances, experiment)


def _check_modes(material: Material, discrepancy: Discrepancy, experiment: Experiment) -> None:
    for curve in experiment.curves:
        if problem := material.why_not(curve.path.moved(curve.points[:1], 0.0)):
            raise ModelError(problem)
        where = f"test '{curve.name}' ({curve.mode.name})"
        check_lateral_stretch(material, discrepancy, curve.path.at(curve.points[:1]), where)


def check_lateral_stretch(material: Material, discrepancy: Discrepancy, states: States, where: str) -> None:
    """Refuse a lateral stretch that is left to the material where it would depend on a further energy, too.

    Raises
    ------
    ModelError
    """
    if discrepancy.is_energy and discrepancy.parameters and has_free_axis(material, states):
        raise ModelError(
            f"in {where} the lateral stretch of '{material.name}' would depend on the discrepancy "
            f"'{discrepancy.name}', too, which is an energy: fit with --discrepancy none, or with one that is an error "
            "of the stress as measured, and of its loading mode alone (--discrepancy gp-pinned)."
        )


def _check_parameters(material: Material, discrepancy: Discrepancy, noise: Noise) -> None:
    if material.needs_matrix:
        raise ModelError(
            f"material '{material.name}' consists of fibres only, without stiffness where they are not stretched: add "
            f"a matrix, as in 'neo-hookean+{material.name}'."
        )
    of_material = {parameter.symbol: parameter for parameter in material.parameters}
    parts: dict[str, Discrepancy | Noise] = {
        f"discrepancy '{discrepancy.name}' adds": discrepancy,
        f"noise '{noise.name}' has": noise,
    }
    for has, part in parts.items():
        shared = [parameter for parameter in part.parameters if parameter.symbol in of_material]
        if not shared:
            continue
        symbols = ", ".join(parameter.symbol for parameter in shared)
        advice = (
            "no data can separate the two. Choose another material or discrepancy."
            if any(parameter.description == of_material[parameter.symbol].description for parameter in shared)
            else "a name for two things. Rename those of the material, as in "
            f"{shared[0].symbol} to {shared[0].symbol}_law, or choose another {has.partition(' ')[0]}."
        )
        raise ModelError(f"{has} {symbols}, which material '{material.name}' has already: {advice}")


def _check_errors(discrepancy: Discrepancy, noise: Noise, tolerances: Tolerances, experiment: Experiment) -> None:
    if not noise.parameters:
        noise.of_tests(experiment)  # says where there is not one for each test
    if noise.shares_discrepancy and len(experiment.curves) > 1:
        raise InputError(f"noise '{noise}' is for one test: choose the noise 'unknown' for several.")
    if noise.shares_discrepancy and len(np.unique(experiment.states.abscissa)) == experiment.size:
        raise InputError(
            f"experiment '{experiment.name}' has no two measurements at the same stretch, so the noise cannot be "
            "determined from repeats: choose the noise 'unknown', or round the stretches to the steps of the test."
        )
    if noise.is_consecutive and discrepancy.is_correlated:
        raise ModelError(
            f"discrepancy '{discrepancy.name}' cannot be separated from autocorrelated noise: choose the noise "
            "'unknown', or a discrepancy that is an energy, such as 'auto'."
        )
    if not tolerances:
        return
    if discrepancy.is_correlated:
        raise ModelError(
            f"discrepancy '{discrepancy.name}' takes up errors of a whole test itself: choose no tolerances, "
            "or a discrepancy that is an energy, such as 'auto'."
        )
    if noise.depends_on_level or noise.shares_discrepancy:
        raise ModelError(
            f"noise '{noise}' and tolerances of whole tests do not go together: choose the noise 'unknown', "
            "or tolerances=Tolerances(), which are none."
        )


def check_separable(triangle: FloatArray, name: str, symbols: tuple[str, ...]) -> None:
    """Refuse columns, as their triangle (k, k), that the stretches of an experiment leave nearly dependent."""
    lengths = np.linalg.norm(triangle, axis=0)
    if not lengths.all() or np.linalg.cond(triangle / lengths) > MAX_CONDITION_NUMBER:
        raise ModelError(
            f"the stretches of experiment '{name}' cannot separate the parameters {', '.join(symbols)}: measure at "
            "more or other stretches, or choose a simpler material or discrepancy."
        )


def check_angles(
    material: Material, discrepancy: Discrepancy, experiment: Experiment, usual_bent: tuple[float, ...]
) -> None:
    """Refuse fibres whose angle is to be found, beside an energy, where across the tests they carry no measured stress.

    The nearer they lie to that angle, the stiffer they may be, and the energy takes up what they leave of the stress.
    """
    usual = np.linalg.norm(stress_basis(material, experiment.states, usual_bent), axis=0)
    for number, parameter in enumerate(p for p in material.parameters if not p.is_linear):
        if parameter.support != ANGLES:
            continue
        bent = np.array(usual_bent)
        bent[number] = ANGLES[1]
        across = np.linalg.norm(stress_basis(material, experiment.states, bent), axis=0)
        if (across <= NO_STRESS * usual).any():
            raise ModelError(
                f"the angle {parameter.symbol} of the fibres in '{material.name}' is not determined beside the "
                f"discrepancy '{discrepancy.name}': fibres across carry none of the stress that was measured, that of "
                "one axis. Give the angle where it is known, as in exponential-fibres@45, fit without a discrepancy "
                "(--discrepancy none), or measure the stresses of both axes."
            )


@lru_cache(maxsize=256)
def check_linearity(material: Material, ends: States, bent: tuple[float, ...]) -> None:
    """Refuse a material whose stress, between two states of a path, is not proportional to its linear parameters."""
    low, high = ends.points[0]
    states = ends.paths[0].at(np.linspace(low, high, 16))
    is_linear = material.linear_mask
    tried = np.empty((is_linear.sum() + 1, len(is_linear)))
    tried[:, ~is_linear] = bent
    tried[:, is_linear] = 0.3 + np.random.default_rng(0).random((len(tried), is_linear.sum()))
    stress = stresses_at(material, states, tried)
    expected = tried[:, is_linear] @ stress_basis(material, states, bent).T
    rounding = 1e-12  # MPa, of parameters of about one; a law may have no stress at all along a path
    if not np.allclose(stress, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max() + rounding):
        linear = [p.symbol for p in material.parameters if p.is_linear]
        raise ModelError(
            f"the stress of material '{material.name}' is not proportional to its parameters ({', '.join(linear)}), "
            "for example because one stands in an exponent: declare such a parameter with is_linear=False and a "
            "relative_prior."
        )
