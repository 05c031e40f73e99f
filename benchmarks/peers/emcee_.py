"""emcee as its tutorial shows: 32 walkers in a small ball around the maximum, 5000 steps; no evidence."""

import emcee
import numpy as np
from scipy.optimize import minimize

from peers.outcome import Chains, Floats, fit_all
from peers.problem import Problem

WALKERS = 32


def fit(problem: Problem) -> Chains:
    """Return the posterior of one formulation, walkers as chains."""

    def log_density(points: Floats) -> Floats:
        inside = np.isfinite(problem.log_prior(points))
        density = np.full(len(points), -np.inf)
        density[inside] = problem.log_likelihood(points[inside])
        return density

    start = problem.from_cube(np.full(len(problem.symbols), 0.55))
    bounds = list(zip(*problem.bounds, strict=True))
    best = minimize(lambda point: -log_density(point[None])[0], start, method="Nelder-Mead", bounds=bounds).x
    ball = best + 1e-4 * np.random.default_rng(1).standard_normal((WALKERS, len(best)))
    sampler = emcee.EnsembleSampler(WALKERS, len(best), log_density, vectorize=True)
    np.random.seed(1)  # noqa: NPY002  (the generator that emcee draws from)
    sampler.run_mcmc(np.clip(ball, problem.bounds[0] + 1e-6, problem.bounds[1] - 1e-6), 5000)
    return Chains(np.swapaxes(sampler.get_chain(discard=1000), 0, 1))


if __name__ == "__main__":
    fit_all(fit)
