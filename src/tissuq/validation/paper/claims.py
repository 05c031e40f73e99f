"""The claims of the paper, each tested on the findings from every data set."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tissuq.posterior.posterior import Posterior
from tissuq.prediction.bands import Band, predict_band


@dataclass(frozen=True)
class Finding:
    """The posterior of C10 and the predictive checks of one formulation on one data set."""

    low: float
    high: float
    holds_truth: bool
    measurements: int
    inside: float
    inside_model_only: float
    band_width: float
    mean_shift: float
    """Largest distance of the predicted median from that of no discrepancy, relative to the largest stress."""
    log_evidence: float | None

    @property
    def passes(self) -> bool:
        """Whether the data pass the predictive check with the discrepancy (eq. 27)."""
        return passes(self.inside, self.measurements)

    @property
    def passes_model_only(self) -> bool:
        """Whether the data pass the predictive check of the model alone (eq. 28)."""
        return passes(self.inside_model_only, self.measurements)


Findings = Mapping[str, Finding]
"""What one data set says about every formulation."""


def find(posterior: Posterior, truth: float, base: Band | None = None) -> Finding:
    """Return the finding of a posterior; ``base`` is the predictive band without discrepancy."""
    data = posterior.model.experiment
    low, high = posterior.solution.marginals["C10"].hdi()
    band = predict_band(posterior.solution, data.stretch)
    shift = np.abs(band.median - base.median).max() / np.abs(data.stress).max() if base else 0.0
    return Finding(
        low=low,
        high=high,
        holds_truth=low <= truth <= high,
        measurements=len(data),
        inside=posterior.predictive_coverage(),
        inside_model_only=posterior.predictive_coverage(discrepancy=False),
        band_width=float(np.mean(band.high - band.low)),
        mean_shift=float(shift),
        log_evidence=posterior.log_evidence,
    )


def passes(share: float, measurements: int) -> bool:
    """Return whether a share inside a 95 % band is what chance allows: not in the lowest 2.5 % of a binomial law."""
    from scipy.special import bdtr

    return bool(bdtr(round(share * measurements), measurements, 0.95) > 0.025)


INFLATED = ("constant", "linear", "mooney-rivlin")


@dataclass(frozen=True)
class Claim:
    """One statement of the paper: how it is tested on one data set, and what is reported of it.

    The test returns None where a data set cannot decide.
    """

    text: str
    test: Callable[[Findings], bool | None]
    report: Callable[[Findings], str]
    note: str = ""


@dataclass(frozen=True)
class Verdict:
    """Result for a claim: on the run's own data set, and how often over all data sets."""

    claim: Claim
    holds: bool | None
    observed: str
    times: int
    decided: int

    @property
    def word(self) -> str:
        """The verdict on the run's own data set, in a word or two."""
        return {True: "confirmed", False: "not confirmed", None: "undecided"}[self.holds]


def judge(data_sets: Sequence[Findings]) -> list[Verdict]:
    """Return the verdict on every claim; the first data set is the run's own."""
    verdicts = []
    for claim in CLAIMS:
        results = [claim.test(findings) for findings in data_sets]
        decided = [result for result in results if result is not None]
        verdicts.append(Verdict(claim, results[0], claim.report(data_sets[0]), sum(decided), len(decided)))
    return verdicts


def _interval(name: str) -> Callable[[Findings], str]:
    def report(findings: Findings) -> str:
        finding = findings[name]
        holds = "holds" if finding.holds_truth else "misses"
        return (
            f"{_count(finding.inside, finding)} inside the band; the 95 % interval of C10, "
            f"[{finding.low:.3f}, {finding.high:.3f}] MPa, {holds} the true value"
        )

    return report


def _alone(name: str) -> Claim:
    return Claim(
        f"The model alone, without the discrepancy's share (eq. 28), does not describe the data: {name}.",
        lambda findings: not findings[name].passes_model_only,
        lambda findings: f"{_count(findings[name].inside_model_only, findings[name])} inside the model's own band",
    )


def _passes_and_misses(name: str) -> Claim:
    return Claim(
        f"The {name} form passes the predictive check (eq. 27) and yet misses C10.",
        lambda findings: findings[name].passes and not findings[name].holds_truth,
        _interval(name),
    )


def _count(share: float, finding: Finding) -> str:
    return f"{round(share * finding.measurements)} of {finding.measurements} measurements"


def _oftener(findings: Findings) -> bool | None:
    constant, none = findings["constant"].holds_truth, findings["none"].holds_truth
    return None if constant == none else constant


def _widths(findings: Findings) -> dict[str, float]:
    return {name: findings[name].band_width / findings["none"].band_width for name in INFLATED}


def _band_report(findings: Findings) -> str:
    widths = ", ".join(f"{name} {ratio:.1f} times" for name, ratio in _widths(findings).items())
    inside = ", ".join(f"{100 * findings[name].inside:.0f} %" for name in INFLATED)
    shift = max(findings[name].mean_shift for name in INFLATED)
    return (
        f"band width relative to no discrepancy: {widths}; measurements inside: {inside}; "
        f"the mean curve moves by at most {100 * shift:.0f} % of the largest stress"
    )


CLAIMS = (
    Claim(
        "Without model uncertainty the predictive band misses the data.",
        lambda findings: not findings["none"].passes,
        lambda findings: f"{_count(findings['none'].inside, findings['none'])} inside the band",
    ),
    _passes_and_misses("quadratic"),
    _passes_and_misses("gp"),
    Claim(
        "With the Yeoh mean the 95 % interval of C10 contains the true value.",
        lambda findings: findings["yeoh"].holds_truth,
        _interval("yeoh"),
    ),
    _alone("quadratic"),
    _alone("yeoh"),
    _alone("gp"),
    Claim(
        "The constant mean holds the true C10 more often than no discrepancy.",
        _oftener,
        lambda findings: "; ".join(
            f"{name}: [{findings[name].low:.3f}, {findings[name].high:.3f}] MPa "
            f"{'holds' if findings[name].holds_truth else 'misses'} it"
            for name in ("constant", "none")
        ),
        "The paper says both: section 5.4 calls the constant mean like the base model, its conclusion calls it better. "
        "A data set counts when exactly one of the two holds the truth.",
    ),
    Claim(
        "The bands of the constant, linear and Mooney-Rivlin forms are hardly changed from no discrepancy.",
        lambda findings: max(_widths(findings).values()) < 1.5,
        _band_report,
        "With S free under a wide prior the band inflates until it holds about 95 % of the data; it is the mean curve "
        "that hardly changes. Counted as confirmed when no band is half as wide again.",
    ),
)
