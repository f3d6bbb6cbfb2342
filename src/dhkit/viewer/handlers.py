"""The handlers of the viewer's server: its files, and the websockets of its pages.

A request is refused unless it names the server's own address as Host (against DNS rebinding), comes from one of the
server's own pages if it has an Origin (a websocket must have one), and knows the random token in the path.
"""

from __future__ import annotations

import asyncio
import hmac
import json
from collections.abc import Collection, Mapping
from contextlib import suppress
from typing import Any, Protocol

from tornado.iostream import IOStream
from tornado.web import HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from dhkit.viewer.bounds import BOUNDS
from dhkit.viewer.page import SECURITY_POLICY
from dhkit.viewer.protocol import ProtocolError
from dhkit.viewer.requests import Request, Shown, decode_message
from dhkit.viewer.session import Session


class PageServer(Protocol):
    """The server, as far as the handlers use it."""

    token: str
    """The random part of every address."""
    files: Mapping[str, tuple[str, bytes]]
    """Content type and content of each file of the page, by name."""
    pages: set[Page]
    """Open pages."""

    @property
    def hosts(self) -> Collection[str]:
        """Values of the Host header that are the server's own: address and port."""

    def replay(self) -> Session:
        """Return a session that has everything shown so far to send."""

    def ask(self, page: Page, request: Request) -> None:
        """Queue a page's request, to be answered after those before it."""

    def trust(self, stream: IOStream) -> None:
        """Note that a connection has shown the token."""

    def forget(self, page: Page) -> None:
        """Drop a page that is closed, and its requests."""


class Guarded(RequestHandler):
    """A request that is refused unless it comes from our own page and knows the token."""

    def initialize(self, server: PageServer) -> None:
        """Keep the server."""
        self.server = server

    def prepare(self) -> None:
        """Refuse foreign requests before anything else is done."""
        origin = self.request.headers.get("Origin")
        if self.request.host not in self.server.hosts:
            raise HTTPError(403, reason="Foreign Host")
        if origin is not None and origin not in [f"http://{host}" for host in self.server.hosts]:
            raise HTTPError(403, reason="Foreign Origin")
        if not hmac.compare_digest(
            (self.path_args or [""])[0].encode(), self.server.token.encode()
        ):
            raise HTTPError(403, reason="Missing token")
        connection: Any = self.request.connection
        self.server.trust(connection.stream)

    def set_default_headers(self) -> None:
        """Send headers that tell little about the server, and keep the content from other sites and from caches."""
        self.clear_header("Server")
        self.set_header("Content-Security-Policy", SECURITY_POLICY)
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cache-Control", "no-store")

    def write_error(self, status_code: int, **_: object) -> None:
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
        """Refuse foreign requests, those without an Origin, which browsers send, and pages beyond BOUNDS.pages."""
        super().prepare()
        if "Origin" not in self.request.headers:
            raise HTTPError(403, reason="Missing Origin")
        if len(self.server.pages) >= BOUNDS.pages:
            raise HTTPError(503, reason="Too many pages")

    def check_origin(self, origin: str) -> bool:
        """Accept every origin: :meth:`prepare` has checked it."""
        return True

    def open(self, *_: str) -> None:
        """Send the whole state to the page."""
        self.set_nodelay(True)
        self.session = self.server.replay()
        self.server.pages.add(self)
        self.send()

    async def on_message(self, message: str | bytes) -> None:
        """Take an acknowledgement, and send the next messages; or queue a request.

        No more is read from a page until it has taken the errors that it is sent, so that nothing piles up for it.
        """
        try:
            received = decode_message(message)
        except ProtocolError as error:
            await self._send_and_wait({"type": "error", "error": str(error)})
            return
        if isinstance(received, Shown):
            self.session.acknowledge(received.sequence)
            self.send()
        elif self._unanswered >= BOUNDS.requests:
            text = f"{BOUNDS.requests} requests wait for an answer; expected at most so many"
            await self._send_and_wait({"type": "error", "id": received.id, "error": text})
        else:
            self._unanswered += 1
            self.server.ask(self, received)

    def send_answer(self, answer: str) -> None:
        """Send the answer to a request; until the page takes it the request counts as unanswered."""
        written = self._write(answer, binary=False)
        if written is not None:
            written.add_done_callback(self._count_answered)

    def beat(self) -> None:
        """Send a sign of life, unless the page has not even taken the message before."""
        connection = self.ws_connection
        stream = None if connection is None else connection.stream
        if stream is not None and not stream.writing():
            self._write(json.dumps({"type": "beat"}), binary=False)

    def on_close(self) -> None:
        """Drop the page."""
        self.server.forget(self)

    def send(self) -> None:
        """Send the messages that may be sent now."""
        while (message := self.session.next()) is not None:
            self._write(message, binary=True)

    async def _send_and_wait(self, message: Mapping[str, object]) -> None:
        """Send a line of JSON, and wait until the page has taken it or is gone."""
        written = self._write(json.dumps(message), binary=False)
        if written is not None:
            with suppress(WebSocketClosedError):
                await written

    def _count_answered(self, _: asyncio.Future[None]) -> None:
        self._unanswered -= 1

    def _write(self, message: str | bytes, binary: bool) -> asyncio.Future[None] | None:
        try:
            written = self.write_message(message, binary=binary)
        except WebSocketClosedError:
            self.server.forget(self)
            return None
        written.add_done_callback(_ignore_error)
        return written


def _ignore_error(written: asyncio.Future[None]) -> None:
    """Retrieve the error of a write, if any: that a page is gone is not worth a line in the log."""
    if not written.cancelled():
        written.exception()
