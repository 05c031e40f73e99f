"""Thick tubes of known laws, and what they bear: pressure and axial force, summed through the deformed wall."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.optimize import brentq

MMHG = 133.322387415e-6  # MPa
INNER, OUTER = 1.25, 1.5  # mm
SIZES = {"diameter": "3 mm", "thickness": "0.25 mm"}
ROWS = 25
HEADINGS = "Pressure (mmHg),Outer diameter (um),Axial stretch,Axial force (mN)"
NODES, WEIGHTS = np.polynomial.legendre.leggauss(60)


def first_invariant(hoop, axial):
    return hoop**2 + axial**2 + 1 / (hoop * axial) ** 2


def neo_hookean(hoop, axial):
    """W = 20 kPa (I1 - 3)."""
    return 0.02 * (first_invariant(hoop, axial) - 3)


def mooney_rivlin(hoop, axial):
    """With C01 = 5 kPa."""
    return neo_hookean(hoop, axial) + 0.005 * (1 / hoop**2 + 1 / axial**2 + (hoop * axial) ** 2 - 3)


def yeoh(hoop, axial):
    """With C20 = 20 kPa."""
    return neo_hookean(hoop, axial) + 0.02 * (first_invariant(hoop, axial) - 3) ** 2


def ogden(hoop, axial):
    """With the exponent 8."""
    return 0.00125 * (hoop**8 + axial**8 + (hoop * axial) ** -8 - 3)


def gent(hoop, axial):
    """With the limit 8 of I1 - 3."""
    return -0.16 * np.log(1 - (first_invariant(hoop, axial) - 3) / 8)


def demiray(hoop, axial):
    """W = a/(2 b) (exp(b (I1 - 3)) - 1), b = 2."""
    return 0.005 * (np.exp(2 * (first_invariant(hoop, axial) - 3)) - 1)


def fung(hoop, axial):
    """W = c/2 (exp(6 E1^2 + 3 E2^2 + 2 E1 E2) - 1) of Green's strains: another law along the axis than around it."""
    around, along = (hoop**2 - 1) / 2, (axial**2 - 1) / 2
    return 0.01 * (np.exp(6 * around**2 + 3 * along**2 + 2 * around * along) - 1)


def fibres(hoop, axial):
    """Two families at 45 degrees in a neo-Hookean matrix (Holzapfel, Gasser & Ogden 2000), k2 = 1."""
    square = (hoop**2 + axial**2) / 2
    return neo_hookean(hoop, axial) + 0.01 * (np.exp((square - 1) ** 2) - 1)


LAWS = (neo_hookean, mooney_rivlin, yeoh, ogden, gent, demiray, fung, fibres)


def slope(law, hoop, axial):
    """Return dW/dl of the hoop, by a complex step."""
    return law(hoop + 1e-30j, axial).imag / 1e-30


def steeper_fibres(hoop, axial):
    """Two families at 37 degrees to the hoop in a softer matrix, k2 = 3."""
    share = np.cos(np.radians(37)) ** 2
    square = share * hoop**2 + (1 - share) * axial**2
    return 0.3 * neo_hookean(hoop, axial) + 0.003 * (np.exp(3 * (square - 1) ** 2) - 1)


def axial_slope(law, hoop, axial):
    """Return dW/dl of the axis, by a complex step."""
    return law(hoop, axial + 1e-30j).imag / 1e-30


def wall(ratio):
    """Return the radii of a wall so many times as thick as the radius of its middle, which is 1 mm."""
    outer = (ratio + np.sqrt(ratio**2 + 4)) / 2
    return 1 / outer, outer


def radii(hoop, axial, inner, outer):
    """Return the deformed inner and outer radius for a hoop stretch at the undeformed radius sqrt(inner outer)."""
    added = inner * outer * (axial * hoop**2 - 1)
    return np.sqrt((inner**2 + added) / axial), np.sqrt((outer**2 + added) / axial)


def borne(law, hoop, axial, inner, outer):
    """Return the pressure (MPa) and the reduced force (N).

    They are the integrals of (s_hoop - s_radial)/r and of pi (2 s_axial - s_radial - s_hoop) r over the deformed
    radius r, with principal Cauchy stresses whose differences from the radial one are the stretch times the slope.
    """
    a, b = radii(hoop, axial, inner, outer)
    r = (a + b) / 2 + (b - a) / 2 * NODES
    stretch = r / np.sqrt(axial * r**2 - axial * a**2 + inner**2)
    around, along = stretch * slope(law, stretch, axial), axial * axial_slope(law, stretch, axial)
    dr = (b - a) / 2 * WEIGHTS
    return around / r @ dr, np.pi * (2 * along - around) * r @ dr


def hoop_at(law, pressure, axial, inner, outer):
    """Return the hoop stretch of the middle under a pressure."""
    lowest = np.sqrt((1 - 0.99 * inner / outer) / axial)
    highest = lowest
    while borne(law, highest, axial, inner, outer)[0] < pressure:
        highest += 0.05
    return brentq(lambda hoop: borne(law, hoop, axial, inner, outer)[0] - pressure, lowest, highest, xtol=1e-12)


@cache
def measured(law, inner=INNER, outer=OUTER, held=(1.2, 1.4, 1.6), at_rest=1.0):
    """Return hoop and axial stretches, pressures (MPa) and reduced forces (N) of inflations, and then of an extension.

    The extension is at the pressure at which the tube has the hoop stretch ``at_rest`` at an axial stretch of 1.3.
    """
    points = []
    for axial in held:
        start = hoop_at(law, 0.0, axial, inner, outer)
        points += [(hoop, axial) for hoop in np.linspace(start, max(start + 0.1, 1.4 / np.sqrt(axial)), ROWS)]
    if at_rest:
        pressure = borne(law, at_rest, 1.3, inner, outer)[0]
        points += [(hoop_at(law, pressure, axial, inner, outer), axial) for axial in np.linspace(1.1, 1.6, ROWS)]
    hoop, axial = np.array(points).T
    return hoop, axial, *np.array([borne(law, *point, inner, outer) for point in points]).T


def rows_of(law, noise=0.0, seed=0, **protocol):
    """Return rows of pressure (mmHg), outer diameter (um), axial stretch and force (mN); noise is of the largest."""
    hoop, axial, pressure, force = measured(law, **protocol)
    random = np.random.default_rng(seed)
    pressure, force = (
        load + noise * np.abs(load).max() * random.standard_normal(len(load)) for load in (pressure, force)
    )
    diameter = 2 * radii(hoop, axial, INNER, OUTER)[1]
    return np.column_stack([pressure / MMHG, 1e3 * diameter, axial, 1e3 * force])


def written(folder, rows, headings=HEADINGS, name="artery.csv"):
    lines = [",".join(f"{value:.10g}" for value in row) for row in rows]
    (folder / name).write_text("\n".join([headings, *lines]) + "\n", encoding="utf-8")
    return folder / name
