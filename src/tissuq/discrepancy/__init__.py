"""The discrepancies, one family a file; importing this package registers them all."""

from tissuq.discrepancy.discrepancy import Discrepancy, discrepancies, discrepancy_named
from tissuq.discrepancy.energy import Auto, EnergyDiscrepancy, EnergySum, Member
from tissuq.discrepancy.gaussian_process import GaussianProcess
from tissuq.discrepancy.hyperelastic import MooneyRivlinTerm, YeohTerms
from tissuq.discrepancy.none import NoDiscrepancy
from tissuq.discrepancy.polynomial import Constant, Linear, Quadratic

__all__ = [
    "Auto",
    "Constant",
    "Discrepancy",
    "EnergyDiscrepancy",
    "EnergySum",
    "GaussianProcess",
    "Linear",
    "Member",
    "MooneyRivlinTerm",
    "NoDiscrepancy",
    "Quadratic",
    "YeohTerms",
    "discrepancies",
    "discrepancy_named",
]
