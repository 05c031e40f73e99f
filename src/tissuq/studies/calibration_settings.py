"""What a calibration of an expensive model depends on."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Self

from pydantic import field_validator, model_validator

from tissuq.studies.finite_element_settings import ModelSettings
from tissuq.studies.option import argument, only_rows, option, seed
from tissuq.studies.option_texts import column, number_or_text, pairs_of, priors, sd_or_unknown
from tissuq.studies.settings import positive_or_unknown

if TYPE_CHECKING:
    from tissuq.emulation.deck_forward import DeckForward
    from tissuq.emulation.forward import Forward
    from tissuq.parameters.priors import Prior

OWN = "Your own finite-element model"
NUMBER = r"\d+\.?\d*"
RANGE = re.compile(rf"{NUMBER}:{NUMBER}")
"""Smallest and largest stretch."""


class OfModel(NamedTuple):
    """What a finite-element model gives, and what of it the controls are: the time of the model, if empty."""

    names: tuple[str, ...]
    controlled: str


class CalibrationSettings(ModelSettings):
    """Everything that a calibration depends on, in the units of the forward model.

    With ``model``, what was measured is in the units of the file.
    """

    files: tuple[str, ...] = argument(
        ...,
        "CSV or Excel file with a column of controls and one of measured values (with several --qoi one of each name); "
        "of several experiments a file each.",
        takes=list[Path],
        min_length=1,
    )
    forward: str | None = option(
        None, "Function of the model: file.py:function or package.module:function. Its code is run."
    )
    umbridge: str | None = option(None, "Instead: address of an UM-Bridge server, such as http://localhost:4242.")
    server_model: str = option("forward", "Name of the model on that server.")
    models: tuple[str, ...] = option(
        (),
        "Instead: your finite-element model, a deck as of tissuq ensemble; of several files one each, in their order.",
        name="model",
        takes=list[Path],
        group=OWN,
    )
    replaced: tuple[str, ...] = option(
        (),
        "Name (ANSYS: number) of the material in it whose card follows the parameters; of several models one for all, "
        "or one each.",
        name="replace",
        group=OWN,
    )
    quantities: dict[str, str] = option(
        default_factory=dict,
        help="What was measured: NAME=RF3@SET and the like, as of tissuq ensemble; repeat for more.",
        name="qoi",
        parse=pairs_of("--qoi", "a quantity of interest", "NAME=WHAT, as in force=RF3@TOP"),
        group=OWN,
    )
    along: dict[str, str] = option(
        default_factory=dict,
        help="What the controls are: NAME=U3@SET and the like [the time of the model].",
        parse=pairs_of("--along", "what the controls are", "NAME=WHAT, as in depth=U3@TOP"),
        group=OWN,
    )
    factors: dict[str, float] = option(
        default_factory=dict,
        help="What the model's value of --qoi or --along is multiplied with: NAME=-4 for the other sign and a quarter "
        "of the body. Units of forces, lengths and stresses are converted without it.",
        name="factor",
        parse=pairs_of("--factor", "a factor", "NAME=NUMBER, as in force=-4", number_or_text),
        group=OWN,
    )
    priors: dict[str, dict[str, Any]] = option(
        default_factory=dict,
        help="Prior of a parameter in the model's units, such as C10=uniform(0.1,5); repeat for each.",
        name="prior",
        parse=priors,
    )
    prior_correlations: dict[str, float] = option(
        default_factory=dict,
        help="Correlation of the priors of two parameters, normal or log-normal (then of logarithms): A,B=-0.5.",
        name="prior-correlation",
        parse=pairs_of("--prior-correlation", "a correlation", "A,B=NUMBER, as in mu1,alpha1=-0.5", number_or_text),
    )
    prior_run: str | None = option(
        None,
        "Run folder of tissuq fit: the priors of the parameters of --material are its posterior.",
        takes=Path,
    )
    control: str | int | None = option(
        None, "Column of the control [the first of two; with several --qoi the only other one].", parse=column
    )
    measured: str | int | None = option(None, "Column of the measured values [the second of two].", parse=column)
    discrepancy: str = option(
        "gp-pinned", "The model's error: gp-pinned (zero with its slope at zero load), gp, or none [gp-pinned]."
    )
    noise_sd: float | Literal["unknown"] | dict[str, float | Literal["unknown"]] = option(
        "unknown",
        "Sd of the noise, in the unit of the measured values, or unknown; with several --qoi NAME=SD,NAME=SD.",
        takes=str,
        parse=sd_or_unknown,
    )
    zero_load: float = option(0.0, "Control at zero load.")
    runs: int = option(40, "Runs of the model over the priors.", ge=1)
    refine: int = option(0, "Further runs at most, where the posterior is and the emulator unsure.", ge=0)
    design: str = option("sobol", "sobol or latin.", choices="tissuq.emulation.runs:PointSet")
    kernel: str = option(
        "squared-exponential",
        "squared-exponential or matern-5/2.",
        choices="tissuq.emulation.kriging:Kernel",
    )
    trend: str = option("linear", "Mean: constant, linear or quadratic.", choices="tissuq.emulation.kriging:Trend")
    method: str = option("auto", "auto, importance or nuts.", choices="tissuq.emulation.problem:Method")
    material: str | None = option(
        None, "Law in the model with all its parameters: predict, export and structure then take the run."
    )
    range: str | None = option(None, "With --material: smallest and largest stretch, such as 0.7:1.3.")
    mode: str = option("uniaxial", "With --material: loading mode of the range.")
    only: dict[str, str | int] = only_rows()
    leave_out: str | None = option(None, "Lines of the file to leave out, such as 31,45:50.")
    every: int = option(1, "Use only every N-th row.", ge=1)
    sheet: str | int | None = option(None, "Sheet of an Excel workbook, by name or number.", parse=column)
    skip_rows: int = option(0, "Lines to skip at the top of the file.", ge=0)
    seed: int = seed()

    _positive_or_unknown = field_validator("noise_sd", mode="before")(
        positive_or_unknown("the unit of the measured values")
    )

    @model_validator(mode="before")
    @classmethod
    def _of_earlier_versions(cls, values: Any) -> Any:
        """Take what a single file and a single model were called, and a model on a server."""
        if not isinstance(values, dict):
            return values
        former = {"file": "files", "model": "server_model" if values.get("umbridge") else "models"}
        values = {former.get(name, name): value for name, value in values.items()}
        several = ("files", "models", "replaced")
        return {
            name: [value] if name in several and isinstance(value, str) else value for name, value in values.items()
        }

    @model_validator(mode="after")
    def _one_model(self) -> Self:
        if sum(bool(source) for source in (self.forward, self.umbridge, self.models)) != 1:
            raise ValueError("give one forward model: a function in a file (--forward), a server (--umbridge) or a "
                             "deck (--model)")  # fmt: skip
        if not self.priors and self.prior_run is None:
            raise ValueError("give the prior of every parameter of the model, as in C10=uniform(0.1, 5), or a run "
                             "whose posterior they are (--prior-run)")  # fmt: skip
        if self.prior_run is not None and self.material is None:
            raise ValueError(
                "a run as prior (--prior-run) needs the law in the forward model, whose posterior it is (--material)"
            )
        self._check_deck()
        self._check_noise()
        if (self.material is None) != (self.range is None):
            raise ValueError("the law of the forward model and its stretches belong together: give --material LAW "
                             "--range 0.7:1.3")  # fmt: skip
        if self.range is not None and not RANGE.fullmatch(self.range):
            raise ValueError(f"range must be the smallest and the largest stretch, such as 0.7:1.3, not {self.range!r}")
        return self

    def _check_deck(self) -> None:
        names = [*self.quantities, *self.along]
        if not self.models:
            if len(self.files) > 1:
                raise ValueError("several files need a finite-element model each (model)")
            if named := [name for name in ("replaced", "quantities", "along", "factors") if getattr(self, name)]:
                raise ValueError(f"{', '.join(named)} belong to a finite-element model: give it, too (model)")
            return
        missing = {"replaced": "--replace NAME", "quantities": "--qoi force=RF3@SET", "material": "--material LAW",
                   "range": "--range 0.7:1.3"}  # fmt: skip
        if lacking := [text for name, text in missing.items() if not getattr(self, name)]:
            raise ValueError(f"a finite-element model needs {', '.join(lacking)}, too")
        if len(self.models) != len(self.files):
            raise ValueError(
                f"every file has its model, in the same order: there are {len(self.files)} files and "
                f"{len(self.models)} models"
            )
        if len(self.replaced) not in (1, len(self.models)):
            raise ValueError(f"give --replace once for all models, or for each of the {len(self.models)}")
        if len(self.along) > len(self.models):
            raise ValueError("all quantities of a model have the same controls: give at most one --along for each")
        if len(self.quantities) < len(self.models):
            raise ValueError(
                f"every model gives something that was measured: give --qoi for each of {len(self.models)}"
            )
        if len(set(names)) < len(names):
            raise ValueError(f"what was measured and its control are both called {names[0]}: rename one")
        if unknown := [name for name in self.factors if name not in names]:
            raise ValueError(f"factors are of {' and '.join(names)}, not of {', '.join(unknown)}")

    def _check_noise(self) -> None:
        several = self.measured_names != ("",)
        if isinstance(self.noise_sd, dict) and (not several or set(self.noise_sd) - set(self.quantities)):
            owners = ", ".join(self.quantities) if several else "one quantity, and has no name"
            raise ValueError(f"the noise (noise_sd) is of {owners}; it is given for {', '.join(self.noise_sd)}")
        if several and isinstance(self.noise_sd, float):
            sds = ",".join(f"{name}=SD" for name in self.quantities)
            raise ValueError(f"every quantity has a noise of its own: --noise-sd {sds}, or unknown")
        if several and self.measured is not None:
            raise ValueError("the columns of several quantities are called as these are: leave out measured")

    @property
    def measured_names(self) -> tuple[str, ...]:
        """What was measured, by name; the name of a single quantity is empty."""
        return tuple(self.quantities) if len(self.quantities) > 1 else ("",)

    @property
    def noises(self) -> dict[str, float | str]:
        """The standard deviation of the noise of everything that was measured."""
        noise_of_quantity = (
            self.noise_sd if isinstance(self.noise_sd, dict) else dict.fromkeys(self.measured_names, self.noise_sd)
        )
        return {name: noise_of_quantity.get(name, "unknown") for name in self.measured_names}

    @property
    def stretches(self) -> tuple[float, float]:
        """The smallest and the largest stretch in the forward model."""
        low, high = str(self.range).split(":")
        return float(low), float(high)

    def forward_model(
        self,
        beside: Path = Path(),
        units: Mapping[str, tuple[str, str]] = MappingProxyType({}),
        experiments: Sequence[OfModel] = (),
        **running: Any,
    ) -> Forward:
        """Return what is run.

        Parameters
        ----------
        beside : Path
            Where the files of a finite-element model lie, unless their names are absolute.
        units : mapping of str to (str, str)
            Of control and measured values in the file, by the names of `measured_names`; empty where it does not say,
            which is refused for quantities that have a unit in a finite-element model.
        experiments : sequence of OfModel
            What each finite-element model gives.
        **running
            How a finite-element model is run: fields of `tissuq.DeckForward`.
        """
        from tissuq.emulation import FileForward, SeveralModels, UmbridgeForward

        if self.umbridge:
            return UmbridgeForward(self.umbridge, self.server_model)
        if not self.models:
            return FileForward(str(self.forward))
        replaced = self.replaced * (len(self.models) if len(self.replaced) == 1 else 1)
        decks = [
            self._deck_forward(beside / model, of_model, material, units, beside, running)
            for model, of_model, material in zip(self.models, experiments, replaced, strict=True)
        ]
        pairs = zip([of_model.names for of_model in experiments], decks, strict=True)
        return decks[0] if len(decks) == 1 else SeveralModels(tuple(pairs))

    def _deck_forward(
        self,
        model: Path,
        of_model: OfModel,
        replaced: str,
        units: Mapping[str, tuple[str, str]],
        beside: Path,
        running: Mapping[str, Any],
    ) -> DeckForward:
        from tissuq.decks.quantity import located
        from tissuq.emulation import DeckForward
        from tissuq.emulation.deck_forward import check_unit_of_function, conversion
        from tissuq.errors import InputError
        from tissuq.experiments.units import LENGTH

        cards = self.card_settings()
        unit_of = {name or next(iter(self.quantities)): units.get(name, ("", ""))[1] for name in of_model.names}
        quantities = {name: located(self.quantities[name], beside) for name in unit_of}
        factors = {
            name: self.factors.get(name, 1.0) * conversion(self.quantities[name], cards, unit)
            for name, unit in unit_of.items()
        }
        is_one, control_unit = len(quantities) == 1, units.get(of_model.names[0], ("", ""))[0]
        controlled, along = of_model.controlled, self.along.get(of_model.controlled)
        compared = [(name, self.quantities[name], unit) for name, unit in unit_of.items()]
        for name, text, unit in [*compared, *([(controlled, along, control_unit)] if along else [])]:
            if name not in self.factors:
                check_unit_of_function(name, text, cards, unit)
        if along is None and LENGTH.factor_or_none(control_unit):
            raise InputError(
                f"the controls of the file are lengths ({control_unit}), and would be compared with the time of the "
                "model: say which displacement of it they are, as in --along depth=U3@SET; where the time itself is "
                "meant, leave the unit out of the heading."
            )
        return DeckForward(
            model,
            replaced,
            str(self.material),
            next(iter(quantities.values())) if is_one else quantities,
            self.stretches,
            along=None if along is None else located(along, beside),
            factor=next(iter(factors.values())) if is_one else factors,
            along_factor=self.factors.get(controlled, 1.0) * (conversion(along, cards, control_unit) if along else 1.0),
            mode=self.mode,
            solver=self.solver,
            command=self.command,
            deck=self.deck,
            card_format=self.card_format,
            cards=cards,
            also=tuple(str((beside / file).absolute()) for file in self.also),
            **running,
        )

    @property
    def parameter_priors(self) -> dict[str, Prior]:
        """Of the parameters, by name."""
        from tissuq.parameters.priors import prior_from

        return {symbol: prior_from(prior) for symbol, prior in self.priors.items()}

    @property
    def correlations(self) -> dict[tuple[str, str], float]:
        """Of the priors of pairs of parameters."""
        pairs = {pair.partition(","): value for pair, value in self.prior_correlations.items()}
        return {(symbol_1.strip(), symbol_2.strip()): value for (symbol_1, _, symbol_2), value in pairs.items()}
