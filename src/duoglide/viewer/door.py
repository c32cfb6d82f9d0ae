"""Who may come in to the page, and the Stop that waits behind nothing.

viser serves whoever knows the port, and any web page can make a browser know it. So every request
passes here first: the address holds a token that nobody can guess; Host must name this computer,
which a name that was pointed here later does not; Origin must be the page itself.

Stop does not go through viser at all. The page is given a button of its own, above whatever is
shown, and the space bar, whatever has the focus; both send a request that is answered here. So is
the banner's: a page that does not hear of the machine any more says so (``overlay.html``).
"""

from __future__ import annotations

import asyncio
import gzip
import ipaddress
import json
import logging
import math
import secrets
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from http import HTTPStatus
from importlib import resources
from typing import Any
from urllib.parse import urlsplit

_SEEN = "Duoglide-Seen"  # the number of the banner that a page shows
_ORDER = "Duoglide-Order"  # a header that a foreign page cannot send without asking first
_STOPPERS = 4  # threads; one that waits for a process which is stuck holds up no other Stop
_RATE = 200  # messages a second of one page; a hand on a slider and a turning camera make 120
_BURST = 0.5  # [s] of such messages may come at once
_OLD = 3.0  # [s] after which what was last told may not be so any more
_WAIT, _LOOK = 2.0, 0.05  # [s]: how long a banner is waited for, how often it is looked at
_HEADERS = {  # the token must not leave in a Referer, and nobody may frame the page
    "Referrer-Policy": "no-referrer",
    "X-Frame-Options": "DENY",
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
}


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why somebody is not let in.

    Attributes:
        status: Of the answer.
        reason: In words.
    """

    status: HTTPStatus
    reason: str


@dataclass(frozen=True, slots=True)
class Gate:
    """What a request must have to be let in.

    Attributes:
        host: What is served on.
        token: The first part of the path.
    """

    host: str
    token: str = field(default_factory=lambda: secrets.token_urlsafe(18))

    def judge(self, path: str, headers: Mapping[str, str]) -> str | Refusal:
        """Return the path beyond the token, or why there is no way in.

        Args:
            path: As it was asked for, with what is behind a question mark.
            headers: Of the request.
        """
        try:
            host, origin = headers.get("Host", ""), headers.get("Origin")
            upgrade = headers.get("Upgrade")
        except LookupError:  # which of two would count is for nobody to choose
            return Refusal(HTTPStatus.BAD_REQUEST, "a header comes twice")
        if not self._names_us(host):
            return Refusal(HTTPStatus.MISDIRECTED_REQUEST, "Host does not name this computer")
        if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
            return Refusal(HTTPStatus.FORBIDDEN, "Origin is another page")
        if origin is None and upgrade is not None:
            return Refusal(HTTPStatus.FORBIDDEN, "a stream needs an Origin")
        token, _, rest = path.partition("?")[0].lstrip("/").partition("/")
        if not secrets.compare_digest(token.encode(errors="replace"), self.token.encode()):
            return Refusal(
                HTTPStatus.FORBIDDEN, "open the address that duoglide view printed, all of it"
            )
        return rest

    def _names_us(self, host: str) -> bool:
        """Tell whether a Host header names this computer and not a domain that points to it."""
        try:
            parts = urlsplit(f"//{host}")
            name, _ = parts.hostname or "", parts.port  # a port that is none raises too
        except ValueError:
            return False
        if parts.username is not None:  # no browser says who asks
            return False
        if name in ("localhost", self.host.lower()):
            return True
        try:
            given, served = ipaddress.ip_address(name), ipaddress.ip_address(self.host)
        except ValueError:
            return False
        return given.is_loopback or served.is_unspecified


class News:
    """The newest banner, told by one thread and asked for by pages."""

    def __init__(self) -> None:
        self._newest = 0, "{}"
        self._told = -math.inf  # when that was last said [s], monotonic

    @property
    def newest(self) -> tuple[int, str]:
        """Its number, and what pages are given of it: a JSON object."""
        return self._newest

    @property
    def is_old(self) -> bool:
        """Whether it has not been said for so long that it may not be so any more."""
        return time.monotonic() - self._told > _OLD

    def tell(self, words: Mapping[str, Any]) -> None:
        """Tell pages something, or that it is still so."""
        self._told = time.monotonic()
        number, known = self._newest
        text = json.dumps(words)
        if text != known:
            self._newest = number + 1, text


class Door:
    """Stands between whoever asks and viser's server.

    Args:
        gate: Who is let in.
        stop: What Stop does; it may wait, and may be called by many threads at once.
        news: What the banner says.
    """

    def __init__(self, gate: Gate, stop: Callable[[], object], news: News) -> None:
        self.gate = gate
        self._stop, self._news = stop, news
        self._stoppers = ThreadPoolExecutor(_STOPPERS, thread_name_prefix="page-stop")
        self._page = b""

    def close(self) -> None:
        """Take no more orders."""
        self._stoppers.shutdown(wait=False, cancel_futures=True)

    @contextmanager
    def before_viser(self) -> Iterator[None]:
        """Have a server of viser that is made meanwhile ask here first.

        viser hands its page to ``websockets`` as ``process_request``, and has no place for another
        one; so that function is given a companion while the server is made.
        """
        from websockets.asyncio import server

        plain = server.serve

        def guarded(*args: Any, process_request: Any, **others: Any) -> Any:
            async def ask(connection: Any, request: Any) -> Any:
                return await self._answer(process_request, connection, request)

            others |= {"create_connection": _calm(), "logger": _silent()}
            return plain(*args, process_request=ask, **others)

        server.serve = guarded  # type: ignore[assignment,misc]
        try:
            yield
        finally:
            server.serve = plain  # type: ignore[misc]

    async def _answer(self, viser: Any, connection: Any, request: Any) -> Any:
        """Answer one request; None lets a stream begin."""
        asked = self.gate.judge(request.path, request.headers)
        if isinstance(asked, Refusal):
            return _response(asked.status, asked.reason)
        if request.headers.get("Upgrade", "").lower() == "websocket":
            return None
        if asked in ("stop", "state"):
            answer = self._answer_stop if asked == "stop" else self._answer_state
            return await answer(request)
        if asked or not request.path.partition("?")[0].endswith("/"):
            if asked not in ("", "index.html"):
                return _response(HTTPStatus.NOT_FOUND, "there is no such page")
            goal = f"/{self.gate.token}/"
            return _response(HTTPStatus.TEMPORARY_REDIRECT, "this way", Location=goal)
        if not self._page:
            self._page = gzip.compress(_with_overlay(await _page_of(viser, connection)))
        kind = {"Content-Type": "text/html; charset=utf-8", "Content-Encoding": "gzip"}
        return _response(HTTPStatus.OK, self._page, **kind)

    async def _answer_state(self, request: Any) -> Any:
        """Answer with the banner, as soon as it is another one than the page has seen."""
        seen = request.headers.get_all(_SEEN)
        for _ in range(round(_WAIT / _LOOK)):
            if [str(self._news.newest[0])] != seen:
                break
            await asyncio.sleep(_LOOK)
        if self._news.is_old:
            return _response(HTTPStatus.SERVICE_UNAVAILABLE, "nobody looks at the machine")
        number, words = self._news.newest
        answer = f'{{"number": {number}, "banner": {words}}}'
        return _response(HTTPStatus.OK, answer, **{"Content-Type": "application/json"})

    async def _answer_stop(self, request: Any) -> Any:
        if request.headers.get_all(_ORDER) != ["stop"]:
            return _response(HTTPStatus.FORBIDDEN, "stop is an order, not a page")
        loop = asyncio.get_running_loop()
        try:
            await loop.run_in_executor(self._stoppers, self._stop)
        except Exception as error:  # whatever it is, the operator must hear of it
            return _response(HTTPStatus.INTERNAL_SERVER_ERROR, f"{type(error).__name__}: {error}")
        return _response(HTTPStatus.OK, "stopped")


def _silent() -> logging.Logger:
    """Return a log that nobody reads.

    Every request would be written to that of ``websockets``, with the token in it, and a traceback
    to the terminal for every one that is nonsense.
    """
    logger = logging.getLogger("duoglide.viewer.requests")
    logger.propagate = False
    logger.setLevel(logging.CRITICAL + 1)
    return logger


def _calm() -> Any:
    """Return a kind of connection that is read no faster than anybody can click and drag.

    What comes faster waits in the sender's own buffers: all pages share one loop, and Stop is
    answered in it.
    """
    from websockets.asyncio.server import ServerConnection

    class Calm(ServerConnection):
        _due = 0.0

        async def recv(self, decode: bool | None = None) -> Any:
            message = await super().recv(decode)
            now = self.loop.time()
            self._due = max(self._due, now - _BURST) + 1.0 / _RATE
            await asyncio.sleep(max(self._due - now, 0.0))
            return message

    return Calm


async def _page_of(viser: Any, connection: Any) -> bytes:
    """Return the page that viser would send."""
    from websockets.datastructures import Headers
    from websockets.http11 import Request

    answer = viser(connection, Request("/", Headers()))
    body: bytes = answer.body
    return body


def _with_overlay(page: bytes) -> bytes:
    """Put banner and Stop at the end of a page, and our name at its head."""
    overlay = resources.files("duoglide.viewer").joinpath("overlay.html").read_bytes()
    return page.replace(b"<title>Viser</title>", b"<title>Duoglide</title>", 1) + overlay


def _response(status: HTTPStatus, body: str | bytes, **more: str) -> Any:
    from websockets.datastructures import Headers
    from websockets.http11 import Response

    content = body.encode() if isinstance(body, str) else body
    headers = {"Content-Type": "text/plain; charset=utf-8", **_HEADERS}
    headers |= {name.replace("_", "-"): value for name, value in more.items()}
    headers["Content-Length"] = str(len(content))
    return Response(status.value, status.phrase, Headers(**headers), content)
