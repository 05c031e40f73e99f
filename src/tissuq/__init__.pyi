"""The public names, and the modules they are imported from when they are first used."""

from tissuq import decks as decks
from tissuq import finite_elements as finite_elements
from tissuq import mechanics as mechanics
from tissuq.assessment import Assessment as Assessment, Average as Average, average as average, compare as compare
from tissuq.emulation import (
    Calibration as Calibration,
    DeckForward as DeckForward,
    Emulator as Emulator,
    UmbridgeForward as UmbridgeForward,
)
from tissuq.errors import (
    ConvergenceError as ConvergenceError,
    InputError as InputError,
    ModelError as ModelError,
    TissuqError as TissuqError,
)
from tissuq.experiments import datasets as datasets
from tissuq.experiments.experiment import Experiment as Experiment
from tissuq.experiments.reading.inspection import Inspection as Inspection, inspect as inspect
from tissuq.experiments.modes.mode import LoadingMode as LoadingMode, loading_modes as loading_modes
from tissuq.experiments.reading.read import read as read, read_experiment as read_experiment
from tissuq.experiments.reading.table_of_specimens import read_sizes as read_sizes
from tissuq.experiments.reading.tests_in_file import read_tests as read_tests
from tissuq.mechanics import (
    engineering_stress as engineering_stress,
    initial_shear_modulus as initial_shear_modulus,
    load_material as load_material,
    simulate as simulate,
)
from tissuq.mechanics.laws.fibres import FibreMaterial as FibreMaterial
from tissuq.mechanics.material import Material as Material, StretchMaterial as StretchMaterial, materials as materials
from tissuq.mechanics.user_law import FunctionLaw as FunctionLaw
from tissuq.model.discrepancy import discrepancies as discrepancies
from tissuq.model.discrepancy.discrepancy import Discrepancy as Discrepancy
from tissuq.model.measurement_errors import MeasurementError as MeasurementError
from tissuq.model.noise import (
    KnownNoise as KnownNoise,
    Noise as Noise,
    ProportionalNoise as ProportionalNoise,
    RepeatNoise as RepeatNoise,
    UnknownNoise as UnknownNoise,
)
from tissuq.model.tolerances import Tolerances as Tolerances, estimands as estimands
from tissuq.next_test import Candidate as Candidate
from tissuq.parameters.parameter import Parameter as Parameter
from tissuq.parameters.priors import (
    Exponential as Exponential,
    Flat as Flat,
    HalfCauchy as HalfCauchy,
    HalfNormal as HalfNormal,
    LogNormal as LogNormal,
    LogUniform as LogUniform,
    Normal as Normal,
    Prior as Prior,
    Uniform as Uniform,
)
from tissuq.population import Population as Population, fit_population as fit_population
from tissuq.posterior.ensemble import EnergyDraw as EnergyDraw, Ensemble as Ensemble
from tissuq.posterior.fitting import fit as fit, fit_many as fit_many
from tissuq.posterior.laws import LawComparison as LawComparison, fit_laws as fit_laws
from tissuq.posterior.posterior import Posterior as Posterior
from tissuq.posterior.plots import plot_compare as plot_compare
from tissuq.report.cards import write_cards as write_cards
from tissuq.studies.calibrate import calibrate as calibrate
from tissuq.studies.earlier_run import load as load, load_run as load_run
from tissuq.studies.specimen import held_out_tests as held_out_tests
from tissuq.studies.predict_run import predict_run as predict_run
from tissuq.studies.prediction import Prediction as Prediction

__version__: str
