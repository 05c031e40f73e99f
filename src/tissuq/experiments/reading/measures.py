"""Measures of strain and of stress that files hold, a row of a registry each: names, and what they are converted to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, pi

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.modes.mode import SHEAR
from tissuq.experiments.reading.tube import Tube
from tissuq.experiments.reading.twisted_disc import rim_stress

ENGINEERING = (
    r"engineering|eng\.?|nominal\w*|nominell\w*|technisch\w*|conventionnelle|ingenieril|工程|公称|инженерн\w+|"
    r"номинальн\w+|условн\w+"
)
TRUE = r"true|wahre?[rs]?|vraie?|r[ée]elle|verdader[ao]|real|ver[ao]|verdadeir[ao]|werkelijke|真实|真實|真|истинн\w+"
"""Words for the engineering and the true strain or stress."""


@dataclass(frozen=True)
class StrainMeasure:
    """A measure of strain.

    Parameters
    ----------
    name : str
        What ``strain_type`` calls it.
    words : str
        Regular expression of the words in a heading, in lower case, that say it.
    stretch, strain : callable, optional
        The stretch for a strain, and the other way round; none of a measure of shear alone.
    formula : str
        The stretch in words, ``{}`` for the strain.
    shear, shear_formula : callable and str, optional
        The amount of simple shear, likewise; none where one component does not tell it.
    limits : tuple of float
        Between which a strain, or an angle, lies.
    """

    name: str
    words: str
    stretch: Callable[[FloatArray], FloatArray] | None = None
    strain: Callable[[FloatArray], FloatArray] | None = None
    formula: str = ""
    shear: Callable[[FloatArray], FloatArray] | None = None
    shear_formula: str = ""
    limits: tuple[float, float] = (-inf, inf)

    def converted(self, values: FloatArray, is_shear: bool) -> tuple[FloatArray, str]:
        """Return the stretch, or amount of shear, for strains as plain ratios (angles in rad), and the formula.

        Raises
        ------
        InputError
            When this measure does not tell it, or a strain is beyond its limits.

        Examples
        --------
        >>> STRAIN_MEASURES["green"].converted(np.array([0.0, 0.625]), is_shear=False)
        (array([1. , 1.5]), 'sqrt(1 + 2 x {})')
        """
        convert, formula = (self.shear, self.shear_formula) if is_shear else (self.stretch, self.formula)
        if convert is None:
            what = "an amount of shear" if is_shear else "a stretch"
            measures = STRAIN_MEASURES.items()
            alternatives = (name for name, measure in measures if (measure.shear if is_shear else measure.stretch))
            raise InputError(
                f"strain of type '{self.name}' does not tell {what}. Say which it is: --strain-type "
                f"{' or '.join(alternatives)}; or add a column with {what} to the file."
            )
        low, high = self.limits
        outside = values[(values <= low) | (values >= high)]
        if len(outside) and not (is_shear and self.stretch):
            bound = f"larger than {low:.4g}" if outside[0] <= low else f"smaller than {high:.4g}"
            raise InputError(
                f"{outside[0]:g} is no strain of type '{self.name}', which is {bound}. Check the unit (--strain-unit) "
                "and the type (--strain-type)."
            )
        return convert(values), formula


STRAIN_MEASURES = {
    measure.name: measure
    for measure in (
        StrainMeasure(
            name="engineering",
            words=rf"{ENGINEERING}|unitari[ao]|unitaire|relative|относительн\w+",
            stretch=lambda strain: 1 + strain,
            strain=lambda stretch: stretch - 1,
            formula="1 + {}",
            shear=lambda strain: strain,
            shear_formula="{}",
        ),
        StrainMeasure(
            name="true",
            words=rf"{TRUE}|log\.?|logar\w*|ln|hencky|natural|对数|對數|対数|логарифмическ\w+",
            stretch=np.exp,
            strain=np.log,
            formula="exp({})",
        ),
        StrainMeasure(
            name="green",
            words=r"green( ?(lagrange|lagrangian|(de )?(st\.?|saint) venant))?|грина( лагранжа)?",
            stretch=lambda strain: np.sqrt(1 + 2 * strain),
            strain=lambda stretch: (stretch**2 - 1) / 2,
            formula="sqrt(1 + 2 x {})",
            shear=lambda strain: 2 * strain,
            shear_formula="2 x {}",
            limits=(-0.5, inf),
        ),
        StrainMeasure(
            name="almansi",
            words=r"(euler(ian)? )?almansi|альманси",
            stretch=lambda strain: 1 / np.sqrt(1 - 2 * strain),
            strain=lambda stretch: (1 - stretch**-2) / 2,
            formula="1 / sqrt(1 - 2 x {})",
            shear=lambda strain: 2 * strain,
            shear_formula="2 x {}",
            limits=(-inf, 0.5),
        ),
        StrainMeasure(
            name="angle",
            words=r"shear(ing)? angle|angle of shear|(scher|schub|scherungs|gleit)winkel|"
            r"angle de (cisaillement|glissement)|[áa]ngulo de (corte|cizallamiento|cizalladura|cisalhamento)|"
            r"angolo di (taglio|scorrimento)|afschuifhoek|剪切角|せん断角|угол сдвига",
            shear=np.tan,
            shear_formula="tan({})",
            limits=(-pi / 2, pi / 2),
        ),
    )
}
"""Every measure of strain by its name.

