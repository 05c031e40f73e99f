"""Measures of strain that files hold, a row of a registry each: its names, and the stretch or amount of shear."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, pi

import numpy as np
from numpy.typing import NDArray

from tissuq.errors import InputError

__all__ = ["STRAIN_MEASURES", "StrainMeasure"]

Column = NDArray[np.float64]


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
    stretch: Callable[[Column], Column] | None = None
    strain: Callable[[Column], Column] | None = None
    formula: str = ""
    shear: Callable[[Column], Column] | None = None
    shear_formula: str = ""
    limits: tuple[float, float] = (-inf, inf)

    def converted(self, values: Column, is_shear: bool) -> tuple[Column, str]:
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
            alternatives = (name for name, measure in STRAIN_MEASURES.items() if measure.tells(is_shear))
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

    def tells(self, is_shear: bool) -> bool:
        """Return whether it tells the amount of shear, or else the stretch."""
        return bool(self.shear if is_shear else self.stretch)


STRAIN_MEASURES = {
    measure.name: measure
    for measure in (
        StrainMeasure(
            name="engineering",
            words=r"engineering|eng\.?|nominal\w*|nominell\w*|technisch\w*|conventionnelle|ingenieril|unitari[ao]|"
            r"unitaire|relative|工程|公称|инженерн\w+|номинальн\w+|условн\w+|относительн\w+",
            stretch=lambda strain: 1 + strain,
            strain=lambda stretch: stretch - 1,
            formula="1 + {}",
            shear=lambda strain: strain,
            shear_formula="{}",
        ),
        StrainMeasure(
            name="true",
            words=r"true|log\.?|logar\w*|ln|hencky|natural|wahre?[rs]?|vraie?|r[ée]elle|verdader[ao]|real|ver[ao]|"
            r"verdadeir[ao]|werkelijke|真实|真實|真|对数|對數|対数|истинн\w+|логарифмическ\w+",
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
