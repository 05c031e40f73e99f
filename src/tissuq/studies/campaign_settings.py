"""What campaigns say on the command line of all that they depend on; `tissuq.validation` adds the rest."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, FiniteFloat

from tissuq.parameters.checks import MAX_SEED
from tissuq.studies.option import Settings, argument, option, seed
from tissuq.studies.option_texts import pairs_of, priors, tolerances
from tissuq.studies.settings import SizesOfErrors, imported

NoiseKnown = Annotated[
    tuple[Literal["known", "unknown"], ...],
    BeforeValidator(lambda value: (value,) if isinstance(value, str) else value),
]
NOISE = "known or unknown to the fits."


def each_once(values: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the values of a setting, of which none is given twice."""
    for index, value in enumerate(values):
        if value in values[:index]:
            raise ValueError(f"{value} is given twice, which would count the same fits twice")
    return values


def names_among(available: Collection[str], what: str) -> Callable[[tuple[str, ...]], tuple[str, ...]]:
    """Return a validator of names of something, which must be among those that there are."""

    def check(names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            if name not in available:
                raise ValueError(f"there is no {what} '{name}'; choose from {', '.join(available)}")
        return names

    return check


class PaperOptions(Settings):
    """The study of the paper; stresses in MPa."""

    points: int = option(30, "Number of measurements.", name="measurements", ge=6, le=10_000)
    noise_sd: float = option(
        0.5,
        "Standard deviation of the noise, MPa [0.5]. If the paper's 0.5 is a variance, this is 0.7071.",
        unit="MPa",
        gt=0,
        allow_inf_nan=False,
    )
    priors: dict[str, dict[str, Any]] = option(
        help="A prior in MPa, such as c=uniform(0,10); repeat for more.",
        default_factory=dict,
        name="prior",
        parse=priors,
        validate_default=True,
    )
    truth: dict[str, FiniteFloat] = option(
        help="A parameter of the measured Yeoh material, MPa [C10=1.2, C20=-0.057, C30=0.004]; repeat for more.",
        default_factory=dict,
        name="true-value",
        parse=pairs_of("--true-value", "a parameter of the Yeoh material", "NAME=VALUE, as in C10=0.6"),
        validate_default=True,
    )
    seed: int = option(2021, "Seed of noise and draws.", ge=0, le=MAX_SEED)
    sampler: Literal["exact", "nuts", "both"] = option("exact", "exact, nuts or both.", name="method")
    replicates: int = option(1, "Data sets over which every claim is checked.", ge=1, le=10_000)


class CoverageOptions(Settings):
    """A campaign that counts how often intervals hold."""

    replicates: int = option(50, "Data sets of every family [50, or as the preset says].", ge=1, le=100_000)
    noise: NoiseKnown = option(("known",), NOISE, name="noise-is", takes=str, min_length=1)
    seed: int = seed()


class SbcOptions(Settings):
    """A campaign of calibration by simulation."""

    replicates: int = option(300, "Data sets of every formulation.", ge=20, le=100_000)
    noise: NoiseKnown = option(("known", "unknown"), NOISE, name="noise-is", takes=str, min_length=1)
    seed: int = seed()
    material: str = option("neo-hookean", "The material that is calibrated.")
    formulations: tuple[str, ...] = option(
        help="Discrepancy; repeat for more [all of them].",
        default_factory=lambda: tuple(imported("tissuq.model.discrepancy:discrepancies")()),
        name="discrepancy",
        min_length=1,
    )


class TissueOptions(Settings):
    """A benchmark on measured tests."""

    folder: str | None = argument(
        None,
        "Folder with a CSV file for each set of tests [the sets of tissuq].",
        takes=Path,
        parse=lambda folder: str(folder.resolve()),
    )
    sets: tuple[str, ...] = option((), "A set to take; repeat for more [all of them].", name="dataset")
    protocols: tuple[str, ...] = option(
        ("tests", "specimens", "ends"),
        "What is predicted: tests, modes, specimens, ends, halves; repeat for more [tests, specimens, ends].",
        name="protocol",
        min_length=1,
    )
    formulations: tuple[str, ...] = option(
        ("auto", "none"), "Discrepancy, or embedded; repeat for more [auto, none].", name="discrepancy", min_length=1
    )
    material: str = option("neo-hookean", "The material that is fitted.")
    tolerances: SizesOfErrors = option(
        None,
        "Error of a test, as of tissuq fit (stresses in MPa): stress=10%, smooth=2% ...; or none.",
        name="tolerance",
        takes=list[str],
        parse=tolerances,
    )
    predictions: int = option(12, "Predictions at most of a set and protocol.", ge=1)


class StructureStudyOptions(Settings):
    """A campaign on the force of structures whose law is known to us."""

    truths: tuple[str, ...] = option(
        ("gent", "ogden"), "Law of the truth; repeat for more.", name="truth", min_length=1
    )
    structures: tuple[str, ...] = option(
        ("bar", "indentation", "plate"),
        "Structure; repeat for more [bar, indentation, plate].",
        name="structure",
        min_length=1,
    )
    replicates: int = option(60, "Sets of tests of every law.", ge=1, le=100_000)
    modes: tuple[str, ...] = option(
        ("uniaxial", "planar"), "Loading mode of a test; repeat for more [uniaxial, planar].", name="mode", min_length=1
    )
    low: float = option(0.8, "Smallest stretch of uniaxial tests.", ge=0.3, lt=1)
    high: float = option(1.25, "Largest stretch of all tests, or 1 + the largest amount of shear.", gt=1, le=1.3)
    points: int = option(24, "Measurements of a test.", name="measurements", ge=6, le=10_000)
    noise: float = option(0.01, "Noise over the largest stress of a test.", name="noise-share", gt=0, le=0.5)
    estimand: str = option("specimen", "Whose errors of tests are simulated and told to the fits, as of tissuq fit.")
    draws: int = option(64, "Draws of a posterior.", ge=8)
    full_runs: int | None = option(8, "Draws computed in full; the others follow to first order, much faster.", ge=4)
    steps: int = option(2, "Steps of the force.", ge=1)
    seed: int = seed()
