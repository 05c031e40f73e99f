"""The discrepancies, one family a file; importing this package registers them all."""

from tissuq.discrepancy.conditioned import ConditionedProcess
from tissuq.discrepancy.discrepancy import Discrepancy, discrepancies, discrepancy_named
from tissuq.discrepancy.energy import Auto, EnergyDiscrepancy, EnergySum, Member, side_by_side
from tissuq.discrepancy.gaussian_process import GaussianProcess
from tissuq.discrepancy.hyperelastic import MooneyRivlinTerm, YeohTerms
from tissuq.discrepancy.none import NoDiscrepancy
from tissuq.discrepancy.orthogonal import OrthogonalProcess
from tissuq.discrepancy.pinned import PinnedProcess
from tissuq.discrepancy.polynomial import Constant, Linear, Quadratic
from tissuq.discrepancy.scaled import ScaledProcess
from tissuq.discrepancy.separate import separated

__all__ = [
    "Auto",
    "ConditionedProcess",
    "Constant",
    "Discrepancy",
    "EnergyDiscrepancy",
    "EnergySum",
    "GaussianProcess",
    "Linear",
    "Member",
    "MooneyRivlinTerm",
    "NoDiscrepancy",
    "OrthogonalProcess",
    "PinnedProcess",
    "Quadratic",
    "ScaledProcess",
    "YeohTerms",
    "discrepancies",
    "discrepancy_named",
    "separated",
    "side_by_side",
]
