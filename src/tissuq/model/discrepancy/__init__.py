"""The discrepancies, one family a file; importing this package registers them all."""

from tissuq.model.discrepancy.discrepancy import Discrepancy, NoDiscrepancy
from tissuq.model.discrepancy.energy import (
    Auto,
    EnergyDiscrepancy,
    EnergySum,
    Member,
    discrepancies,
    discrepancy_named,
    side_by_side,
)
from tissuq.model.discrepancy.means import Constant, Linear, MooneyRivlinTerm, Quadratic, YeohTerms
from tissuq.model.discrepancy.processes import (
    ConditionedProcess,
    GaussianProcess,
    OrthogonalProcess,
    PinnedProcess,
    ScaledProcess,
)

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
    "side_by_side",
]
