"""Names of other quantities than the stress, force and deformation of a test, which share their units."""

from __future__ import annotations

import re

from tissuq.experiments.units import measured_in

__all__ = ["other_quantity"]

OTHER_QUANTITIES = {
    "a modulus": r"modul|^[ge]('|\"|′|″|\*)?$|^young",
    "a stiffness": r"stiff|steif|rigid|raideur|rigidez|rigidezza|жесткост|刚度|剛性",
    "a hardness": r"hardness|härte|duret|dureza|durezza|твердост|硬度|硬さ",
    "a strength": r"strength|festigkeit|résistance|resistencia|resistenza|прочност|强度|強度",
    "a stress or strain at yield": r"yield|streckgrenze|dehngrenze|fließ|текучест|屈服|降伏",
    "a largest value, and no curve": r"\bpeak\b|\bultimate\b|\bmaximum\b|\bmaximal\b|\bmax\b",
    "a value at failure, and no curve": r"\b(fracture|failure|rupture|break(ing)?)\b|bruch",
    "a range or a difference": r"\brange\b|difference|differenz|invariant",
    "what a model says": r"predict|^model|\bmodel(led)?$|^fit$|\bfit(ted)?$|simulat|theor|berechnet",
    "a load before the test": r"\bpre ?(load|stress|strain|tension|stretch)|^vorkraft|^vorspannung",
    "an amplitude, and no curve": r"amplitud|амплитуд|振幅",
    "what was asked of the machine, and not measured": r"set ?point|command|demand|sollwert",
    "an offset": r"\boffset|versatz|смещение нуля",
    "an error": r"\berror|fehler|residuals?$",
    "a logarithm": r"\b(log|lg|ln)(10)?\b(?! strain)|logarithm of",
    "of bending": r"flex(ur|ion)|bend|bieg|изгиб|弯曲|曲げ",
    "of peeling": r"peel|schäl|pelage|отслаив|剥离|剥離",
    "of pulling out": r"pull ?out|auszieh",
    "of friction": r"friction|reib(ung|kraft)|frottement|трени|摩擦",
    "of indentation": r"indent|penetration|puncture|needle|eindring|вдавл|индент|压痕|圧痕",
    "an equivalent (von Mises) value": r"mises|equivalent|vergleichs|эквивалентн|等效|相当",
    "along another direction than the load": r"transvers|\blateral|\bradial|quer(dehnung|kontraktion|richtung)|"
    r"(diameter|width|thickness) (change|reduction|strain)|poisson|"
    r"попереч|横向",
    "a change of volume": r"volum|объ[её]мн|体积|体積",
    "a change of area": r"area (reduction|change|ratio|strain)|reduction (of|in) area|einschnürung|necking",
    "what remains after a test": r"residual|remaining|permanent|plastic|bleibend|restdehnung|остаточн|残余|残留",
    "what was lost": r"relaxation|recovery|\bdrop\b|\bloss\b",
    "of a crack": r"\bcrack|\briss|fissure|трещин|裂纹|亀裂",
    "a damage": r"damage|schädigung|поврежд|损伤",
    "a porosity": r"poros|пористост|孔隙|空隙",
    "a swelling": r"swell|quell|набухан|溶胀|膨潤",
    "a humidity": r"humid|\brh\b|\br ?h$|feucht|humedad|umidità|влажност|湿度",
    "a concentration": r"concentration|\bdensity|fraction|konzentration|content|gehalt|концентрац|含量|浓度",
    "a progress": r"progress|fortschritt|completed?$|прогресс|进度|進捗",
    "a dissipation": r"dissipat|hysteresis|damping|dämpfung",
}
"""What names with such words, in small letters, are of, in words that follow *is*."""
PATTERNS = {what: re.compile(words) for what, words in OTHER_QUANTITIES.items()}
SYMBOL = r"d ?([^\W\d_]{1,2}|stress|strain|stretch|force|load|sigma|epsilon|lambda|disp(lacement)?)"
DERIVATIVE = re.compile(rf"\b{SYMBOL} ?/ ?{SYMBOL}\b|derivative|ableitung|\bslope|gradient|steigung|производн")
"""One quantity by another."""


def other_quantity(quantity: str, unit: str) -> str:
    """Return what a column is that is neither load nor deformation, by its name; an empty text where it may be one.

    Parameters
    ----------
    quantity : str
        As `tissuq.experiments.reading.headings.heading` writes it.
    unit : str
        Symbols of moduli are so in units of stress alone.

    Examples
    --------
    >>> other_quantity("hardness", "kPa"), other_quantity("rh", "%"), other_quantity("dstress/dstretch", "kPa")
    ('a hardness', 'a humidity', 'a derivative')
    >>> other_quantity("e", "kPa"), other_quantity("e", "%"), other_quantity("elongation", "%")
    ('a modulus', '', '')
    """
    if DERIVATIVE.search(quantity):
        return "a derivative"
    is_stress = measured_in(unit) == "stress"
    kinds = (what for what, words in PATTERNS.items() if (is_stress or what != "a modulus") and words.search(quantity))
    return next(kinds, "")
