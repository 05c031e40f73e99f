"""Headings of columns: what laboratories and testing machines call quantities and dimensions, and units beside them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache, lru_cache
from unicodedata import normalize

from tissuq.experiments.reading.strain_measures import STRAIN_MEASURES, StrainMeasure
from tissuq.experiments.reading.stress_measures import STRESS_MEASURES, StressMeasure
from tissuq.experiments.units import BRACKETS, looks_like_unit

__all__ = [
    "AXES",
    "COMPONENTS",
    "CYCLE_NAMES",
    "DIMENSION_NAMES",
    "ROLES",
    "ROLES_OF_TUBE",
    "SET_NAMES",
    "SPREADS",
    "STRESS_NOUNS",
    "Heading",
    "dimensions_named",
    "heading",
    "is_of_count",
    "is_of_mean",
    "is_of_role",
    "is_of_specimens",
    "measure_in",
    "of_spread",
    "on_axis",
    "on_lettered_axis",
    "plain",
    "role_names",
    "without_gradient",
    "without_mean",
]


ACCENTS = re.compile(r"(?<=[A-Za-z])[\u0300-\u036f]+")
"""Accents of Latin letters, where these are written apart from them."""
UMLAUTS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "ø": "oe"})
"""How keyboards without them write umlauts and their like."""


def _without_accents(text: str) -> str:
    """Return a text without the accents of Latin letters, and with plain digits for lowered ones."""
    return normalize("NFKC", ACCENTS.sub("", normalize("NFKD", text)))


def _names(text: str) -> frozenset[str]:
    """Return names, as they are and as keyboards without accents and umlauts write them."""
    names = [*text.split(", "), *text.translate(UMLAUTS).split(", ")]
    return frozenset(names).union(map(_without_accents, names))


ROLES = {
    "stretch": _names(
        "stretch, stretch ratio, extension ratio, lambda, λ, streckung, étirement, estiramiento, stiramento"
    ),
    "strain": _names(
        "strain, engineering strain, nominal strain, tensile strain, compressive strain, dehnung, stauchung, eps, "
        "epsilon, ε, déformation, deformación, deformação, deformazione, rek, töjning, tøyning, 应变, 應變, ひずみ, "
        "歪み, 歪, 변형률"
    ),
    "shear": _names(
        "shear, amount of shear, shear strain, gamma, γ, scherung, schiebung, scherdeformation, cisaillement"
    ),
    "twist": _names(
        "twist, twist angle, angle of twist, torsion angle, rotation, rotation angle, angle, angular displacement, "
        "angular position, deflection angle, encoder, drehwinkel, verdrehwinkel, torsionswinkel, auslenkwinkel, "
        "angle de torsion, ángulo de torsión, angolo di torsione, ângulo de torção, 扭转角, ねじり角"
    ),
    "rate": _names(
        "shear rate, shear strain rate, rate of shear, scherrate, schergeschwindigkeit, taux de cisaillement, "
        "vitesse de cisaillement, velocidad de corte, tasa de corte, velocità di taglio, γ̇"
    ),
    "sliding": _names(
        "shear displacement, lateral displacement, horizontal displacement, sliding, sliding displacement, schubweg, "
        "scherweg, déplacement de cisaillement, desplazamiento de corte, spostamento di taglio"
    ),
    "displacement": _names(
        "displacement, disp, axial displacement, compressive displacement, extension, tensile extension, "
        "compressive extension, crosshead, crosshead displacement, weg, standardweg, traversenweg, position, "
        "axial position, crosshead position, stroke, travel, traverse, déplacement, allongement, desplazamiento, "
        "alargamiento, deslocamento, alongamento, spostamento, allungamento, corsa, verplaatsing, verlenging, "
        "位移, 變位, 変位, 伸び, 伸长, 변위"
    ),
    "length": _names(
        "gap, gap width, gap height, height, sample height, specimen height, current length, current height, spalt, "
        "spaltweite, höhe, probenhöhe"
    ),
    "force": _names(
        "force, axial force, tensile force, compressive force, load, axial load, tensile load, compressive load, "
        "kraft, standardkraft, prüfkraft, druckkraft, normal force, normalkraft, shear force, lateral force, "
        "horizontal force, schubkraft, scherkraft, querkraft, effort de cisaillement, fuerza de corte, "
        "forza di taglio, effort, charge, fuerza, carga, força, forza, carico, kracht, belasting, "
        "力, 载荷, 荷重, 试验力, 試験力, 하중"
    ),
    "torque": _names(
        "torque, axial torque, drehmoment, moment, torsionsmoment, couple, couple de torsion, par, par de torsión, "
        "momento torsor, momento torcente, coppia, torque de torção, 扭矩, トルク"
    ),
    "stress": _names(
        "stress, tensile stress, compressive stress, shear stress, spannung, druckspannung, schubspannung, "
        "contrainte, tensión, esfuerzo, tensão, tensione, sforzo, spanning, spänning, 应力, 應力, 応力, 응력"
    ),
    "outer_diameter": _names(
        "diameter, outer diameter, outside diameter, external diameter, vessel diameter, artery diameter, od, o.d., "
        "durchmesser, außendurchmesser, gefäßdurchmesser, diamètre, diamètre externe, "
        "diamètre extérieur, diámetro, diámetro externo, diámetro exterior, diametro, diametro esterno, diâmetro, "
        "diâmetro externo, 外径, 直径, 外徑, 直徑, 외경, 직경"
    ),
    "inner_diameter": _names(
        "inner diameter, inside diameter, internal diameter, lumen diameter, luminal diameter, i.d., innendurchmesser, "
        "lumendurchmesser, diamètre interne, diamètre intérieur, diámetro interno, diámetro interior, "
        "diametro interno, diâmetro interno, 内径, 內徑, 내경"
    ),
    "pressure": _names(
        "pressure, internal pressure, inner pressure, luminal pressure, intraluminal pressure, lumen pressure, "
        "transmural pressure, distending pressure, inflation pressure, druck, innendruck, transmuraler druck, "
        "pression, pression interne, pression intraluminale, pression transmurale, presión, presión interna, "
        "presión intraluminal, presión transmural, pressione, pressione interna, pressione transmurale, pressão, "
        "pressão interna, pressão transmural, 压力, 内压, 壓力, 圧力, 内圧, 압력, 내압"
    ),
}
"""Names of columns by their role, as :func:`plain` writes them, without the words for a measure of strain or stress."""

NOUNS = {
    "strain": _names("axial strain, longitudinal strain, e, λ, lambda"),
    "stress": _names("axial stress, longitudinal stress, s, sigma, σ"),
}
"""Further names of strain and stress that are known as such beside a word for a measure of them."""
MEASURES: dict[str, list[StrainMeasure] | list[StressMeasure]] = {
    "strain": [measure for measure in STRAIN_MEASURES.values() if measure.stretch],
    "shear": [measure for measure in STRAIN_MEASURES.values() if measure.shear],
    "stress": list(STRESS_MEASURES.values()),
}
"""Measures of what columns of a role hold."""
LINK = re.compile(r"\(\)|\b(de|di|of|nach|selon|according to)\b")
"""What may stand between such a word and the noun."""
SAYS_ALONE = re.compile(r"hencky|almansi|green .+|cauchy|.*(pk|piola).*|.*(angl|ngulo|ngolo|winkel|hoek|角).*")
"""Words for a measure that no noun need follow."""
SPREADS = {"sem": "standard error", "sd": "standard deviation"}
"""What columns beside a mean may hold, by their roles."""
SPREAD_WORDS = {
    "sem": r"sem|s\.e\.m\.?|se|std\.? ?err(or)?|stderr|standard error|standardfehler|erreur type|error est[áa]ndar|"
    r"errore standard|erro padr[ãa]o|标准误差?|標準誤差?",
    "sd": r"sd|s\.d\.?|std\.? ?dev(iation)?\.?|std\.?|stdev\.?|st\.? ?dev\.?|standard deviation|standardabweichung|"
    r"stabw\.?|[ée]cart type|desviaci[óo]n (est[áa]ndar|t[íi]pica)|deviazione standard|desvio padr[ãa]o|标准差|"
    r"標準偏差",
    "open": r"±|\+/|^\+$|error|err|fehler|uncertainty",
}
"""Words for them, and those that leave open which it is."""
MEAN_WORDS = r"mean|average|avg\.?|averaged|mittelwert|mittlere[rs]?|moyenne?|media|medio|promedio|m[ée]dia|平均"
COUNT_NAMES = re.compile(
    r"n|count|sample size|(number|no\.?|#) of (specimens|samples|tests)|specimens|samples|anzahl( proben)?"
)
"""Names of a column that tells of how many specimens a mean is."""
CYCLE_NAMES = _names("cycle, cycles, cycle count, cycle number, total cycles, total cycle count, zyklus, zyklen")
SET_NAMES = _names("setname, set name, set")
"""Names of the column in which parts of a test are named."""

SPECIMEN_NAME = re.compile(
    r"(specimen|sample|probe|proben?körper|replicate|replikat|donor|subject|patient|animal|tier|éprouvette|échantillon|"
    r"probeta|muestra|provino|campione)s?( ?(id|no\.?|nr\.?|n°|#|number|nummer|name|label|bezeichnung))?"
)
"""Names of a column that tells which specimen a row is of."""

DIMENSION_NAMES = {
    "area": _names(
        "area, cross section, cross sectional area, cross section area, s0, a0, querschnitt, querschnittsfläche, "
        "probenquerschnitt, anfangsquerschnitt, section, section transversale, section droite, aire, "
        "aire de la section, sección, sección transversal, área, área de la sección, "
        "área de la sección transversal, seção, secção, seção transversal, secção transversal, área da seção, "
        "área da secção, área da seção transversal, área da secção transversal, sezione, sezione trasversale, "
        "area della sezione, area della sezione trasversale, doorsnede, dwarsdoorsnede, "
        "oppervlakte van de doorsnede, 横截面积, 截面积, 橫截面積, 截面積, 面积, 面積, 断面積, 原断面積"
    ),
    "width": _names(
        "width, b0, breite, probenbreite, largeur, anchura, ancho, largura, larghezza, breedte, 宽度, 寬度, 幅, 板幅"
    ),
    "thickness": _names(
        "thickness, a0, dicke, probendicke, épaisseur, espesor, grosor, espessura, spessore, dikte, 厚度, 厚さ, 板厚"
    ),
    "diameter": _names(
        "diameter, d0, durchmesser, probendurchmesser, diamètre, diámetro, diâmetro, diametro, 直径, 直徑"
    ),
    "length": _names(
        "length, gauge length, gage length, l0, grip separation, grip to grip separation, distance between grips, "
        "messlänge, anfangsmesslänge, anfangslänge, einspannlänge, probenlänge, longueur, longueur de référence, "
        "longueur entre repères, longueur entre mors, distance entre mors, longitud, longitud de referencia, "
        "longitud entre puntos, longitud entre mordazas, distancia entre mordazas, comprimento, "
        "comprimento de referência, comprimento de medida, distância entre garras, lunghezza, "
        "lunghezza di riferimento, lunghezza tra i riferimenti, distanza tra gli afferraggi, lengte, "
        "meetlengte, beginlengte, inklemlengte, 标距, 标距长度, 標距, 长度, 長度, 夹具间距, "
        "標点距離, 標点間距離, 原標点距離, 長さ, つかみ具間距離, チャック間距離, ゲージ長"
    ),
}
"""What the sizes of specimens are called, in the words of testing standards, without those in `OF_SPECIMEN`."""
HEIGHT_NAMES = _names("height, h0, höhe, probenhöhe, hauteur, altura, altezza, hoogte, 高度, 高さ")
"""What the length of a cylinder or a disc is called; of other specimens it may be the thickness."""
OF_SPECIMEN = re.compile(
    r"\b((de|del|della|di|du|da|do|van) )*(la |het |l'|d')?(specimen|sample|test piece|disc|disk|eprouvette|"
    r"echantillon|probeta|muestra|provino|campione|corpo de prova|amostra|proefstuk|monster)('s)?\b|"
    r"\b(initiale?|initieel|inicial|iniziale|original|undeformed|(mean|average)(?! diameter))\b|"
    r"原始|初始|初期|试样|試樣|試験片|样品|の"
)
"""Words beside the name of a size that leave it what it is, without accents; a mean diameter is that of a tube."""
SYMBOL_AFTER = re.compile(r" [abdhls]_?[0o]$")
"""That of a size in standards, after its name."""
MEASURED_ALONG = re.compile(r"(?<=messlange) (?P<way>.+)")
"""What is measured along a gauge length, as in ``Messlänge Standardweg``."""


ROLES_OF_TUBE = ("outer_diameter", "inner_diameter", "pressure")
ROLES_AND_SIZES = frozenset(["size"]).union(*(names for role, names in ROLES.items() if role not in ROLES_OF_TUBE))
"""Names of what is along an axis of a biaxial machine."""
STRESS_NOUNS = frozenset(noun for noun in NOUNS["stress"] if len(noun) > 1) | {"σ"}
"""Names of a stress whose measure they leave open; one letter may be anything else."""
AXES = {"x": "x", "y": "y", "1": "x", "2": "y"}
"""Axes of a biaxial machine, by how columns name them."""
COMPONENTS = {"stress": _names("s, p, t"), "strain": _names("e")}
"""Symbols of which a component such as S11 or Eyy is along an axis, of a measure that they leave open."""
DIRECTIONS_OF_WALL = {
    "x": r"circumferential|circumf\.?|circ\.?|hoop|umfangs|circonf[ée]rentielle?|circunferencial|circonferenziale|fd",
    "y": r"axial|longitudinal|long\.?|axiale?|längs|longitudinale|xd",
}
"""Directions in a wall, or along and across fibres, by the axis that they stand for."""

MEASURE_IN_BRACKETS = re.compile(
    rf"\s*[\[(]({'|'.join(measure.words for kind in MEASURES.values() for measure in kind)})[\])]", re.IGNORECASE
)
"""As in ``Strain (true) [%]``."""
CHANNEL = re.compile(r"\([^():]+:[^()]+\)(?=\s*[(\[])")
"""A channel of the machine before the unit, as in ``Position(Linear:Position) (mm)``."""
SYMBOL = re.compile(r" ([espftλσεγτ]|e ?gl)$")
"""A symbol after a name, as in ``Green strain E``."""
GREEK_SYMBOL = re.compile(r" [λεσγ]$")
"""One that leaves open which measure it is, as in ``Stretch λ``."""
COMPONENT = re.compile(r" (sigma|eps|[espft]|[σετ]) ?([1x]{2}|[2y]{2})$")
"""Likewise, of what is along an axis, as in ``Cauchy stress T11``."""
DEFORMATION_GRADIENT = re.compile(r"f ?(11|22|xx|yy)")
"""Its components that are stretches, where they have no unit as forces do."""
UNIT_IN_HEADING = (
    re.compile(r"(?P<quantity>.+?)\s*[\[({<](?P<unit>[^\])}>]*)[\])}>]?"),
    re.compile(r"(?P<quantity>[^/]+?)(?:,\s*|\s+in\s+)(?P<unit>\S+)"),
    re.compile(r"(?P<quantity>.+?)\s*/\s*(?P<unit>.+)"),
)
"""Forms of a name with a unit; brackets are often mistyped, as in ``Stress [kPa}``."""
QUOTIENT = re.compile(rf"[^{re.escape(BRACKETS)}/]+/[^{re.escape(BRACKETS)}/]+")
"""A unit without brackets, as in ``Stress N/mm^2``."""
REMEMBERED = 4096
"""Names that are taken apart once."""
COPY = re.compile(r"(?<=[^\d\s])\.\d$")
"""What pandas adds to a name that stands in a table again, as in ``Stress.1``."""
NEXT_WORD = re.compile(r"(?<=[a-zß-ÿ]{3})(?=[A-Z])|(?<=[A-Z][a-z]{2})(?=[A-Z])")
"""Where a word begins without a blank, as in ``TrueStrain`` and ``EngStress``; not in ``mmHg`` and ``kPa``."""
UNIT_AS_SUFFIX = re.compile(r"(?P<quantity>.+)[-_.:;|\s](?P<unit>\S*[^\W\d_]\S*|%)")


@dataclass(frozen=True)
class Heading:
    """A column name taken apart: ``Stress [kPa]`` is the quantity ``stress`` in the unit ``kPa``."""

    quantity: str
    unit: str = ""


@lru_cache(maxsize=REMEMBERED)
def heading(name: str) -> Heading:
    """Take a column name apart into its quantity, in lower case, and its unit."""
    name = CHANNEL.sub("", name)
    name = MEASURE_IN_BRACKETS.sub(r" \1", COPY.sub("", NEXT_WORD.sub(" ", name.strip()))).strip()
    matches = list(filter(None, (pattern.fullmatch(name) for pattern in UNIT_IN_HEADING)))
    suffix = UNIT_AS_SUFFIX.fullmatch(name)
    is_unit = suffix is not None and looks_like_unit(suffix["unit"])
    if suffix is not None and is_unit and (not matches or QUOTIENT.fullmatch(suffix["unit"])):
        matches = [suffix]
    if not matches:
        return Heading(plain(name))
    match = next((match for match in matches if looks_like_unit(match["unit"])), matches[0])
    return Heading(plain(match["quantity"].rstrip(" ,.:;|_-")), match["unit"].strip())


def plain(name: str) -> str:
    """Return a name in lower case with blanks for hyphens and underscores."""
    return re.sub(r"[\s_–-]+", " ", name).strip().lower()


def dimensions_named(quantity: str, *, is_cylinder: bool = False) -> frozenset[str]:
    """Return the dimensions of a specimen that a name may mean, as its unit says; none for other names.

    A height is the length of a cylinder.

    Examples
    --------
    >>> dimensions_named("initial specimen width"), dimensions_named("messlänge standardweg")
    (frozenset({'width'}), frozenset({'length'}))
    >>> dimensions_named("height"), dimensions_named("height", is_cylinder=True)
    (frozenset(), frozenset({'length'}))
    """
    name = SYMBOL_AFTER.sub("", plain(OF_SPECIMEN.sub(" ", _without_accents(quantity))))
    if (along := MEASURED_ALONG.search(name)) and along["way"] in ROLES["displacement"] | ROLES["strain"]:
        name = name[: along.start()]
    dimensions = frozenset(dimension for dimension, names in DIMENSION_NAMES.items() if name in names)
    return dimensions | {"length"} if is_cylinder and name in HEIGHT_NAMES else dimensions


def without_gradient(quantity: str) -> str:
    """Return the name of a column without a unit, a component of the deformation gradient as a stretch along its axis.

    Examples
    --------
    >>> without_gradient("f11"), without_gradient("f yy"), without_gradient("f1")
    ('stretch 11', 'stretch yy', 'f1')
    """
    return DEFORMATION_GRADIENT.sub(r"stretch \1", quantity) if DEFORMATION_GRADIENT.fullmatch(quantity) else quantity


def role_names(role: str) -> frozenset[str]:
    """Return the names that columns of a role may have."""
    return ROLES[role]


def measure_in(quantity: str) -> tuple[str, str]:
    """Return what a column holds without the words for a measure of strain or stress, and the name of that measure.

    Examples
    --------
    >>> measure_in("wahre dehnung"), measure_in("pk2"), measure_in("true stress x"), measure_in("stress")
    (('dehnung', 'true'), ('stress', 'second-piola-kirchhoff'), ('stress x', 'cauchy'), ('stress', ''))
    """
    for role, measures in MEASURES.items():
        for measure in measures:
            match = _words(measure.words).search(quantity)
            if not match:
                continue
            noun = plain(LINK.sub(" ", f"{quantity[: match.start()]} {quantity[match.end() :]}"))
            noun = COMPONENT.sub(r" \2", noun)
            axis, name = on_axis(noun)
            if name in ROLES[role]:
                return noun, measure.name
            if SYMBOL.sub("", name) in ROLES[role]:
                return SYMBOL.sub("", noun), measure.name
            is_component = bool(axis) and name in COMPONENTS.get(role, ())
            if name in NOUNS.get(role, ()) or is_component or (not noun and SAYS_ALONE.fullmatch(match[0])):
                return f"{role} {axis}".strip(), measure.name
    noun = GREEK_SYMBOL.sub("", quantity)
    return (noun if any(noun in names for names in ROLES.values()) else quantity), ""


def is_of_role(name: str) -> bool:
    """Tell whether a name is that of a deformation or a load."""
    return any(measure_in(heading(name).quantity)[0] in names for names in ROLES.values())


def of_spread(quantity: str) -> tuple[str, str]:
    """Return what a column holds beside a mean, ``sem``, ``sd`` or ``open``, and of what; empty texts for others.

    Examples
    --------
    >>> of_spread("stress std dev"), of_spread("sem"), of_spread("±"), of_spread("stress")
    (('sd', 'stress'), ('sem', ''), ('open', ''), ('', ''))
    """
    for kind, words in SPREAD_WORDS.items():
        match = _words(words).search(quantity)
        if match:
            noun = without_mean(f"{quantity[: match.start()]} {quantity[match.end() :]}")
            return kind, plain(re.sub(r"\bof( the)?\b", " ", noun))
    return "", ""


def without_mean(quantity: str) -> str:
    """Return what a column holds without words for a mean."""
    return plain(_words(MEAN_WORDS).sub(" ", quantity))


def is_of_mean(quantity: str) -> bool:
    """Tell whether a column of that name is of a mean of specimens."""
    return _words(MEAN_WORDS).search(quantity) is not None


def is_of_count(quantity: str) -> bool:
    """Tell whether a column of that name tells of how many specimens a mean is."""
    return COUNT_NAMES.fullmatch(quantity) is not None


@cache
def _words(words: str) -> re.Pattern[str]:
    """Return the pattern of words, not within others; those that are not of Latin letters may be."""
    return re.compile(rf"(?<![a-zß-ÿ])(?:{words})(?![a-zß-ÿ])")


def is_of_specimens(quantity: str) -> bool:
    """Tell whether a column of that name tells which specimen a row is of.

    Examples
    --------
    >>> is_of_specimens("specimen id"), is_of_specimens("specimen width")
    (True, False)
    """
    return SPECIMEN_NAME.fullmatch(quantity) is not None


def on_axis(quantity: str) -> tuple[str, str]:
    """Return the axis (x, y, or nothing) that a column of a biaxial machine belongs to, and its name without it.

    Axes that are numbered 1 and 2 are x and y, as are the circumferential and the axial direction; components such as
    xx and 22 are along them.

    Examples
    --------
    >>> on_axis("xforce"), on_axis("stress y"), on_axis("stretch 1"), on_axis("sigma yy"), on_axis("load")
    (('x', 'force'), ('y', 'stress'), ('x', 'stretch'), ('y', 'sigma'), ('', 'load'))
    """
    parts = [(quantity[:1], quantity[1:].strip()), (quantity[-1:], quantity[:-1].strip())]
    if quantity[-1:] == quantity[-2:-1]:
        component = quantity[-1:], quantity[:-2].strip()
        if component[0] in AXES and component[1] in frozenset().union(*COMPONENTS.values()):
            return AXES[component[0]], component[1]
        parts.append(component)
    for axis, name in parts:
        if axis in AXES and (name in ROLES_AND_SIZES or name in STRESS_NOUNS):
            return AXES[axis], name
    for axis, words in DIRECTIONS_OF_WALL.items():
        name = plain(_words(words).sub(" ", quantity, count=1))
        if name != quantity and (name in ROLES_AND_SIZES or name in STRESS_NOUNS):
            return axis, name
    return "", quantity


def on_lettered_axis(quantity: str) -> tuple[str, str]:
    """Return `on_axis`, but for axes that are numbered: the numbers may be those of specimens.

    Examples
    --------
    >>> on_lettered_axis("stress y"), on_lettered_axis("stretch 1")
    (('y', 'stress'), ('', 'stretch 1'))
    """
    axis, name = on_axis(quantity)
    is_numbered = AXES.keys() - AXES.values() & {quantity[:1], quantity[-1:]}
    return ("", quantity) if is_numbered else (axis, name)
