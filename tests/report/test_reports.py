"""The HTML reports: well-formed, self-contained, complete."""

import base64
import re
import shutil
from html.parser import HTMLParser
from importlib.metadata import version
from itertools import product
from xml.etree import ElementTree

import pytest

from marks import slow_but
from tissuq.report.paper import paper_result
from tissuq.report.run_folder import LIBRARIES, write_figures
from tissuq.report.specimen import specimen_result
from tissuq.report.writer import write_result
from tissuq.validation.paper.claims import CLAIMS

VOID = {"meta", "img", "br", "hr", "link", "input"}


class Page(HTMLParser):
    """Collects elements and what they refer to, and refuses tags that do not close."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.references, self.images, self.styles, self.words = [], [], [], [], []
        self.counts, self.metas, self.scripts = {}, [], ""
        self.feed(text)
        self.close()
        assert self.open == [], f"never closed: {self.open}"

    def handle_starttag(self, tag, attributes):
        self.counts[tag] = self.counts.get(tag, 0) + 1
        given = dict(attributes)
        assert len(given) == len(attributes), f"an attribute of {tag} is given twice"
        self.references += [value for name, value in attributes if name in ("src", "href", "srcset", "data", "action")]
        if tag == "meta":
            self.metas.append(given)
        if tag == "img":
            self.images.append(given)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag, f"</{tag}> closes another element"

    def handle_data(self, data):
        if self.open and self.open[-1] == "script":
            self.scripts += data
            return
        (self.styles if self.open and self.open[-1] == "style" else self.words).append(data)


@pytest.fixture(scope="session")
def paper_folder(paper_study, tmp_path_factory):
    """The report of the paper's study, with copies of figure 5 in the places of figures 1 to 4 and 6."""

    def write_some(folder, figures):
        write_figures(folder, {name: figures[name] for name in ("figure5", "figure7")})
        for name, kind in product(figures.keys() - {"figure5", "figure7"}, ("svg", "png")):
            shutil.copy(folder / "figures" / f"figure5.{kind}", folder / "figures" / f"{name}.{kind}")

    folder = tmp_path_factory.mktemp("paper")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tissuq.report.writer.write_figures", write_some)
        write_result(paper_result(paper_study), folder)
    return folder


@pytest.fixture(scope="session")
def long_paper_folder(paper_study, tmp_path_factory):
    folder = tmp_path_factory.mktemp("long_paper")
    write_result(paper_result(paper_study), folder)
    return folder


@pytest.fixture(scope="session")
def specimen_folder(specimen_study, tmp_path_factory):
    folder = tmp_path_factory.mktemp("specimen")
    write_result(specimen_result(specimen_study), folder)
    return folder


@pytest.fixture(scope="session")
def long_specimen_folder(long_specimen_study, tmp_path_factory):
    folder = tmp_path_factory.mktemp("long_specimen")
    write_result(specimen_result(long_specimen_study), folder)
    return folder


SHORT = ["paper", "specimen"]


@pytest.fixture(params=slow_but(SHORT, [*SHORT, *(f"long_{name}" for name in SHORT)]))
def folder(request):
    return request.getfixturevalue(f"{request.param}_folder")


@pytest.fixture
def text(folder):
    return (folder / "report.html").read_text(encoding="utf-8")


def words_of(text):
    return " ".join(" ".join(Page(text).words).split())


def test_the_page_is_well_formed(text):
    page = Page(text)
    assert text.startswith("<!doctype html>")
    assert {page.counts[tag] for tag in ("html", "head", "body", "title", "main", "h1")} == {1}


def test_every_table_has_rows_as_wide_as_its_heading(text):
    for table in re.findall(r"<table>.*?</table>", text, re.DOTALL):
        rows = re.findall(r"<tr>.*?</tr>", table, re.DOTALL)
        assert len({len(re.findall(r"<t[hd][ >]", row)) for row in rows}) == 1


def test_a_percentage_is_spelled_in_one_way(text):
    shown = re.sub(r"<(script|style|pre|code)\b.*?</\1>|<[^>]*>", " ", text, flags=re.DOTALL)
    assert "95\u00a0%" in shown
    assert re.findall(r".{30}\d ?%", shown) == []


def test_the_page_asks_no_host_for_anything(text):
    page = Page(text)
    assert all(reference.startswith(("data:", "#")) for reference in page.references)
    assert not any(word in "".join(page.styles) for word in ("url(", "@import", "//"))
    assert page.counts.keys().isdisjoint({"link", "iframe", "object", "embed", "base"})
    (policy,) = (meta["content"] for meta in page.metas if meta.get("http-equiv") == "Content-Security-Policy")
    assert policy == "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
    assert not re.search(r"fetch\(|XMLHttpRequest|WebSocket|EventSource|sendBeacon|\.src\b|location", page.scripts)


