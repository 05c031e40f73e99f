"""What a person sees and does on the page of a fit, in a browser."""

import json
import re

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from matplotlib.figure import Figure

import tissuq as tq
from browser import FIRST_SCREEN, needs_chromium, opened
from tissuq.assessment.uses import Use, Verdict
from tissuq.experiments.units import stress_unit
from tissuq.report.laws import columns_of_laws
from tissuq.report.result import Number, Picture, Preformatted, Result, Section, Table
from tissuq.report.specimen import specimen_result
from tissuq.report.writer import write_result
from tissuq.result_warning import ResultWarning, Severity
from tissuq.studies.specimen import SpecimenSettings, run_specimen

pytestmark = [needs_chromium, pytest.mark.slow]

TYPED, SLIDER = "#chart input[type=number]", "#chart input[aria-label$='at which to predict']"
READOUT, OF_PARAMETERS = ".chart-readout", "#chart fieldset input[type=range]"
NUMBER = r"-?\d+\.?\d*(?:e[+-]?\d+)?"


@pytest.fixture(scope="module")
def of_one_test(specimen_study, tmp_path_factory):
    """The page of a fit with several formulations."""
    folder = tmp_path_factory.mktemp("one")
    write_result(specimen_result(specimen_study), folder)
    return folder / "report.html"


@pytest.fixture(scope="module")
def of_two_tests(tmp_path_factory):
    """The page of a fit of two loading modes."""
    folder, files = tmp_path_factory.mktemp("two"), []
    for number, mode in enumerate(("uniaxial", "planar")):
        test = tq.simulate("ogden-1", {"mu1": 0.5, "alpha1": 3.0}, np.linspace(1, 2, 9), 0.01, number, mode=mode)
        files.append(folder / f"{mode}.csv")
        rows = "".join(f"{x},{y}\n" for x, y in zip(test.stretch, test.stress, strict=True))
        files[-1].write_text(f"stretch,stress_MPa\n{rows}", encoding="utf-8")
    tests = [{"file": str(file), "mode": file.stem, "noise_sd": 0.01} for file in files]
    study = run_specimen(SpecimenSettings(tests=tests, material="ogden-1", discrepancies=["none"]))
    (folder / "run").mkdir()
    write_result(specimen_result(study), folder / "run")
    return folder / "run" / "report.html"


@pytest.fixture(scope="module")
def of_another_command(tmp_path_factory):
    """The page of a result with every kind of block."""
    table = Table(["name", "value"], [["a", "1"]], "Main table", note="Of `all`.")
    deeper = Section("Deeper", (Preformatted("text"), Table(["x"], [["deep"]])))
    result = Result(
        command="design",
        title="Which test to make next",
        subject="two tests",
        numbers=(Number("modulus", 81.34, 79.02, 83.71, "kPa"), Number("the best", "a test of a very long name " * 3)),
        finding="**Strong** and `code`.",
        uses=(Use("report it", Verdict.CARE, "known to ± 3 %"),),
        next_step="type tissuq design {run}",
        picture=Picture("answer", small_figure, "a line that rises", "A line."),
        tables=(table,),
        sections=(Section("Folded", ("A paragraph.", ("first", "second"), table, deeper)),),
        warnings=(ResultWarning("a caution"), ResultWarning("a note", severity=Severity.NOTE)),
        how_to_repeat="`tissuq design RUN`",
    )
    folder = tmp_path_factory.mktemp("other")
    write_result(result, folder)
    return folder / "report.html"


def test_a_table_of_laws_is_seen_whole_on_a_screen_of_1200_pixels(tmp_path):
    widest = ["veronda-westmann", "1.496", "[1.253, 1.689]", "3", "0.202 %", "-15.3 ± 10.4", "0.9999", "0.941 %",
              "29.7 %", "96.6 % / 95.8 %"]  # fmt: skip
    headers = list(columns_of_laws(stress_unit("kPa")))
    result = Result(command="fit", title="which law", subject="a test", tables=(Table(headers, [widest], "Laws"),))
    write_result(result, tmp_path)
    with opened(tmp_path / "report.html") as page:
        seen, whole = page.locator(".scroll").evaluate("table => [table.clientWidth, table.scrollWidth]")
    assert whole <= seen


def small_figure():
    figure = Figure(figsize=(4, 3))
    figure.subplots().plot([0, 1])
    return figure


def violations(page):
    """What axe finds on a page, with the elements, by rule."""
    found = Axe().run(page).response["violations"]
    return {violation["id"]: [node["html"] for node in violation["nodes"]] for violation in found}


