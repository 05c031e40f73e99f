"""The server of the page: on this computer alone, under an address that nobody can guess."""

from __future__ import annotations

import signal
import socket
import tempfile
import webbrowser
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from secrets import token_urlsafe

import uvicorn
from starlette.applications import Starlette
from starlette.routing import Mount

from tissuq.app.guard import Guard
from tissuq.app.routes import routes
from tissuq.app.sessions import GRACE, Sessions
from tissuq.app.workers import Workers
from tissuq.errors import InputError

__all__ = ["LOOPBACK", "serve"]

LOOPBACK = "127.0.0.1"
ENDING = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""Ctrl-C, a request to terminate, and a terminal that was closed, which Windows has not."""


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
