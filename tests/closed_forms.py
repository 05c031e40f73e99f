"""Stresses of every material by tensors and closed forms, which share no code with the materials.

The Cauchy stress is 2 W1 B - 2 W2 B^-1 + sum over k of l_k w'(l_k) n_k n_k + sum over fibres of 2 W4 F a (F a)' - p I,
with the derivatives W1, W2 and W4 of an energy of the invariants and a sum of w(l_k); the free face gives p.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import special_ortho_group

from loading import LARGEST, MEASURED
from tissuq.mechanics import material_named
from tissuq.mechanics.material import SUMS, materials

RELATIVE = 1e-10
TURN = special_ortho_group.rvs(3, random_state=7)
OTHER_NAMES = (
    "rivlin:C10,C01,C11,C22", "ogden-5", "gent+mooney-rivlin", "demiray+veronda-westmann", "ogden-1+hencky",
    "neo-hookean+exponential-fibres", "mooney-rivlin+dispersed-fibres:one@35", "neo-hookean+standard-fibres:one",
    "ogden-1+dispersed-fibres:one@0", "neo-hookean+exponential-fibres:one@0+exponential-fibres@40",
)  # fmt: skip
EVERY = [kind() for kind in materials().values()] + [material_named(name) for name in OTHER_NAMES]


def values_of(material, seed=0, largest=LARGEST):
    """Return values for every parameter: linear ones of size one, the others from their default prior."""
    rng = np.random.default_rng(seed)
    return np.array([rng.normal() if p.is_linear else nonlinear(p, rng.random(), largest) for p in material.parameters])


def nonlinear(parameter, probability, largest=LARGEST):
    unit = {"limit": largest, "rate": 1 / largest}.get(parameter.dimension, 1.0)
    return float(parameter.relative_prior.scaled(unit).quantile(probability))


def langevin(x):
    return 1 / np.tanh(x) - 1 / x


def inverse_langevin(y):
    """Kröger (2015), the formula as he prints it."""
    return (3 * y - y / 5 * (6 * y**2 + y**4 - 2 * y**6)) / (1 - y**2)


def eight_chains(I1, mu, limit):
    """W1 = n k T sqrt(N) L^-1(c / sqrt(N)) / (6 c), where c = sqrt(I1 / 3) is the stretch of a chain."""
    N = 1 + limit / 3

    def slope(c):
        return np.sqrt(N) * inverse_langevin(c / np.sqrt(N)) / (6 * c)

    return mu / 2 * slope(np.sqrt(I1 / 3)) / slope(1.0)


def van_der_waals(I1, mu, attraction, limit):
    h = np.sqrt((I1 - 3) / limit)
    return mu / 2 / (1 - h) - attraction / 2 * np.sqrt((I1 - 3) / 2)


def cross_links(I1, Gc, limit):
    d, x = 1 / limit, I1 - 3
    return Gc / 2 * ((1 - d) / (1 - d * x) ** 2 - d / (1 - d * x))


def squared_strain(I1, I2, mu, b):
    """Green's strain: tr(E^2) = (tr(C^2) - 2 tr(C) + 3) / 4 with tr(C^2) = I1^2 - 2 I2."""
    size = mu * np.exp(b * (I1**2 - 2 * I2 - 2 * I1 + 3) / 4)
    return size * (I1 - 1) / 2, -size / 2


OF_INVARIANTS = {  # (I1, I2, values) to W1 and W2
    "neo-hookean": lambda I1, I2, C10: (C10, 0),
    "mooney-rivlin": lambda I1, I2, C10, C01: (C10, C01),
    "yeoh": lambda I1, I2, C10, C20, C30: (C10 + 2 * C20 * (I1 - 3) + 3 * C30 * (I1 - 3) ** 2, 0),
    "isihara": lambda I1, I2, C10, C01, C20: (C10 + 2 * C20 * (I1 - 3), C01),
    "biderman": lambda I1, I2, C10, C01, C20, C30: (C10 + 2 * C20 * (I1 - 3) + 3 * C30 * (I1 - 3) ** 2, C01),
    "rivlin:C10,C01,C11,C22": lambda I1, I2, C10, C01, C11, C22: (
        C10 + C11 * (I2 - 3) + 2 * C22 * (I1 - 3) * (I2 - 3) ** 2,
        C01 + C11 * (I1 - 3) + 2 * C22 * (I1 - 3) ** 2 * (I2 - 3),
    ),
    "gent": lambda I1, I2, mu, Jm: (mu / 2 * Jm / (Jm - I1 + 3), 0),
    "gent-gent": lambda I1, I2, mu1, mu2, Jm: (mu1 / 2 * Jm / (Jm - I1 + 3), 3 * mu2 / 2 / I2),
    "arruda-boyce": lambda I1, I2, mu, Jm: (eight_chains(I1, mu, Jm), 0),
    "demiray": lambda I1, I2, mu, b: (mu / 2 * np.exp(b * (I1 - 3)), 0),
    "fung": squared_strain,
    "veronda-westmann": lambda I1, I2, mu, b: (mu * np.exp(b * (I1 - 3)), -mu / 2),
    "knowles": lambda I1, I2, mu, b, n: (mu / 2 * (1 + b * (I1 - 3) / n) ** (n - 1), 0),
    "van-der-waals": lambda I1, I2, mu, A, Jm: (van_der_waals(I1, mu, A, Jm), 0),
    "extended-tube": lambda I1, I2, Gc, Ge, Jm, beta: (cross_links(I1, Gc, Jm), 0),
}


