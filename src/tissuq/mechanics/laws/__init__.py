"""The library of material laws, one family a file; importing this package registers them all."""

from tissuq.mechanics.laws.fibres import DispersedFibres, ExponentialFibres, StandardFibres
from tissuq.mechanics.laws.limiting_chains import ArrudaBoyce, ExtendedTube, Gent, GentGent, VanDerWaals
from tissuq.mechanics.laws.polynomial import Biderman, Isihara, MooneyRivlin, NeoHookean, Rivlin, Yeoh
from tissuq.mechanics.laws.separable import Hencky, Ogden, Ogden1, Ogden2, Ogden3, PengLandel, ValanisLandel
from tissuq.mechanics.laws.stiffening import Demiray, Fung, Knowles, VerondaWestmann
from tissuq.mechanics.material import MaterialSum

__all__ = [
    "ArrudaBoyce",
    "Biderman",
    "Demiray",
    "DispersedFibres",
    "ExponentialFibres",
    "ExtendedTube",
    "Fung",
    "Gent",
    "GentGent",
    "Hencky",
    "Isihara",
    "Knowles",
    "MaterialSum",
    "MooneyRivlin",
    "NeoHookean",
    "Ogden",
    "Ogden1",
    "Ogden2",
    "Ogden3",
    "PengLandel",
    "Rivlin",
    "StandardFibres",
    "ValanisLandel",
    "VanDerWaals",
    "VerondaWestmann",
    "Yeoh",
]