Along the axis of a stretch l these are l - 1, ln l, (l^2 - 1)/2 and (1 - l^-2)/2. Simple shear of an amount g has the
shear components g, none that is agreed upon for logarithms, g/2 and g/2, and its angle is arctan g.
"""


@dataclass(frozen=True)
class StressMeasure:
    """A measure of stress.

    Parameters
    ----------
    name : str
        What ``stress_type`` calls it.
    words : str
        Regular expression of the words in a heading, in lower case, that say it.
    engineering : callable, optional
        The engineering stresses (k, n) for a loading mode, its points (n,) or (n, c), and stresses (k, n) of this
        measure; none where they are the same.
    step : str
        How, in words.
    is_of_file : bool
        Whether stretches count from where they do in the file, and not from where a preload makes the specimen taut.
    doubt : callable, optional
        What is doubtful about such stresses (k, n) at points of the mode, in words; an empty text where nothing is.
    """

    name: str
    words: str
    engineering: Callable[[LoadingMode, FloatArray, FloatArray], FloatArray] | None = None
    step: str = ""
    is_of_file: bool = False
    doubt: Callable[[FloatArray, FloatArray], str] = lambda points, stress: ""


def _from_torsion(mode: LoadingMode, points: FloatArray, stress: FloatArray) -> FloatArray:
    if mode.controls != (SHEAR,) or len(mode.stresses) > 1:
        raise InputError(
            "stress_type='torsion' (--stress-type torsion) is for a twisted disc: give --mode simple-shear."
        )
    return rim_stress(points, stress[0])[None]


STRESS_MEASURES = {
    measure.name: measure
    for measure in (
        StressMeasure(
            name="engineering",
            words=rf"{ENGINEERING}|pk ?1|(1st|first|1\.) (pk|piola( kirchhoff)?)",
        ),
        StressMeasure(
            name="cauchy",
            words=rf"cauchy|kirchhoff|{TRUE}|коши",
            engineering=lambda mode, points, stress: stress / np.stack([p.cauchy_ratio(points) for p in mode.paths]),
            step="Cauchy stress divided by stretch to engineering stress",
        ),
        StressMeasure(
            name="second-piola-kirchhoff",
            words=r"(2nd|second|2\.|zweite) (pk|piola( kirchhoff)?)|pk ?2|s? ?2 ?pk|pk ?ii",
            engineering=lambda mode, points, stress: mode.from_second_piola_kirchhoff(points, stress),
            step="second Piola-Kirchhoff stress times the deformation gradient to engineering stress",
            is_of_file=True,
        ),
        StressMeasure(
            name="torsion",
            words=r"apparent|scheinbare?|apparente?",
            engineering=_from_torsion,
            step="apparent stress at the rim of a twisted disc times (3 + d ln T / d ln g)/4 to the stress there",
        ),
    )
}
"""Every measure of stress by its name: force over undeformed area P, over deformed area P F', F^-1 P (no change of
volume), and 2 T / (pi R^3) of the torque T of a disc with the radius R."""


def _hoop_and_axial(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    hoop, axial = (points, np.ones(len(points))) if points.ndim == 1 else np.moveaxis(points, -1, 0)
    return hoop, axial


def measure_of_tube(tube: Tube) -> StressMeasure:
    """Return the measure of loads of a tube's wall: p / ln(B/A), and the force over the cross-section if it is read."""
    return StressMeasure(
        name="inflation",
        words="",
        engineering=lambda mode, points, loads: tube.engineering_stresses(*_hoop_and_axial(points), loads),
        step="from mean stresses of the wall to engineering stress in its middle, by a mixture of laws that bears them",
        is_of_file=True,
        doubt=lambda points, loads: tube.doubt(*_hoop_and_axial(points), loads),
    )
