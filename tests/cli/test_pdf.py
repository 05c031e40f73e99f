"""`tissuq show RUN --pdf FILE`."""

import shutil

import pytest

ALONE = ("--noise-sd", 1, "--discrepancy", "none", "--no-figures")
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


@pytest.fixture
def run(done, here, specimen):
    done("fit", specimen, *ALONE, "--out", "run")
    return here / "run"


@pytest.mark.slow
@pytest.mark.skipif(not any(map(shutil.which, BROWSERS)), reason="needs Chromium")
def test_a_report_is_printed_as_a_pdf(cli, here, run):
    said = cli("show", "run", "--pdf", "report.pdf")
    assert (said.status, said.out, said.err) == (0, "report.pdf\n", "")
    content = (here / "report.pdf").read_bytes()
    assert content.startswith(b"%PDF-")
    assert b"/Page" in content


def test_without_a_browser_a_message_says_what_to_do(refused, here, run, monkeypatch):
    monkeypatch.setenv("PATH", str(here))
    refused(["tissuq doctor", "run/report.html"], "show", "run", "--pdf", "report.pdf")
    assert not (here / "report.pdf").exists()


def test_a_browser_that_fails_is_told_with_its_last_words(refused, here, run, monkeypatch):
    program = here / "chromium"
    program.write_text("#!/bin/sh\necho first >&2\necho no display >&2\nexit 3\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(here))
    refused(["no display"], "show", "run", "--pdf", "report.pdf")
    assert not (here / "report.pdf").exists()


def test_a_folder_without_a_page_is_refused(refused, here):
    refused(["nowhere/report.html"], "show", "nowhere", "--pdf", "report.pdf")
