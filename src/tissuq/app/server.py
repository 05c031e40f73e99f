"""The server of the page: on this computer alone, for those who know its address, which nobody can guess."""

from __future__ import annotations

import signal
import socket
import tempfile
import webbrowser
from collections.abc import AsyncIterator, Iterable, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from secrets import compare_digest, token_urlsafe

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.routing import Mount
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from tissuq.app.routes import routes
from tissuq.app.sessions import GRACE, Sessions
from tissuq.app.workers import Workers
from tissuq.errors import InputError

LOOPBACK = "127.0.0.1"
ENDING = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""Ctrl-C, a request to terminate, and a terminal that was closed, which Windows has not."""
PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What the page may load: its own files, and nothing from another host."""
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": PAGE_POLICY,
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
WRONG_ADDRESS = (
    "This is not the whole address of the page. Open the one that 'tissuq app' printed: it ends in a long random word."
)


class Guard:
    """An ASGI application that refuses what does not know the token, comes under another name, or from another page.

    Parameters
    ----------
    app : ASGI application
        What is guarded.
    token : str
        The first part of every path.
    hosts : iterable of str
        Names with port under which this computer is asked for; another one is a name of somebody else that points
        here (DNS rebinding).
    """

    def __init__(self, app: ASGIApp, token: str, hosts: Iterable[str]) -> None:
        self.app, self.token, self.hosts = app, token, frozenset(hosts)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it; WebSockets are refused in any case: the page has none."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        reason = self._reason_against(scope)
        if scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": "there are no WebSockets here"})
        elif reason:
            await PlainTextResponse(reason, 403)(scope, receive, self._with_headers(send))
        else:
            await self.app(scope, receive, self._with_headers(send))

    def _reason_against(self, scope: Scope) -> str:
        """Return why a request is refused; nothing where it is not."""
        headers = Headers(scope=scope)
        if headers.get("host") not in self.hosts:
            return "This page is only for this computer, under the address that 'tissuq app' printed."
        origin = headers.get("origin")
        if origin is not None and origin.removeprefix("http://") not in self.hosts:
            return "Another page must not talk to this one."
        token = str(scope["path"]).removeprefix("/").partition("/")[0]
        return "" if compare_digest(token.encode(), self.token.encode()) else WRONG_ADDRESS

    @staticmethod
    def _with_headers(send: Send) -> Send:
        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        return send_with_headers


class _Server(uvicorn.Server):
    """A server that signals end without more, so that files are deleted after it."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """End on signals; Uvicorn would raise them anew, and so end the process at once."""
        handlers = {number: signal.signal(number, self.handle_exit) for number in ENDING}
        try:
            yield
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)


def serve(port: int = 0, *, open_browser: bool = True, grace: float = GRACE) -> None:
    """Serve the page until Ctrl-C.

    Parameters
    ----------
    port : int
        0 for one that is free.
    open_browser : bool
    grace : float
        Seconds after which the files of a page that was closed are deleted.

    Raises
    ------
    InputError
        When the port is in use.
    """
    listening = _socket(port)
    port, token = listening.getsockname()[1], token_urlsafe(24)
    address = f"http://{LOOPBACK}:{port}/{token}/"
    with tempfile.TemporaryDirectory(prefix="tissuq-app-", ignore_cleanup_errors=True) as folder:
        sessions = Sessions(Path(folder), Workers(Path(folder)), grace)

        @asynccontextmanager
        async def lifespan(_: Starlette) -> AsyncIterator[None]:
            await sessions.workers.start()
            said = f"The page is at {address}\nIt is for this computer alone. Ctrl-C ends it and deletes its files."
            print(said, flush=True)
            if open_browser:
                webbrowser.open(address)
            try:
                yield
            finally:
                await sessions.close()

        app = Starlette(routes=[Mount(f"/{token}", routes=routes(sessions))], lifespan=lifespan)
        guarded = Guard(app, token, [f"{host}:{port}" for host in (LOOPBACK, "localhost")])
        config = uvicorn.Config(
            guarded, log_level="warning", access_log=False, ws="none", timeout_graceful_shutdown=1, server_header=False
        )
        _Server(config).run(sockets=[listening])


def _socket(port: int) -> socket.socket:
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((LOOPBACK, port))
        listening.listen()  # at once, so that a browser that is quick waits and is not refused
    except OSError as error:
        listening.close()
        raise InputError(
            f"port {port} cannot be used ({error.strerror}): leave --port out, and a free one is taken."
        ) from error
    return listening
