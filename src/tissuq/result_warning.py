"""Warnings about results: a sentence, how severe it is, and what acts on it, as typed in Python and in the shell."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from enum import StrEnum
from types import MappingProxyType

__all__ = ["WARNING_CODES", "ResultWarning", "Severity", "in_shell", "merged", "most_severe_first"]


class Severity(StrEnum):
    """How severe a warning is."""

    PROBLEM = "problem"
    """The result must not be used as it is."""
    CAUTION = "caution"
    """The result may be off, or its interval too narrow."""
    NOTE = "note"
    """Good to know; the interval holds."""


WARNING_CODES: Mapping[str, str] = MappingProxyType(
    {
        "best-fit-target": "The discrepancy aims at the best fit of the material, not at its initial modulus.",
        "contradicting-tests": "Several tests contradict one material.",
        "correlated-residuals": "The residuals of consecutive measurements are correlated.",
        "doubtful-reading": "The file states no unit, or a column was read whose name says something else.",
        "few-measurements": "There are too few measurements to show how the stress deviates from the material.",
        "inaccurate-integral": "Numerical integration is inaccurate.",
        "inseparable-noise": "The data cannot separate noise from discrepancy.",
        "measurements": "Something in the file or in the course of the test is implausible.",
        "no-direction-looked-for": "A preferred direction is not looked for, because a test measured one axis alone.",
        "not-converged": "Sampling has not converged.",
        "not-near-reference": "Nothing is measured near the reference state.",
        "one-direction": "There is tension or compression only.",
        "poorly-determined": "The data determine the headline parameter poorly.",
        "prior-bound": "A bound of a prior, not the data, determines part of the result.",
        "prior-dominates": "A prior that was given determines the result as much as the data do, or more.",
        "stability-contradicted": "The data contradict the stability that was required.",
        "stress-at-rest": "There is stress at the reference state, which no elastic material has.",
        "tests-apart": "Several tests differ by more than tests of one tissue are assumed to.",
        "unmodelled-curve": "The fitted curve does not follow the measured one.",
        "unstable": "Material and discrepancy are more often unstable than stable over the measured range.",
    }
)
"""Every code that a warning has, with what it says; ``docs/warnings.md`` explains each."""


NUMBER = re.compile(r"(?<!\w)[-+]?\d[\d.]*(e[-+]?\d+)?")
"""A number in a sentence, but not one in a name such as C01."""


class ResultWarning(str):
    """A warning as a sentence, in the form that a person in Python can type.

    Parameters
    ----------
    text : str
        The sentence. A field such as ``{noise}`` stands for an option, here ``noise="autoregressive"`` in Python and
        ``--noise autoregressive`` in the shell.
    code : str
        One of `WARNING_CODES`.
    severity : Severity
    **options : str
        Values of the options in the text, by their names in Python.

    Attributes
    ----------
    code, severity
        As above.
    shell : str
        The sentence in the form that a person at a shell can type.

    Examples
    --------
    >>> text = "the residuals are correlated: fit with {noise}."
    >>> warning = ResultWarning(text, "correlated-residuals", noise="autoregressive")
    >>> print(warning)
    the residuals are correlated: fit with noise="autoregressive".
    >>> warning.shell
    'the residuals are correlated: fit with --noise autoregressive.'
    """

    code: str
    severity: Severity
    shell: str

    def __new__(
        cls, text: str, code: str = "measurements", severity: Severity = Severity.CAUTION, **options: str
    ) -> ResultWarning:
        """Return the sentence with its options in both forms."""
        if code not in WARNING_CODES:
            raise ValueError(f"'{code}' is no code of a warning; add it to WARNING_CODES and docs/warnings.md.")
        python = {name: f'{name}="{value}"' for name, value in options.items()}
        shell = {name: f"--{name.replace('_', '-')} {value}" for name, value in options.items()}
        warning = super().__new__(cls, text.format(**python) if options else text)
        warning.code, warning.severity = code, severity
        warning.shell = text.format(**shell) if options else text
        return warning

    def of(self, names: Iterable[str]) -> ResultWarning:
        """Return the same warning with the names of what it concerns at its start."""
        start = f"{', '.join(names)}: "
        return self._written(start + self, start + self.shell, self.severity)

    def as_note(self) -> ResultWarning:
        """Return the same warning as a note."""
        return self._written(str(self), self.shell, Severity.NOTE)

    def _written(self, python: str, shell: str, severity: Severity) -> ResultWarning:
        warning = ResultWarning(python, self.code, severity)
        warning.shell = shell
        return warning


def in_shell(warning: str) -> str:
    """Return a warning in the form of the shell."""
    return warning.shell if isinstance(warning, ResultWarning) else warning


def merged(warnings: Mapping[str, Iterable[ResultWarning]], *, named: bool = False) -> list[ResultWarning]:
    """Return the warnings about several results, one of each text with the names of those that it concerns.

    The numbers in it are those of the first. Of a single result they are as they are, unless it is to be ``named``.
    """
    if len(warnings) == 1 and not named:
        return list(next(iter(warnings.values())))
    concerned: dict[tuple[str, str], dict[str, ResultWarning]] = {}
    for name, of_result in warnings.items():
        for warning in of_result:
            concerned.setdefault((warning.code, NUMBER.sub("", warning)), {}).setdefault(name, warning)
    return [next(iter(by_name.values())).of(by_name) for by_name in concerned.values()]


def most_severe_first(warnings: Iterable[str]) -> list[ResultWarning]:
    """Return warnings in the order of their severity; plain sentences are cautions about the measurements."""
    order = list(Severity)
    known = [text if isinstance(text, ResultWarning) else ResultWarning(text) for text in warnings]
    return sorted(known, key=lambda warning: order.index(warning.severity))
