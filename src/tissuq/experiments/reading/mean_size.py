"""The mean of several measurements of one size of a specimen."""

from __future__ import annotations

from collections.abc import Sequence

from tissuq.experiments.reading.stated_sizes import StatedSize

__all__ = ["MEAN_OF", "statements_of_size"]

NOTABLE_SCATTER = 0.2
"""Range of measurements of one size over their mean, from which they are hardly those of one specimen."""
MEAN_OF = "mean of"
"""How the source of a mean begins."""


def statements_of_size(sizes: Sequence[StatedSize]) -> list[tuple[float, str]]:
    """Return the values of one size and where they stand; measurements that differ little as their mean."""
    by_number = {(size.measurement, size.value): size for size in sizes if size.measurement}
    values = [value for _, value in by_number]
    once = [(size.value, size.source) for size in sizes if not size.measurement]
    mean = sum(values) / max(1, len(values))
    if len(values) < 2 or max(values) - min(values) >= NOTABLE_SCATTER * mean:
        return [*once, *((size.value, size.source) for size in by_number.values())]
    places = ", ".join(dict.fromkeys(size.source.removeprefix("in ") for size in by_number.values()))
    listed = ", ".join(f"{value:g}" for value in values)
    return [*once, (mean, f"{MEAN_OF} {len(values)} measurements ({listed}, in {places})")]
