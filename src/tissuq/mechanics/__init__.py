"""What the material says: strain energies, and stress as their derivative along a loading mode."""

from tissuq.mechanics.laws import MooneyRivlin, NeoHookean, Ogden1, Ogden2, Ogden3, Yeoh
from tissuq.mechanics.laws.fibres import FibreMaterial
from tissuq.mechanics.material import Material, StretchMaterial
from tissuq.mechanics.named import material_named, standard_name
from tissuq.mechanics.simulate import simulate
from tissuq.mechanics.stress import engineering_stress, initial_shear_modulus, stress_basis, traced_stress_basis
from tissuq.mechanics.user_law import FunctionLaw, load_material

__all__ = [
    "FibreMaterial",
    "FunctionLaw",
    "Material",
    "MooneyRivlin",
    "NeoHookean",
    "Ogden1",
    "Ogden2",
    "Ogden3",
    "StretchMaterial",
    "Yeoh",
    "engineering_stress",
    "initial_shear_modulus",
    "load_material",
    "material_named",
    "simulate",
    "standard_name",
    "stress_basis",
    "traced_stress_basis",
]
