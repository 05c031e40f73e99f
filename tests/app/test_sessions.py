"""A session has its own files, news and work, and all of it goes with its page."""

from __future__ import annotations

import asyncio

import pytest

from tissuq.app.sessions import Sessions
from tissuq.app.workers import News
from tissuq.errors import InputError


class Slow:
    """In place of processes: work that says the folder, and ends when it is told, or is stopped."""

    def __init__(self):
        self.may_end, self.stopped = asyncio.Event(), []

    async def run(self, task, request, folder, say):
        try:
            say(News("step", folder.name))
            await self.may_end.wait()
            say(News("done", request))
        except asyncio.CancelledError:
            self.stopped.append(task)
            raise

    async def stop(self):
        pass


def run_with(check, folder, grace=0.05):
    async def run():
        workers = Slow()
        await check(Sessions(folder, workers, grace), workers)

    asyncio.run(run())


def test_two_sessions_do_not_mix(tmp_path):
    async def check(sessions, workers):
        first, second = sessions.new(), sessions.new()
        (first.folder / "a.csv").write_text("1")
        for session, number in ((first, 1), (second, 2)):
            session.begin(workers, "fit", {"number": number})
        workers.may_end.set()
        await asyncio.gather(*first.tasks.values(), *second.tasks.values())
        assert (first.files, second.files) == (["a.csv"], [])
        for session, number in ((first, 1), (second, 2)):
            assert [item["data"] for item in session.news] == [session.name, {"number": number}]
        with pytest.raises(InputError, match="in this session"):
            second.path_of(f"../{first.name}/a.csv")

    run_with(check, tmp_path)


def test_a_page_that_goes_away_in_mid_fit_stops_the_work_and_deletes_the_files(tmp_path):
    async def check(sessions, workers):
        session = sessions.new()
        (session.folder / "a.csv").write_text("1")
        sessions.listen(session)
        session.begin(workers, "fit", {})
        await asyncio.sleep(0.01)
        sessions.leave(session)
        await asyncio.sleep(0.5)
        assert workers.stopped == ["fit"]
        assert not session.folder.exists()
        with pytest.raises(InputError, match="Load it again"):
            sessions.named(session.name)

    run_with(check, tmp_path)


def test_a_page_that_comes_back_soon_finds_its_session_and_what_it_missed(tmp_path):
    async def check(sessions, workers):
        session = sessions.new()
        sessions.listen(session)
        session.begin(workers, "fit", {})
        sessions.leave(session)
        await asyncio.sleep(0.01)
        sessions.listen(session)
        workers.may_end.set()
        await asyncio.sleep(0.3)
        assert not workers.stopped
        assert session.folder.exists()
        heard = session.heard(1)
        assert await anext(heard) == (1, {"task": 1, "kind": "done", "data": {}})

    run_with(check, tmp_path, grace=0.1)


def test_a_page_that_is_loaded_again_takes_up_its_session_and_another_tab_does_not(tmp_path):
    async def check(sessions, workers):
        session = sessions.new()
        sessions.listen(session)
        assert await sessions.taken_up(session.name) is None
        sessions.leave(session)
        assert await sessions.taken_up(session.name) is session
        await asyncio.sleep(0.1)
        assert session.folder.exists()
        assert await sessions.taken_up("another") is None

    run_with(check, tmp_path)


def test_a_task_that_is_stopped_says_so_and_the_session_goes_on(tmp_path):
    async def check(sessions, workers):
        session = sessions.new()
        sessions.listen(session)
        number = session.begin(workers, "fit", {})
        await asyncio.sleep(0.01)
        session.stop(number)
        await asyncio.sleep(0.01)
        assert [item["kind"] for item in session.news] == ["step", "stopped"]
        assert not session.tasks
        assert session.folder.exists()

    run_with(check, tmp_path)


@pytest.mark.parametrize("name", ["", "..", "../x", "\0", "x" * 5000, "/etc/passwd"])
def test_a_path_that_is_none_in_the_session_is_refused_without_an_error_of_the_program(tmp_path, name):
    async def check(sessions, workers):
        session = sessions.new()
        if name:
            with pytest.raises(InputError, match="in this session"):
                session.path_of(name)
        else:
            assert session.path_of(name) == session.folder.resolve()

    run_with(check, tmp_path)
