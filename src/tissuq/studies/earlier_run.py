"""What an earlier run left: its posteriors, as they were saved or as priors of another model, and its settings."""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING
from warnings import warn

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.assessment.modulus import positive_symbols
from tissuq.errors import InputError
from tissuq.experiments.units import stress_unit
from tissuq.mechanics import Material, material_named, standard_name
from tissuq.model.discrepancy import Auto, Discrepancy, NoDiscrepancy
from tissuq.parameters.checks import checked_path
from tissuq.parameters.priors import LogNormal, Normal, Prior
from tissuq.posterior.archive import read_modes
from tissuq.posterior.posterior import Posterior
from tissuq.result_warning import symbols_in
from tissuq.studies.settings import RECIPE, damage_reported, load_settings, setting_of

if TYPE_CHECKING:
    from tissuq.studies.fit_settings import SpecimenSettings

POSTERIORS = "posterior"
"""Subfolder of a run with a file for each of its posteriors."""
FAR = 5.0
"""Standard deviations that a bound must be away from the mean of a normal prior."""
SMALL_CORRELATION = 1e-6
"""Size below which a correlation is left out."""


def load(
    path: str | Path, discrepancy: str | Discrepancy | None = None, material: str | Material | None = None
) -> Posterior:
    """Return a posterior that was saved, by `Posterior.save` or in a run of ``tissuq fit``, as it was.

    Nothing is fitted again, and no code in the folder is run.

    Parameters
    ----------
    path : str or Path
        The file, or the run folder.
    discrepancy : str or Discrepancy, optional
        Which of the run's discrepancies; unless given, ``"auto"`` where the run has it, or the only one. An object,
        where it is of a class of your own.
    material : str or Material, optional
        Which of the laws of a run that compared several; an object, where it is a law of your own.

    Raises
    ------
    InputError
        When there is no such file or run, or it is damaged, or material or discrepancy is not one of the run's, or must
        be given.

    Examples
    --------
    >>> import tissuq as tq
    >>> posterior = tq.load("runs/brain", discrepancy="auto")  # doctest: +SKIP
    >>> posterior = tq.load("runs/laws", material="gent")  # doctest: +SKIP
    """
    file = checked_path(path, "a run folder ('runs/specimen') or the file of a posterior")
    law = material if isinstance(material, Material) else None
    user_discrepancy = discrepancy if isinstance(discrepancy, Discrepancy) else None
    posterior = Posterior.load(file if file.is_file() else _file_in(file, discrepancy, material), law, user_discrepancy)
    if isinstance(material, str) and standard_name(material) != posterior.model.material.name:
        raise InputError(f"'{path}' is of the material '{posterior.model.material.name}', and not of '{material}'.")
    return posterior


def load_run(
    folder: str | Path, discrepancy: str | Discrepancy | None = None, material: str | Material | None = None
) -> Posterior:
    """Return `load` of the same arguments: its earlier name, deprecated."""
    warn("tissuq.load_run is now called tissuq.load.", DeprecationWarning, stacklevel=2)
    return load(folder, discrepancy, material)


def load_without_discrepancy(folder: str | Path, material: Material | None = None) -> Posterior:
    """Return the posterior without discrepancy of the measurements of a run; fitted, where the run has none.

    Parameters
    ----------
    folder : str or Path
    material : Material, optional
        As of `load`; of a run that compared laws the one of these.

    Raises
    ------
    InputError, ModelError, ConvergenceError
        As `load` and `tissuq.fit`.
    """
    from tissuq.studies.specimen import fitted

    run = Path(folder)
    if NoDiscrepancy.name in posteriors_in(run):
        return load(run, NoDiscrepancy.name, material)
    return fitted(recipe_of(run), NoDiscrepancy.name, run, material)


def modes_of(folder: str | Path, discrepancy: str | None = None, material: str | Material | None = None) -> list[str]:
    """Return the loading modes of the tests of a run.

    Raises
    ------
    InputError
        As `load`.
    """
    return read_modes(_file_in(Path(folder), discrepancy, material))


