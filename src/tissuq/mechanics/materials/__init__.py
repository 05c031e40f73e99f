"""The material library, one family a file; importing this package registers them all."""

from tissuq.mechanics.materials.polynomial import MooneyRivlin, NeoHookean, Yeoh

__all__ = ["MooneyRivlin", "NeoHookean", "Yeoh"]