def said(page):
    """The numbers that are read out: stretch, measured where it is, predicted, ends of measurements, ..."""
    return [float(text) for text in re.findall(NUMBER, page.inner_text(READOUT).replace("95 %", ""))]


def expected(study, stretch):
    (bands, stress, alone) = (
        study.posteriors["auto"].predict([stretch], unit="kPa", **options).iloc[0]
        for options in ({}, {"noise": False}, {"noise": False, "discrepancy": False})
    )
    return [stretch, *bands[["median", "low", "high"]], *stress[["low", "high"]], alone["median"]]


def test_a_stretch_is_typed_reached_by_keys_and_dragged_and_its_numbers_are_read_out(of_one_test, specimen_study):
    with opened(of_one_test) as page:
        page.select_option("#chart select >> nth=0", "auto")
        assert page.get_attribute(READOUT, "aria-live") == "polite"
        page.fill(TYPED, "1.43")
        assert said(page) == pytest.approx(expected(specimen_study, 1.43), rel=2e-2, abs=8)
        page.focus(SLIDER)
        page.keyboard.press("ArrowRight")
        assert 0 < said(page)[0] - 1.43 < 0.02
        before = said(page)
        box = page.locator(".chart-mark").bounding_box()
        across, down = box["x"] + box["width"] / 2, box["y"] + 40
        page.mouse.move(across, down)
        page.mouse.down()
        page.mouse.move(across - 80, down, steps=3)
        page.mouse.up()
        after = said(page)
        assert after[0] < before[0] - 0.1
        at = float(page.input_value(TYPED))
        assert after == pytest.approx(expected(specimen_study, at), rel=2e-2, abs=8)
        page.fill(TYPED, "3")
        assert "beyond 0.6 to 2" in page.inner_text(READOUT)


def test_loading_and_unloading_are_read_out_apart(tmp_path):
    loading = np.linspace(1, 1.4, 9)
    rows = [(x, x - x**-2) for x in loading] + [(x, 0.8 * (x - x**-2)) for x in loading[-2::-1]]
    file = tmp_path / "cycle.csv"
    file.write_text("stretch,stress_kPa\n" + "".join(f"{x},{y}\n" for x, y in rows), encoding="utf-8")
    study = run_specimen(SpecimenSettings(tests=[{"file": str(file), "noise_sd": 0.0001}], discrepancies=["none"]))
    folder = tmp_path / "run"
    folder.mkdir()
    write_result(specimen_result(study), folder)
    with opened(folder / "report.html") as page:
        page.fill(TYPED, "1.2")
        stress = 1.2 - 1.2**-2
        words = f"stretch 1.2, in kPa: measured {stress:.3g} (loading) and {0.8 * stress:.3g} (unloading), predicted"
        assert words in page.inner_text(READOUT)


def test_small_strains_are_told_apart_in_words(tmp_path):
    file = tmp_path / "stiff.csv"
    file.write_text("stretch,stress_kPa\n" + "".join(f"{x:.5g},{x - x**-2:.5g}\n" for x in np.linspace(1, 1.0062, 9)))
    study = run_specimen(SpecimenSettings(tests=[{"file": str(file), "noise_sd": 1e-4}], discrepancies=["none"]))
    (tmp_path / "run").mkdir()
    write_result(specimen_result(study), tmp_path / "run")
    with opened(tmp_path / "run" / "report.html") as page:
        page.fill(TYPED, "1.0031")
        assert page.inner_text(READOUT).startswith("stretch 1.0031, in Pa:")
        assert page.get_attribute(SLIDER, "aria-valuetext") == "1.0031"
        page.fill(TYPED, "1.0063")
        assert page.inner_text(READOUT).startswith("1.0063 is beyond 1 to 1.0062,")


def test_small_stresses_are_told_apart_on_the_axis_and_in_words(tmp_path):
    file = tmp_path / "soft.csv"
    file.write_text("stretch,stress_psi\n" + "".join(f"{x},{6e-5 * (x - x**-2)}\n" for x in np.linspace(1, 1.3, 9)))
    study = run_specimen(SpecimenSettings(tests=[{"file": str(file), "noise_sd": 1e-7}], discrepancies=["none"]))
    folder = tmp_path / "run"
    folder.mkdir()
    write_result(specimen_result(study), folder)
    with opened(folder / "report.html") as page:
        assert "measured 4.25e-05, predicted" in page.inner_text(READOUT)
        page.evaluate("""() => {
            const draw = CanvasRenderingContext2D.prototype.fillText;
            window.drawn = [];
            CanvasRenderingContext2D.prototype.fillText = function (text, ...place) {
                window.drawn.push(text);
                draw.call(this, text, ...place);
            };
            window.dispatchEvent(new Event("resize"));
        }""")
        page.wait_for_function("window.drawn.length > 0")
        assert {"1e-05", "2e-05", "3e-05"} <= set(page.evaluate("window.drawn"))


