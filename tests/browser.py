"""Pages in Debian's Chromium, driven by Playwright, which downloads nothing."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Page

CHROMIUM = shutil.which("chromium")
FIRST_SCREEN = 700
"""Pixels of a page that are seen at once on a small screen."""

needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed (make system)")


@contextmanager
def opened(file: Path, width: int = 1200, height: int = FIRST_SCREEN, **options: Any) -> Iterator[Page]:
    """Give a file as a page; an error of its scripts fails the test."""
    from playwright.sync_api import sync_playwright

    errors: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_context(viewport={"width": width, "height": height}, **options).new_page()
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(file.resolve().as_uri())
        yield page
        browser.close()
    assert errors == []
