"""tissuq through its public interface: posterior summary and log evidence of all seven."""

import tissuq as tq
from peers.outcome import Known, fit_all
from peers.problem import BOUNDS, NOISE_SD, STRESS, STRETCH, Problem


def fit(problem: Problem) -> Known:
    """Return the posterior of one formulation."""
    data = tq.Experiment(mode="uniaxial", stretch=STRETCH, stress=STRESS)
    priors = {symbol: tq.Uniform(*BOUNDS[symbol]) for symbol in problem.symbols}
    posterior = tq.fit(data, material="neo-hookean", discrepancy=problem.name, noise_sd=NOISE_SD, priors=priors, seed=1)
    C10 = posterior.summary().loc["C10"]
    draws = posterior.solution.draws["C10"]
    return Known(float(C10["mean"]), float(C10["sd"]), draws.size, posterior.log_evidence)


if __name__ == "__main__":
    fit_all(fit)
