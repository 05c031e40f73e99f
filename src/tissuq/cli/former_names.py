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
            "--stretch": "--at",
            "--stretch2": "--at2",
            "--stress-type": "--stress",
        },
        "population": {"--specimen": "--specimen-column"},
        "design": {"--points": "--measurements", "--specimen": "--next-specimen"},
        "ensemble": {"--material": "--replace"},
        "coverage": {"--noise": "--noise-is", "--noise-sd": "--noise-is"},
        "sbc": {"--noise": "--noise-is", "--noise-sd": "--noise-is", "--formulation": "--discrepancy"},
        "tissues": {"--formulation": "--discrepancy"},
    }
)
"""By command: the name today of every option that had another one."""


OF_RUN = "predict", "design", "export", "structure", "simulate"
"""Commands in which ``--material law.py:Name`` was what ``--user-law`` is; a law by its name is one of the run's."""


def todays_names(command: str, arguments: Sequence[str]) -> list[str]:
    """Return what was typed after a command, with every option under its name today."""
    names = FORMER_NAMES.get(command, {})
    options = [argument.partition("=") for argument in arguments]
    todays = []
    for (option, equals, value), following in zip(options, [*arguments, ""][1:], strict=True):
        is_own_law = command in OF_RUN and option == "--material" and ".py:" in (value if equals else following)
        todays.append(("--user-law" if is_own_law else names.get(option, option)) + equals + value)
    return todays
