"""The posterior as a user meets it: a table, predictions, labelled draws for ArviZ, a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from tissuq.arrays import BoolArray
from tissuq.assessment import Assessment, assess, measurement_warnings
from tissuq.assessment.answer import Answer, answer_of
from tissuq.assessment.comparison import scores_of
from tissuq.assessment.modulus import modulus
from tissuq.assessment.stability import StableRange, stability_over, stable_ranges
from tissuq.errors import ModelError
from tissuq.experiments.checked_arrays import headed, in_unit
from tissuq.experiments.modes import LoadingMode
from tissuq.experiments.reading.tests_in_file import measurements
from tissuq.experiments.units import StressUnit
from tissuq.inference.marginal import Marginal
from tissuq.inference.solution import Diagnostics, Solution
from tissuq.mechanics import Material
from tissuq.model.discrepancy import Discrepancy
from tissuq.model.statistical_model import StatisticalModel
from tissuq.next_test import Candidate, rank_tests
from tissuq.next_test.targets import Target
from tissuq.parameters.checks import check_probability, check_switches, checked_path
from tissuq.pictures.answer import small_svg
from tissuq.posterior.archive import read_solution, solution_groups
from tissuq.posterior.drawn_materials import Sampling, drawn_ensemble
from tissuq.posterior.ensemble import Ensemble
from tissuq.posterior.labelled import labelled_arrays, labels_of, prior_arrays, summaries_in
from tissuq.posterior.netcdf import LabelledGroup, save_groups, tree_of
from tissuq.posterior.plots import PosteriorPlots
from tissuq.posterior.solver import Solver
from tissuq.posterior.warnings import warnings_about
from tissuq.prediction.bands import inside_band, predict_band, stress_ratio
from tissuq.prediction.densities import LeaveOneOut, leave_one_out
from tissuq.result_warning import ResultWarning, most_severe_first

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


@dataclass(frozen=True, eq=False, repr=False)
class Posterior(PosteriorPlots):
    """What `tissuq.fit` returns.

    Attributes
    ----------
    solution : Solution
        Marginals, mixture and draws.
    solver : Solver
        How it was solved, which solves other models likewise.
    """

    solution: Solution
    solver: Solver

    @property
    def seed(self) -> int:
        """The seed from which the draws follow."""
        return self.solver.seed

    @property
    def model(self) -> StatisticalModel:
        """The model that was fitted, with its data and priors."""
        return self.solution.model

    @property
    def marginals(self) -> Mapping[str, Marginal]:
        """The marginal posterior of every parameter: mean, sd, density, quantiles, HDI."""
        return self.solution.marginals

    @cached_property
    def initial_shear_modulus(self) -> Marginal:
        """The marginal posterior of the material's initial shear modulus, MPa: what an energy discrepancy leaves alone.

        Examples
        --------
        >>> import tissuq as tq
        >>> stretch = [0.7, 0.8, 0.9, 0.95, 1.05, 1.1, 1.2, 1.3, 1.4, 1.5, 1.7, 2.0]
        >>> truth = {"C10": 0.5, "C01": 0.1}
        >>> data = tq.simulate("mooney-rivlin", truth, stretch, noise_sd=0.02, seed=1)
        >>> low, high = tq.fit(data, material="mooney-rivlin", noise_sd=0.02).initial_shear_modulus.hdi()
        >>> bool(low < 2 * (0.5 + 0.1) < high)
        True
        """
        return modulus(self.solution)

    @property
    def log_evidence(self) -> float | None:
        """Log of p(data), data in MPa, priors normalised (uniform densities included).

        None where the method gives none (nuts and joint when asked for by name), or a prior is flat and improper.
        """
        return self.solution.log_evidence

    @property
    def log_evidence_error(self) -> float | None:
        """Estimated error of `log_evidence`."""
        return self.solution.log_evidence_error

    @property
    def method(self) -> str:
        """The method that gave it; `how` says why it was taken and what it did."""
        return self.solution.route

    @property
    def how(self) -> str:
        """How it was computed and why so: what was integrated, and which errors were estimated and taken as known.

        Examples
        --------
        >>> import tissuq as tq
        >>> data = tq.simulate("neo-hookean", {"C10": 0.5}, [0.8, 0.9, 1.1, 1.2], noise_sd=0.02, seed=1)
        >>> tq.fit(data, discrepancy="none", noise_sd=0.02).how
        'C10 integrated in closed form; nothing left to integrate'
        """
        seen = self.model.tolerances.account_of(self.model.experiment.least_errors)
        return "; ".join(filter(None, (self.solution.reason, self.model.fitted_errors.account, seen)))

    @property
    def diagnostics(self) -> Diagnostics | None:
        """R-hat, effective sample sizes, divergences, BFMI and a verdict; None where nothing was sampled."""
        return self.solution.diagnostics

    @cached_property
    def warnings(self) -> tuple[ResultWarning, ...]:
        """What a reader of this posterior must know, in sentences with a code and a severity, the severest first."""
        of_data = measurement_warnings(self.model.experiment) if self.solution.is_of_data else ()
        return tuple(most_severe_first([*of_data, *self.warnings_of_fit]))

    @cached_property
    def warnings_of_fit(self) -> tuple[ResultWarning, ...]:
        """Those warnings that are not of the measurements alone, which are the same for every fit of them."""
        return tuple(most_severe_first(warnings_about(self.solution, self.stable_ranges, self._is_inside)))

    @cached_property
    def answer(self) -> Answer:
        """What it says before everything else: the modulus, for what the result can be used, and what to do next.

        Examples
        --------
        >>> import tissuq as tq
        >>> data = tq.simulate("neo-hookean", {"C10": 0.5}, [0.7, 0.8, 0.9, 1.1, 1.2, 1.4, 1.7, 2], 0.02, seed=1)
        >>> answer = tq.fit(data, discrepancy="none", noise_sd=0.02).answer
        >>> for use in answer.uses:
        ...     print(use.purpose, "-", use.verdict)
        report the modulus - with care
        predict these tests - yes
        predict other loading modes - with care
        simulate with finite elements - with care
        """
        return answer_of(self.solution, self.stable_ranges, self.warnings, self._is_inside)

    def assess(self) -> Assessment:
        """Return to what extent the data need the discrepancy, and what it does to the parameters.

        The same data are fitted without discrepancy and with other prior scales of what sets the discrepancy's size,
        unless that would need a sampler, which the fit itself did without.

        Examples
        --------
        >>> import tissuq as tq
        >>> stretch = [0.7, 0.8, 0.9, 0.95, 1.05, 1.1, 1.2, 1.3, 1.4, 1.5, 1.7, 2.0]
        >>> data = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.0}, stretch, noise_sd=0.02, seed=1)
        >>> found = tq.fit(data, discrepancy="auto", noise_sd=0.02).assess()
        >>> found.share[0] > 0.2, abs(found.initial_share[0]) < 1e-6, found.probability_of_none < 0.01
        (True, True, True)
        """
        return self._assessment

    @cached_property
    def _assessment(self) -> Assessment:
        alike = self.solver if self.diagnostics is not None else self.solver.for_checks
        return assess(self.solution, self.solver.solve, alike.solve, self.stable_ranges)

    def stability(
        self, mode: str | LoadingMode | None = None, stretch: ArrayLike | None = None, points: int = 41
    ) -> pd.DataFrame:
        """Return how probable it is that the material, with an energy discrepancy, is stable.

        Parameters
        ----------
        mode : str or LoadingMode, optional
            That of the data unless another is given.
        stretch : (g,) array, optional
            Unless given, ``points`` stretches over the range in which both invariants were measured.

        Returns
        -------
        pandas.DataFrame
            Columns stretch; baker_ericksen, drucker, rising, the shares of draws for which each criterion holds there;
            and stable, the share for which all hold from the reference up to there.

        Examples
        --------
        >>> import tissuq as tq
        >>> stretch = [0.7, 0.8, 0.9, 1.1, 1.2, 1.3, 1.4, 1.5, 1.7, 2.0]
        >>> data = tq.simulate("neo-hookean", {"C10": 0.5}, stretch, noise_sd=0.02, seed=1)
        >>> table = tq.fit(data, discrepancy="none", noise_sd=0.02).stability("equibiaxial")
        >>> float(table["stable"].min())
        1.0
        """
        import pandas as pd

        table = stability_over(self.solution, mode, stretch, points)
        return pd.DataFrame({name: value for name, value in vars(table).items() if name != "mode"})

    @cached_property
    def stable_ranges(self) -> Mapping[str, StableRange]:
        """How far from the reference it is stable, with what probability, and where it ceases to be, by loading mode.

        Over the range in which both invariants were measured; empty where the material's energy does not tell.

        Examples
        --------
        >>> import tissuq as tq
        >>> data = tq.datasets.load("rubber-treloar-uniaxial")
        >>> found = tq.fit(data, material="mooney-rivlin", discrepancy="none").stable_ranges["uniaxial"]
        >>> found.probability < 0.05, found.loss_above.median  # it has a negative modulus: lost at the reference
        (True, 1.0)
        """
        return stable_ranges(self.solution)

    def design(
        self,
        candidates: str | Candidate | Sequence[str | Candidate] = (),
        target: str | Target | Sequence[str | Target] = (),
        **options: Any,
    ) -> pd.DataFrame:
        """Rank tests that could be made next by how much less uncertain they are expected to make a target.

        The columns, and the ``options`` points, specimen, seed and unit, are those of `tissuq.next_test.rank_tests`.

        Parameters
        ----------
        candidates : str, Candidate, or sequence of these
            Such as ``"planar 1:1.5 20"``; usual ones in all modes, unless given.
        target : str, Target, or sequence of these
            ``"modulus"`` (the initial shear modulus, unless given), a parameter, a stress such as ``"planar:1.5"``; or
            a quantity of a finite-element model (`tissuq.next_test.quantity_target`).

        Examples
        --------
        >>> import tissuq as tq
        >>> data = tq.simulate("neo-hookean", {"C10": 0.5}, [0.8, 0.9, 1.1, 1.2], noise_sd=0.02, seed=1)
        >>> posterior = tq.fit(data, discrepancy="none", noise_sd=0.02)
        >>> posterior.design(["uniaxial 0.9:1.1 4", "uniaxial 0.7:1.3 4"]).query("not is_repeat")["low"].tolist()
        [0.7, 0.9]
        """
        return rank_tests(self.solution, candidates, target, **options)

    def update(self, more: Any) -> Posterior:
        """Return the posterior after further measurements, as if all had been fitted at once.

        Where noise and discrepancy are independent from point to point and the stress is linear in its parameters, the
        measurements so far enter by their sufficient statistics, and only the new ones are read. They may be all that
        `tissuq.fit` takes.

        Raises
        ------
        InputError
            When the measurements are in another loading mode, or means were fitted in place of very many.

        Examples
        --------
        >>> import tissuq as tq
        >>> first = tq.simulate("neo-hookean", {"C10": 0.5}, [0.8, 0.9, 1.1, 1.2], noise_sd=0.05, seed=1)
        >>> more = tq.simulate("neo-hookean", {"C10": 0.5}, [0.7, 1.3], noise_sd=0.05, seed=2)
        >>> before = tq.fit(first, discrepancy="none", noise_sd=0.05)
        >>> after = before.update(more)
        >>> bool(after.summary().loc["C10", "sd"] < before.summary().loc["C10", "sd"])
        True
        """
        return Posterior(self.solver.solve([self.model.with_more(measurements(more))])[0], self.solver)

    def summary(
        self, prob: float = 0.95, parameters: Sequence[str] | None = None, unit: str | None = None
    ) -> pd.DataFrame:
        """Return mean, sd, median and the highest-density interval of every parameter (psi in stretch).

        Amplitudes of an energy discrepancy whose prior has no mean (the default, half-Cauchy) have a median and an
        interval only: few directions of the data tell them, so that their posterior may have its prior's tail.

        Parameters
        ----------
        parameters : sequence of str, optional
            Only these; what is not asked for is not computed.
        prob : float
            Probability inside the interval; 0.95 gives the paper's 95 % HPD.
        unit : str, optional
            Unit of stress, such as ``"MPa"``; that of the measurements unless given.

        Returns
        -------
        pandas.DataFrame
            Indexed by parameter: mean, sd, median, hdi_low, hdi_high; and ess (the lesser of bulk and tail) and rhat
            when the posterior was sampled. The unit of stresses stands at the head of the columns.

        Examples
        --------
        >>> import tissuq as tq
        >>> data = tq.Experiment("uniaxial", [0.8, 0.9, 1.1, 1.2], [-3.81, -1.67, 1.37, 2.53], stress_unit="kPa")
        >>> posterior = tq.fit(data, discrepancy="none", noise_sd=1e-5)
        >>> print(posterior.summary()[["mean", "sd"]].round(3))  # doctest: +NORMALIZE_WHITESPACE
        stresses in kPa   mean     sd
        parameter
        C10              2.499  0.005
        >>> float(posterior.summary(unit="MPa").loc["C10", "mean"].round(4))
        0.0025
        """
        import pandas as pd

        rows = summaries_in(self.unit(unit), self.solution, prob, parameters)
        return headed(pd.DataFrame(list(rows.values()), pd.Index(list(rows), name="parameter")), self.unit(unit))

    def predict(
        self,
        stretch: ArrayLike,
        *,
        discrepancy: bool = True,
        noise: bool = True,
        prob: float = 0.95,
        mode: str | LoadingMode | None = None,
        channel: int = 0,
        stress_type: str = "engineering",
        unit: str | None = None,
    ) -> pd.DataFrame:
        """Return the predicted stress at new stretches.

        Parameters
        ----------
        stretch : (g,) array, or (g, c) for a mode with c controls, dimensionless
        discrepancy : bool
            With the discrepancy's share (eq. 27), or the model alone (eq. 28).
        noise : bool
            For a new measurement, or for the stress itself. Where means of several measurements were fitted (more than
            2000 rows), for a new one of them.
        prob : float
            Probability between low and high, equal tails.
        mode : str or LoadingMode, optional
            Another loading mode than that of the data: for the material alone, or a discrepancy that is an energy. A
            new measurement has the geometric mean of the noise of the tests of that mode, or of all where none is of
            it; of a discrepancy of the stress, which is another in each of several tests, the first one counts.
        channel : int
            Which of the mode's stresses, from 0, where it has several.
        stress_type : str
            ``"engineering"``, or ``"cauchy"``: times the stretch along the axis of the stress (a shear stress is both).
        unit : str, optional
            Unit of stress, such as ``"MPa"``; that of the measurements unless given.

        Returns
        -------
        pandas.DataFrame
            Columns stretch, median, low, high, with the unit of the latter at the head of the columns.
        """
        import pandas as pd

        options: dict[str, Any] = {"discrepancy": discrepancy, "noise": noise, "prob": prob, "mode": mode}
        ratio = stress_ratio(stress_type, mode or self.model.experiment.modes[0], channel)
        table = pd.DataFrame(vars(predict_band(self.solution, stretch, **options, channel=channel)))
        factor = ratio(np.atleast_1d(np.asarray(stretch, dtype=np.float64)))
        table[["median", "low", "high"]] *= np.asarray(factor)[:, None]
        return in_unit(table, ["median", "low", "high"], self.unit(unit).name)

    def scores(
        self,
        test: Any,
        *,
        discrepancy: bool = True,
        prob: float = 0.95,
        stress_type: str = "engineering",
        unit: str | None = None,
    ) -> pd.DataFrame:
        """Return how well a test that the posterior has not seen is predicted, in any loading mode.

        Parameters
        ----------
        test : Experiment, str, path or table, or sequence of these
            As `tissuq.fit` takes it. Its measurements without stress are left out: at rest it is zero by definition.
            Where means of several measurements were fitted (more than 2000 rows), those of as many are judged.
        discrepancy, prob, stress_type, unit
            As of `predict`.

        Returns
        -------
        pandas.DataFrame
            For every stress of the test a row with all measurements and, where some lie beyond the range in which both
            invariants were measured, one with those in the ``range`` (``"calibrated"``) and one with those
            ``"beyond"``: how many (``count``), and what `tissuq.prediction.scores.Judged.summary` describes: inside,
            half_width, error, crps and interval_score, the unit of the latter two at the head of the columns.

        Examples
        --------
        >>> import tissuq as tq
        >>> stretch = [0.7, 0.8, 0.9, 0.95, 1.05, 1.1, 1.2, 1.3, 1.4, 1.5, 1.7, 2.0]
        >>> data, other = (tq.simulate("neo-hookean", {"C10": 0.5}, stretch, 0.02, mode=m, seed=1)
        ...                for m in ("uniaxial", "planar"))
        >>> found = tq.fit(data, noise_sd=0.02).scores(other)
        >>> bool(found["inside"][0] > 0.7), bool(found["crps"][0] < 0.03)
        (True, True)
        """
        table = scores_of(
            self.solution, measurements(test), discrepancy=discrepancy, prob=prob, stress_type=stress_type
        )
        return in_unit(table, ["crps", "interval_score"], self.unit(unit).name)

    def ensemble(self, count: int, seed: int = 0, sampling: Sampling = "sobol", *, admissible: bool = True) -> Ensemble:
        """Return equally probable draws as complete materials, with the discrepancy in their energy.

        They are for other programs and other loading modes: finite elements, material cards. They carry the
        posterior's whole uncertainty, within the measured range and beyond, where the energy goes on as in `predict`.
        Scatter of the stress (S, noise) is no energy, and left out.

        Parameters
        ----------
        count : int
            Number of draws.
        seed : int
            From which the draws follow.
        sampling : str
            How they spread over the posterior: ``"sobol"`` (quasi-random), ``"latin"`` (Latin hypercube) or
            ``"random"``.
        admissible : bool
            Leave out draws that are not stable in every loading mode over the range that was measured.

        Raises
        ------
        InputError, ModelError
            When the discrepancy is an error of the stress, or hardly any draw is stable.

        Examples
        --------
        >>> import tissuq as tq
        >>> stretch = [0.7, 0.8, 0.9, 0.95, 1.05, 1.1, 1.2, 1.3, 1.4, 1.5, 1.7, 2.0]
        >>> data = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.0}, stretch, noise_sd=0.02, seed=1)
        >>> draws = tq.fit(data, noise_sd=0.02).ensemble(8)
        >>> planar = tq.loading_modes()["planar"]()
        >>> draws.stress(planar, [1.5]).shape
        (8, 1)
        >>> bool(abs(tq.engineering_stress(draws[0], planar, [1.5], ()) - draws.stress(planar, [1.5])[0])[0] < 1e-9)
        True
        """
        return drawn_ensemble(self.solution, count, seed, sampling, admissible=admissible)

    def predictive_coverage(self, *, discrepancy: bool = True, prob: float = 0.95) -> float:
        """Return the share of the measurements inside their predictive band (a check of the fit, not of C10)."""
        return float(np.mean(np.concatenate(self.inside_bands(discrepancy=discrepancy, prob=prob))))

    def inside_bands(self, *, discrepancy: bool = True, prob: float = 0.95) -> tuple[BoolArray, ...]:
        """Return which measurements are inside their predictive band, an array for every curve of the experiment."""
        check_switches(discrepancy=discrepancy)
        check_probability(prob)
        key = (discrepancy, prob)
        if key not in self._inside:
            options: dict[str, Any] = {"discrepancy": discrepancy, "prob": prob}
            curves = self.model.experiment.curves
            self._inside[key] = tuple(inside_band(self.solution, curve, **options) for curve in curves)
        return self._inside[key]

    @property
    def _is_inside(self) -> BoolArray:
        """Which measurements are inside their predictive band; none of a posterior of somebody who was not measured."""
        return np.concatenate(self.inside_bands()) if self.solution.is_of_data else np.ones(0, dtype=np.bool_)

    @cached_property
    def left_out(self) -> LeaveOneOut:
        """The log density of every measurement given all others, in `data` and in `tissuq.compare`.

        Examples
        --------
        >>> import tissuq as tq
        >>> data = tq.simulate("neo-hookean", {"C10": 0.5}, [0.7, 0.8, 0.9, 1.1, 1.2, 1.4, 1.7, 2], 0.02, seed=1)
        >>> tq.fit(data, discrepancy="none", noise_sd=0.02).left_out.log_density.shape
        (8,)
        """
        return leave_one_out(self.solution)

    @cached_property
    def _inside(self) -> dict[tuple[bool, float], tuple[BoolArray, ...]]:
        return {}

    @cached_property
    def data(self) -> xr.DataTree:
        """Everything as labelled arrays that ArviZ reads, in the unit of the measurements: `data_in` of it.

        Groups posterior, posterior_predictive, log_likelihood (dimensions chain, draw and, for the latter two,
        measurement), leave_one_out, observed_data and constant_data. With very many measurements the former two hold
        only some of the draws. The log likelihood of a draw is that of each measurement given the draw's parameters
        and, under a process, the other measurements; leave_one_out has each measurement's density given the others,
        everything integrated, which is what `tissuq.compare` takes. Parameters in the posterior have the error that all
        tests have in common; what is said of the measurements has not. On the
        exact route draws of nonlinear parameters (S, c, psi, noise_sd) take the values of the quadrature's points: for
        their intervals and densities use `summary` and ``solution.marginals``.

        Examples
        --------
        >>> import arviz_stats
        >>> import tissuq as tq
        >>> data = tq.Experiment("uniaxial", [0.8, 0.9, 1.1, 1.2], [-3.81, -1.67, 1.37, 2.53], stress_unit="kPa")
        >>> posterior = tq.fit(data, discrepancy="none", noise_sd=1e-5)
        >>> posterior.data["posterior"]["C10"].attrs["units"]
        'kPa'
        >>> float(arviz_stats.summary(posterior.data, round_to=1).loc["C10", "mean"])
        2.5
        """
        return self.data_in(self.unit().name)

    def data_in(self, unit: str) -> xr.DataTree:
        """Return `data` with stresses, and parameters that are stresses, in a unit of stress, such as ``"MPa"``.

        Every variable says its unit in its attribute ``units``. Densities are those of data in MPa in any unit, and so
        are the evidence and the numbers of the headline parameter among the attributes.

        Raises
        ------
        InputError
            When it is no unit of stress.
        """
        return tree_of(self._groups(self.unit(unit)))

    def prior_predictive(self, draws: int = 500) -> xr.DataTree:
        """Return draws from the priors and the measurements to which they lead, as ``prior`` and ``prior_predictive``.

        Parameters and stresses are in the unit of the measurements, with the discrepancy and noise of the model; errors
        of whole tests, and correlations of consecutive ones, are left out. Default priors are wide boxes about the
        data, and so are these draws. For ArviZ beside the posterior:
        ``posterior.data.assign(posterior.prior_predictive().children)``.

        Raises
        ------
        ModelError
            When the noise depends on the data (``proportional``, ``repeats``).

        Examples
        --------
        >>> import tissuq as tq
        >>> data = tq.simulate("neo-hookean", {"C10": 0.5}, [0.8, 0.9, 1.1, 1.2], noise_sd=0.02, seed=1)
        >>> drawn = tq.fit(data, discrepancy="none", noise_sd=0.02).prior_predictive(draws=200)
        >>> dict(drawn["prior_predictive"]["stress"].sizes)
        {'chain': 1, 'draw': 200, 'measurement': 4}
        """
        return tree_of(prior_arrays(self.model, draws, self.seed, self.unit()))

    def _groups(self, unit: StressUnit) -> dict[str, LabelledGroup]:
        labels = labels_of(self.solution, self.seed)
        left_out = self.left_out if self.solution.is_of_data else None
        return {"/": LabelledGroup(attrs=labels)} | labelled_arrays(self.solution, self.seed, unit, left_out)

    def save(self, path: str | Path) -> None:
        """Write the whole posterior as NetCDF: `data`, which ArviZ and xarray open, and what `load` needs."""
        save_groups(
            self._groups(self.unit()) | solution_groups(self.solution, self.solver), checked_path(path, "a file")
        )

    @classmethod
    def load(
        cls, path: str | Path, material: Material | None = None, discrepancy: Discrepancy | None = None
    ) -> Posterior:
        """Return the posterior that `save` wrote: nothing is fitted again, and no code of the file is run.

        Parameters
        ----------
        path : str or Path
            The file.
        material, discrepancy
            Those of the posterior, where they are classes or functions of your own.

        Raises
        ------
        InputError
            When the file holds no posterior or is damaged, or material or discrepancy must be given.
        """
        return cls(
            *read_solution(checked_path(path, "the file of a posterior ('posterior.nc')"), material, discrepancy)
        )

    def __repr__(self) -> str:
        model = self.model
        return (
            f"<Posterior of {', '.join(model.symbols)}: {model.material.name}, discrepancy {model.discrepancy.name}, "
            f"{model.experiment.size} {model.experiment.rows_name}, {self.solution.route}>"
        )

    def _repr_html_(self) -> str:
        """Return the posterior in a line above its summary and a small figure of its fit, which notebooks show."""
        table = self.summary().to_html(float_format="{:.4g}".format)
        try:
            figure = small_svg(self.solution, self.unit(), "Measurements and their 95 % band")
        except ModelError:  # some of its materials lock within the range
            figure = ""
        return f"<p>{escape(repr(self))}</p>{table}{figure}"
