"""Sessions of the page, one a tab: its files, its work, its news; when the tab is closed, all of it goes."""

from __future__ import annotations

import asyncio
import os
import re
import shutil
import unicodedata
from collections.abc import AsyncIterator, Mapping
from contextlib import suppress
from pathlib import Path
from secrets import token_urlsafe
from typing import Any

from tissuq.app.workers import News, Workers
from tissuq.errors import InputError
from tissuq.studies.settings import is_inside

GRACE = 60.0
"""Seconds after which a session ends whose page has gone."""
MAX_SESSIONS = 50
FIRST_SIGN = 60.0
"""Seconds within which a new session's page must listen."""
LEAVING = 1.0
"""Seconds within which a page that is loaded again is noticed to have gone."""
SHOWN = 200
"""Letters of a name in a message."""
MEGABYTE = 1_000_000
MAX_FILE, MAX_TOTAL, MAX_FILES = 50 * MEGABYTE, 200 * MEGABYTE, 60
"""Bytes of one file, bytes of all files of a session, and their number."""
MAX_LETTERS = 100
RESERVED = re.compile(r"(?i)(runs|cards|con|prn|aux|nul|com\d|lpt\d)(\.|$)")
"""Names that Windows or this page has another use for."""


class Session:
    """What one tab has: a folder, tasks that go on, and news of them that it has not heard.

    Parameters
    ----------
    name : str
        Random, so that no tab knows that of another.
    folder : Path
        With the files of its user.
    """

    def __init__(self, name: str, folder: Path) -> None:
        self.name, self.folder = name, folder
        self.news: list[dict[str, Any]] = []
        self.tasks: dict[int, asyncio.Task[None]] = {}
        self.listeners = 0
        self.end: asyncio.TimerHandle | None = None
        self._changed = asyncio.Event()
        self._count = 0

    @property
    def files(self) -> list[str]:
        """The names of the files that were dropped."""
        return sorted(path.name for path in self.folder.iterdir() if path.is_file() and not path.name.startswith("."))

    def path_of(self, name: str) -> Path:
        """Return a file in the folder, by its path there.

        Raises
        ------
        InputError
            When there is no such file, or it lies elsewhere.
        """
        path = self.folder / name
        if not (is_inside(path, self.folder.resolve()) and os.path.exists(path)):
            raise InputError(f"there is no '{name[:SHOWN]}' in this session.")
        return path.resolve()

    def begin(self, workers: Workers, task: str, request: Mapping[str, Any]) -> int:
        """Begin a task and return its number, under which its news are."""
        self._count += 1
        number = self._count

        def say(news: News) -> None:
            self.news.append({"task": number, "kind": news.kind, "data": news.data})
            self._changed.set()

        async def work() -> None:
            try:
                await workers.run(task, request, self.folder, say)
            except asyncio.CancelledError:
                say(News("stopped", None))
                raise
            finally:
                self.tasks.pop(number, None)

        self.tasks[number] = asyncio.get_running_loop().create_task(work())
        return number

    def stop(self, number: int) -> None:
        """Stop a task, if it still goes on."""
        if task := self.tasks.get(number):
            task.cancel()

    def stay(self) -> None:
        """Do not end, though the page was not heard of for a while."""
        if self.end is not None:
            self.end.cancel()

    async def heard(self, start: int) -> AsyncIterator[tuple[int, dict[str, Any]]]:
        """Iterate over the news from a number on, as they come."""
        position = start
        while True:
            while position < len(self.news):
                yield position, self.news[position]
                position += 1
            self._changed.clear()
            await self._changed.wait()


