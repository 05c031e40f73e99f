"""No discrepancy: the material is taken to be right."""

from tissuq.discrepancy.discrepancy import Discrepancy

__all__ = ["NoDiscrepancy"]


class NoDiscrepancy(Discrepancy):
    """Measured stress = material + noise (eq. 12)."""

    name = "none"
    formula = "0"
    source = "Zeraatpisheh et al. 2021, eq. 12"
    is_energy = True
    caution = (
        "If the material is wrong, its parameters are over-confident: the interval does not show it, the check may."
    )
