"""What MkDocs calls while it builds the site: pages that are made, code that is run, formulas, and a last look."""

from __future__ import annotations

import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from mkdocs.exceptions import PluginError
from mkdocs.plugins import get_plugin_logger
from mkdocs.structure.files import File

from execution import PageError, has_code, timed_page
from formulas import with_formulas, with_whole_numbers
from generated import all_pages, linked_in_site, page_title
from offline import make_local, outside_addresses

log = get_plugin_logger("code of the pages")
PROCESSES = 2
SETTINGS = {"COLUMNS": "88", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""Of the processes that run the code of pages: the width of what commands print, and one thread for small matrices."""
_made: dict[str, str] = {}
_executed: dict[str, str] = {}


def on_config(config: Any) -> Any:
    """Make the pages of the package and put them, and pages that nobody has put anywhere, into the navigation."""
    _made.update(all_pages())
    sections = {title: entry for part in config.nav for title, entry in part.items()}
    for title, folder in (("Commands", "commands/"), ("Python", "reference/")):
        pages = {page: text for page, text in _made.items() if page.startswith(folder)}
        sections["Reference"].append({title: [{page_title(text): page} for page, text in pages.items()]})
    docs = Path(config.docs_dir)
    named = set(_pages_in(config.nav))
    for file in sorted(docs.rglob("*.md")):
        page = file.relative_to(docs).as_posix()
        if page not in named:
            sections["How to"].append({page_title(file.read_text(encoding="utf-8")): page})
    return config


def _pages_in(entry: Any) -> list[str]:
    if isinstance(entry, str):
        return [entry]
    parts = entry.values() if isinstance(entry, dict) else entry
    return [page for part in parts for page in _pages_in(part)]


def on_files(files: Any, config: Any) -> Any:
    """Add the pages that are made, and run the code of all pages, the longest first."""
    for page, text in _made.items():
        files.append(File.generated(config, page, content=text))
    texts = {file.src_uri: file.content_string for file in files.documentation_pages() if file.src_uri not in _made}
    pages = {page: text for page, text in texts.items() if has_code(text) and "SKIP_CODE" not in os.environ}
    order = sorted(pages, key=lambda page: page not in config.extra["longest"])
    sys.path.insert(0, str(Path(__file__).parent))  # where the processes find the modules of this folder
    for name, value in SETTINGS.items():
        os.environ.setdefault(name, value)
    with ProcessPoolExecutor(PROCESSES, mp_context=multiprocessing.get_context("spawn")) as pool:
        running = {page: pool.submit(timed_page, pages[page], page) for page in order}
        for page, result in running.items():
            try:
                _executed[page], seconds = result.result()
                log.info("%s has run in %.1f s of a processor", page, seconds)
            except PageError as error:
                raise PluginError(str(error)) from error
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Return a page with what its code said, its formulas, and its links to the pages of the site."""
    text = _executed.get(page.file.src_uri, markdown)
    return with_formulas(with_whole_numbers(linked_in_site(text)))


def on_post_build(config: Any) -> None:
    """Stop where a page would fetch a script, a style, a font or a picture from elsewhere."""
    make_local(Path(config.site_dir))
    found = outside_addresses(Path(config.site_dir))
    if found:
        raise PluginError("These are fetched from elsewhere:\n" + "\n".join(found))
