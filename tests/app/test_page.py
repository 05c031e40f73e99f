"""The page in a real browser: upload, mend, fit, compare, predict, export; bad files, two users, pages that go away."""

from __future__ import annotations

import json
import re
import shutil
import socket
import time
import urllib.error
import urllib.parse
import urllib.request
import zipfile
from pathlib import Path

import pytest

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed (the extra 'dev')")

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed (make system)")
PATIENCE = 300_000
"""Milliseconds that a busy computer has for a step."""
SCRIPTS = {name: Path(__file__).with_name(f"{name}.js").read_text() for name in ("drop", "faint", "nameless")}


@pytest.fixture(scope="module")
def browser():
    sync_api.expect.set_options(timeout=PATIENCE)
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def visit(browser, address):
    """Open the page as one more user; none may complain, or ask another host for anything."""
    pages, complaints = [], []

    def open_page(width=1200):
        page = browser.new_context(viewport={"width": width, "height": 900}, accept_downloads=True).new_page()
        page.set_default_timeout(PATIENCE)
        page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on(
            "request", lambda asked: None if asked.url.startswith((address, "data:")) else complaints.append(asked.url)
        )
        page.goto(address)
        page.wait_for_selector("body[data-ready]", state="attached")
        pages.append(page)
        return page

    yield open_page
    for page in pages:
        if not page.is_closed():
            page.context.close()
    assert not [text for text in complaints if "400 (Bad Request)" not in text]


def upload(page, *files):
    page.set_input_files("#pick", files)
    page.wait_for_selector("#tests .plot, #refusal .question")


def fit(page, until="#report iframe"):
    page.click("#fit-button")
    page.wait_for_selector(until)


def number_of(page):
    """Return the modulus that the page shows, and its interval, kPa."""
    text = page.inner_text(".numbers .first")
    assert "kPa" in text
    return [float(number) for number in re.findall(r"(?<![\w%])[\d.]+(?= kPa|\sto|$)", text)]


def status_of(address, **headers):
    try:
        with urllib.request.urlopen(urllib.request.Request(address, headers=headers)) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


@pytest.mark.slow
def test_a_file_that_is_dropped_is_read_and_shown(visit, tmp_path, write_stretches):
    page = visit()
    text = write_stretches(tmp_path).read_text()
    page.evaluate(SCRIPTS["drop"], text)
    page.wait_for_selector("#tests .plot")
    assert page.inner_text("#file-list .name") == "kidney.csv"
    assert page.locator(".plot circle").count() == 40
    page.get_by_role("button", name="uniaxial", exact=True).click()
    page.wait_for_selector("#questions .question", state="detached")
    assert page.inner_text("#tests h3") == "kidney: uniaxial, 40 of 40 rows, stretch 1.010 to 1.500"
    assert page.is_visible("#fit-button")


def test_without_the_token_or_under_another_name_nothing_is_served_and_no_web_socket_opens(address):
    host, token = re.match(r"http://([^/]+)/([^/]+)/", address).groups()
    assert status_of(address) == 200
    assert status_of(f"http://{host}/") == 403
    assert status_of(f"http://{host}/{token[:-1]}x/main.js") == 403
    assert status_of(address, Host="evil.example") == 403
    for path in ("/", f"/{token}/", f"/{token}/sessions/x/news"):
        with socket.create_connection(host.split(":"), timeout=30) as line:
            line.sendall(
                f"GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
                "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode()
            )
            assert not line.recv(100).startswith(b"HTTP/1.1 101")


def test_the_page_listens_on_this_computer_alone(address):
    port = int(re.search(r":(\d+)/", address)[1])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))
            other = probe.getsockname()[0]
        except OSError:
            pytest.skip("this computer has no other address than the loopback")
    if other.startswith("127."):
        pytest.skip("this computer has no other address than the loopback")
    with pytest.raises(OSError):  # noqa: PT011 (refused or out of reach)
        socket.create_connection((other, port), timeout=5)


