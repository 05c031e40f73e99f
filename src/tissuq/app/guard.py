"""Who may talk to the page: only those who know its address, from this computer, and nothing from elsewhere."""

from __future__ import annotations

from collections.abc import Iterable
from secrets import compare_digest

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

__all__ = ["PAGE_POLICY", "REPORT_POLICY", "Guard"]

PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What the page may load: its own files, and nothing from another host."""
REPORT_POLICY = (
    "sandbox allow-scripts allow-modals; default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; frame-ancestors 'self'"
)
"""What a report may do that stands in the page: draw itself. It cannot reach the page."""
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
