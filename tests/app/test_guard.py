"""Requests are refused without the token, under other names, from other pages; WebSockets always."""

from __future__ import annotations

import asyncio

import pytest

from tissuq.app.server import Guard

TOKEN, HOST = "secret-word", "127.0.0.1:8000"


def answer_to(path, *, kind="http", host=HOST, origin=None):
    """Return the messages with which a guarded application answers a request."""
    sent = []

    async def app(scope, receive, send):
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"inside"})

    async def send(message):
        sent.append(message)

    async def receive():
        return {"type": f"{kind}.request"}

    headers = [(b"host", host.encode())] + ([(b"origin", origin.encode())] if origin else [])
    scope = {"type": kind, "path": path, "headers": headers, "method": "GET", "query_string": b""}
    asyncio.run(Guard(app, TOKEN, [HOST])(scope, receive, send))
    return sent


def test_a_request_with_the_token_is_answered_and_may_load_nothing_from_elsewhere():
    start, body = answer_to(f"/{TOKEN}/")
    headers = {name.decode(): value.decode() for name, value in start["headers"]}
    assert (start["status"], body["body"]) == (200, b"inside")
    policy = dict(part.strip().split(" ", 1) for part in headers["content-security-policy"].split(";"))
    assert policy["default-src"] == "'none'"
    assert not any("http" in value or "*" in value or "unsafe" in value for value in policy.values())
    assert headers["referrer-policy"] == "no-referrer"


@pytest.mark.parametrize(
    ("path", "host", "origin"),
    [
        ("/", HOST, None),
        ("/secret-wor/", HOST, None),
        ("/secret-words/", HOST, None),
        ("/other/secret-word/", HOST, None),
        ("/geheim-ü/", HOST, None),
        (f"/{TOKEN}/", "evil.example:8000", None),
        (f"/{TOKEN}/", "127.0.0.1:8001", None),
        (f"/{TOKEN}/", "", None),
        (f"/{TOKEN}/", HOST, "http://evil.example"),
        (f"/{TOKEN}/", HOST, "https://127.0.0.1:8000.evil.example"),
        (f"/{TOKEN}/", HOST, "null"),
    ],
)
def test_without_the_token_under_another_name_or_from_another_page_it_is_refused(path, host, origin):
    start, body = answer_to(path, host=host, origin=origin)
    assert start["status"] == 403
    assert b"inside" not in body["body"]


@pytest.mark.parametrize("path", ["/", f"/{TOKEN}/"])
def test_web_sockets_are_refused(path):
    (message,) = answer_to(path, kind="websocket")
    assert message["type"] == "websocket.close"
