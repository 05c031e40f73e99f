"""tissuq: parameters of hyperelastic soft-tissue models, with uncertainty that can be trusted."""

from tissuq import finite_elements
from tissuq.assessment import Assessment, Average, Candidate, average, compare
from tissuq.discrepancy import Discrepancy, discrepancies
from tissuq.emulation import Calibration, Emulator, UmbridgeForward
from tissuq.ensemble import EnergyDraw, Ensemble
from tissuq.errors import ConvergenceError, InputError, ModelError, TissuqError
from tissuq.experiments import datasets
from tissuq.experiments.experiment import Experiment
from tissuq.experiments.inspection import Inspection, inspect
from tissuq.experiments.modes import LoadingMode, loading_modes
from tissuq.experiments.reading import read_experiment
from tissuq.fitting import fit, fit_many
from tissuq.mechanics import (
    FibreMaterial,
    FunctionLaw,
    Material,
    StretchMaterial,
    engineering_stress,
    initial_shear_modulus,
    load_material,
    simulate,
)
from tissuq.mechanics.material import materials
from tissuq.noise import KnownNoise, Noise, ProportionalNoise, RepeatNoise, UnknownNoise
from tissuq.parameters import Parameter
from tissuq.population import Population, fit_population
from tissuq.posterior import Posterior
from tissuq.priors import Exponential, Flat, HalfCauchy, HalfNormal, LogNormal, LogUniform, Normal, Prior, Uniform
from tissuq.report.cards import write_cards
from tissuq.studies.calibrate import calibrate
from tissuq.studies.earlier_run import load_run
from tissuq.studies.held_out import held_out_tests
from tissuq.studies.prediction import Prediction, predict_run
from tissuq.tolerances import Tolerances

__version__ = "0.1.0"

__all__ = [
    "Assessment",
    "Average",
    "Calibration",
    "Candidate",
    "ConvergenceError",
    "Discrepancy",
    "Emulator",
    "EnergyDraw",
    "Ensemble",
    "Experiment",
    "Exponential",
    "FibreMaterial",
    "Flat",
    "FunctionLaw",
    "HalfCauchy",
    "HalfNormal",
    "InputError",
    "Inspection",
    "KnownNoise",
    "LoadingMode",
    "LogNormal",
    "LogUniform",
    "Material",
    "ModelError",
    "Noise",
    "Normal",
    "Parameter",
    "Population",
    "Posterior",
    "Prediction",
    "Prior",
    "ProportionalNoise",
    "RepeatNoise",
    "StretchMaterial",
    "TissuqError",
    "Tolerances",
    "UmbridgeForward",
    "Uniform",
    "UnknownNoise",
    "average",
    "calibrate",
    "compare",
    "datasets",
    "discrepancies",
    "engineering_stress",
    "finite_elements",
    "fit",
    "fit_many",
    "fit_population",
    "held_out_tests",
    "initial_shear_modulus",
    "inspect",
    "load_material",
    "load_run",
    "loading_modes",
    "materials",
    "predict_run",
    "read_experiment",
    "simulate",
    "write_cards",
]
