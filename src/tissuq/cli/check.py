"""``tissuq check``: whether a law of the user's own can be used."""

from __future__ import annotations

from typing import Annotated

import typer

__all__ = ["check"]


def check(material: Annotated[str, typer.Argument(help="Your own law.py:Name, or the name of any material.")]) -> None:
    """Check a material: zero at the reference, derivatives, what is linear; status 2 where it fails."""
    from tissuq.mechanics import material_named
    from tissuq.mechanics.contract import checked

    found = material_named(material, laws=True)
    print(f"{found.name}\n    {found.formula}")
    print(f"    parameters: {', '.join(f'{p.symbol} ({p.unit})' if p.unit else p.symbol for p in found.parameters)}")
    for each in checked(found):
        print(f"    FAILS: {each.claim}: {each.problem}" if each.problem else f"    holds: {each.claim}")
