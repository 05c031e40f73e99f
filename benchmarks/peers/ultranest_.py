"""UltraNest: reactive nested sampling with its defaults and a vectorised likelihood."""

import logging

import numpy as np
from ultranest import ReactiveNestedSampler

from peers.outcome import Weighted, fit_all
from peers.problem import Problem

logging.disable(logging.INFO)


def fit(problem: Problem) -> Weighted:
    """Return the posterior of one formulation."""
    np.random.seed(1)  # noqa: NPY002  (the generator that UltraNest draws from)
    sampler = ReactiveNestedSampler(
        list(problem.symbols), problem.log_likelihood, transform=problem.from_cube, vectorized=True
    )
    found = sampler.run(show_status=False, viz_callback=False)
    weighted = found["weighted_samples"]
    return Weighted(weighted["points"], weighted["weights"], found["logz"], found["logzerr"])


if __name__ == "__main__":
    fit_all(fit)
