"""tissuq: parameters of hyperelastic soft-tissue models, with uncertainty that can be trusted."""

from tissuq.discrepancy import Discrepancy, discrepancies
from tissuq.errors import ConvergenceError, InputError, ModelError, TissuqError
from tissuq.experiments import datasets
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.modes import LoadingMode, loading_modes
from tissuq.experiments.reading import read_experiment
from tissuq.fitting import fit
from tissuq.mechanics import Material, engineering_stress, initial_shear_modulus, simulate
from tissuq.mechanics.material import materials
from tissuq.parameters import Parameter
from tissuq.posterior import Posterior
from tissuq.priors import Exponential, HalfCauchy, HalfNormal, LogNormal, Normal, Prior, Uniform

__version__ = "0.1.0"

__all__ = [
    "ConvergenceError",
    "Discrepancy",
    "Experiment",
    "Exponential",
    "HalfCauchy",
    "HalfNormal",
    "InputError",
    "LoadingMode",
    "LogNormal",
    "Material",
    "ModelError",
    "Normal",
    "Parameter",
    "Posterior",
    "Prior",
    "TissuqError",
    "Uniform",
    "datasets",
    "discrepancies",
    "engineering_stress",
    "fit",
    "initial_shear_modulus",
    "loading_modes",
    "materials",
    "read_experiment",
    "simulate",
]
