"""What the command line knows of files and messages, which the page uses, too: given to it, not imported."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

if TYPE_CHECKING:
    from tissuq.experiments.reading.experiment_file import Reading

__all__ = ["Proposal", "ShellForms"]


class Proposal(Protocol):
    """What a message proposes: options of the command line, some of whose values a person must type."""

    @property
    def text(self) -> str:
        """The options as they are typed."""

    @property
    def options(self) -> tuple[tuple[str, str], ...]:
        """The options with their values."""

    @property
    def asked_for(self) -> tuple[str, ...]:
        """The options whose values a person must type: sizes."""

    @property
    def leaves_out(self) -> str:
        """The setting that it takes away."""


class ShellForms(NamedTuple):
    """Functions of the command line.

    Parameters
    ----------
    measured : callable
        From files, settings of reading, modes, specimens and noise to the settings of a fit and what was read.
    find_tests : callable
        From a file and settings of reading to the settings and the reading of every test in it.
    proposals_in : callable
        From a message, the names of columns and the settings to what the message proposes.
    with_proposal : callable
        From settings and a proposal to the settings with it.
    run_name : callable
        From files, no recipe and the files of all tests to the name of the run's folder.
    """

    measured: Callable[..., tuple[dict[str, Any], list[Reading | None]]]
    find_tests: Callable[..., list[tuple[dict[str, Any], Reading]]]
    proposals_in: Callable[[str, Sequence[str], Mapping[str, Any]], Sequence[Proposal]]
    with_proposal: Callable[[Mapping[str, Any], Any], dict[str, Any]]
    run_name: Callable[[Sequence[Path], None, Sequence[Path]], str]

    def tests_in(
        self, files: Sequence[Path], reading: Mapping[str, Any], modes: Sequence[str | None]
    ) -> list[tuple[dict[str, Any], Reading]]:
        """Return the settings and the reading of every test in some files."""
        return [
            test
            for file, mode in zip(files, modes, strict=True)
            for test in self.find_tests(file, {**reading, "mode": mode}, is_only_file=len(files) == 1)
        ]
