"""The main calls: from experiments to the posterior of a material's parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Unpack

import numpy as np

from tissuq.assessment.stable_posterior import modes_named
from tissuq.errors import InputError
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import States
from tissuq.experiments.reading.options import PythonOptions
from tissuq.experiments.reading.python_form import is_to_be_read
from tissuq.experiments.reading.tests_in_file import measurements
from tissuq.mechanics import Material, material_named
from tissuq.model.discrepancy import Discrepancy, discrepancy_named
from tissuq.model.noise import Noise, noise_named
from tissuq.model.statistical_model import StatisticalModel
from tissuq.model.tolerances import AS_TESTED, ESTIMANDS, Tolerances
from tissuq.parameters.checks import check_priors, check_seed
from tissuq.parameters.priors import Prior
from tissuq.posterior.plug_in import default_tolerances, with_standard_errors
from tissuq.posterior.posterior import Posterior
from tissuq.posterior.solver import METHODS, Method, Solver

OPTIONS = ("discrepancy", "material", "noise_sd", "noise", "priors", "tolerances", "method", "stable_in", "seed")
"""Of a fit, beside those of reading."""
MAX_SIZE = 2000
"""Stresses that are fitted one by one; of more, means of consecutive ones: errors of whole tests and the correlation of
consecutive errors cost more with every one, and more than that many tell no more about a smooth curve."""


def fit(
    data: Any,
    *,
    discrepancy: str | Discrepancy = "auto",
    material: str | Material = "neo-hookean",
    noise_sd: float | str | Sequence[float | str] | None = None,
    noise: str | Noise | None = None,
    priors: Mapping[str, Prior] | None = None,
    tolerances: Tolerances | Mapping[str, float | str] | str | None = None,
    method: Method = "auto",
    stable_in: str | Sequence[str] = (),
    seed: int = 0,
    **reading: Unpack[PythonOptions],
) -> Posterior:
    """Identify the parameters of a material from an experiment, with a model discrepancy and noise.

    Parameters
    ----------
    data : Experiment, str, path or table, or sequence of these
        The measurements: of one test, or of several in any modes, which share one material. A discrepancy that is an
        energy acts in all of them; one in stress is another in each test, of the same size. Files and tables (of
        pandas, polars, xarray) are read as by `tissuq.read`. Of more than 2000 stresses, means of consecutive ones are
        fitted (`Experiment.averaged`) and noise_sd is that of means, a known one divided by the root of their number;
        every measurement without errors of the test (tolerances that are none, one test with known noise).
    discrepancy : str or Discrepancy
        What the material cannot explain, by name (``tissuq discrepancies`` lists them) or as an object; ``"auto"`` is
        an average of strain energies that leave the initial shear modulus alone, by the evidence.
    material : str or Material
        The material whose parameters are wanted.
    noise_sd : float, or str such as "0.02 kPa" or "unknown"
        Standard deviation of the measurement noise, a number of MPa or a text with its unit (or a quantity of pint);
        unknown, as when nothing is said, makes it a parameter. For several tests a sequence of numbers, one for each,
        is taken, too; where it is unknown, its ratios between the tests are those of their scatter about smooth curves,
        and noise_sd is its geometric mean.
    noise : str or Noise
        Another kind of noise instead: ``"proportional"`` (sd = noise_sd + noise_share |stress|), ``"repeats"`` (told
        by repeated measurements at the same stretch), ``"autoregressive"`` (errors of consecutive measurements
        correlated), or ``"independent"``. Unknown noise beside errors of the test and an energy discrepancy is
        autoregressive where the data are far more probable so, else independent.
    priors : mapping of str to Prior
        Priors in MPa (psi in stretch) that replace the defaults, by parameter.
    tolerances : Tolerances, mapping of str to float, or str
        By how much whole tests may be off, and so what the intervals are of: ``"as-tested"`` (or ``"none"``),
        ``"specimen"`` or ``"tissue"`` (`tissuq.estimands`), or sizes such as ``Tolerances("specimen", slack=0)``; a
        mapping such as ``{"slack": 0.01}`` replaces those of the default one by one, ``Tolerances(slack=0.01)`` has no
        others. Sizes that are not stated as numbers are at least the ``least_errors`` of the experiment. By default
        they are of the specimen, or where tests are of several, of the tissue; as tested where the noise of one test is
        known, or a discrepancy that is no energy alone takes up errors of the test. Unless they are stated as numbers,
        the spreads between specimens and tests are as large as several tests tell. Standard errors of means that the
        data state are in all of them but ``"as-tested"``.
    method : str
        ``"exact"``: closed form and quadrature over at most three nonlinear parameters, importance points of more and
        of ridges too thin for it.
        ``"nuts"``: the linear parameters in closed form, the no-U-turn sampler over the others.
        ``"smc"``: the same with tempered sequential Monte Carlo, which gives the evidence, too.
        ``"joint"``: the no-U-turn sampler over all parameters, nothing integrated, as in the paper.
        ``"auto"``: exact where it applies and reaches its tolerance; else nuts, with the evidence from smc.
        The posterior's ``method`` and ``how`` say what was done and why.
    stable_in : str or sequence of str
        Loading modes, or ``"all"``, in which material and energy discrepancy must be stable over the range that was
        measured: the prior leaves out what is not, and the posterior is known by those of its draws that are.
    seed : int
        Of the draws.
    reading
        Options of `tissuq.read`, where files or tables are given, such as ``mode``, ``stress="P [kPa]"``, ``unit`` (of
        the stresses: noise and priors without a unit are in MPa whatever it is), ``length="10 mm"``.

    Raises
    ------
    InputError
        When data, noise or priors cannot be used.
    ModelError
        When the parts do not fit each other, or the method does not apply, or hardly any of the posterior is stable
        where that is asked for.
    ConvergenceError
        When the method was asked for by name and cannot reach its tolerance.

    References
    ----------
    Zeraatpisheh, Bordas & Beex (2021), eq. 15 to 26.

    Examples
    --------
    >>> import tissuq as tq
    >>> truth = {"C10": 1.2, "C20": -0.057, "C30": 0.004}
    >>> stretch = [0.5, 0.75, 1.25, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0]
    >>> data = tq.simulate("yeoh", truth, stretch, noise_sd=0.1, seed=1)
    >>> posterior = tq.fit(data, material="neo-hookean", discrepancy="yeoh", noise_sd=0.1)
    >>> low, high = posterior.summary().loc["C10", ["hdi_low", "hdi_high"]]
    >>> bool(low < 1.2 < high)
    True
    >>> table = {"lambda": [0.8, 0.9, 1.1, 1.2, 1.3], "P [kPa]": [-3.81, -1.67, 1.37, 2.53, 3.54]}
    >>> tq.fit(table, discrepancy="none", noise_sd="0.01 kPa")
    <Posterior of C10: neo-hookean, discrepancy none, 5 measurements, exact>
    """
    return fit_many(
        [data],
        discrepancy=discrepancy,
        material=material,
        noise_sd=noise_sd,
        noise=noise,
        priors=priors,
        tolerances=tolerances,
        method=method,
        stable_in=stable_in,
        seed=seed,
        **reading,
    )[0]


def fit_many(
    datasets: Sequence[Any],
    *,
    discrepancy: str | Discrepancy = "auto",
    material: str | Material = "neo-hookean",
    noise_sd: float | str | Sequence[float | str] | None = None,
    noise: str | Noise | None = None,
    priors: Mapping[str, Prior] | None = None,
    tolerances: Tolerances | Mapping[str, float | str] | str | None = None,
    method: Method = "auto",
    stable_in: str | Sequence[str] = (),
    seed: int = 0,
    **reading: Unpack[PythonOptions],
) -> list[Posterior]:
    """Fit many experiments with the same model, each by itself; the parameters are those of `fit`.

    Experiments on the same stretches in the same loading mode (replicates, specimens, synthetic data) share all
    factorisations and are integrated together, which takes a small part of the time of as many calls of `fit` and gives
    the same posteriors to the accuracy of the integration.

    Parameters
    ----------
    datasets : sequence of Experiment, files or tables, or of sequences of them
        Several tests that belong together count as one data set.

    Returns
    -------
    list of Posterior
        In the order of the experiments.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        As `fit`; or when there is no list.

    Examples
    --------
    >>> import tissuq as tq
    >>> stretch = [0.7, 0.8, 0.9, 1.1, 1.2, 1.3, 1.4]
    >>> specimens = [tq.simulate("neo-hookean", {"C10": 0.5}, stretch, noise_sd=0.05, seed=s) for s in range(20)]
    >>> posteriors = tq.fit_many(specimens, discrepancy="none", noise_sd=0.05)
    >>> held = [0.5 > p.summary().loc["C10", "hdi_low"] for p in posteriors]
    >>> len(held)
    20
    """
    if is_to_be_read(datasets) or not isinstance(datasets, Iterable):
        raise InputError(
            "a list of data sets is needed, each as for tissuq.fit, which fits a single one; not "
            f"{type(datasets).__name__}."
        )
    _refuse_several(material, priors, reading.get("mode"))
    experiments = [measurements(data, OPTIONS, **reading) for data in datasets]
    replacing = dict(tolerances) if isinstance(tolerances, Mapping) else {}
    given = None if tolerances is None else stated_tolerances(tolerances)
    tolerances = None if isinstance(tolerances, Mapping) else given
    if method not in METHODS:
        raise InputError(f"there is no method '{method}'. Choose one of: {', '.join(METHODS)}.")
    check_seed(seed)
    if noise_sd is not None and noise is not None:
        raise InputError(f"give noise_sd or noise, not both (noise_sd is {noise_sd!r}, noise is {noise!r}).")
    noise_model = noise_named(noise if noise is not None else "unknown" if noise_sd is None else noise_sd)
    parts = material_named(material), discrepancy_named(discrepancy)
    solver = Solver(method, modes_named(stable_in), int(seed))

    def model_of(data: Experiment) -> StatisticalModel:
        is_quick = not tolerances and (tolerances is not None or (not noise_model.parameters and len(data.tests) == 1))
        if not (is_quick or noise_model.shares_discrepancy):
            data = data.averaged(MAX_SIZE)
        options = *parts, _noise_of_means(noise_model, data), dict(priors or {})
        stated = tolerances.at_least(data.least_errors) if tolerances else tolerances or Tolerances()
        model = StatisticalModel(data, *options, stated)
        standard = default_tolerances(model).replaced_by(replacing) if tolerances is None else stated
        if tolerances is None or tolerances.estimand not in ("", AS_TESTED):
            standard = with_standard_errors(model, standard)
        if standard.stated != stated.stated:
            model = replace(model, tolerances=standard)
        if model.tolerances.has_standard_spreads:
            model = solver.with_spreads_of_tests(model)
        return solver.with_probable_noise(model)

    models = [model_of(data) for data in experiments]
    groups: dict[tuple[States, int], list[int]] = {}
    for number, model in enumerate(models):
        is_shared = len(model.experiment.tests) == 1 and not model.tolerances and not noise_model.is_consecutive
        groups.setdefault((model.experiment.states, 0 if is_shared else number), []).append(number)
    posteriors: dict[int, Posterior] = {}
    for numbers in groups.values():
        solutions = solver.solve([models[number] for number in numbers])
        posteriors |= {number: Posterior(solution, solver) for number, solution in zip(numbers, solutions, strict=True)}
    return [posteriors[number] for number in range(len(datasets))]


def _noise_of_means(noise: Noise, rows: Experiment) -> Noise:
    """Return the noise of rows that are means, of tests of which each has a known one; another noise as it is."""
    counts = np.array([test.curves[0].averaged for test in rows.tests])
    if noise.parameters or (counts == 1).all():
        return noise
    sds = noise.of_tests(rows) / np.sqrt(counts)
    return noise_named(float(sds[0]) if len(sds) == 1 else tuple(sds.tolist()))


def _refuse_several(material: Any, priors: Any, mode: Any) -> None:
    """Refuse several laws, priors that are not by parameter, and modes of several tests in place of one."""
    if isinstance(material, str) and material == "all":
        raise InputError("one fit has one material: tissuq.fit_laws(data) fits all of them and compares them.")
    if priors is not None:
        check_priors(priors)
    if isinstance(mode, (list, tuple)):
        raise InputError(
            "mode is one for all tests that are read: give each its own in [tissuq.read(table, mode='uniaxial'), "
            "tissuq.read(other, mode='planar')]."
        )


def stated_tolerances(stated: Tolerances | Mapping[str, float | str] | str) -> Tolerances:
    """Return tolerances as people state them: themselves, by an estimand, or by sizes without others.

    Raises
    ------
    InputError
        When they are none of these.
    """
    if isinstance(stated, Mapping):
        return Tolerances(**stated)
    if isinstance(stated, Tolerances | str):
        return stated if isinstance(stated, Tolerances) else Tolerances(stated)
    raise InputError(
        "tolerances must be such as {'slack': 0.01} or tissuq.Tolerances(stress=0.1), or one of "
        f"{', '.join(ESTIMANDS)}, not {stated!r}."
    )