class Sessions:
    """All sessions, by their names, and the processes that work for them.

    Parameters
    ----------
    folder : Path
        In which every session has its own.
    workers : Workers
    grace : float
        Seconds after which a session ends whose page has gone.
    """

    def __init__(self, folder: Path, workers: Workers, grace: float = GRACE) -> None:
        self.folder, self.workers, self.grace = folder, workers, grace
        self._by_name: dict[str, Session] = {}

    def __len__(self) -> int:
        return len(self._by_name)

    def new(self) -> Session:
        """Begin a session.

        Raises
        ------
        InputError
            When there are too many.
        """
        if len(self) >= MAX_SESSIONS:
            raise InputError(f"{MAX_SESSIONS} pages are open already: close some.")
        name = token_urlsafe(12)
        folder = self.folder / name
        folder.mkdir(mode=0o700)
        session = self._by_name[name] = Session(name, folder)
        self._end_in(session, FIRST_SIGN)
        return session

    async def taken_up(self, name: str) -> Session | None:
        """Return the session of a page that was loaded again; None where it has ended, or another tab has it."""
        end = asyncio.get_running_loop().time() + LEAVING
        while (session := self._by_name.get(name)) and session.listeners:
            if asyncio.get_running_loop().time() > end:
                return None
            await asyncio.sleep(LEAVING / 20)
        if session:
            self._end_in(session, FIRST_SIGN)
        return session

    def named(self, name: str) -> Session:
        """Return a session.

        Raises
        ------
        InputError
            When it has ended.
        """
        if name not in self._by_name:
            raise InputError("this page was away for too long, and its files are deleted. Load it again.")
        return self._by_name[name]

    def listen(self, session: Session) -> None:
        """Count a page that listens to a session's news."""
        session.listeners += 1
        session.stay()

    def leave(self, session: Session) -> None:
        """Count that page no more; the last one's session ends soon unless it comes back."""
        session.listeners -= 1
        if not session.listeners and session.name in self._by_name:
            self._end_in(session, self.grace)

    def end(self, session: Session) -> None:
        """Stop the work of a session and delete its files."""
        self._by_name.pop(session.name, None)
        session.stay()
        tasks = list(session.tasks.values())
        for task in tasks:
            task.cancel()
        self._delete(session, tasks)

    def _delete(self, session: Session, tasks: list[asyncio.Task[None]]) -> None:
        if any(not task.done() for task in tasks):  # its process may still write
            asyncio.get_running_loop().call_later(0.05, self._delete, session, tasks)
        else:
            shutil.rmtree(session.folder, ignore_errors=True)

    def _end_in(self, session: Session, seconds: float) -> None:
        session.stay()
        session.end = asyncio.get_running_loop().call_later(seconds, self.end, session)

    async def close(self) -> None:
        """End all sessions and all processes."""
        for session in list(self._by_name.values()):
            with suppress(OSError):
                self.end(session)
        await self.workers.stop()


def harmless_name(name: str) -> str:
    """Return the name of a file without folders, signs that shells or messages give a meaning, and excess length.

    Examples
    --------
    >>> harmless_name("../../etc/pass;wd.csv"), harmless_name("/data/Test 1 (kPa).xlsx")
    ('pass_wd.csv', 'Test 1 (kPa).xlsx')
    """
    last = unicodedata.normalize("NFC", name).replace("\\", "/").rpartition("/")[2]
    plain = re.sub(r"[^\w .,()+=\[\]-]", "_", last).strip().lstrip(".-").strip() or "file"
    stem, dot, ending = plain.rpartition(".") if "." in plain else (plain, "", "")
    short = stem[: MAX_LETTERS - len(dot + ending[:10])].strip() + dot + ending[:10]
    return f"_{short}" if RESERVED.match(short) else short


def free_name(name: str, folder: Path) -> str:
    """Return a name that no file in a folder has, also not in other letters (``A.csv``, ``a.csv``)."""
    taken = {path.name.casefold() for path in folder.iterdir()}
    stem, dot, ending = name.rpartition(".") if "." in name else (name, "", "")
    number, free = 1, name
    while free.casefold() in taken:
        number += 1
        free = f"{stem}-{number}{dot}{ending}"
    return free


async def store(chunks: AsyncIterator[bytes], name: str, folder: Path) -> str:
    """Write what arrives into a file of a folder; return its name there.

    Raises
    ------
    InputError
        When it is empty, too large, or there are too many; nothing of it is then left.
    """
    sizes = [path.stat().st_size for path in folder.iterdir() if path.is_file()]
    if len(sizes) >= MAX_FILES:
        raise InputError(f"there are {MAX_FILES} files already: remove some, or use 'tissuq fit' for so many.")
    target = folder / free_name(harmless_name(name), folder)
    size = 0
    try:
        with target.open("xb") as file:
            async for chunk in chunks:
                size += len(chunk)
                if size > MAX_FILE or size + sum(sizes) > MAX_TOTAL:
                    limit = f"{MAX_FILE // MEGABYTE} MB" if size > MAX_FILE else f"all {MAX_TOTAL // MEGABYTE} MB"
                    raise InputError(
                        f"'{target.name}' is too large for this page ({limit} at most). Take fewer rows, or use the "
                        f"command line, which has no limit: tissuq fit '{target.name}'."
                    )
                file.write(chunk)
        if not size:
            raise InputError(f"'{target.name}' is empty: was it saved before it was dropped here?")
    except BaseException:
        target.unlink(missing_ok=True)
        raise
    return target.name
