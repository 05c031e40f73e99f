"""What a page says of a calibration: for what the parameters can be used, the finding, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from math import inf

import numpy as np

from tissuq.assessment.uses import MIN_INSIDE, Use, Verdict, precision_of, relative_half_width, worst_of
from tissuq.emulation.calibration import Calibration
from tissuq.emulation.problem import is_far
from tissuq.emulation.warnings import NO_PARAMETERS_FIT
from tissuq.model.discrepancy import GaussianProcess, NoDiscrepancy, PinnedProcess
from tissuq.prediction.bands import Band
from tissuq.report.measured import METHODS, other_form
from tissuq.report.result import Number, Section
from tissuq.result_warning import Severity, has_code, symbols_in
from tissuq.studies.calibration import CalibrationStudy
from tissuq.studies.calibration_settings import CalibrationSettings

LARGE_SHARE, TOO_LARGE_SHARE = 0.1, 0.5
"""Shares of the variance of a parameter that the emulator's error makes: beyond the first more runs are worth while,
beyond the second an interval says more of the emulator than of the parameter."""
SUM_OF_PARTS = "emulator(parameters) + discrepancy(control) + noise (Kennedy & O'Hagan 2001)"
FEW_NAMES = 2
"""Parameters that a purpose names; more are called the parameters."""
IF_RIGHT = "if the model is right: its errors are not included"


def uses_of_calibration(study: CalibrationStudy) -> tuple[Use, ...]:
    """Return for what the parameters of a forward model can be used, by the limits that hold for fits.

    Those of a law serve other loading modes and finite elements as its posterior says; others serve another model.
    """
    names = names_of(study)
    against = _reason_against(study)
    of_law = study.posterior.answer.uses[2:] if study.posterior is not None else ()
    elsewhere = of_law or (Use(f"use {names} in another model", Verdict.YES, ""),)
    return (
        Use(f"report {names}", *((Verdict.NO, against) if against else _reporting(study))),
        Use("predict this experiment", *_predicting(study)),
        *(use._replace(verdict=Verdict.NO, reason=against) if against else _of_model_alone(use, study)
          for use in elsewhere),
    )  # fmt: skip


def names_of(study: CalibrationStudy) -> str:
    """Return the parameters of the forward model as a few words: their names where they are few."""
    symbols = study.calibration.problem.forward_symbols
    return " and ".join(symbols) if len(symbols) <= FEW_NAMES else "the parameters"


def _reason_against(study: CalibrationStudy) -> str:
    """Return what stands against any use of the parameters; nothing where nothing does."""
    share, warnings = _share_of_emulator(study), study.calibration.warnings
    bounded, without_effect = (", ".join(symbols_in(warnings, code)) for code in ("prior-bound", "poorly-determined"))
    reasons = {
        "sampling has not converged": not study.calibration.converged,
        "no parameters that the priors allow give the measurements": has_code(warnings, "unmodelled-curve"),
        f"the model hardly depends on {without_effect}": bool(without_effect),
        f"a bound of its prior, not the data, determines {bounded}": bool(bounded),
        "the discrepancy takes initial stiffness from the parameters, so that intervals often miss them": (
            _takes_stiffness(study)
        ),
        f"the error of the emulator makes up to {100 * share:.0f} % of the variance": share > TOO_LARGE_SHARE,
    }
    return next((reason for reason, applies in reasons.items() if applies), "")


def _takes_stiffness(study: CalibrationStudy) -> bool:
    """Return whether the discrepancy has initial stiffness of its own: no zero load near by takes it away."""
    discrepancy, zero_load = study.calibration.problem.discrepancy, study.settings.zero_load
    if isinstance(discrepancy, PinnedProcess):
        return any(is_far(measured.control, zero_load) for measured in study.data.values())
    return isinstance(discrepancy, GaussianProcess)


def _share_of_emulator(study: CalibrationStudy) -> float:
    """Return the largest share of the variance of a parameter that is due to the emulator."""
    calibration = study.calibration
    return max(calibration.emulator_share[symbol] for symbol in calibration.problem.forward_symbols)


def _reporting(study: CalibrationStudy) -> tuple[Verdict, str]:
    """Return whether the parameters can be reported: what is said is that of the least certain one."""
    calibration = study.calibration
    widths = {}
    for symbol in calibration.problem.forward_symbols:
        low, high = calibration.marginals[symbol].hdi()
        has_sign = not low < 0 < high
        widths[symbol] = (high - low) / 2 / abs(calibration.marginals[symbol].mean) if has_sign else inf
    worst = max(widths, key=lambda symbol: widths[symbol])
    verdict, width = precision_of(widths[worst])
    if widths[worst] == inf:  # as of an angle, of which that may be enough
        verdict, width = Verdict.CARE, f"the interval of {worst} includes zero"
    elif len(widths) > 1:
        width = f"{worst} {width}, others better"
    share = _share_of_emulator(study)
    if share > LARGE_SHARE:
        verdict = worst_of(verdict, Verdict.CARE)
        width += f"; up to {100 * share:.0f} % of the variance is the error of the emulator"
    elif any(w.code == "inaccurate-emulator" and w.severity is not Severity.NOTE for w in calibration.warnings):
        verdict, width = worst_of(verdict, Verdict.CARE), f"{width}; see the warning about the emulator"
    if isinstance(calibration.problem.discrepancy, NoDiscrepancy):
        return worst_of(verdict, Verdict.CARE), f"{width}, {IF_RIGHT}"
    return verdict, width


def _predicting(study: CalibrationStudy) -> tuple[Verdict, str]:
    """Return whether what was measured is described, the discrepancy included: as the least certain quantity."""
    calibration = study.calibration
    if not calibration.converged:
        return Verdict.NO, "sampling has not converged"
    inside = calibration.predictive_coverage()
    counts = f"{100 * inside:.0f} % of the measurements inside the band"
    if inside < MIN_INSIDE or has_code(calibration.warnings, "unmodelled-curve"):
        return Verdict.NO, f"only {counts}" if inside < MIN_INSIDE else "the model does not give the measurements"
    verdict, width = precision_of(_half_width(calibration, discrepancy=True))
    return verdict, f"{width} on average where it was measured; {counts}"


def _half_width(calibration: Calibration, *, discrepancy: bool) -> float:
    """Return the half width of the band over its middle where it was measured, of the quantity with the widest one."""
    table = calibration.predict(noise=False, discrepancy=discrepancy)
    band = Band(*(table[name].to_numpy() for name in ("control", "mean", "low", "high")))
    return max(relative_half_width(band.at(slice(*ends))) for ends in calibration.problem.quantities.values())


def _of_model_alone(use: Use, study: CalibrationStudy) -> Use:
    """Return a use of the parameters elsewhere, where the model is by itself: its discrepancy does not go with them."""
    calibration = study.calibration
    if isinstance(calibration.problem.discrepancy, NoDiscrepancy):
        reason = f"{use.reason}; {IF_RIGHT}" if use.reason else IF_RIGHT
        return use._replace(verdict=worst_of(use.verdict, Verdict.CARE), reason=reason)
    inside = calibration.predictive_coverage(discrepancy=False)
    counts = f"{100 * inside:.0f} % of the measurements inside the band of the model alone"
    if inside < MIN_INSIDE:
        return use._replace(verdict=Verdict.NO, reason=f"only {counts}, and its discrepancy is of this experiment")
    if use.reason:
        return use
    verdict, width = precision_of(_half_width(calibration, discrepancy=False))
    return use._replace(verdict=verdict, reason=f"the model alone is {width} where it was measured; {counts}")


def finding_of(study: CalibrationStudy) -> str:
    """Return what the numbers are, and how much of their intervals the emulator makes."""
    if has_code(study.calibration.warnings, "unmodelled-curve"):
        return f"Not to be used: {NO_PARAMETERS_FIT}, and the intervals are of those that are least far from them."
    share = _share_of_emulator(study)
    size = "less than 1 %" if share < 0.01 else f"at most {100 * share:.0f} %"
    known = study.symbols_of_material | set(study.units)
    without_unit = [symbol for symbol in study.calibration.problem.forward_symbols if symbol not in known]
    units = f", {' and '.join(without_unit)} in the unit of the forward model" if without_unit else ""
    return f"Means, and intervals that hold 95 %{units}. The error of the emulator makes {size} of their variance."


def next_step_of(study: CalibrationStudy, uses: Sequence[Use]) -> str:
    """Return what to do next, given `uses_of_calibration`: what stands against the use of the parameters first."""
    calibration = study.calibration
    if has_code(calibration.warnings, "unmodelled-curve"):
        return "check units and signs of data and model (--unit, --factor), and the priors: no parameters fit the data."
    if not calibration.converged:
        return "make the posterior converge: repeat the command with --method nuts --force, or narrower priors."
    if has_code(calibration.warnings, "poorly-determined"):
        return "see whether the model reads the parameters that it hardly depends on, as the warning says."
    if bounded := ", ".join(symbols_in(calibration.warnings, "prior-bound")):
        return f"give {bounded} a wider --prior, and repeat the command with --force; keep a bound that nature sets."
    if _share_of_emulator(study) > LARGE_SHARE:
        return "make the emulator more accurate where the posterior is: repeat the command with --refine 20 --force."
    has_curves = any(np.ptp(measured.control) for measured in study.data.values())
    if has_curves and (not isinstance(calibration.problem.discrepancy, PinnedProcess) or _takes_stiffness(study)):
        is_unknown = any(is_far(measured.control, study.settings.zero_load) for measured in study.data.values())
        at = " --zero-load C, C the control at which there is no load (of stretches 1)" if is_unknown else ""
        return f"let the forward model be wrong: repeat the command with --discrepancy gp-pinned --force{at}."
    if calibration.predictive_coverage(discrepancy=False) < MIN_INSIDE:
        return "calibrate a model that comes nearer to the measurements, such as one with another law."
    if study.posterior is not None:
        return "take the material further: tissuq predict {run} (export and structure take the run, too)"
    if uses[-1].verdict is Verdict.NO:
        return "let another test narrow the parameters: repeat the command with --prior-run RUN or narrower priors."
    return (
        "name the law of the model and the stretches in it: repeat the command with --material LAW --range LOW:HIGH "
        "--force; predict, export and structure then take the run."
    )


def methods_of_calibration(study: CalibrationStudy, numbers: Sequence[Number]) -> Section:
    """Return the text for the methods section of a paper: data, model, emulator, priors, computation and result."""
    calibration, settings, problem = study.calibration, study.settings, study.calibration.problem
    kind, posterior = problem.discrepancy, calibration.posterior
    priors = ", ".join(f"{study.label(symbol)} {prior}" for symbol, prior in problem.priors.items())
    means = "; ".join(f"{number.name} {number.text} ({number.range})" for number in numbers)
    sentences = (
        f"The model {study.forward.name} was calibrated by Bayesian inference with tissuq {version('tissuq')} to "
        f"{len(problem.measured)} measurements, taken as {SUM_OF_PARTS}.",
        other_form(kind, kind.name) if kind.parameters else "No discrepancy was included: the model is right.",
        f"Noise sd: {noises_in_words(settings)}. Priors: {priors}.",
        f"The emulator, Gaussian processes of the model's outputs with the kernel {settings.kernel} and a "
        f"{settings.trend} mean, was made from {len(calibration.runs)} runs; the variance of its error is part of the "
        f"likelihood. Checks: {calibration.check}.",
        f"Posterior by {posterior.method}, effective size {min(posterior.ess.values()):.0f}. {posterior.verdict}",
        f"Posterior means, with 95 % highest-density intervals: {means}.",
    )
    return Section(METHODS, (" ".join(sentences),))


def noises_in_words(settings: CalibrationSettings) -> str:
    """Return the noise of every quantity."""
    return ", ".join(f"{sd} ({name})" if name else str(sd) for name, sd in settings.noises.items())