def powers(stretch, *values):
    terms = len(values) // 2
    return sum(2 * mu / a * stretch**a for mu, a in zip(values[:terms], values[terms:], strict=True))


OF_STRETCHES = {  # (l, values) to l w'(l)
    **dict.fromkeys(("ogden-1", "ogden-2", "ogden-3", "ogden-5"), powers),
    "extended-tube": lambda x, Gc, Ge, Jm, beta: -2 * Ge / beta * x**-beta,
    "valanis-landel": lambda x, mu: 2 * mu * x * np.log(x),
    "peng-landel": lambda x, mu: 3 * mu * (x - 1 - np.log(x) / 3 + np.log(x) ** 2 / 6 - np.log(x) ** 3 / 54),
    "hencky": lambda x, mu: 2 * mu * np.log(x),
}


def exponential(I1, I4, k1, k2):
    strain = np.maximum(I4 - 1, 0)
    return 0.0, k1 * strain * np.exp(k2 * strain**2)


def dispersed(I1, I4, k1, k2, kappa):
    strain = np.maximum(kappa * (I1 - 3) + (1 - 3 * kappa) * (I4 - 1), 0)
    slope = k1 * strain * np.exp(k2 * strain**2)
    return kappa * slope, (1 - 3 * kappa) * slope


OF_FIBRES = {  # (I1, I4, values without the angle) to W1 and W4 of one family
    "standard-fibres": lambda I1, I4, k: (0.0, k * np.maximum(I4 - 1, 0)),
    "exponential-fibres": exponential,
    "dispersed-fibres": dispersed,
}
ONLY_ALONG_AXIS_1 = ["ogden-1+dispersed-fibres:one@0"]
"""Materials with fibres that stay symmetric about the axis of a uniaxial test."""


def has_stress(material, measured):
    """Whether the deformation of a mode is that of the material: of one with fibres, where all of it is prescribed."""
    only_isotropic = measured.mode.name in ("uniaxial", "equibiaxial")
    along = measured.mode.name == "uniaxial" and material.name in ONLY_ALONG_AXIS_1
    return material.is_isotropic or not only_isotropic or along


STRESSES = [(material, measured) for material in EVERY for measured in MEASURED if has_stress(material, measured)]
ISOTROPIC = [material for material in EVERY if material.is_isotropic]


def in_every_mode(test):
    """Run a test of a material and a measured stress for each material in all its modes; a failure names the mode."""

    @pytest.mark.parametrize("material", EVERY, ids=lambda material: material.name)
    def whole(material):
        for own, measured in STRESSES:
            if own is material:
                try:
                    test(material, measured)
                except Exception as error:
                    error.add_note(f"{material.name} in {measured}")
                    raise

    whole.__name__, whole.__doc__ = test.__name__, test.__doc__
    return whole


def of_fibres(name, values, F):
    """Return the Cauchy stress of fibres, whose name tells how many families there are, and a known angle."""
    law, _, known = name.partition("@")
    law, _, one = law.partition(":")
    *values, angle = [*values, np.radians(float(known))] if known else values
    stress = np.zeros((3, 3))
    for sign in (1,) if one else (1, -1):
        fibre = F @ [np.cos(angle), sign * np.sin(angle), 0]
        W1, W4 = OF_FIBRES[law](np.trace(F.T @ F), fibre @ fibre, *values)
        stress += 2 * W1 * F @ F.T + 2 * W4 * np.outer(fibre, fibre)
    return stress


def of_invariants(name, I1, I2, values):
    return OF_INVARIANTS[name](I1, I2, *values) if name in OF_INVARIANTS else (0.0, 0.0)


def of_stretches(name, stretch, values):
    return OF_STRETCHES[name](stretch, *values) if name in OF_STRETCHES else 0.0 * stretch


def tensor_stress(name, values, F, turn=TURN):
    """Return the nominal stress (3, 3) from F and the Cauchy stress, computed in axes that are turned."""
    F = turn @ F @ turn.T
    free = turn[:, 2]
    B, C = F @ F.T, F.T @ F
    I1, I2 = np.trace(C), (np.trace(C) ** 2 - np.trace(C @ C)) / 2
    squares, axes = np.linalg.eigh(B)
    cauchy = np.zeros((3, 3))
    start = 0
    for part in SUMS.get(name, name).split("+"):
        count = len(material_named(part).parameters)
        own = values[start : start + count]
        start += count
        if "fibres" in part:
            cauchy += turn @ of_fibres(part, own, turn.T @ F @ turn) @ turn.T
        W1, W2 = of_invariants(part, I1, I2, own)
        cauchy += 2 * W1 * B - 2 * W2 * np.linalg.inv(B)
        cauchy += (axes * of_stretches(part, np.sqrt(squares), own)) @ axes.T
    cauchy -= (free @ cauchy @ free) * np.eye(3)
    return turn.T @ cauchy @ np.linalg.inv(F).T @ turn
