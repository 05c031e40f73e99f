"""Names of files become harmless, sizes are limited, and nothing is left of what is refused."""

from __future__ import annotations

import asyncio

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tissuq.app import sessions
from tissuq.errors import InputError


async def chunks(*parts):
    for part in parts:
        yield part


@pytest.mark.slow
@given(st.text(max_size=300))
def test_every_name_becomes_one_of_a_file_in_the_folder(name):
    harmless = sessions.harmless_name(name)
    assert harmless
    assert len(harmless) <= 112
    assert not set(harmless) & set("/\\:*?\"<>|#$`;&'\0\n")
    assert harmless[0] not in ".- "
    assert harmless.lower() not in ("runs", "cards", "con", "nul")
    assert sessions.harmless_name(harmless) == harmless


@pytest.mark.parametrize(
    ("name", "harmless"),
    [
        ("../../etc/passwd", "passwd"),
        ("C:\\Users\\me\\Probe 3 (kPa).xlsx", "Probe 3 (kPa).xlsx"),
        ("Größe.csv", "Größe.csv"),
        (".hidden", "hidden"),
        ("a#b.csv", "a_b.csv"),
        ("con.csv", "_con.csv"),
        ("", "file"),
    ],
)
def test_names_that_mean_something_are_kept_as_far_as_they_are_harmless(name, harmless):
    assert sessions.harmless_name(name) == harmless


def test_two_files_of_one_name_are_both_stored(tmp_path):
    names = [asyncio.run(sessions.store(chunks(b"1"), name, tmp_path)) for name in ("a.csv", "A.csv", "a.csv")]
    assert names == ["a.csv", "A-2.csv", "a-3.csv"]


@pytest.mark.parametrize(
    ("parts", "words"), [((b"12345", b"67890", b"1"), "too large"), ((), "empty")], ids=["large", "empty"]
)
def test_what_is_too_large_or_empty_is_refused_and_gone(tmp_path, monkeypatch, parts, words):
    monkeypatch.setattr(sessions, "MAX_FILE", 10)
    with pytest.raises(InputError, match=words):
        asyncio.run(sessions.store(chunks(*parts), "a.csv", tmp_path))
    assert not list(tmp_path.iterdir())


def test_all_files_together_are_limited_too(tmp_path, monkeypatch):
    monkeypatch.setattr(sessions, "MAX_TOTAL", 10)
    asyncio.run(sessions.store(chunks(b"12345678"), "a.csv", tmp_path))
    with pytest.raises(InputError, match="all 0 MB"):
        asyncio.run(sessions.store(chunks(b"123"), "b.csv", tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]
