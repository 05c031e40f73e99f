"""Weighted points of mixtures of proposals against densities whose mass is known."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from tissuq.inference.proposal_mixture import fitted, weighted_points
from tissuq.inference.quasi_monte_carlo import Proposal, log_normal

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
    *_, (_, log_weights) = islice(weighted_points(log_density, [WIDE], 1024, seed=0), 12)
    assert np.exp(log_weights).mean() == pytest.approx(1.0, abs=0.05)


def test_both_peaks_keep_their_shares():
    *_, (points, log_weights) = islice(weighted_points(two_peaks, [WIDE], 1024, seed=1), 8)
    weights = np.exp(log_weights) / np.exp(log_weights).sum()
    assert weights[points[:, 0] > 0].sum() == pytest.approx(0.3, abs=0.02)
    shares = [share for share, proposal in fitted(points, log_weights) if proposal.mean[0] > 0]
    assert sum(shares) == pytest.approx(0.3, abs=0.03)