def test_a_mode_of_which_a_discrepancy_says_nothing_cannot_be_chosen_beside_it(of_one_test):
    with opened(of_one_test) as page:
        discrepancy, modes = page.locator("#chart select").nth(0), page.locator("#chart select").nth(1)
        disabled = {}
        for name in discrepancy.locator("option").all_inner_texts():
            discrepancy.select_option(name)
            disabled[name] = modes.locator("option[disabled]").all_inner_texts()
        assert disabled["auto"] == []
        (of_stress,) = set(disabled) - {"auto", "none", "yeoh"}
        assert "planar (predicted)" in disabled[of_stress]
        assert "uniaxial" not in disabled[of_stress]


def test_parameters_that_are_moved_draw_the_material_alone(of_one_test):
    with opened(of_one_test) as page:
        page.fill(TYPED, "1.5")
        slider = page.locator(OF_PARAMETERS).first
        slider.evaluate("slider => { slider.value = slider.max; slider.dispatchEvent(new Event('input')); }")
        *_, yours = said(page)
        top = float(slider.input_value())
        assert yours == pytest.approx(2 * top * (1.5 - 1.5**-2), rel=6e-3)
        page.click("text=back to the fit")
        assert "yours" not in page.inner_text(READOUT)


def test_a_limit_that_is_moved_draws_the_material_that_locks_there(tmp_path):
    file = tmp_path / "stiffening.csv"
    rows = [(x, (x - x**-2) * (1 + 0.1 * (x**2 + 2 / x - 3))) for x in np.linspace(0.7, 1.6, 19)]
    file.write_text("stretch,stress_kPa\n" + "".join(f"{x:.6g},{y:.6g}\n" for x, y in rows), encoding="utf-8")
    settings = SpecimenSettings(tests=[{"file": str(file), "noise_sd": 0.2}], material="gent", discrepancies=["none"])
    (tmp_path / "run").mkdir()
    write_result(specimen_result(run_specimen(settings)), tmp_path / "run")
    with opened(tmp_path / "run" / "report.html") as page:
        page.fill(TYPED, "1.5")
        modulus = float(page.locator(OF_PARAMETERS).first.input_value())
        slider = page.locator(OF_PARAMETERS).nth(1)
        for share in (0.01, 0.1, 0.5):
            move = "(slider, x) => { slider.value = +slider.min + x * (slider.max - slider.min);"
            slider.evaluate(move + " slider.dispatchEvent(new Event('input')); }", share)
            limit = float(slider.input_value())
            stress = modulus * (1.5 - 1.5**-2) / (1 - (1.5**2 + 2 / 1.5 - 3) / limit)
            assert said(page)[-1] == pytest.approx(stress, rel=6e-3)


def test_what_is_selected_is_shown_alone_and_all_comes_back(of_one_test):
    with opened(of_one_test) as page:
        picture = page.locator("#chart canvas")
        whole = picture.screenshot()
        page.fill(TYPED, "1.2")
        page.click("[aria-label='zoom in around the mark']")
        assert picture.screenshot() != whole
        page.click("[aria-label='show the whole curve']")
        page.fill(TYPED, "2")
        page.mouse.move(0, 0)
        assert picture.screenshot() == whole


@pytest.mark.parametrize("width", [1200, 400])
def test_number_verdicts_and_curve_begin_on_the_first_screen(of_one_test, width):
    with opened(of_one_test, width) as page:
        for part in (".numbers strong", ".uses li >> nth=3", ".uses .next", "#chart canvas"):
            assert page.locator(part).first.bounding_box()["y"] < FIRST_SCREEN - 40, part
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        reasons = [page.locator(part).first.is_visible() for part in (".uses li span", ".reasons li")]
        assert reasons == ([True, False] if width > 820 else [False, True])


@pytest.mark.parametrize("page_of", ["of_one_test", "of_two_tests", "of_another_command"])
@pytest.mark.parametrize("width", [1200, 400])
def test_axe_finds_nothing_that_shuts_someone_out(request, page_of, width):
    with opened(request.getfixturevalue(page_of), width, bypass_csp=True) as page:
        page.evaluate("document.querySelectorAll('details').forEach(part => { part.open = true; })")
        seen = violations(page)
        assert seen == {}, json.dumps(seen, indent=1)