@pytest.mark.slow
def test_a_file_is_mended_by_clicking(visit, tmp_path, write_machine):
    page = visit()
    upload(page, write_machine(tmp_path))
    assert "undeformed length" in page.inner_text("#refusal")
    assert not page.is_visible("#fit-button")
    page.fill("#refusal [name=length]", "12 mm")
    page.locator("#refusal").get_by_role("button", name="Use").click()
    page.wait_for_selector("#tests .plot")
    page.get_by_role("button", name="take only loading").click()
    heading = page.locator("#tests h3")
    sync_api.expect(heading).to_contain_text("60 of 120 rows, stretch 1.000 to 1.333")
    page.get_by_role("button", name="uniaxial", exact=True).click()
    sync_api.expect(page.locator("#questions .question")).to_have_count(0)
    page.locator(".plot").scroll_into_view_if_needed()
    box = page.locator(".plot").bounding_box()
    page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 50)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 60, steps=3)
    page.mouse.up()
    page.get_by_role("button", name="Use all stretches").wait_for()
    assert 15 < int(re.search(r"(\d+) of 120", heading.inner_text())[1]) < 35
    page.get_by_role("button", name="Use all stretches").click()
    sync_api.expect(heading).to_contain_text("60 of 120 rows")
    page.click("#mend summary")
    page.select_option("[name='column Load (N)']", "stress")
    page.wait_for_selector("#refusal .question")
    assert not page.is_visible("#fit-button")
    page.select_option("[name='column Load (N)']", "force")
    page.fill("[name='dimensions.thickness']", "4 mm")
    page.press("[name='dimensions.thickness']", "Tab")
    sync_api.expect(page.locator("#findings")).to_contain_text("thickness")
    assert page.evaluate("document.activeElement.name") == "dimensions.diameter"
    page.get_by_role("button", name="As the files say").click()
    page.wait_for_selector("#refusal [name=length]")


@pytest.mark.slow
def test_from_a_file_to_the_answer_and_all_that_follows(visit, tmp_path, write_stretches):
    page = visit()
    upload(page, write_stretches(tmp_path))
    page.get_by_role("button", name="uniaxial", exact=True).click()
    sync_api.expect(page.locator("#questions .question")).to_have_count(0)
    fit(page)
    modulus, low, high = number_of(page)
    assert low < 10 < high
    assert low < modulus < high
    report = page.frame_locator("#report iframe")
    assert report.locator(".numbers .first").inner_text().split()[3] in page.inner_text(".numbers .first")
    sync_api.expect(report.locator("canvas")).not_to_have_count(0)
    page.select_option("#material", "yeoh")
    assert page.is_visible("#stale")
    page.select_option("#material", "neo-hookean")
    assert not page.is_visible("#stale")

    with page.expect_download() as download:
        page.click("#zip")
    download.value.save_as(tmp_path / "run.zip")
    with zipfile.ZipFile(tmp_path / "run.zip") as run:
        names = set(run.namelist())
        answer = json.loads(run.read("kidney/result.json"))
    assert {f"kidney/{name}" for name in ("report.html", "run.toml", "input/kidney.csv", "posterior/auto.nc")} <= names
    assert answer["numbers"][0]["value"] == pytest.approx(modulus, rel=6e-3)

    page.click("#laws > summary")
    laws = {"neo-hookean", "mooney-rivlin", "hencky", "valanis-landel"}
    for law in laws:
        page.check(f"#law-list [value='{law}']")
    page.locator("#laws-form").get_by_role("button", name="Compare").click()
    page.wait_for_selector("#laws-result iframe")
    assert set(page.locator("#laws-result td:first-child").all_inner_texts()) == laws

    page.click("#prediction > summary")
    page.select_option("#mode", "planar")
    page.fill("#stretch", "1:1.2")
    page.locator("#predict-form").get_by_role("button", name="Predict").click()
    page.wait_for_selector("#predict-result iframe")
    cells = page.locator("#predict-result tbody tr").last.locator("td").all_inner_texts()
    low, high = map(float, cells[2].split(" to "))
    assert float(cells[0]) == 1.2
    assert low < 10 * (1.2 - 1.2**-3) < high

    page.click("#cards > summary")
    page.select_option("#format", "abaqus")
    page.fill("#draws", "3")
    page.check("#all-draws")
    page.locator("#export-form").get_by_role("button", name="Write cards").click()
    page.wait_for_selector("#export-result a")
    with page.expect_download() as download:
        page.click("#export-result a")
    download.value.save_as(tmp_path / "cards.zip")
    with zipfile.ZipFile(tmp_path / "cards.zip") as cards:
        inputs = [name for name in cards.namelist() if name.endswith(".inp")]
        assert len(inputs) == 3
        assert b"*MATERIAL" in cards.read(inputs[0]).upper()

    for width in (1200, 400):
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    for details in page.locator("details:not([open]) > summary").all():
        if details.is_visible():
            details.click()
    assert page.evaluate(SCRIPTS["nameless"]) == []
    assert page.evaluate(SCRIPTS["faint"]) == []


