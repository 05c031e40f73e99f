"""Former names of options, which commands still take and no help shows: an option means one thing everywhere."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from typer.core import TyperCommand

__all__ = ["FORMER_NAMES", "Renamed"]

FORMER_NAMES: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "paper": {"--points": "--measurements", "--sampler": "--method"},
        "predict": {"--points": "--grid-points", "--material": "--user-law"},
        "population": {"--specimen": "--specimen-column"},
        "design": {"--points": "--measurements", "--specimen": "--next-specimen", "--material": "--user-law"},
        "export": {"--material": "--user-law"},
        "structure": {"--material": "--user-law"},
        "simulate": {"--material": "--user-law"},
        "coverage": {"--noise": "--noise-sd"},
        "sbc": {"--noise": "--noise-sd", "--formulation": "--discrepancy"},
        "tissues": {"--formulation": "--discrepancy"},
    }
)
"""By command: the name today of every option that had another one."""


class Renamed(TyperCommand):
    """A command that takes its options under their former names, too."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Return what Click leaves of the arguments, former names replaced."""
        return super().parse_args(ctx, [_today(argument, FORMER_NAMES.get(self.name or "", {})) for argument in args])


def _today(argument: str, names: Mapping[str, str]) -> str:
    option, equals, value = argument.partition("=")
    return names.get(option, option) + equals + value
