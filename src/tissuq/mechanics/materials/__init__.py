"""The material library, one family a file; importing this package registers them all."""

from tissuq.mechanics.materials.arruda_boyce import ArrudaBoyce
from tissuq.mechanics.materials.exponential import Demiray, Fung, VerondaWestmann
from tissuq.mechanics.materials.extended_tube import ExtendedTube
from tissuq.mechanics.materials.fibres import DispersedFibres, ExponentialFibres, StandardFibres
from tissuq.mechanics.materials.gent import Gent, GentGent
from tissuq.mechanics.materials.knowles import Knowles
from tissuq.mechanics.materials.ogden import Ogden, Ogden1, Ogden2, Ogden3
from tissuq.mechanics.materials.polynomial import Biderman, Isihara, MooneyRivlin, NeoHookean, Rivlin, Yeoh
from tissuq.mechanics.materials.sums import MaterialSum
from tissuq.mechanics.materials.valanis_landel import Hencky, PengLandel, ValanisLandel
from tissuq.mechanics.materials.van_der_waals import VanDerWaals

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