def test_the_page_of_any_command_has_verdicts_before_the_picture_on_a_small_screen(of_another_command):
    with opened(of_another_command, 400) as page:
        parts = (".numbers", ".uses li span", ".uses .next", ".picture", "#warnings")
        tops = [page.locator(part).first.bounding_box()["y"] for part in parts]
        assert tops == sorted(tops)
        assert page.evaluate("document.documentElement.scrollWidth") <= 400


def test_two_verdicts_stand_before_the_finding_and_numbers_are_in_one_piece(tmp_path):
    result = Result(
        command="population",
        title="A population",
        subject="two specimens",
        numbers=(
            Number("a", 1.0),
            Number("initial shear modulus, of a population", 6.08e-05, 4.99e-05, 7.15e-05, "MPa"),
        ),
        finding="A sentence of some length about the numbers. " * 8,
        uses=(Use("report it", Verdict.YES, "known"), Use("a purpose of a rather long name", Verdict.NO, "not known")),
        next_step="fit another law",
        picture=Picture("answer", small_figure, "a line that rises", "A line."),
    )
    write_result(result, tmp_path)
    for width in (1200, 400, 380, 360, 340):
        with opened(tmp_path / "report.html", width) as page:
            parts = (".numbers", ".uses li", ".uses .next", ".finding")
            tops = [page.locator(part).first.bounding_box()["y"] for part in parts]
            assert tops == sorted(tops)
            for part in (".numbers strong >> nth=1", ".uses li strong >> nth=1"):
                assert page.locator(part).evaluate("part => part.getClientRects().length") == 1
            assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_the_names_of_rows_stay_in_view_where_a_table_is_moved(tmp_path):
    rows = [[name, *["0.123 ± 0.001"] * 6] for name in ("neo-hookean", "veronda-westmann")]
    table = Table(["law", *"abcdef"], rows, "Laws")
    sections = (Section("Laws", (table,)),)
    write_result(Result(command="fit", title="Which law", subject="a test", sections=sections), tmp_path)
    for width, is_moved in ((1200, False), (400, True)):
        with opened(tmp_path / "report.html", width) as page:
            page.evaluate("document.querySelectorAll('details').forEach(part => { part.open = true; })")
            cells = page.locator("td", has_text="veronda-westmann"), page.locator("tr:last-child td").nth(1)
            before = [cell.bounding_box()["x"] for cell in cells]
            page.locator(".scroll:has(> table)").evaluate("part => { part.scrollLeft = 90; }")
            after = [cell.bounding_box()["x"] for cell in cells]
            assert after == [before[0], before[1] - 90 * is_moved]


def test_what_is_wider_than_a_small_screen_says_so_and_text_is_wrapped(tmp_path):
    table = Table(["law", *"abcdefgh"], [["neo-hookean", *["0.123 ± 0.001"] * 8]])
    sections = (Section("Laws", (table, Preformatted("word " * 60), Preformatted("x" * 300))),)
    write_result(Result(command="fit", title="Which law", subject="a test", sections=sections), tmp_path)
    for width, is_cut in ((1600, False), (400, True)):
        with opened(tmp_path / "report.html", width) as page:
            page.evaluate("document.querySelectorAll('details').forEach(part => { part.open = true; })")
            page.wait_for_timeout(200)
            assert page.locator(".scroll.more").count() == is_cut
            widths = "part => part.scrollWidth - part.clientWidth"
            beyond = page.locator("pre").evaluate_all(f"parts => parts.map({widths})")
            assert not is_cut or max(beyond) <= 1


def test_the_legend_of_the_chart_stands_beneath_it_on_any_screen(of_one_test):
    for width in (1200, 400):
        with opened(of_one_test, width) as page:
            assert page.locator("#chart label", has_text="material + discrepancy").first.is_visible()
            assert page.locator(".chart-dashes").is_visible()
            assert not page.locator("#chart label", has_text="unloading").is_visible()


def test_axe_finds_a_fault_that_is_planted(of_one_test):
    with opened(of_one_test, bypass_csp=True) as page:
        page.evaluate("document.querySelector('img').removeAttribute('alt')")
        page.evaluate("document.querySelector('.soft').style.color = '#bbbbbb'")
        page.evaluate("document.querySelector('.still').classList.remove('print-only')")
        assert violations(page).keys() >= {"color-contrast", "image-alt"}


def test_without_scripts_the_still_figure_stands_there(of_one_test):
    with opened(of_one_test, java_script_enabled=False) as page:
        assert page.locator(".still img").is_visible()
        assert not page.locator("#chart").is_visible()
