"""Former names of options, which commands still take and no help shows: an option means one thing everywhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

__all__ = ["FORMER_NAMES", "todays_names"]

FORMER_NAMES: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "paper": {"--points": "--measurements", "--sampler": "--method"},
        "predict": {
            "--points": "--grid-points",
            "--material": "--user-law",
            "--stretch": "--at",
            "--stretch2": "--at2",
            "--stress-type": "--stress",
        },
        "population": {"--specimen": "--specimen-column"},
        "design": {"--points": "--measurements", "--specimen": "--next-specimen", "--material": "--user-law"},
        "export": {"--material": "--user-law"},
        "ensemble": {"--material": "--replace"},
        "structure": {"--material": "--user-law"},
        "simulate": {"--material": "--user-law"},
        "coverage": {"--noise": "--noise-is", "--noise-sd": "--noise-is"},
        "sbc": {"--noise": "--noise-is", "--noise-sd": "--noise-is", "--formulation": "--discrepancy"},
        "tissues": {"--formulation": "--discrepancy"},
    }
)
"""By command: the name today of every option that had another one."""


def todays_names(command: str, arguments: Sequence[str]) -> list[str]:
    """Return what was typed after a command, with every option under its name today."""
    names = FORMER_NAMES.get(command, {})
    options = [argument.partition("=") for argument in arguments]
    return [names.get(option, option) + equals + value for option, equals, value in options]
