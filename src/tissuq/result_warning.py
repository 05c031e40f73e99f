"""Warnings about results: a sentence, how severe it is, and what acts on it, as typed in Python and in the shell."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from enum import StrEnum
from json import dumps
from types import MappingProxyType


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
        "not-converged": "Sampling has not converged.",
        "doubtful-reading": "The file states no unit, or a column was read whose name says something else.",
        "large-noise": "The noise that was given is larger than every stress of a test.",
        "stress-at-rest": "There is stress at the reference state, which no elastic material has.",
        "large-drift": "Back at the first stretch, the stress is another one by more than 15 % of the largest.",
        "tests-apart": "Several tests differ by more than tests of one tissue are assumed to.",
        "contradicting-tests": "Several tests contradict one material.",
        "unmodelled-curve": "The fitted curve does not follow the measured one.",
        "measurements": "Something in the file or in the course of the test is implausible.",
        "few-measurements": "There are too few measurements to show how the stress deviates from the material.",
        "slack": "The specimen bears no load at the beginning of the test.",
        "unstable": "Material and discrepancy are stable in fewer than half of the draws over the measured range.",
        "best-fit-target": "The discrepancy aims at the best fit of the material, not at its initial modulus.",
        "no-discrepancy": "No error of the forward model is allowed for.",
        "free-discrepancy": "The discrepancy beside a forward model is learnt from one experiment.",
        "inaccurate-emulator": "The emulator of an expensive model is inaccurate where the posterior is.",
        "stability-contradicted": "The data contradict the stability that was required.",
        "prior-bound": "A bound of a prior, not the data, determines part of the result.",
        "prior-dominates": "A prior that was given determines the result as much as the data do, or more.",
        "standard-errors-left-out": "Standard errors of means that the data state are not in the intervals.",
        "sharp-prior": "A prior that was given is as sharp as the error that all tests have in common.",
        "correlated-residuals": "The residuals of consecutive measurements are correlated.",
        "inaccurate-integral": "Numerical integration is inaccurate.",
        "not-near-reference": "Nothing is measured near the reference state.",
        "poorly-determined": "The data determine the headline parameter poorly.",
        "one-direction": "There is tension or compression only.",
        "no-direction-looked-for": "A preferred direction is not looked for, because a test measured one axis alone.",
        "inseparable-parameters": "Other parameters of the material give the same stresses in the measured tests.",
        "inseparable-noise": "The data cannot separate noise from discrepancy.",
    }
)
"""Every code that a warning has, with what it says, from what matters most; ``docs/warnings.md`` explains each."""


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
    symbols : sequence of str
        The parameters that it is about, where it names some.
    **options : str, int or True
        Values of the options in the text, by their names in Python.

    Attributes
    ----------
    code, severity, symbols
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
    symbols: tuple[str, ...]
    shell: str

    def __new__(
        cls,
        text: str,
        code: str = "measurements",
        severity: Severity = Severity.CAUTION,
        symbols: Iterable[str] = (),
        **options: str | int,
    ) -> ResultWarning:
        """Return the sentence with its options in both forms."""
        if code not in WARNING_CODES:
            raise ValueError(f"'{code}' is no code of a warning; add it to WARNING_CODES and docs/warnings.md.")
        python = {
            name: f"{name}={dumps(value) if isinstance(value, str) else value}" for name, value in options.items()
        }
        shell = {
            name: f"--{name.replace('_', '-')}{'' if value is True else f' {value}'}" for name, value in options.items()
        }
        warning = super().__new__(cls, text.format(**python) if options else text)
        warning.code, warning.severity, warning.symbols = code, severity, tuple(symbols)
        warning.shell = text.format(**shell) if options else text
        return warning

    def of(self, names: Iterable[str]) -> ResultWarning:
        """Return the same warning with the names of what it concerns at its start."""
        start = f"{', '.join(names)}: "
        return self._written(start + self, start + self.shell, self.severity)

    def in_python(self, text: str) -> ResultWarning:
        """Return the same warning as a person in Python can type it."""
        return self._written(text, self.shell, self.severity)

    def as_note(self) -> ResultWarning:
        """Return the same warning as a note."""
        return self._written(str(self), self.shell, Severity.NOTE)

    def with_end(self, end: str) -> ResultWarning:
        """Return the same warning with more words at its end."""
        return self._written(self + end, self.shell + end, self.severity)

    def _written(self, python: str, shell: str, severity: Severity) -> ResultWarning:
        warning = ResultWarning(python, self.code, severity, self.symbols)
        warning.shell = shell
        return warning


def has_code(warnings: Iterable[str], code: str) -> bool:
    """Whether some warning is of a code; plain sentences have none."""
    return any(isinstance(warning, ResultWarning) and warning.code == code for warning in warnings)


def symbols_in(warnings: Iterable[ResultWarning], code: str) -> tuple[str, ...]:
    """Return the parameters that the warnings of a code are about, each of them once."""
    return tuple(dict.fromkeys(symbol for w in warnings if w.code == code for symbol in w.symbols))


def in_shell(warning: str) -> str:
    """Return a warning in the form of the shell."""
    return warning.shell if isinstance(warning, ResultWarning) else warning


def merged(
    warnings: Mapping[str, Iterable[ResultWarning]], *, named: bool = False, everyone: str = ""
) -> list[ResultWarning]:
    """Return the warnings about several results, one of each text with the names of those that it concerns.

    Texts that differ in numbers alone are one, with the numbers of the first. Of a single result they stand without its
    name, unless it is to be ``named``; ``everyone`` stands for the names of all.

    Examples
    --------
    >>> slack = {name: [ResultWarning(f"{count} rows are slack.")] for name, count in (("A", 3), ("B", 4))}
    >>> print(*merged(slack, everyone="all tests"))
    all tests: 3 rows are slack. (The numbers are those of the first.)
    """
    concerned: dict[tuple[str, str], list[tuple[str, ResultWarning]]] = {}
    for name, of_result in warnings.items():
        for warning in of_result:
            concerned.setdefault((warning.code, NUMBER.sub("", warning)), []).append((name, warning))
    texts = []
    for group in concerned.values():
        names, (warning, *repeats) = dict.fromkeys(name for name, _ in group), [of_name for _, of_name in group]
        if any(repeated != warning for repeated in repeats):
            warning = warning.with_end(" (The numbers are those of the first.)")
        if named or len(warnings) > 1:
            warning = warning.of([everyone] if everyone and len(names) == len(warnings) else names)
        texts.append(warning)
    return texts


def most_severe_first(warnings: Iterable[str]) -> list[ResultWarning]:
    """Return warnings by severity, then as their codes matter; plain sentences are cautions about the measurements."""
    severities, codes = list(Severity), list(WARNING_CODES)
    coded = [text if isinstance(text, ResultWarning) else ResultWarning(text) for text in warnings]
    return sorted(coded, key=lambda warning: (severities.index(warning.severity), codes.index(warning.code)))
