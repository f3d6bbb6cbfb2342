"""What the viewer's server answers, and to whom.

Requests must name the server's own address as Host (against DNS rebinding), come from one of its own pages if they
say where they come from (a websocket must), and know the random token in the path.
"""

from __future__ import annotations

import asyncio
import hmac
import json
from collections.abc import Collection, Mapping
from contextlib import suppress
from typing import Any, Protocol

from tornado.web import HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from dhkit.viewer.page import SECURITY_POLICY
from dhkit.viewer.protocol import ProtocolError
from dhkit.viewer.requests import Request, Shown, decode_message
from dhkit.viewer.session import Session

MOST_REQUESTS = 64
"""Of one page that wait for an answer, or whose answer the page has not taken yet."""
MOST_PAGES = 100
"""Pages at a time: each may keep the samples of some minutes waiting."""


class PageServer(Protocol):
    """What the handlers ask of the server whose requests they answer."""

    token: str
    """Random part of every address."""
    files: Mapping[str, tuple[str, bytes]]
    """Content type and content of the page's files, by name."""
    pages: set[Page]
    """Open pages."""

    @property
    def hosts(self) -> Collection[str]:
        """Values of the Host header that are the server's own: address and port."""

    def replay(self) -> Session:
        """Return a session that has everything shown so far to send."""

    def ask(self, page: Page, request: Request) -> None:
        """Have a page's request answered."""

    def forget(self, page: Page) -> None:
        """Drop a page that is closed, and what waits for it."""


class Guarded(RequestHandler):
    """A request that is refused unless it comes from our own page and knows the token."""

    def initialize(self, server: PageServer) -> None:
        """Know the server."""
        self.server = server

    def prepare(self) -> None:
        """Refuse strangers before anything else is done."""
        origin = self.request.headers.get("Origin")
        if self.request.host not in self.server.hosts:
            raise HTTPError(403, reason="Foreign Host")
        if origin is not None and origin not in [f"http://{host}" for host in self.server.hosts]:
            raise HTTPError(403, reason="Foreign Origin")
        if not hmac.compare_digest((self.path_args or [""])[0].encode(), self.server.token.encode()):
            raise HTTPError(403, reason="Missing token")

    def set_default_headers(self) -> None:
        """Say as little as possible, to as few as possible."""
        self.clear_header("Server")
        self.set_header("Content-Security-Policy", SECURITY_POLICY)
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cache-Control", "no-store")

    def write_error(self, status_code: int, **_: Any) -> None:
        """Answer with one line."""
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code} {self._reason}\n")


class Refused(Guarded):
    """Any other address."""

    def prepare(self) -> None:
        """Refuse."""
        super().prepare()
        raise HTTPError(404)


class File(Guarded):
    """One of the page's files, by its exact name."""

    def get(self, _token: str, name: str) -> None:
        """Send the file."""
        if name not in self.server.files:
            raise HTTPError(404)
        content_type, content = self.server.files[name]
        self.set_header("Content-Type", content_type)
        self.finish(content)


class Page(Guarded, WebSocketHandler):
    """The websocket of one page."""

    session: Session
    _unanswered = 0
    """Requests that wait for an answer."""

    def prepare(self) -> None:
        """Refuse strangers, who does not say where it comes from (browsers do), and more pages than we can serve."""
        super().prepare()
        if "Origin" not in self.request.headers:
            raise HTTPError(403, reason="Missing Origin")
        if len(self.server.pages) >= MOST_PAGES:
            raise HTTPError(503, reason="Too many pages")

    def check_origin(self, origin: str) -> bool:
        """Accept: :meth:`prepare` has looked at it."""
        return True

    def open(self, *_: str) -> None:
        """Send the page everything."""
        self.set_nodelay(True)
        self.session = self.server.replay()
        self.server.pages.add(self)
        self.send()

    async def on_message(self, message: str | bytes) -> None:
        """Take an acknowledgement, and send what has come up meanwhile; or have a request answered.

        Nothing more is read from a page that does not take what it is told, so that nothing piles up for it.
        """
        try:
            found = decode_message(message)
        except ProtocolError as error:
            await _taken(self.say({"type": "error", "error": str(error)}))
            return
        if isinstance(found, Shown):
            self.session.shown(found.sequence)
            self.send()
        elif self._unanswered >= MOST_REQUESTS:
            text = f"{MOST_REQUESTS} requests wait for an answer; expected at most so many"
            await _taken(self.say({"type": "error", "id": found.id, "error": text}))
        else:
            self._unanswered += 1
            self.server.ask(self, found)

    def answered(self, answer: str) -> None:
        """Send the answer to a request; until the page takes it the request counts as unanswered."""
        written = self._write(answer, binary=False)
        if written is not None:
            written.add_done_callback(self._count_answered)

    def beat(self) -> None:
        """Give a sign of life, unless the page has not even taken what it was told before."""
        connection = self.ws_connection
        stream = None if connection is None else connection.stream
        if stream is not None and not stream.writing():
            self.say({"type": "beat"})

    def on_close(self) -> None:
        """Forget the page."""
        self.server.forget(self)

    def send(self) -> None:
        """Send what may be sent."""
        while (message := self.session.next()) is not None:
            self._write(message, binary=True)

    def say(self, message: dict[str, Any]) -> asyncio.Future[None] | None:
        """Send a line of JSON; what is returned is done when the page has taken it."""
        return self._write(json.dumps(message), binary=False)

    def _count_answered(self, _: asyncio.Future[None]) -> None:
        self._unanswered -= 1

    def _write(self, message: str | bytes, binary: bool) -> asyncio.Future[None] | None:
        try:
            written = self.write_message(message, binary=binary)
        except WebSocketClosedError:
            self.server.forget(self)
            return None
        written.add_done_callback(_note)
        return written


async def _taken(written: asyncio.Future[None] | None) -> None:
    """Wait until a page has taken a message, or is gone."""
    if written is not None:
        with suppress(WebSocketClosedError):
            await written


def _note(written: asyncio.Future[None]) -> None:
    """Take note of how a write ended: that a page is gone is not worth a line in the log."""
    if not written.cancelled():
        written.exception()
