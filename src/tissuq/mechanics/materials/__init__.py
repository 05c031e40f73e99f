"""The material library, one family a file; importing this package registers them all."""

from tissuq.mechanics.materials.ogden import Ogden1, Ogden2, Ogden3
from tissuq.mechanics.materials.polynomial import MooneyRivlin, NeoHookean, Yeoh

__all__ = ["MooneyRivlin", "NeoHookean", "Ogden1", "Ogden2", "Ogden3", "Yeoh"]