def test_every_figure_is_inside_the_page_as_the_svg_of_the_folder(folder, text):
    prefix = "data:image/svg+xml;base64,"
    embedded = [base64.b64decode(image["src"].removeprefix(prefix)) for image in Page(text).images]
    drawn = [path.read_bytes() for path in (folder / "figures").glob("*.svg")]
    assert sorted(embedded) == sorted(drawn)
    assert len(drawn) >= 3


def test_every_figure_has_a_text_alternative_and_a_caption(text):
    page = Page(text)
    assert all(image["alt"] for image in page.images)
    assert page.counts["figcaption"] == page.counts["figure"] == len(page.images)


def test_a_figure_refers_to_nothing_outside_itself(folder):
    for path in (folder / "figures").glob("*.svg"):
        for element in ElementTree.parse(path).iter():
            references = [value for name, value in element.attrib.items() if name.endswith(("href", "src"))]
            assert all(value.startswith(("#", "data:")) for value in references)
            styles = " ".join(element.attrib.values()) + (element.text or "")
            assert re.findall(r"url\((?!#)", styles) == []
            assert "@import" not in styles


def test_the_page_holds_the_settings_the_seed_and_the_versions(folder, text):
    words = words_of(text)
    assert " ".join((folder / "run.toml").read_text().split()) in words
    assert re.search(r"\bseed = (5|11)\b", words)
    assert all(f"{name} {version(name)}" in words for name in LIBRARIES)


def test_every_claim_of_the_paper_is_in_the_page_with_its_verdict(paper_folder, paper_study):
    words = words_of((paper_folder / "report.html").read_text())
    assert len(CLAIMS) == len(paper_study.verdicts)
    for verdict in paper_study.verdicts:
        assert f"{verdict.claim.text} {verdict.word} {verdict.times} of {verdict.decided}" in words


def test_the_page_of_the_paper_shows_every_row_of_its_summary(paper_folder, paper_study):
    text = (paper_folder / "report.html").read_text()
    for name, fitted in paper_study.main.items():
        low, high = fitted.finding.low, fitted.finding.high
        (row,) = re.findall(rf"<tr><td>{name}</td><td>[\d.]+</td><td>[\d.]+</td><td>\[([\d., ]+)\]</td>", text)
        shown = [float(end) for end in row.split(", ")]
        assert shown == pytest.approx([low, high], abs=0.05 * (high - low))


def test_the_page_of_a_specimen_is_in_the_unit_of_its_file(specimen_folder, specimen_study):
    words = words_of((specimen_folder / "report.html").read_text())
    assert "C10, kPa" in words
    assert "sd 200 kPa" in words
    marginal = specimen_study.posteriors["yeoh"].solution.marginals["C10"]
    assert re.search(rf"yeoh {1000 * marginal.mean:.0f} {1000 * marginal.sd:.0f} \[", words)


@pytest.mark.parametrize("kind", slow_but(["specimen"], ["specimen", "long_specimen"]))
def test_cautions_of_the_discrepancies_are_told(request, kind):
    words = words_of((request.getfixturevalue(f"{kind}_folder") / "report.html").read_text())
    study = request.getfixturevalue(f"{kind}_study")
    cautions = [each.model.discrepancy.caution for each in study.posteriors.values()]
    assert any(cautions)
    assert all(caution in words for caution in cautions)


def test_the_summary_on_the_page_has_stability_in_the_modes_that_were_measured(specimen_folder, specimen_study):
    page = (specimen_folder / "report.html").read_text()
    start = page.index('aria-label="table, discrepancy to')
    table = page[start : page.index("</table>", start)]
    headers = re.findall(r'<th scope="col">(.*?)</th>', table)
    cells = re.findall(r"<td>(.*?)</td>", re.search(r"<tr class=main><td>auto</td>(.*?)</tr>", table, re.DOTALL)[1])
    probability = specimen_study.posteriors["auto"].stable_ranges["uniaxial"].probability
    assert cells[headers.index("stable") - 1] == f"{100 * probability:.0f}\u00a0%"


def test_a_page_without_figures_says_how_to_repeat_it_without(specimen_study, tmp_path):
    write_result(specimen_result(specimen_study), tmp_path, figures=False)
    text = (tmp_path / "report.html").read_text()
    assert "tissuq fit --no-figures --config run.toml" in words_of(text)
    assert "<img" not in text
    assert not (tmp_path / "figures").exists()
