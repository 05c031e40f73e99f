"""Settings that studies of measured files share: how a file is read, what is fitted, and errors of whole tests."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self, cast

from pydantic import Field, field_validator, model_validator

from tissuq.studies.option import Settings, only_rows, option, seed
from tissuq.studies.option_texts import column, columns_by_role, range_of, sd_or_unknown, tolerances
from tissuq.studies.settings import SizesOfErrors, positive_or_unknown, there_is

if TYPE_CHECKING:
    from tissuq.experiments.experiment import Experiment
    from tissuq.experiments.reading.experiment_file import Reading
    from tissuq.experiments.reading.options import ReadingOptions
    from tissuq.experiments.units import StressUnit
    from tissuq.model.noise import Noise
    from tissuq.model.tolerances import Tolerances

READING = "Reading files"
HELP_ON_AXIAL_STRETCH = (
    "Of a tube that was stretched along its axis, then inflated: length over undeformed length; to fit several files "
    "once for each [the file's]."
)
reading = partial(option, group=READING)
"""Declares an option of reading."""


class ReadingSettings(Settings):
    """The options of :func:`tissuq.read_experiment`."""

    mode: str | None = option(None, "Loading mode [as file and columns say, or uniaxial].")
    columns: dict[str, str | int] = reading(
        default_factory=dict,
        help="ROLE=COLUMN for stretch, strain, displacement, length, shear or twist, and stress, force or torque, or "
        "pressure, outer_diameter (or inner_diameter), axial_stretch and force (or total_force) of a tube, such as "
        "stretch=Strain, or stress=2:5 for columns of as many tests; of the "
        "spread of a mean: sd or sem, and n; repeat, of several files also a role. Of a second axis or stress: "
        "stretch2 ... sem2.",
        name="column",
        parse=columns_by_role,
    )
    stress_unit: str | None = reading(
        None, "Unit of the stress column [the file's, or MPa]; for forces, the unit shown [kPa]."
    )
    stress_type: str | None = reading(
        None,
        "engineering, cauchy (true), second-piola-kirchhoff, or torsion (as rheometers state it for a disc) [what the "
        "column's name says, or engineering].",
    )
    strain_type: str | None = reading(
        None, "engineering, true (logarithmic), green, almansi or angle (of shear) [likewise]."
    )
    strain_unit: str | None = reading(None, "Unit of a strain column: 1 or percent; of an angle of shear: rad or deg.")
    force_unit: str | None = reading(None, "Unit of a force, torque or pressure column that states none, such as mN.")
    displacement_unit: str | None = reading(None, "Unit of a displacement column that states none.")
    zero: str | None = reading(
        None, "Value from which displacements are counted ('35.2 mm'), or first: that of the first row."
    )
    mean_of: int | None = reading(
        None,
        "Number of specimens that the stresses are means of, for a column of standard deviations [the file's].",
        ge=2,
    )
    dimensions: dict[str, str] = reading(
        default_factory=dict,
        entries={
            "length": "Undeformed length, such as '20 mm' [the file's]; in mode biaxial that along x.",
            "area": "Undeformed cross-section, such as '10 mm2' [the file's].",
            "width": "With --thickness, instead of --area; in mode biaxial the size along y.",
            "thickness": "With --width, instead of --area; with --diameter of a tube its undeformed wall.",
            "diameter": "Of a round specimen, instead of --area; of a tube the undeformed outer one.",
        },
    )
    axial_stretch: float | None = reading(None, HELP_ON_AXIAL_STRETCH, gt=0)
    only: dict[str, str | int] = only_rows(READING)
    compression_positive: bool | None = reading(
        None, "Which the file counts as positive [its sign].", negative="tension-positive"
    )
    turn: str | None = reading(
        None, "Signs to change: load (of a cell that counts tension as negative), deformation or both."
    )
    load_zero: str | None = reading(
        None, "What the load cell reads without load ('0.02 N'), or first: the load of the first row."
    )
    cycle: str | int | None = reading(None, "Use only this cycle: first, last or its number [all].")
    branch: str | None = reading(None, "Use only loading or unloading [both].")
    compliance: str | None = reading(None, "Of the machine ('0.5 um/N'): what it gives way is taken off displacements.")
    leave_out: str | None = reading(None, "Lines of the file to leave out, such as 31,45:50.")
    preload: str | None = reading(
        None,
        "Force or stress at which the specimen is taut ('0.05 N'), or auto, where load begins: stretch 1 is there.",
    )
    stretch_range: tuple[float, float] | None = reading(
        None,
        "LOW:HIGH, the only stretches to use, such as 1:1.2 [all].",
        name="stretch",
        takes=str,
        parse=range_of("--stretch", "1:1.2"),
    )
    until_peak: bool = reading(False, "Leave out the rows after the largest stress.")
    relaxed: bool = reading(False, "Use only the last row of every rest: the relaxed stress of a test in steps.")
    incompressible: bool = reading(False, "Take a volume as constant that changes by a column of lateral strains.")
    every: int = reading(1, "Use only every N-th row [1].", ge=1)
    axis: str | None = reading(None, "x or y: the only axis to read from a biaxial machine's file.")
    sheet: str | int | None = reading(None, "Sheet of a workbook, by name or number.", parse=column)
    table: int | None = reading(None, "Which of several tables of a text or sheet, from 1.", ge=1)
    skip_rows: int = reading(0, "Lines to skip at the top of the file.", ge=0)

    @field_validator("columns", mode="before")
    @classmethod
    def _one_column_of_a_role(cls, columns: Any) -> Any:
        for role, names in columns.items() if isinstance(columns, dict) else ():
            if isinstance(names, list):
                raise ValueError(f"'{role}' is given {len(names)} times; give it once")
        return columns

    @property
    def reading_options(self) -> ReadingOptions:
        """How to read a file."""
        return cast("ReadingOptions", {name: getattr(self, name) for name in ReadingSettings.model_fields})


class MeasuredFile(ReadingSettings):
    """A file, and how to read it."""

    file: str
    name: str | None = None

    def reading(self, folder: Path = Path(), found: Reading | None = None) -> Reading:
        """Return what is read from the file, a relative one in ``folder``, unless that has been found already.

        It is named as the settings say, or as the file.
        """
        from tissuq.experiments.reading.experiment_file import read_file

        reading = found or read_file(folder / self.file, **self.reading_options)
        return replace(reading, experiment=reading.experiment.labelled(name=self.name or Path(self.file).stem))

    def mode_stated(self, folder: Path = Path()) -> str | None:
        """Return the loading mode that the settings, the file, its name or its columns say; None where none does."""
        from tissuq.experiments.reading.stated_mode import DEFAULT_SOURCE, mode_of
        from tissuq.experiments.reading.tables import read_table

        path, options = folder / self.file, self.reading_options | {"mode": self.mode or None}
        mode, source = mode_of(path, read_table(path, **options), options)
        return None if source == DEFAULT_SOURCE else str(getattr(mode, "name", mode))

    def experiment(self, folder: Path = Path()) -> Experiment:
        """Read the measurements; a relative file lies in ``folder``."""
        return self.reading(folder).experiment


class MeasuredTest(MeasuredFile):
    """One of several files that are fitted together."""

    specimen: str = ""
    direction: str = ""
    condition: str = ""
    noise_sd: float | None = Field(None, gt=0)

    def reading(self, folder: Path = Path(), found: Reading | None = None) -> Reading:
        """Return what is read from the file, with the specimen, the direction and the condition that are stated."""
        reading = super().reading(folder, found)
        stated = {"specimen": self.specimen, "direction": self.direction, "condition": self.condition}
        labels = {name: label for name, label in stated.items() if label}
        return replace(reading, experiment=reading.experiment.labelled(**labels))


class FittedSettings(Settings):
    """What is fitted, and by how much whole tests may be off; noise and errors are in the files' unit of stress."""

    material: str = option("neo-hookean", "Material, as for tissuq fit [neo-hookean]; see tissuq materials.")
    noise_sd: float | Literal["unknown"] | dict[str, float | Literal["unknown"]] = option(
        "unknown",
        "Sd of the noise, in the files' stress unit, or unknown; or of each specimen, such as a=0.1,b=0.2 (of others "
        "unknown).",
        takes=str,
        parse=sd_or_unknown,
    )
    noise: str | None = option(
        None,
        "Instead: unknown (errors of consecutive measurements correlated where the data say so), independent, "
        "autoregressive (correlated), proportional (grows with the stress) or repeats (same stretch again).",
    )
    method: str = option("auto", "auto, exact, nuts, smc or joint.", choices="tissuq.posterior.solver:Method")
    seed: int = seed()
    estimand: str | None = option(
        None,
        "What intervals are of: the specimen as-tested (no errors of the test), the specimen (errors of a careful "
        "laboratory), or the tissue (the mean of its specimens) [specimen; tissue for files of several specimens].",
    )
    tolerances: SizesOfErrors = option(
        None,
        "Error of a whole test (standard deviation) instead of that of the estimand: stress=10%, test=10%, length=2%, "
        "slack=0.01 (of stretch), smooth=2% (along the curve), zero=0.1 (in the stress unit), or of every single "
        "stretch=0.001 or stress, resolution=0.2% (of the largest); or none; repeat.",
        name="tolerance",
        takes=list[str],
        parse=tolerances,
    )

    _positive_or_unknown = field_validator("noise_sd", mode="before")(
        positive_or_unknown("the file's stress unit", "; noise of zero would make every measurement exact")
    )

    @field_validator("noise", mode="before")
    @classmethod
    def _is_no_size(cls, value: Any) -> Any:
        from tissuq.experiments.numbers import number_and_unit

        number, unit = number_and_unit(str(value))
        if unit == "%":
            raise ValueError("noise that grows with the stress is 'proportional', and how much is estimated")
        if number is not None:
            raise ValueError(
                f"says how the noise behaves, not how large it is: {value} is a standard deviation, which is given as "
                f"a number in the file's stress unit, such as --noise-sd {number:g} (noise_sd = {number:g} in a "
                "configuration)"
            )
        return value

    _known_noise = field_validator("noise")(there_is("tissuq.model.noise:unknown_noise_named"))
    _known_estimand = field_validator("estimand")(there_is("tissuq.model.tolerances:Tolerances"))

    @model_validator(mode="after")
    def _one_noise(self) -> Self:
        if self.noise is not None and self.noise_sd != "unknown":
            raise ValueError(f"give noise_sd or noise, not both (noise_sd is {self.noise_sd}, noise is '{self.noise}')")
        return self

    @model_validator(mode="after")
    def _one_set_of_errors(self) -> Self:
        from tissuq.model.tolerances import AS_TESTED

        if self.tolerances == {} and self.estimand not in (None, AS_TESTED):
            raise ValueError(
                f"the tolerance is none, and the estimand '{self.estimand}' has errors of the tests: give one of them "
                f"('{AS_TESTED}' has no errors)"
            )
        return self

    def noise_in(self, *units: StressUnit) -> Noise:
        """Return the noise of all, a known standard deviation converted from their unit, the first, to MPa."""
        from tissuq.model.noise import noise_named

        if isinstance(self.noise_sd, float):
            return noise_named(self.noise_sd * units[0].to_mpa)
        return noise_named(self.noise or "unknown")

    def tolerances_in(self, unit: StressUnit) -> Tolerances | dict[str, float] | None:
        """Return the tolerances, those of stresses converted from a unit to MPa.

        Where no estimand is given, the sizes that replace those of `tissuq.fit`, or None.
        """
        from tissuq.model.tolerances import Tolerances

        if self.tolerances is None and self.estimand is None:
            return None
        sizes = self.tolerances or {}
        is_stress = {error.name for error, _ in Tolerances(**sizes) if error.is_stress}
        scale = {name: unit.to_mpa if name in is_stress else 1.0 for name in sizes}
        in_mpa = {name: size * scale[name] for name, size in sizes.items()}
        return in_mpa if in_mpa and self.estimand is None else Tolerances(self.estimand or "", **in_mpa)
