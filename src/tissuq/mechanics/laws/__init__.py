"""The library of material laws, one family a file; importing this package registers them all."""

from tissuq.mechanics.laws.arruda_boyce import ArrudaBoyce
from tissuq.mechanics.laws.exponential import Demiray, Fung, VerondaWestmann
from tissuq.mechanics.laws.extended_tube import ExtendedTube
from tissuq.mechanics.laws.fibres import DispersedFibres, ExponentialFibres, StandardFibres
from tissuq.mechanics.laws.gent import Gent, GentGent
from tissuq.mechanics.laws.knowles import Knowles
from tissuq.mechanics.laws.ogden import Ogden, Ogden1, Ogden2, Ogden3
from tissuq.mechanics.laws.polynomial import Biderman, Isihara, MooneyRivlin, NeoHookean, Rivlin, Yeoh
from tissuq.mechanics.laws.valanis_landel import Hencky, PengLandel, ValanisLandel
from tissuq.mechanics.laws.van_der_waals import VanDerWaals
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
