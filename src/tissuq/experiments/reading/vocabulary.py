"""What laboratories and testing machines call columns, sizes of specimens and other quantities, in many languages."""

from __future__ import annotations

import re
from unicodedata import normalize

from tissuq.experiments.units import measured_in

ACCENTS = re.compile(r"(?<=[A-Za-z])[\u0300-\u036f]+")
"""Accents of Latin letters, where these are written apart from them."""
UMLAUTS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "ø": "oe", "ё": "е", "ł": "l"})
"""How keyboards without them write umlauts and their like."""

OTHER_QUANTITIES = {
    "a modulus": r"modu[lł]|^[ge]('|\"|′|″|\*)?$|^young",
    "a stiffness": r"stiff|steif|rigid|raideur|rigidez|rigidezza|жесткост|刚度|剛性",
    "a hardness": r"hardness|härte|duret|dureza|durezza|твердост|硬度|硬さ",
    "a strength": r"strength|festigkeit|résistance|resistencia|resistenza|прочност|强度|強度|wytrzymałoś",
    "a stress or strain at yield": r"yield|streckgrenze|dehngrenze|fließ|текучест|屈服|降伏",
    "a largest value, and no curve": r"\bpeak\b|\bultimate\b|\bmaximum\b|\bmaximal\b|\bmax\b",
    "a smallest value, and no curve": r"\bminimum\b|\bminimal\b|\bmin\b",
    "a value at failure, and no curve": r"\b(fracture|failure|rupture|break(ing)?)\b|bruch",
    "a range or a difference": r"\brange\b|difference|differenz|invariant",
    "what a model says": r"predict|^model|\bmodel(led)?$|^fit$|\bfit(ted)?$|simulat|\bsim\b|\bfe[am]\b|theor|berechnet",
    "a load before the test": r"(?<!from )\bpre ?(load|stress|strain|tension|stretch)|^vorkraft|^vorspannung",
    "an amplitude, and no curve": r"amplitud|амплитуд|振幅",
    "what was asked of the machine, and not measured": r"set ?point|command|demand|sollwert",
    "a multiple by a power of ten, which belongs into its unit, as in (10^-3 MPa)": r"((?<!\w)x|[×*·/]) ?"
    r"(10( ?\^| ?\*\*| \d|[⁻⁰¹²³⁴-⁹])|1e ?\d)|^10( ?\^| ?\*\*|[⁻⁰¹²³⁴-⁹])",
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


def without_accents(text: str) -> str:
    """Return a text without the accents of Latin letters, and with plain digits for lowered ones."""
    return normalize("NFKC", ACCENTS.sub("", normalize("NFKD", text)))


def names_of(text: str) -> frozenset[str]:
    """Return names, as they are and as keyboards without accents and umlauts write them."""
    names = [*text.split(", "), *text.translate(UMLAUTS).split(", ")]
    return frozenset(names).union(map(without_accents, names))


ROLES = {
    "stretch": names_of(
        "stretch, stretch ratio, extension ratio, elongation ratio, draw ratio, "
        "lambda, λ, streckung, étirement, estiramiento, stiramento, "
        "степень растяжения, степень удлинения, кратность растяжения, кратность удлинения, коэффициент растяжения, "
        "拉伸比, 伸长比, 伸張比"
    ),
    "strain": names_of(
        "strain, engineering strain, nominal strain, tensile strain, nominelle dehnung, gerinim, birim uzama, "
        "compressive strain, dehnung, nenndehnung, stauchung, eps, "
        "epsilon, ε, déformation, deformación, deformação, deformazione, rek, töjning, tøyning, 应变, 應變, ひずみ, "
        "歪み, 歪, 변형률, деформация, деформация растяжения, деформация сжатия, осевая деформация, "
        "продольная деформация, "
        "удлинение при растяжении, 延伸率, 伸长率, 拉伸应变, 压缩应变, 名义应变, 引張ひずみ, 圧縮ひずみ, 公称ひずみ, "
        "인장 변형률, 압축 변형률, odkształcenie, odkształcenie względne, wydłużenie względne"
    ),
    "shear": names_of(
        "shear, amount of shear, shear strain, gamma, γ, scherung, schiebung, scherdeformation, cisaillement, "
        "сдвиг, деформация сдвига, сдвиговая деформация, величина сдвига, 剪切应变, 剪应变, せん断ひずみ"
    ),
    "twist": names_of(
        "twist, twist angle, angle of twist, torsion angle, rotation, rotation angle, angle, angular displacement, "
        "angular position, deflection angle, encoder, drehwinkel, verdrehwinkel, torsionswinkel, auslenkwinkel, "
        "angle de torsion, ángulo de torsión, angolo di torsione, ângulo de torção, 扭转角, ねじり角, "
        "угол закручивания, угол кручения, угол поворота, закручивание"
    ),
    "rate": names_of(
        "shear rate, shear strain rate, rate of shear, scherrate, schergeschwindigkeit, taux de cisaillement, "
        "vitesse de cisaillement, velocidad de corte, tasa de corte, velocità di taglio, γ̇, "
        "скорость сдвига, скорость деформации сдвига, 剪切速率, せん断速度"
    ),
    "sliding": names_of(
        "shear displacement, lateral displacement, horizontal displacement, sliding, sliding displacement, schubweg, "
        "scherweg, déplacement de cisaillement, desplazamiento de corte, spostamento di taglio, "
        "перемещение сдвига, сдвиговое перемещение, 剪切位移, せん断変位"
    ),
    "displacement": names_of(
        "displacement, disp, compression, uzama, yer değiştirme, "
        "axial displacement, compressive displacement, extension, tensile extension, "
        "compressive extension, crosshead, crosshead displacement, cross head displacement, crosshead extension, "
        "grip displacement, clamp displacement, jaw displacement, actuator displacement, machine displacement, "
        "extension from preload, weg, standardweg, "
        "traversenweg, verfahrweg, kolbenweg, position, "
        "axial position, crosshead position, crosshead travel, cross head travel, stroke, travel, traverse, "
        "déplacement, allongement, desplazamiento, "
        "alargamiento, deslocamento, alongamento, spostamento, allungamento, corsa, verplaatsing, verlenging, "
        "位移, 變位, 変位, 伸び, ストローク, 伸长, 변위, 스트로크, 變形量, 变形, 变形量, 伸长量, "
        "拉伸位移, 压缩位移, 横梁位移, 夹头位移, "
        "standard travel, course, course standard, przemieszczenie, wydłużenie, droga, "
        "перемещение, смещение, удлинение, абсолютное удлинение, укорочение, осадка, ход, ход траверсы, ход поршня, "
        "перемещение траверсы, перемещение захвата, положение, положение траверсы, позиция"
    ),
    "length": names_of(
        "marker distance, marker separation, distance between markers, distance of markers, markerabstand, "
        "grip distance, grip separation, grip to grip separation, distance between grips, clamp distance, "
        "distance entre marqueurs, distancia entre marcadores, 标记间距, gap, gap width, gap height, height, "
        "sample height, specimen height, current length, current height, spalt, "
        "spaltweite, höhe, probenhöhe, зазор, высота, высота образца, текущая длина, текущая высота, 间隙, 間隙, すき間"
    ),
    "force": names_of(
        "force, axial force, tensile force, compressive force, load, axial load, tensile load, compressive load, "
        "kuvvet, yük, "
        "kraft, standardkraft, prüfkraft, druckkraft, normal force, normalkraft, shear force, lateral force, "
        "horizontal force, force per width, force per unit width, line load, membrane force, "
        "kraft pro breite, schubkraft, scherkraft, querkraft, effort de cisaillement, fuerza de corte, "
        "forza di taglio, effort, charge, fuerza, carga, força, forza, carico, kracht, belasting, "
        "reduced force, reduced axial force, transducer force, axial transducer force, "
        "standard force, force standard, siła, obciążenie, "
        "力, 载荷, 拉伸载荷, 压缩载荷, 荷重, 试验力, 試験力, 하중, 负荷, 負荷, 負載, 负载, 拉力, 拉伸力, 力值, "
        "сила, усилие, нагрузка, осевая сила, осевое усилие, осевая нагрузка, растягивающая сила, сжимающая сила, "
        "растягивающее усилие, сжимающее усилие, нормальная сила, сила сдвига, сдвиговая сила, поперечная сила, "
        "剪切力, せん断力"
    ),
    "total_force": names_of(
        "total force, total axial force, axial total force, wall force, axial wall force, gesamtkraft, force totale, "
        "fuerza total, forza totale, força total, 总力, 总轴向力, полная сила, полная осевая сила"
    ),
    "torque": names_of(
        "torque, axial torque, drehmoment, moment, torsionsmoment, couple, couple de torsion, par, par de torsión, "
        "momento torsor, momento torcente, coppia, torque de torção, 扭矩, トルク, "
        "момент, крутящий момент, вращающий момент, момент кручения"
    ),
    "stress": names_of(
        "stress, wall stress, tensile stress, compressive stress, shear stress, gerilme, "
        "spannung, zugspannung, druckspannung, schubspannung, nennspannung, nominelle spannung, "
        "contrainte, tensión, esfuerzo, tensão, tensione, sforzo, spanning, spänning, 应力, 應力, 応力, 응력, "
        "напряжение, осевое напряжение, напряжение растяжения, растягивающее напряжение, напряжение сжатия, "
        "сжимающее напряжение, напряжение сдвига, касательное напряжение, 拉应力, "
        "拉伸应力, 压应力, 压缩应力, 名义应力, 公称応力, 인장 응력, 압축 응력, naprężenie, naprężenie rozciągające, "
        "naprężenie ściskające, 剪切应力, 剪应力, "
        "引張応力, 圧縮応力, せん断応力"
    ),
    "outer_diameter": names_of(
        "diameter, outer diameter, outside diameter, external diameter, vessel diameter, artery diameter, od, o.d., "
        "durchmesser, außendurchmesser, gefäßdurchmesser, diamètre, diamètre externe, "
        "diamètre extérieur, diámetro, diámetro externo, diámetro exterior, diametro, diametro esterno, diâmetro, "
        "diâmetro externo, 外径, 直径, 外徑, 直徑, 외경, 직경, "
        "диаметр, наружный диаметр, внешний диаметр"
    ),
    "inner_diameter": names_of(
        "inner diameter, inside diameter, internal diameter, lumen diameter, luminal diameter, i.d., innendurchmesser, "
        "lumendurchmesser, diamètre interne, diamètre intérieur, diámetro interno, diámetro interior, "
        "diametro interno, diâmetro interno, 内径, 內徑, 내경, внутренний диаметр, диаметр просвета"
    ),
    "pressure": names_of(
        "pressure, internal pressure, inner pressure, luminal pressure, intraluminal pressure, lumen pressure, "
        "transmural pressure, distending pressure, inflation pressure, druck, innendruck, transmuraler druck, "
        "pression, pression interne, pression intraluminale, pression transmurale, presión, presión interna, "
        "presión intraluminal, presión transmural, pressione, pressione interna, pressione transmurale, pressão, "
        "pressão interna, pressão transmural, 压力, 内压, 壓力, 圧力, 内圧, 압력, 내압, "
        "давление, внутреннее давление, внутрипросветное давление, трансмуральное давление"
    ),
}
"""Names of columns by their role, as :func:`plain` writes them, without the words for a measure of strain or stress."""


ROLES_OF_TUBE = ("outer_diameter", "inner_diameter", "pressure", "total_force")


ROLE_OF_AXIAL_STRETCH = "axial_stretch"
"""Of a column beside these, which may also hold the length of the tube."""


AXIAL_STRETCH = re.compile(
    r"(axial|longitudinal|z) (pre ?)?(stretch( ratio)?|lambda|λ)|(stretch|lambda|λ) ?(z|axial)|pre ?stretch( ratio)?|"
    r"(in ?vivo) (axial |longitudinal )?stretch( ratio)?|"
    r"(axiale|longitudinale) (dehnung|streckung)|[ée]tirement (axial|longitudinal)|estiramiento (axial|longitudinal)|"
    r"轴向拉伸比?|осевая степень растяжения"
)
"""Names of a column that is one where there are columns of a tube, too."""


AXIAL_STRAIN = re.compile(r"(axial|longitudinal) (pre ?)?strain")
"""Likewise, of a strain, where a line states it."""


LENGTH_OF_TUBE = re.compile(
    r"((axial|longitudinal|vessel|artery|tube|segment|specimen|sample|current|deformed|loaded|stretched) )?length|"
    r"gefäßlänge|(axiale |aktuelle )?länge|longueur( axiale)?|longitud( axial)?|lunghezza( assiale)?|"
    r"(轴向)?长度|(осевая )?длина"
)
"""Likewise, of a column of its length."""


NOUNS = {
    "strain": names_of("axial strain, longitudinal strain, e, λ, lambda"),
    "stress": names_of("axial stress, longitudinal stress, s, sigma, σ"),
}
"""Further names of strain and stress that are known as such beside a word for a measure of them."""


SPREADS = {"sem": "standard error", "sd": "standard deviation"}
"""What columns beside a mean may hold, by their roles."""


SPREAD_WORDS = {
    "sem": r"sem|s\.e\.m\.?|se|std\.? ?err(or)?|stderr|standard error|standardfehler|erreur type|error est[áa]ndar|"
    r"errore standard|erro padr[ãa]o|标准误差?|標準誤差?|"
    r"стандартная ошибка( среднего)?|ошибка среднего",
    "sd": r"sd|s\.d\.?|std\.? ?dev(iation)?\.?|std\.?|stdev\.?|st\.? ?dev\.?|standard deviation|standardabweichung|"
    r"stabw\.?|[ée]cart type|desviaci[óo]n (est[áa]ndar|t[íi]pica)|deviazione standard|desvio padr[ãa]o|标准差|"
    r"標準偏差|標準差|стандартное отклонение|ско",
    "open": r"±|\+/|^\+$|error|err|fehler|uncertainty",
}
"""Words for them, and those that leave open which it is."""


OPEN_WITHOUT_UNIT = names_of("elongation, relative elongation, относительное удлинение")
"""Names of strains or displacements, as their unit says."""


DEFORMATION_NOUNS = names_of("déformation, deformación, deformação, deformazione, деформация")
"""Names of strains that are displacements where their unit is a length."""


MEAN_WORDS = (
    r"mean|average|avg\.?|averaged|mittelwert|mittlere[rs]?|moyenne?|media|medio|promedio|m[ée]dia|平均|"
    r"средн(ее|яя|ий)"
)


COUNT_NAMES = re.compile(
    r"n|count|sample size|(number|no\.?|#) of (specimens|samples|tests)|specimens|samples|anzahl( proben)?|"
    r"число образцов|количество образцов|试样数"
)
"""Names of a column that tells of how many specimens a mean is."""


STATED_COUNT = re.compile(
    r"(?<![\w-])n\s*[=:]\s*(?P<number>\d+)(?![\d.,]\d|\d)|(?:mean|average) of (?P<specimens>\d+)\b", re.IGNORECASE
)
"""How a line, or the name of a column, states it."""


UPPER_ENDS = re.compile(r"\b(upper|max(imum)?|high)\b|\+ ?(1 ?)?(sd|sem|se|std|error|err)\b")
LOWER_ENDS = re.compile(r"\b(lower|min(imum)?|low)\b|[−–] ?(1 ?)?(sd|sem|se|std|error|err)\b")
"""Names of columns of the upper and of the lower ends of error bars."""


CYCLE_NAMES = names_of(
    "cycle, cycles, cycle count, cycle number, total cycles, total cycle count, "
    "zyklus, zyklen, цикл, циклы, номер цикла, 循环, 循环次数, 周期, サイクル"
)


SET_NAMES = names_of("setname, set name, set")
"""Names of the column in which parts of a test are named."""


SPECIMEN_NAME = re.compile(
    r"(specimen|sample|proben?|proben?körper|prüfling|replicate|replikat|donor|subject|patient|animal|tier|éprouvette|échantillon|"
    r"probeta|muestra|provino|campione|образ[её]ц|проба|пациент|试样|試験片|样品|样本)s?"
    r"([ -]?(id|no\.?|nr\.?|n°|#|№|number|nummer|name|label|bezeichnung|编号|番号))?|"
    r"(nom|nombre|nome) (de l'|de la |del |della |da |do )?(éprouvette|échantillon|probeta|muestra|provino|campione|"
    r"amostra)|номер (образца|пробы)|№ образца"
)
"""Names of a column that tells which specimen a row is of."""


DIMENSION_NAMES = {
    "area": names_of(
        "area, cross section, cross sectional area, cross section area, s0, a0, querschnitt, querschnittsfläche, "
        "fläche, probenfläche, "
        "probenquerschnitt, anfangsquerschnitt, section, section transversale, section droite, aire, "
        "aire de la section, sección, sección transversal, área, área de la sección, "
        "área de la sección transversal, seção, secção, seção transversal, secção transversal, área da seção, "
        "área da secção, área da seção transversal, área da secção transversal, sezione, sezione trasversale, "
        "area della sezione, area della sezione trasversale, doorsnede, dwarsdoorsnede, "
        "oppervlakte van de doorsnede, 横截面积, 截面积, 橫截面積, 截面積, 面积, 面積, 断面積, 原断面積, "
        "przekrój, pole przekroju, pole przekroju poprzecznego, "
        "площадь, сечение, поперечное сечение, площадь сечения, площадь поперечного сечения"
    ),
    "width": names_of(
        "width, b0, breite, probenbreite, largeur, anchura, ancho, largura, larghezza, breedte, 宽度, 寬度, 幅, 板幅, "
        "szerokość, ширина"
    ),
    "thickness": names_of(
        "thickness, a0, dicke, probendicke, épaisseur, espesor, grosor, espessura, spessore, dikte, 厚度, 厚さ, 板厚, "
        "grubość, толщина"
    ),
    "diameter": names_of(
        "diameter, d0, ø, ⌀, durchmesser, probendurchmesser, diamètre, diámetro, diâmetro, diametro, 直径, 直徑, "
        "średnica, диаметр"
    ),
    "length": names_of(
        "length, gauge length, gage length, l0, grip separation, grip to grip separation, distance between grips, "
        "länge, messlänge, anfangsmesslänge, anfangslänge, ausgangslänge, einspannlänge, probenlänge, "
        "longueur, longueur de référence, longueur entre repères, longueur entre mors, distance entre mors, "
        "longitud, longitud de referencia, "
        "longitud entre puntos, longitud entre mordazas, distancia entre mordazas, comprimento, "
        "comprimento de referência, comprimento de medida, distância entre garras, lunghezza, "
        "lunghezza di riferimento, lunghezza tra i riferimenti, distanza tra gli afferraggi, lengte, "
        "meetlengte, beginlengte, inklemlengte, 标距, 标距长度, 標距, 长度, 長度, 夹具间距, "
        "標点距離, 標点間距離, 原標点距離, 長さ, つかみ具間距離, チャック間距離, ゲージ長, "
        "długość, długość pomiarowa, "
        "длина, рабочая длина, расчётная длина, измерительная длина, зажимная длина, база, измерительная база, "
        "база экстензометра, расстояние между захватами, расстояние между зажимами"
    ),
}
"""What the sizes of specimens are called, in the words of testing standards, without those in `OF_SPECIMEN`."""


HEIGHT_NAMES = names_of("height, h0, höhe, probenhöhe, hauteur, altura, altezza, hoogte, 高度, 高さ, wysokość, высота")
"""What the length of a cylinder or a disc is called; of other specimens it may be the thickness."""


OF_SPECIMEN = re.compile(
    r"\b((de|del|della|di|du|da|do|van) )*(la |het |l'|d')?(specimen|sample|test piece|disc|disk|eprouvette|"
    r"echantillon|probeta|muestra|provino|campione|corpo de prova|amostra|proefstuk|monster)('s)?\b|"
    r"\b(bei startposition|zu beginn|at (the )?(start|beginning)|before (the )?test)\b|"
    r"\b(initiale?|initieel|inicial|iniziale|original|undeformed|(mean|average)(?! diameter))\b|"
    r"原始|初始|初期|试样|試樣|試験片|样品|の|"
    r"\b(перво)?начальн(ая|ый|ое)\b|\bисходн(ая|ый|ое)\b|\b(образца|пробы)\b|\b(probki|poczatkow[aey])\b"
)
"""Words beside the name of a size that leave it what it is, without accents; a mean diameter is that of a tube."""


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
