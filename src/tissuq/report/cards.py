"""The folder of material cards: a file for each draw, and an index of all."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

from tissuq.errors import InputError
from tissuq.export import Cards, CardSettings, card_format
from tissuq.export.cards import distances_from_median
from tissuq.parameters.checks import checked_path
from tissuq.posterior.ensemble import Ensemble
from tissuq.report.run_folder import run_folder

INDEX = "index.csv"


def write_cards(
    ensemble: Ensemble, folder: str | Path, format: str = "abaqus", *, force: bool = False, **settings: Any
) -> Cards:
    """Write draws of a posterior as material cards for a finite-element code.

    Every draw is a file of its own, with the same name of the material in all, so that a model includes one after
    the other; ``index.csv`` has a row for each: parameters, constants, and how far the card is from the draw.

    Parameters
    ----------
    ensemble : Ensemble
        Of `Posterior.ensemble`.
    folder : str or Path
        A new folder.
    format : str
        ``"abaqus"``, ``"calculix"``, ``"ansys"``, ``"febio"``, ``"ls-dyna"``, or ``"table"``.
    force : bool
        Replace the folder of earlier cards.
    **settings
        As `tissuq.export.CardSettings`: ``law``, ``order``, ``unit``, ``bulk_modulus``, ``poisson``, ``name``,
        ``source``.

    Returns
    -------
    Cards
        Texts, rows of the index with the distance of every draw from the median stresses, and warnings.

    Raises
    ------
    InputError
        When the folder exists, or the code has no such law.

    Examples
    --------
    >>> import tempfile
    >>> import tissuq as tq
    >>> stretch = [0.7, 0.8, 0.9, 0.95, 1.05, 1.1, 1.2, 1.3, 1.4, 1.5, 1.7, 2.0]
    >>> data = tq.simulate("yeoh", {"C10": 0.5, "C20": 0.1, "C30": 0.0}, stretch, noise_sd=0.02, seed=1)
    >>> draws = tq.fit(data, material="yeoh", discrepancy="none", noise_sd=0.02).ensemble(4)
    >>> with tempfile.TemporaryDirectory() as place:
    ...     cards = tq.write_cards(draws, f"{place}/cards", "calculix", unit="kPa")
    >>> cards.warnings[0]
    "The cards are the draws' own law, exactly: YEOH."
    >>> print(cards.files["draw-1.inp"].splitlines()[-2])
    *HYPERELASTIC, YEOH
    """
    if not isinstance(ensemble, Ensemble):
        raise InputError(f"draws are needed, as posterior.ensemble(20) returns them, not {ensemble!r:.80}.")
    with run_folder(checked_path(folder, "a new folder"), "export", force=force) as scratch:
        cards = card_format(format).checked_cards(ensemble, CardSettings(**settings))
        pairs = zip(cards.index, distances_from_median(ensemble).tolist(), strict=True)
        cards = replace(cards, index=tuple({**row, "from_median": distance} for row, distance in pairs))
        for name, text in cards.files.items():
            (scratch / name).write_text(text, encoding="utf-8")
        with (scratch / INDEX).open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, list(cards.index[0]))
            writer.writeheader()
            writer.writerows(cards.index)
    return cards
