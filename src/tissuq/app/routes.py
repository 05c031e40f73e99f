"""What the page asks for, and what it gets: files in, tasks begun and stopped, news, results."""

from __future__ import annotations

import asyncio
import json
import shutil
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from secrets import token_urlsafe
from typing import Any

from starlette.background import BackgroundTask
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from tissuq.app.sessions import MAX_FILE, MEGABYTE, Session, Sessions, store
from tissuq.app.tasks import TASKS
from tissuq.errors import TissuqError

STATIC = Path(__file__).parent / "static"
REPORT_POLICY = (
    "sandbox allow-scripts allow-modals; default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; frame-ancestors 'self'"
)
"""What a report may do that stands in the page: draw itself. It cannot reach the page."""
HEARTBEAT = 15.0
"""Seconds after which a line is sent when there are no news, so that a page that has gone is noticed."""
MAX_REQUEST = 1_000_000
"""Bytes of what a page asks for, files aside."""
TYPES = {".html": "text/html; charset=utf-8", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}

Endpoint = Callable[[Request], Awaitable[Response]]


def routes(sessions: Sessions) -> list[Route]:
    """Return the routes of the page for some sessions."""
    of_session = "/sessions/{session}"
    return [
        Route("/", _static("page.html")),
        *(Route(f"/{path.name}", _static(path.name)) for path in sorted(STATIC.iterdir()) if path.suffix in TYPES),
        Route("/sessions", _checked(_new, sessions), methods=["POST"]),
        Route(f"{of_session}/news", _checked(_news, sessions)),
        Route(f"{of_session}/files", _checked(_upload, sessions), methods=["POST"]),
        Route(f"{of_session}/files/{{name}}", _checked(_remove, sessions), methods=["DELETE"]),
        Route(f"{of_session}/tasks/{{task}}", _checked(_begin, sessions), methods=["POST"]),
        Route(f"{of_session}/tasks/{{number:int}}", _checked(_stop, sessions), methods=["DELETE"]),
        Route(f"{of_session}/results/{{path:path}}", _checked(_result, sessions)),
        Route(f"{of_session}/zip/{{path:path}}", _checked(_zip, sessions)),
    ]


def _static(name: str) -> Endpoint:
    async def answer(_: Request) -> Response:
        return FileResponse(STATIC / name, media_type=TYPES[Path(name).suffix])

    return answer


def _checked(handle: Callable[[Request, Sessions], Awaitable[Response]], sessions: Sessions) -> Endpoint:
    """Answer with the message of what is refused."""

    async def answer(request: Request) -> Response:
        try:
            return await handle(request, sessions)
        except TissuqError as error:
            return JSONResponse({"error": str(error)}, 400)

    return answer


def _session(request: Request, sessions: Sessions) -> Session:
    return sessions.named(request.path_params["session"])


async def _new(request: Request, sessions: Sessions) -> Response:
    session = await sessions.taken_up(request.query_params.get("again", "")) or sessions.new()
    limit = {"bytes": MAX_FILE, "words": f"{MAX_FILE // MEGABYTE} MB"}
    return JSONResponse({"session": session.name, "files": session.files, "limit": limit})


async def _upload(request: Request, sessions: Sessions) -> Response:
    session = _session(request, sessions)
    name = await store(request.stream(), request.query_params.get("name", ""), session.folder)
    return JSONResponse({"name": name, "files": session.files})


async def _remove(request: Request, sessions: Sessions) -> Response:
    session = _session(request, sessions)
    if request.path_params["name"] in session.files:
        session.path_of(request.path_params["name"]).unlink()
    return JSONResponse({"files": session.files})


async def _begin(request: Request, sessions: Sessions) -> Response:
    session, task = _session(request, sessions), request.path_params["task"]
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > MAX_REQUEST:
            return JSONResponse({"error": "the request is too large."}, 413)
    try:
        values: Any = json.loads(body or b"{}")
    except ValueError:
        values = None
    if task not in TASKS or not isinstance(values, dict):
        return JSONResponse({"error": f"there is no task '{task}' with such values."}, 400)
    files = values.get("files", [])
    # a test is named FILE#TEST
    if not isinstance(files, list) or not {str(name).partition("#")[0] for name in files} <= set(session.files):
        return JSONResponse({"error": "one of these files is not here any more: drop it again."}, 400)
    return JSONResponse({"task": session.begin(sessions.workers, task, values)})


async def _stop(request: Request, sessions: Sessions) -> Response:
    _session(request, sessions).stop(request.path_params["number"])
    return JSONResponse({})


async def _news(request: Request, sessions: Sessions) -> Response:
    session = _session(request, sessions)
    last = request.headers.get("last-event-id", "")
    return StreamingResponse(
        _lines(session, sessions, int(last) + 1 if last.isdecimal() else 0), media_type="text/event-stream"
    )


async def _lines(session: Session, sessions: Sessions, start: int) -> AsyncIterator[str]:
    """Yield news as server-sent events until the page goes away."""
    sessions.listen(session)
    news = aiter(session.heard(start))
    following: asyncio.Future[tuple[int, dict[str, Any]]] | None = None
    try:
        yield ": the page listens\n\n"
        while True:
            following = following or asyncio.ensure_future(anext(news))
            done, _ = await asyncio.wait([following], timeout=HEARTBEAT)
            if not done:
                yield ": nothing new\n\n"
                continue
            number, item = following.result()
            following = None
            yield f"id: {number}\ndata: {json.dumps(item)}\n\n"
    finally:
        if following is not None:
            following.cancel()
        sessions.leave(session)


async def _result(request: Request, sessions: Sessions) -> Response:
    path = _session(request, sessions).path_of(request.path_params["path"])
    is_page = path.suffix == ".html"
    headers = {"Content-Security-Policy": REPORT_POLICY if is_page else "sandbox; default-src 'none'"}
    if path.is_dir():
        return JSONResponse({"error": "that is a folder."}, 400)
    return FileResponse(path, media_type=TYPES.get(path.suffix), headers=headers)


async def _zip(request: Request, sessions: Sessions) -> Response:
    session = _session(request, sessions)
    folder = session.path_of(request.path_params["path"])
    if not folder.is_dir() or folder == session.folder.resolve():
        return JSONResponse({"error": "that is no folder of a result."}, 400)
    archive = sessions.folder / f"{token_urlsafe(12)}.zip"  # beside the session, whose files are counted
    await asyncio.to_thread(shutil.make_archive, str(archive.with_suffix("")), "zip", folder.parent, folder.name)
    removal = BackgroundTask(archive.unlink, missing_ok=True)
    return FileResponse(archive, media_type="application/zip", filename=f"{folder.name}.zip", background=removal)
