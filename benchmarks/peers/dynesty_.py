"""dynesty: static nested sampling with its defaults, which gives posterior and evidence together."""

import dynesty
import numpy as np

from peers.outcome import Weighted, fit_all
from peers.problem import Problem


def fit(problem: Problem) -> Weighted:
    """Return the posterior of one formulation."""
    sampler = dynesty.NestedSampler(
        lambda point: problem.log_likelihood(point[None])[0],
        problem.from_cube,
        len(problem.symbols),
        rstate=np.random.default_rng(1),
    )
    sampler.run_nested(print_progress=False)
    found = sampler.results
    return Weighted(found.samples, found.importance_weights(), found.logz[-1], found.logzerr[-1])


if __name__ == "__main__":
    fit_all(fit)
