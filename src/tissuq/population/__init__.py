"""Several specimens: what they have in common, each of them within it, and a new patient."""

from tissuq.population.pooling import fit_population
from tissuq.population.population import Population

__all__ = ["Population", "fit_population"]
