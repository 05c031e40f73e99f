"""Loading modes: how a specimen is deformed, as a path of deformations along what each measured stress works on."""

from tissuq.experiments.modes.biaxial import Biaxial, ConstrainedUniaxial, ImposedStretches, InflatedTube, ThinTube
from tissuq.experiments.modes.mode import AlongAxis2, Control, LoadingMode, curve_modes, loading_mode, loading_modes
from tissuq.experiments.modes.one_control import Equibiaxial, Planar, SimpleShear, SimpleShearNormal, Uniaxial
from tissuq.experiments.modes.path import Deformation, Path, States

__all__ = [
    "AlongAxis2",
    "Biaxial",
    "ConstrainedUniaxial",
    "Control",
    "Deformation",
    "Equibiaxial",
    "ImposedStretches",
    "InflatedTube",
    "LoadingMode",
    "Path",
    "Planar",
    "SimpleShear",
    "SimpleShearNormal",
    "States",
    "ThinTube",
    "Uniaxial",
    "curve_modes",
    "loading_mode",
    "loading_modes",
]