@pytest.mark.slow
def test_what_to_do_next_names_the_controls_of_the_page(visit, tmp_path, write_stretches):
    page = visit()
    upload(page, *[write_stretches(tmp_path, f"{c10}.csv", c10=c10) for c10 in (5.0, 6.0)])
    page.click("#fit-form summary")
    assert (
        sum(
            text.startswith("auto:") or text == "auto" for text in page.locator("#discrepancy option").all_inner_texts()
        )
        == 1
    )
    page.fill("#noise", "0,1")
    page.click("#fit-button")
    sync_api.expect(page.locator("#alert")).to_contain_text("a positive number with a decimal point")
    page.fill("#noise", "")
    fit(page, until="#answer-body .numbers")
    assert not page.inner_text("#alert")
    advice = page.inner_text("#answer-body")
    assert "fit again with “All tests are of one specimen”" in advice
    assert "--" not in advice
    page.check("#one-specimen")
    page.wait_for_selector("#stale", state="visible")
    fit(page, until="text=for this specimen")
    written = page.evaluate("""async texts => { const { onPage } = await import(new URL("dom.js", document.baseURI));
        return texts.map(onPage); }""", [
        "fit again with --discrepancy auto.", "fit again with --stable-in all.", "fit again with --until-peak.",
        "count from where load begins: fit again with --preload auto.", "fit again with --material all.",
        "tissuq design runs/a says which.", "or with --noise autoregressive.",
        "give --at, and also --at2.", "--at has 3 values and --at2 4", "--format table is exact.",
    ])  # fmt: skip
    assert written == [
        "fit again with “What the material cannot explain”: auto.",
        "fit again with “Only materials that are stable in all loading modes”.",
        "fit again with “Leave out what follows the largest stress”.",
        "count from where load begins: fit again with “Taut (stretch 1) from”: auto.",
        "fit again with “Compare laws”, below.", "tissuq design runs/a says which.", "or with --noise autoregressive.",
        "give “Stretches”, and also “Of the second axis”.", "“Stretches” has 3 values and “Of the second axis” 4",
        "“Code”: table is exact.",
    ]  # fmt: skip


@pytest.mark.slow
def test_a_bad_file_shows_one_message_and_goes_when_it_is_removed(visit, tmp_path, write_stretches):
    page = visit()
    (tmp_path / "bad.csv").write_text("hello,world\nfoo,bar\n")
    upload(page, tmp_path / "bad.csv")
    assert page.inner_text("#refusal").count("bad.csv holds no rows of numbers") == 1
    assert not page.is_visible("#fit-button")
    page.get_by_role("button", name="Remove bad.csv").click()
    sync_api.expect(page.locator("#understood")).to_be_hidden()
    (tmp_path / "empty.csv").write_text("")
    page.set_input_files("#pick", tmp_path / "empty.csv")
    sync_api.expect(page.locator("#alert")).to_contain_text("'empty.csv' is empty")
    upload(page, write_stretches(tmp_path, "pig's.csv"))
    assert page.is_visible("#fit-button")
    said = "Your file 'pig's.csv' is called so here; to repeat the commands of this page give it this name."
    assert page.inner_text("#file-list").splitlines()[0] == "pig_s.csv"
    assert said in page.inner_text("#file-list")


@pytest.mark.slow
def test_two_users_at_once_do_not_mix(visit, tmp_path, write_stretches):
    pages = [visit(), visit(400)]
    for page, c10 in zip(pages, (5.0, 20.0), strict=True):
        (tmp_path / f"{c10}").mkdir()
        upload(page, write_stretches(tmp_path / f"{c10}", c10=c10))
        page.get_by_role("button", name="uniaxial", exact=True).click()
        sync_api.expect(page.locator("#questions .question")).to_have_count(0)
    for page in pages:
        page.click("#fit-button")
    for page, modulus in zip(pages, (10, 40), strict=True):
        page.wait_for_selector("#report iframe")
        _, low, high = number_of(page)
        assert low < modulus < high
    session = re.search(r"sessions/([^/]+)/", pages[0].get_attribute("#report iframe", "src"))[1]
    other = pages[1].evaluate(f"fetch('sessions/{session}x/results/kidney.csv').then(answer => answer.status)")
    assert other == 400


