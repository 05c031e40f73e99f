"""A site that needs no network: what the theme would fetch is here, and a look whether anything else is fetched."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

FETCHED = {
    "script": "src",
    "img": "src",
    "iframe": "src",
    "source": "src",
    "video": "src",
    "audio": "src",
    "object": "data",
}
STYLES = re.compile(r"""(?:@import\s+|url\()\s*['"]?((?:https?:)?//[^'")\s]+)""")

LOCAL = {"https://unpkg.com/iframe-worker/shim": "javascripts/iframe-worker.js"}
"""Scripts of the theme that lie elsewhere, and where they lie in the site."""


def make_local(site: Path) -> None:
    """Have every page take the scripts of the theme from the site."""
    for file in site.rglob("*.html"):
        text = before = file.read_text(encoding="utf-8")
        for address, place in LOCAL.items():
            text = text.replace(address, "../" * (len(file.relative_to(site).parts) - 1) + place)
        if text != before:
            file.write_text(text, encoding="utf-8")


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        addresses = [values.get(FETCHED.get(tag, ""))]
        if tag == "link" and values.get("rel") in ("stylesheet", "preload", "preconnect", "icon", "modulepreload"):
            addresses.append(values.get("href"))
        self.found += [text for text in addresses if text and re.match(r"(https?:)?//", text)]
        self.found += STYLES.findall(values.get("style") or "")


def outside_addresses(site: Path) -> list[str]:
    """Return every address outside that a file of the site has a browser fetch, with the file."""
    found = []
    for file in sorted(site.rglob("*")):
        text = file.read_text(encoding="utf-8") if file.suffix in (".html", ".css") else ""
        addresses = STYLES.findall(text)
        if file.suffix == ".html":
            reader = _Reader()
            reader.feed(text)
            addresses += reader.found
        found += [f"{file.relative_to(site)}: {address}" for address in sorted(set(addresses))]
    return found