def answering(folder: str | Path) -> str:
    """Return the discrepancy whose posterior answers in a run of ``tissuq fit``: auto, or the first of its settings.

    Raises
    ------
    InputError
        As `recipe_of`.
    """
    files = posteriors_in(Path(folder))
    if Auto.name in files:
        return Auto.name
    return next((name for name in recipe_of(folder).discrepancies if name in files), "")


def recipe_of(folder: str | Path) -> SpecimenSettings:
    """Return the settings of a run of ``tissuq fit``.

    Raises
    ------
    InputError
        When the folder is no such run.
    """
    from tissuq.studies.fit_settings import LawSettings, SpecimenSettings

    run = Path(folder)
    recipe = run / RECIPE
    posteriors_in(run)
    if not recipe.is_file():
        raise InputError(f"folder '{run}' is not a complete run of tissuq fit: it lacks {RECIPE}.")
    with damage_reported(recipe):
        command = recipe.read_text(encoding="utf-8").partition("\n")[0]
    if " tissuq fit " not in command:
        raise InputError(f"run '{run}' is not a run of tissuq fit; only these have a posterior to continue from.")
    return load_settings(LawSettings if _has_setting(run, "laws") else SpecimenSettings, recipe, {})


def posteriors_in(run: Path) -> dict[str, Path]:
    """Return the files with the posteriors of a run, by discrepancy."""
    if not run.is_dir():
        raise InputError(f"there is no run folder '{run}'.")
    files = {file.stem: file for file in sorted((run / POSTERIORS).glob("*.nc"))}
    if not files:
        advice = (
            "repeat tissuq calibrate with the law of the model and the stretches in it, as in --material neo-hookean "
            "--range 0.7:1.3"
            if _has_setting(run, "server_model")
            else "give the folder of a run of tissuq fit, as in runs/specimen"
        )
        raise InputError(f"folder '{run}' has no posterior of a material ({POSTERIORS}/*.nc): {advice}.")
    return files


def _file_in(run: Path, discrepancy: str | Discrepancy | None, material: str | Material | None = None) -> Path:
    """Return the file with the posterior of a run under one of its discrepancies, or of one of its laws.

    A law is also chosen by the name that is given for the discrepancy, as it was before it had an option of its own.
    """
    files, is_of_laws = posteriors_in(run), _has_setting(run, "laws")
    if is_of_laws:  # those that were written before a sum had one name
        files = {standard_name(name): file for name, file in files.items()}
    names = list(files)
    name = discrepancy.name if isinstance(discrepancy, Discrepancy) else discrepancy
    law = material.name if isinstance(material, Material) else standard_name(material) if material else None
    if is_of_laws and law and name not in (None, law, *recipe_of(run).discrepancies):
        raise InputError(
            f"run '{run}' has no discrepancy '{name}': its laws are with {recipe_of(run).discrepancies[0]}."
        )
    name = (law if is_of_laws else None) or name
    name = name or (Auto.name if Auto.name in names else names[0] if len(names) == 1 else None)
    if name not in files:
        available = ", ".join(names)
        singular, plural, option = (
            ("law", "laws", "material") if is_of_laws else ("discrepancy", "discrepancies", "discrepancy")
        )
        what = f"has no {singular} '{name}'" if name else f"has several {plural}"
        raise InputError(f"run '{run}' {what}: choose one of {available} (--{option}).")
    return files[name]


def _has_setting(run: Path, name: str) -> bool:
    """Return whether the recipe of a run has a setting: ``laws`` where its posteriors are those of several laws."""
    with suppress(InputError):
        return setting_of(run / RECIPE, name) is not None
    return False


def load_law(run: Path, material: str) -> Posterior:
    """Return the posterior of a law from a run, or from the file of one.

    Raises
    ------
    InputError
        When there is no such run, or it is of another law or has several posteriors of this one.
    """
    law = material_named(material)
    files = posteriors_in(run) if run.is_dir() else {}
    if len(files) > 1 and not {law.name, Auto.name} & set(files):
        if _has_setting(run, "laws"):
            raise _of_other_materials(run, list(files), law)
        named = " or ".join(map(str, files.values()))
        raise InputError(f"the run '{run}' has several posteriors: give the file of one, --prior-run {named}.")
    posterior = load(run, law.name if law.name in files else None)
    if law.name != posterior.model.material.name:
        raise _of_other_materials(run, [posterior.model.material.name], law)
    return posterior