@pytest.mark.slow
def test_a_fit_that_is_cancelled_or_whose_page_is_closed_leaves_nothing(visit, scratch, tmp_path, write_stretches):
    (folder,) = scratch.glob("tissuq-app-*")
    page = visit()
    upload(page, write_stretches(tmp_path))
    page.click("#fit-button")
    page.get_by_text("fitting, discrepancy auto").wait_for()
    page.locator("#fit-progress").get_by_role("button", name="Cancel").click()
    sync_api.expect(page.locator("#fit-progress")).to_contain_text("Stopped")
    before = {session for session in folder.iterdir() if (session / "kidney.csv").exists()}
    assert before
    page.click("#fit-button")
    page.get_by_text("fitting, discrepancy auto").wait_for()
    page.close()
    end = time.monotonic() + PATIENCE / 1000
    while any(session.exists() for session in before) and time.monotonic() < end:
        time.sleep(0.2)
    assert not [session for session in before if session.exists()]
    other = visit()
    upload(other, write_stretches(tmp_path))
    fit(other, ".numbers .first")
    assert number_of(other)[1] < 10 < number_of(other)[2]


@pytest.mark.slow
def test_a_page_that_is_loaded_again_goes_on_where_it_was(visit, tmp_path, write_stretches):
    page = visit()
    upload(page, write_stretches(tmp_path))
    page.evaluate("document.getElementById('stable').checked = true")
    page.click("#fit-button")
    page.get_by_text("fitting, discrepancy auto").wait_for()
    page.reload()
    page.wait_for_selector("#report iframe")
    assert number_of(page)[1] < 10 < number_of(page)[2]
    page.goto("about:blank")
    page.go_back()
    page.wait_for_selector("#report iframe")
    page.wait_for_selector("#tests .plot")
    assert page.inner_text("#file-list .name") == "kidney.csv"
    assert page.is_checked("#stable")
    sync_api.expect(page.locator("#stale")).to_be_hidden()


@pytest.mark.slow
def test_a_page_that_was_away_for_too_long_says_that_its_files_are_deleted(visit, tmp_path, write_stretches):
    page = visit()
    upload(page, write_stretches(tmp_path))
    page.evaluate("addEventListener('pagehide', () => sessionStorage.setItem('tissuq', sessionStorage.getItem('tissuq')"
                  ".replace(/\"session\":\"[^\"]*\"/, '\"session\":\"gone\"')))")  # fmt: skip
    page.reload()
    sync_api.expect(page.locator("#alert")).to_contain_text("away for too long, and its files are deleted")
    assert page.locator("#file-list .name").count() == 0


@pytest.mark.slow
def test_columns_of_two_files_with_other_names_are_chosen_by_clicking(visit, tmp_path, write_stretches):
    page = visit()
    files = [write_stretches(tmp_path, f"{name}.csv", f"{name} 1,{name} 2", c10) for name, c10 in (("a", 5), ("b", 6))]
    upload(page, *files)
    page.evaluate("document.getElementById('mend').open = true")
    for name in ("a", "b"):
        for number, role in ((1, "stretch"), (2, "stress")):
            page.select_option(f'select[name="column {name} {number}"]', role)
            page.wait_for_selector("#understood:not([aria-busy])")
    page.wait_for_function("document.querySelectorAll('#tests .plot').length === 2")
    assert "--column 'stretch=a 1' --column 'stretch=b 1'" in page.locator("#inspect-repeat").text_content()


@pytest.mark.slow
def test_files_chosen_before_the_page_has_its_session_are_not_lost(browser, address, tmp_path):
    path = tmp_path / "first.csv"
    path.write_text("stretch,stress_kPa\n" + "".join(f"{1 + k / 50},{k}\n" for k in range(12)))
    page = browser.new_page()
    page.set_default_timeout(PATIENCE)
    held = []
    page.route("**/sessions?*", lambda route: held.append(route))
    page.goto(address)
    page.wait_for_function("document.getElementById('pick') !== null")
    page.set_input_files("#pick", path)
    while not held:
        page.wait_for_timeout(20)
    held[0].continue_()
    page.wait_for_selector("#tests .plot, #refusal .question")
    assert "first.csv" in page.inner_text("#file-list")
    page.close()


def test_files_chosen_while_the_page_starts_are_not_lost(browser, address, tmp_path):
    path = tmp_path / "early.csv"
    path.write_text("stretch,stress_kPa\n" + "".join(f"{1 + k / 50},{k}\n" for k in range(12)))
    page = browser.new_page()
    page.set_default_timeout(PATIENCE)
    page.goto(address, wait_until="commit")
    page.wait_for_function("document.getElementById('pick') !== null")
    page.set_input_files("#pick", path)
    page.wait_for_selector("#tests .plot, #refusal .question")
    assert "early.csv" in page.inner_text("#file-list")
    page.close()
