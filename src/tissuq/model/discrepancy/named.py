"""Discrepancies by name, and sums of two energies as ``taylor+hencky``."""

from __future__ import annotations

from tissuq.errors import ModelError
from tissuq.model.discrepancy.discrepancy import Discrepancy
from tissuq.model.discrepancy.energy import BLOCKS, EnergySum
from tissuq.registry import find, variants

__all__ = ["discrepancies", "discrepancy_named"]


def discrepancies() -> dict[str, type[Discrepancy]]:
    """Return every discrepancy by name, those with few parameters first."""
    return dict(sorted(variants(Discrepancy).items(), key=lambda item: len(item[1].parameters)))


def discrepancy_named(discrepancy: str | Discrepancy) -> Discrepancy:
    """Return the discrepancy of that name; a discrepancy is returned as it is.

    Raises
    ------
    ModelError
        When no discrepancy has that name.
    """
    if isinstance(discrepancy, Discrepancy):
        return discrepancy
    return _energy_sum(discrepancy) or find(Discrepancy, "discrepancy", discrepancy, ModelError)()


def _energy_sum(names: str) -> EnergySum | None:
    """Return the sum of two blocks named with a plus sign between them, or None when these are other names."""
    blocks_by_name = {block.name: block for block in BLOCKS}
    block_names = [block_name.strip() for block_name in names.split("+")]
    if len(block_names) < 2 or not any(block_name in blocks_by_name for block_name in block_names):
        return None
    unknown = [block_name for block_name in block_names if block_name not in blocks_by_name]
    if unknown or len(block_names) > 2 or len(set(block_names)) < 2:
        raise ModelError(
            f"discrepancy '{names}': a sum has two different ones of the energies {', '.join(blocks_by_name)}"
            + (f"; '{unknown[0]}' is none of them." if unknown else ".")
        )
    return EnergySum(tuple(blocks_by_name[block_name] for block_name in block_names))