def _of_other_materials(run: Path, names: list[str], law: Material) -> InputError:
    return InputError(
        f"the run '{run}' is of the material{'s' * (len(names) > 1)} {', '.join(names)}, and the forward model has "
        f"{law.name}: fit the tests with --material {law.name} (--prior-run)."
    )


def priors_of(
    posterior: Posterior, unit: str = "MPa", stated: Collection[str] = ()
) -> tuple[dict[str, Prior], dict[tuple[str, str], float]]:
    """Return priors of a law's parameters with mean, sd and correlations of a posterior.

    Positive parameters get a log-normal prior with mean and sd of the logarithms, as in a population, others a normal
    one; what the posterior says of a discrepancy or of the noise is left out.

    Parameters
    ----------
    posterior : Posterior
    unit : str
        Of the parameters that are stresses.
    stated : collection of str
        Parameters that have priors, and get none here.

    Returns
    -------
    priors : dict of str to Prior
    correlations : dict of (str, str) to float
        Of every two of them: of logarithms, where the prior is log-normal.

    Raises
    ------
    InputError
        When a parameter has bounds near which the posterior lies, or the bound of a prior cuts one.

    Examples
    --------
    >>> import tissuq as tq
    >>> data = tq.simulate("neo-hookean", {"C10": 0.5}, [0.8, 0.9, 1.1, 1.2], noise_sd=0.01, seed=1)
    >>> posterior = tq.fit(data, discrepancy="none", noise_sd=0.01)
    >>> priors, _ = priors_of(posterior)
    >>> priors["C10"].name, bool(abs(priors["C10"].median / posterior.marginals["C10"].mean - 1) < 0.01)
    ('log-normal', True)
    """
    draws = posterior.data_in("MPa")["posterior"]
    to_mpa = stress_unit(unit).to_mpa
    priors: dict[str, Prior] = {}
    lines: dict[str, FloatArray] = {}
    material = posterior.model.material.plain
    bounded = symbols_in(posterior.warnings, "prior-bound")
    if cut := [parameter.symbol for parameter in material.parameters if parameter.symbol in bounded]:
        raise InputError(
            f"a bound of its prior cuts the posterior of {' and that of '.join(cut)}, so that it is not the data's: "
            f"fit the tests with a wider one, as --prior {cut[0]}=uniform(...), or give priors yourself in place of "
            "the run."
        )
    positive = positive_symbols(posterior.model)
    for parameter in material.parameters:
        symbol, bounds = parameter.symbol, np.array(parameter.support)
        if symbol in stated:
            continue
        scale = to_mpa if parameter.unit else 1.0
        values = np.asarray(draws[symbol], dtype=np.float64).ravel() / scale
        is_log = symbol in positive and bool((values > 0).all())
        line, ends = values, bounds / scale
        if is_log:
            with np.errstate(divide="ignore"):
                line, ends = np.log(values), np.log(np.maximum(ends, 0.0))
        mean, sd = float(line.mean()), float(line.std())
        if mean - FAR * sd < ends[0] or mean + FAR * sd > ends[1]:
            raise InputError(
                f"the posterior of {symbol} lies near a bound of the parameter, and no normal prior is like it: give "
                f"its prior yourself, as --prior {symbol}=uniform(...)."
            )
        priors[symbol] = LogNormal(float(np.exp(mean)), sd) if is_log else Normal(mean, sd)
        lines[symbol] = line
    correlations = {
        (one, other): correlation
        for one, other in combinations(lines, 2)
        if abs(correlation := float(np.corrcoef(lines[one], lines[other])[0, 1])) > SMALL_CORRELATION
    }
    return priors, correlations
