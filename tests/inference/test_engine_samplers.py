"""The sampled routes where several bounds cut: the linear parameters are drawn within them."""

from __future__ import annotations

import numpy as np

import tissuq as tq
from against import neo_hookean, uniform_priors
from dense import Axis, Linear, integrate, problem_of
from tissuq.inference.densities import conditional_density
from tissuq.inference.enumerators.sampled import _ConditionalDraws
from tissuq.model.statistical_model import StatisticalModel


def test_samplers_draw_the_linear_parameters_within_several_bounds():
    # At one value of S, means of 500 independent draws within five of their standard errors: false chance 2e-6.
    stretch = np.linspace(0.75, 1.4, 14)
    stress = 0.5 * neo_hookean(stretch) - 0.1 + 0.3 * (stretch - 1) ** 2
    linear = {symbol: Linear(0.0, 5.0) for symbol in ("C10", "C20", "C30")}
    kinds = tq.materials()["neo-hookean"](), tq.discrepancies()["yeoh"]()
    priors = uniform_priors(linear, {"S": Axis(0, 3, 0.01)})
    model = StatisticalModel(tq.Experiment("uniaxial", stretch, stress), *kinds, 0.02, priors)
    _, drawn = _ConditionalDraws(model, *conditional_density(model), np.full((4, 125, 1), 0.06)).mixture_and_draws(
        seed=1
    )
    # S = 0.06 beside a noise of 0.02 is a noise of their root sum of squares without S.
    problem = problem_of("yeoh", stretch, stress, linear, {}, float(np.hypot(0.02, 0.06)))
    for index, symbol in enumerate(model.linear):
        truth = integrate(problem, symbol)
        assert abs(drawn[..., index].mean() - truth.mean) < 5 * truth.sd / np.sqrt(500)
