"""What a page may ask for, and what is then left of it."""

from __future__ import annotations

import asyncio
import io
import zipfile

import pytest

pytest.importorskip("starlette", reason="the extra 'app' is not installed")

from starlette.applications import Starlette

from tissuq.app.routes import routes
from tissuq.app.sessions import Sessions


def answers_to(paths, folder):
    """Return status and body of what a session answers that has a result ``runs/a`` with a file."""

    async def ask():
        sessions = Sessions(folder, workers=None)
        session = sessions.new()
        (session.folder / "runs" / "a").mkdir(parents=True)
        (session.folder / "runs" / "a" / "table.csv").write_text("1,2")
        application = Starlette(routes=routes(sessions))
        found = []
        for path in paths:
            sent = []

            async def send(message, sent=sent):
                sent.append(message)

            async def receive():
                await asyncio.Event().wait()  # a browser that stays

            scope = {"type": "http", "method": "GET", "path": f"/sessions/{session.name}/{path}", "headers": [],
                     "query_string": b"", "root_path": ""}  # fmt: skip
            await application(scope, receive, send)
            found.append((sent[0]["status"], b"".join(message.get("body", b"") for message in sent)))
        session.end.cancel()
        return found

    return asyncio.run(ask())


def test_a_result_is_downloaded_whole_and_nothing_is_left_of_the_download(tmp_path):
    ((status, body),) = answers_to(["zip/runs/a"], tmp_path)
    assert status == 200
    with zipfile.ZipFile(io.BytesIO(body)) as archive:
        assert archive.read("a/table.csv") == b"1,2"
    assert not [path for path in tmp_path.rglob("*") if path.suffix == ".zip"]


def test_what_is_no_folder_of_a_result_is_not_downloaded(tmp_path):
    for status, body in answers_to(["zip/", "zip/..", "zip/runs/b", "zip/runs/a/table.csv"], tmp_path):
        assert status == 400
        assert b"error" in body
