"""Weighted points of adapted proposals against densities whose mass is known."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from tissuq.inference.proposals import Proposal, fitted_mixture, fitted_proposal, weighted_points
from tissuq.inference.quasi_monte_carlo import log_normal, sobol_rounds

WIDE = [(1.0, Proposal(np.zeros(2), np.eye(2)))]


def two_peaks(points):
    far, near = ((points - centre) / sd for centre, sd in (((1.5, 1.0), 0.1), ((-1.0, -1.5), 0.05)))
    return np.logaddexp(np.log(0.3 / 0.1**2) + log_normal(far), np.log(0.7 / 0.05**2) + log_normal(near))


def funnel(points):
    return log_normal(points[:, :1]) + log_normal(points[:, 1:] / np.exp(points[:, :1])) - points[:, 0]


def bent_ridge(points):
    across = np.stack([points[:, 0], (points[:, 1] - points[:, 0] ** 2 + 1) / 0.03], axis=1)
    return log_normal(across) - np.log(0.03)


@pytest.mark.parametrize("log_density", [two_peaks, funnel, bent_ridge])
def test_the_mass_of_a_density_is_found(log_density):
    rounds = islice(sobol_rounds(2, 1024, seed=0), 12)
    *_, weighted = weighted_points(log_density, [WIDE], rounds, fitted_mixture)
    assert np.exp(weighted.log_weights).mean() == pytest.approx(1.0, abs=0.05)
    assert weighted.log_mass == pytest.approx(0.0, abs=0.05)


def test_weights_of_a_round_are_those_of_its_proposals_alone():
    rounds = sobol_rounds(2, 256, seed=0)
    first, second = islice(weighted_points(two_peaks, [WIDE], rounds, fitted_proposal), 2)
    ((_, proposal),) = fitted_proposal(first.points, first.log_weights)
    new = second.points[256:]
    assert second.log_weights_of_round == pytest.approx(two_peaks(new) - proposal.log_density(new))
    both = np.logaddexp(proposal.log_density(new), WIDE[0][1].log_density(new)) - np.log(2)
    assert second.log_weights[256:] == pytest.approx(two_peaks(new) - both)


def test_both_peaks_keep_their_shares():
    rounds = islice(sobol_rounds(2, 1024, seed=1), 8)
    *_, (points, log_weights, _) = weighted_points(two_peaks, [WIDE], rounds, fitted_mixture)
    weights = np.exp(log_weights) / np.exp(log_weights).sum()
    assert weights[points[:, 0] > 0].sum() == pytest.approx(0.3, abs=0.02)
    shares = [share for share, proposal in fitted_mixture(points, log_weights) if proposal.mean[0] > 0]
    assert sum(shares) == pytest.approx(0.3, abs=0.03)
