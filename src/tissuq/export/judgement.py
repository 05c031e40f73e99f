"""How near the cards of all draws are to the draws, and how stable: as columns of the index, comments and warnings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tissuq.arrays import BoolArray, FloatArray
from tissuq.export.draw_stresses import REACHES, DrawStresses, within
from tissuq.export.laws import Form, Law
from tissuq.export.nearest_law import WANTED_ERROR
from tissuq.export.projection import Projection
from tissuq.export.states import are_stable
from tissuq.posterior.draws_in_words import named_draws
from tissuq.posterior.ensemble import Ensemble

TOO_FAR = 0.1
"""Root mean square error of the stresses that were measured above which a card does not stand for its draw."""
MIN_STABLE_SHARE = 0.9
"""Share of stable draws above which projections are compared by their error alone."""


@dataclass(frozen=True, eq=False)
class JudgedLaw:
    """The law of all cards, its relative errors of stress against the draws, and whether each draw's card is stable.

    Attributes
    ----------
    law : Law
    form : Form
        In which a code writes it.
    projection : Projection or None
        That it is of; None where it is the draws' own law.
    errors : mapping of str to (N, n) array
        As `DrawStresses.errors` returns them, of all but the fibres, which are exact; none of a law that is the draws'.
    stable, stable_beyond : (N,) arrays of bool
        Over the range that was measured, and up to the last of `REACHES`.
    """

    law: Law
    form: Form
    projection: Projection | None
    errors: Mapping[str, FloatArray]
    stable: BoolArray
    stable_beyond: BoolArray

    @classmethod
    def of_draws(cls, ensemble: Ensemble, law: Law, form: Form) -> JudgedLaw:
        """Return the judgement of the law that draws are."""
        errors = DrawStresses(ensemble).errors(law.ensemble(ensemble)) if law.material.is_isotropic else {}
        return cls(law, form, None, errors, *_stable(law, ensemble))

    @classmethod
    def of_projection(
        cls, draws: DrawStresses, projection: Projection, law: Law, complete: Law, form: Form
    ) -> JudgedLaw:
        """Return the judgement of a projection in the place of draws, and as a whole with fibres beside it."""
        errors = draws.errors(law.ensemble(draws.ensemble))
        return cls(complete, form, projection, errors, *_stable(complete, draws.ensemble))

    @property
    def is_near(self) -> BoolArray:
        """Which cards (N,) are within 1 % in every state that was measured."""
        return np.asarray(self.errors[within(1)].max(axis=1) <= WANTED_ERROR)

    @property
    def sizes(self) -> FloatArray:
        """Root mean square errors (N,) of the cards in the states that were measured."""
        return np.asarray([_rms(error) for error in self.errors[within(1)]])

    @property
    def rank(self) -> tuple[bool, float]:
        """Sort key, smaller is better: nearly all draws stable first, then the smaller error."""
        return bool(self.stable.mean() < MIN_STABLE_SHARE), _rms(self.errors[within(1)])

    def row(self, draw: int) -> dict[str, float | bool]:
        """Return the columns of a draw in the index: largest and root mean square of errors, and stability."""
        row: dict[str, float | bool] = {}
        for name, error in self.errors.items():
            row |= {f"error_{name}_max": _largest(error[draw]), f"error_{name}_rms": _rms(error[draw])}
        stable = bool(self.stable[draw]), bool(self.stable_beyond[draw])
        return row | dict(zip(("card_is_stable", f"card_is_stable_within_{REACHES[-1]:g}"), stable, strict=True))

    def lines(self, draw: int) -> Iterator[str]:
        """Return the comments of a draw's card."""
        if self.projection is None:
            yield "the card's law is the draw's own, exactly"
        else:
            yield (
                f"PROJECTION: the card is the nearest of its form; relative error of stress{self._beside_fibres}, "
                "largest and rms:"
            )
            for name, error in self.errors.items():
                yield f"    {_label(name)}: {_percent(_largest(error[draw]))}, {_percent(_rms(error[draw]))}"
            if self.sizes[draw] > TOO_FAR:
                yield "    WARNING: the card does NOT stand for the draw: do not compute with it"
            if not self.is_near[draw]:
                yield f"    WARNING: the card is more than {_percent(WANTED_ERROR)} off in a state that was measured"
        if not self.stable[draw]:
            yield "    WARNING: the card is NOT stable over the whole calibrated range"
        elif not self.stable_beyond[draw]:
            yield f"    NOTE: the card is not stable up to {REACHES[-1]:g} times the measured invariants"

    def sentences(self, code: str, rivals: Sequence[JudgedLaw]) -> Iterator[str]:
        """Return what the user must read of all cards, and which rival families of a code are nearer to some draws."""
        if self.projection is None:
            yield f"The cards are the draws' own law, exactly: {self.form.keyword}."
        else:
            yield from self._wrong_cards()
            yield (
                f"The draws' own law has no card in {code}, so every card is the nearest {self.form.keyword}: its "
                f"stresses{self._beside_fibres} differ from the draw's by (root mean square; largest, of all draws) "
                + "; ".join(
                    f"{_label(name)} {_percent(_rms(error))}, {_percent(_largest(error))}"
                    for name, error in self.errors.items()
                    if name != "states"
                )
                + ". Every file and the index give the errors of each draw."
            )
            yield from self._far_cards(rivals)
        yield from self._unstable_cards()

    @property
    def _beside_fibres(self) -> str:
        return "" if self.law.material.is_isotropic else " (all but that of the fibres, which is exact)"

    def _wrong_cards(self) -> Iterator[str]:
        wrong = np.flatnonzero(self.sizes > TOO_FAR)
        if len(wrong):
            ends = dict.fromkeys(map(_percent, (self.sizes[wrong].min(), self.sizes[wrong].max())))
            yield (
                f"Do NOT compute with the cards of {named_draws(wrong)} of {len(self.stable)}: their stresses are off "
                f"by {' to '.join(ends)} (root mean square over the states that were measured)."
            )

    def _far_cards(self, rivals: Sequence[JudgedLaw]) -> Iterator[str]:
        far = np.flatnonzero(~self.is_near)
        if not len(far):
            return
        better = [rival for rival in rivals if rival.projection and rival.is_near.sum() > self.is_near.sum()]
        if better:
            best = max(better, key=lambda rival: int(rival.is_near.sum()))
            assert best.projection is not None  # noqa: S101 (as chosen above)
            way = (
                f"with --law {best.projection.family} --order {best.projection.order} "
                f"{int(best.is_near.sum())} of all would be within it"
            )
        else:
            exact = "--format table" if self.law.material.is_isotropic else "tissuq.finite_elements.FElupeMaterial"
            way = f"none of this code's other laws is nearer to more of them; {exact} is exact"
        yield (
            f"The cards of {named_draws(far)} of {len(self.stable)} are more than {_percent(WANTED_ERROR)} off in some "
            f"measured state: {way}."
        )

    def _unstable_cards(self) -> Iterator[str]:
        lost = np.flatnonzero(~self.stable)
        if len(lost):
            yield (
                f"The cards of {named_draws(lost)} are NOT stable over the whole calibrated range. Leave them out, or "
                "choose another law with --law."
            )
        lost = np.flatnonzero(self.stable & ~self.stable_beyond)
        if len(lost):
            yield (
                f"The cards of {named_draws(lost)} are not stable up to {REACHES[-1]:g} times the measured invariants: "
                "a model that goes so far may stop there."
            )


def _stable(law: Law, like: Ensemble) -> tuple[BoolArray, BoolArray]:
    """Return whether draws of a law in the place of others are stable, as measured and up to the last of `REACHES`."""
    cards = law.ensemble(like)
    return are_stable(cards), are_stable(cards, REACHES[-1])


def _largest(error: FloatArray) -> float:
    """Return the largest error where the draw has a stress itself."""
    return float(np.nanmax(np.abs(error)))


def _rms(error: FloatArray) -> float:
    return float(np.sqrt(np.nanmean(error**2)))


def _label(name: str) -> str:
    """Return the words for errors of one name."""
    words = {"states": "each difference of stresses in any measured state", within(1): "any measured state"} | {
        within(reach): f"to {reach:g} times the measured invariants" for reach in REACHES[1:]
    }
    return words.get(name, name)


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"
