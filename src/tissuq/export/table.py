"""Draws as plain tables of W1 = dW/dI1 and W2 = dW/dI2 against the invariants: for user subroutines and other tools."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tissuq.arrays import FloatArray
from tissuq.errors import InputError
from tissuq.export.cards import (
    CardFormat,
    Cards,
    CardSettings,
    draw_row,
    ensemble_lines,
    ensemble_sentences,
    file_name,
    words_of,
)
from tissuq.export.states import SeenStates, moduli
from tissuq.posterior.ensemble import Ensemble

ANGLES = (0.02, 7.5, 15.0, 22.5, 30.0, 37.5, 45.0, 52.5, 59.98)
"""Lode angles, degrees; the ends are so near to uniaxial and equibiaxial tension that nothing of note has changed."""
COLUMNS = ("lode_angle", "l1", "l2", "l3", "I1", "I2", "W1", "W2", "cauchy_1_less_3", "cauchy_2_less_3")


class Table(CardFormat):
    """W1 and W2 of any draw, its discrepancy included, from its principal Cauchy stresses by Rivlin's formulas.

    t_i - t_j = 2 (l_i^2 - l_j^2) (W1 + l_k^2 W2) in states between uniaxial and equibiaxial tension.
    """

    name = "table"
    description = "CSV tables of W1 and W2 against the invariants, exact for every draw"
    kind = "tables"
    unused = ("name", "number")

    def cards(self, ensemble: Ensemble, settings: CardSettings) -> Cards:
        if not ensemble[0].is_isotropic:
            raise InputError(
                f"material '{ensemble[0].parts[0][0].name}' has fibres, and W1 and W2 do not tell its stress: write "
                "cards for a finite-element code, such as febio or calculix."
            )
        if any(setting is not None for setting in (settings.law, settings.bulk_modulus, settings.poisson)):
            raise InputError(
                "tables are of the draws themselves, which are incompressible: leave out the law, the bulk modulus and "
                "Poisson's ratio (--law, --order, --bulk-modulus, --poisson), or write cards for a finite-element code."
            )
        states = SeenStates(ensemble.most, ANGLES)
        stress = ensemble.stress(states, states.points) * settings.factor
        shear = moduli(ensemble) * settings.factor
        common = [
            *ensemble_lines(ensemble, settings),
            f"stresses, W1 and W2 in {settings.unit}; W1 = dW/dI1, W2 = dW/dI2; incompressible; no projection",
        ]
        files, index = {}, []
        for draw_index, modulus in enumerate(shear):
            name = file_name(ensemble, draw_index, ".csv")
            heading = [f"draw {draw_index + 1} of {len(ensemble)}: {words_of(ensemble[draw_index], settings)}", *common]
            files[name] = _table(heading, _rows(states, stress[draw_index]))
            row = draw_row(ensemble[draw_index], settings, float(modulus))
            index.append({"file": name, **row})
        note = "The tables are exact: W1 and W2 of material and discrepancy at states whose invariants were measured."
        return Cards(files, tuple(index), (*ensemble_sentences(ensemble), note))


def _rows(states: SeenStates, stress: FloatArray) -> FloatArray:
    """Return the columns (n, 10) from the three differences of stresses (3 n,)."""
    count = len(stress) // 3
    squares = states.base[:, :count].T ** 2
    of_12, of_13, of_23 = stress.reshape(3, count)
    square_1, square_2, square_3 = squares.T
    gap_12, gap_13, gap_23 = square_1 - square_2, square_1 - square_3, square_2 - square_3
    sum_3, sum_2, sum_1 = 0.5 * of_12 / gap_12, 0.5 * of_13 / gap_13, 0.5 * of_23 / gap_23  # W1 + l_k^2 W2
    w2 = np.where(gap_12 > gap_23, (sum_1 - sum_2) / gap_12, (sum_2 - sum_3) / gap_23)
    w1 = sum_2 - square_2 * w2
    angles = np.repeat(ANGLES, count // len(ANGLES))
    invariants = squares.sum(axis=1), (1 / squares).sum(axis=1)
    return np.column_stack([angles, np.sqrt(squares), *invariants, w1, w2, of_13, of_23])


def _table(heading: Sequence[str], rows: FloatArray) -> str:
    lines = [*(f"# {line}" for line in heading), ",".join(COLUMNS)]
    lines += [",".join(f"{number:.10g}" for number in row) for row in rows]
    return "\n".join([*lines, ""])
