"""PyMC models sampled by nutpie, compiled with Numba; two chains at a time."""

from typing import Any

import nutpie
import pymc as pm

from peers.outcome import Chains, fit_all
from peers.problem import Problem
from peers.pymc_model import chains_of, model_of


def compiled(model: pm.Model) -> Any:
    """Return a model with its gradient as machine code."""
    return nutpie.compile_pymc_model(model, backend="numba")


def sample(program: Any, symbols: tuple[str, ...], seed: int = 1) -> Chains:
    """Return the draws of a compiled model."""
    trace = nutpie.sample(program, draws=1000, tune=1000, chains=4, cores=2, seed=seed, progress_bar=False)
    return chains_of(trace, symbols)


def fit(problem: Problem) -> Chains:
    """Return the posterior of one formulation."""
    return sample(compiled(model_of(problem)), problem.symbols)


if __name__ == "__main__":
    fit_all(fit)
