"""What is done with a run of ``tissuq fit``: the settings of a prediction and of a ranking of tests."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from tissuq.errors import InputError
from tissuq.studies.measured_file import MeasuredFile, ReadingSettings
from tissuq.studies.option import Settings, argument, option, seed

if TYPE_CHECKING:
    from tissuq.arrays import FloatArray
    from tissuq.mechanics import Material
    from tissuq.next_test.candidates import Candidate

POINTS = 101
"""Number of stretches of a band by default."""


class RunSettings(Settings):
    """What is done with a run of ``tissuq fit``."""

    run: str = argument(..., "Run folder of tissuq fit.", takes=Path)
    material: str | None = option(None, "Which of the laws of the run, where it compared several.")
    discrepancy: str | None = option(None, "Which of the discrepancies of the run [auto, or the only one].")

    def law_of(self, own: Material | None) -> str | Material | None:
        """Return the law of the run: the user's own, which was named beside the settings, or the name of another.

        Raises
        ------
        InputError
            When these are two.
        """
        if own is not None and self.material not in (None, own.name):
            raise InputError(f"--user-law names the law '{own.name}', and --material '{self.material}': give one law.")
        return own or self.material


class ComparedFile(MeasuredFile):
    """A file of measurements to compare with; its mode is that of the prediction."""

    mode: str = ""


class PredictionSettings(RunSettings):
    """Everything that a prediction depends on."""

    mode: str = option("", "Loading mode to predict [that of the data, or of the run]; see tissuq modes.")
    stretch: str | None = option(
        None, "Stretches (amounts of shear): a range 0.7:2.0, or a list 1.1,1.2,1.5 [where calibrated].", name="at"
    )
    stretch2: str | None = option(
        None, "Of the second control of a mode with two, such as biaxial; one number where it is held.", name="at2"
    )
    points: int = option(POINTS, "Stretches in a range.", name="grid-points", ge=2, le=10_001)
    prob: float = option(0.95, "Probability of the bands.", gt=0, lt=1)
    stress_type: Literal["engineering", "cauchy"] = option(
        "engineering", "Stress to predict: engineering or cauchy.", name="stress"
    )
    data: ComparedFile | None = option(
        None,
        "Measurements of that mode to compare with: a file or a built-in data set. The options of reading, and "
        "--data-stress-type, say how to read it.",
        entry="file",
        takes=Path,
        of=ReadingSettings,
        renamed={"stress_type": "data_stress_type", "stretch": "data_stretch", "mode": ""},
    )

    def mode_in(self, folder: Path, law: Material | None = None) -> str:
        """Return the mode to predict: the one asked for, that of the data, or else that of the run.

        ``law`` is the material of the run, where it is the user's own.

        Raises
        ------
        InputError
            When the data say that they are of another mode, or the run is of several modes.
        """
        from tissuq.experiments.modes import loading_mode
        from tissuq.studies.earlier_run import modes_of

        stated = None if self.data is None else self.data.mode_stated(folder)
        if self.mode and stated and loading_mode(self.mode) != loading_mode(stated):
            assert self.data is not None  # noqa: S101 (they told)
            raise InputError(
                f"'{self.data.file}' was measured in mode {stated}, but mode {self.mode} is to be "
                "predicted: leave --mode out, or give measurements of that mode."
            )
        modes = modes_of(folder / self.run, self.discrepancy, self.law_of(law))
        if not (self.mode or stated) and len(modes) > 1:
            raise InputError(
                f"run '{self.run}' has tests in several modes ({', '.join(modes)}): choose one with --mode."
            )
        return self.mode or stated or modes[0]

    def points_of(self, mode: str) -> FloatArray | None:
        """Return the points that were asked for, (g,) or (g, 2); None where none were.

        Raises
        ------
        InputError
            When a text is no list or range of numbers, or there is not one for every control of the mode.
        """
        import numpy as np

        from tissuq.experiments.modes import loading_mode

        controls = loading_mode(mode).controls
        asked = [text for text in (self.stretch, self.stretch2) if text is not None]
        if self.points != POINTS and asked and not any(":" in text for text in asked):
            raise InputError("--grid-points are those of a range, such as --at 0.7:2.0: leave them out, or give one.")
        if self.stretch2 is not None and len(controls) == 1:
            raise InputError(f"mode '{mode}' has one control, {controls[0].name}: leave --at2 out.")
        if len(controls) == 1 or self.stretch is self.stretch2 is None:
            return None if self.stretch is None else stretches(self.stretch, self.points)
        if self.stretch is None or self.stretch2 is None:
            names = " and ".join(control.name for control in controls)
            raise InputError(f"mode '{mode}' has two controls, {names}: give --at, and also --at2.")
        axis1 = stretches(self.stretch, self.points)
        axis2 = stretches(self.stretch2, len(axis1))
        if len(axis1) == 1 or len(axis2) == 1:
            axis1, axis2 = np.broadcast_arrays(axis1, axis2)
        if len(axis1) != len(axis2):
            raise InputError(
                f"--at has {len(axis1)} values and --at2 {len(axis2)}: give pairs of them, or one number "
                "for an axis that is held."
            )
        return np.column_stack([axis1, axis2])


class CandidateSettings(Settings):
    """A test that could be made, at any stretches."""

    mode: str
    stretch: tuple[float, ...] = Field(min_length=1)
    name: str = ""


class DesignSettings(RunSettings):
    """Everything that a ranking of tests depends on."""

    targets: tuple[str, ...] = option(
        ("modulus",),
        "Quantity to become less uncertain: modulus (initial shear modulus), a parameter, a stress as MODE:STRETCH, "
        "such as planar:1.5, or a quantity of your model as ensemble:FOLDER:NAME; repeat for more [modulus].",
        name="target",
        min_length=1,
    )
    candidates: tuple[str | CandidateSettings, ...] = option(
        (),
        "A test as 'MODE LOW:HIGH POINTS', such as 'planar 1:1.5 20'; repeat for more [every mode of one stretch, in "
        "several ranges].",
        name="candidate",
    )
    points: tuple[int, ...] = option(
        (),
        "Measurements of every default test; repeat for more [as many as the data, 10 to 40].",
        name="measurements",
    )
    specimen: Literal["same", "other"] | None = option(
        None,
        "The next test is of the same specimen or of another one [other where the fit has errors of tests, else same].",
        name="next-specimen",
    )
    seed: int = seed()

    @property
    def tests(self) -> list[Candidate]:
        """The candidates; empty for the default ones."""
        from tissuq.next_test.candidates import Candidate, candidate_named

        return [
            candidate_named(candidate)
            if isinstance(candidate, str)
            else Candidate(candidate.mode, candidate.stretch, candidate.name)
            for candidate in self.candidates
        ]


def stretches(text: str, points: int = POINTS) -> FloatArray:
    """Return the numbers that a text means: ``0.7:2.0`` so many from end to end, ``1.1,1.2,1.5`` these.

    Raises
    ------
    InputError
        When it is neither.

    Examples
    --------
    >>> stretches("1:2", points=3).tolist(), stretches("1.1, 1.5").tolist()
    ([1.0, 1.5, 2.0], [1.1, 1.5])
    """
    import numpy as np

    from tissuq.experiments.checked_arrays import check_no_percent

    is_range = ":" in text
    try:
        numbers = np.array([float(number) for number in text.split(":" if is_range else ",")])
    except ValueError:
        numbers = np.array([])
    is_good = len(numbers) == 2 and numbers[0] < numbers[1] if is_range else len(numbers) > 0
    if not is_good or not np.isfinite(numbers).all():
        raise InputError(
            f"'{text}' is not a range or list of stretches: write LOW:HIGH as 0.7:2.0, or a list as 1.1,1.2,1.5."
        )
    check_no_percent(text, float(numbers.min()), "0.7:2.0")
    return np.linspace(numbers[0], numbers[-1], points) if is_range else numbers
