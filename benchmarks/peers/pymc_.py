"""PyMC: its own NUTS, two chains at a time."""

import pymc as pm

from peers.outcome import Chains, fit_all
from peers.problem import Problem
from peers.pymc_model import chains_of, model_of


def fit(problem: Problem) -> Chains:
    """Return the posterior of one formulation."""
    trace = pm.sample(
        draws=1000,
        tune=1000,
        chains=4,
        cores=2,
        random_seed=1,
        nuts_sampler="pymc",
        progressbar=False,
        compute_convergence_checks=False,
        model=model_of(problem),
    )
    return chains_of(trace, problem.symbols)


if __name__ == "__main__":
    fit_all(fit)
