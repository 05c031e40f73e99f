"""The page of all loading modes, written from their classes."""

from __future__ import annotations

from inspect import getdoc

from tissuq.experiments.modes import LoadingMode, loading_modes

__all__ = ["modes_page"]

HEAD = """# Loading modes

Written by `tissuq modes --markdown` from the classes; a test holds it up to date. F is the deformation gradient, l a
stretch (deformed over undeformed length), g an amount of shear, W the strain energy per undeformed volume. Every mode
keeps the volume. A measured stress is the derivative of W by what it does work on, shared by the axes that carry it:
engineering stress (force over undeformed area), tension positive.
"""
LIBRARY = "tissuq.experiments.modes."


def modes_page() -> str:
    """Return the page in Markdown: of the library's own modes, not of those that others have added."""
    library = [kind for kind in loading_modes().values() if kind.__module__.startswith(LIBRARY)]
    return "\n".join([HEAD, *map(_section, library)])


def _section(kind: type[LoadingMode]) -> str:
    controls = [f"{each.name} ({each.reference:g} at rest)" for each in kind.controls]
    return "\n".join(
        [
            f"## {kind.name}\n",
            (getdoc(kind) or "").replace("``", "`") + "\n",
            f"Set: {', '.join(controls)}. Measured: {', '.join(kind.stresses)}.\n",
        ]
    )
