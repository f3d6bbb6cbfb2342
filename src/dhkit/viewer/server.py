"""A web server on the loopback interface that shows a scene's latest state to every page that opens it.

It runs in a daemon thread with an event loop of its own; :mod:`dhkit.viewer.handlers` says who may talk to it.
"""

from __future__ import annotations

import asyncio
import json
import logging
import secrets
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, TimeoutError as FutureTimeout
from contextlib import suppress
from dataclasses import replace
from typing import Any, TypeAlias

from tornado.httpserver import HTTPServer
from tornado.iostream import IOStream
from tornado.netutil import bind_sockets
from tornado.web import Application

from dhkit.errors import DhkitError, ModelError
from dhkit.viewer.bounds import BOUNDS
from dhkit.viewer.handlers import File, Page, Refused
from dhkit.viewer.page import page_files
from dhkit.viewer.protocol import Samples, encode_state, stamped
from dhkit.viewer.requests import Request
from dhkit.viewer.session import OF_ONE_ARM, Session, Slot

Answer: TypeAlias = Callable[[str, Mapping[str, object]], object]
"""Answers a request, given its name and data, with a value that JSON can hold."""

_LOG = logging.getLogger(__name__)
_ADDRESS = "127.0.0.1"
_START_TIMEOUT = 10.0
"""Longest time that the server's thread may take to start, s."""
_CLOSE_TIMEOUT = 5.0
"""Longest time that the server's thread may take to stop, s."""
BEAT_PERIOD = 2.0
"""Time between two heartbeats to a page, s; the page gives the server up when three are missing."""
_PING_PERIOD = 15.0
"""Time between two pings, s: a browser that vanished without closing its connection is dropped."""
_IDLE_TIMEOUT = 60.0
"""Longest time that a connection may take to send a further request, s."""
FIRST_REQUEST_TIMEOUT = 10.0
"""Longest time that a connection may take until it has shown the token, s."""
_POLL_PERIOD = 0.005
"""Time between two looks at whether pages have drawn everything, s."""


class _BoundedServer(HTTPServer):
    """A server of at most BOUNDS.connections connections: each needs a descriptor, of which a process has few.

    Everybody on the machine can connect. Of connections that have not shown the token, the oldest makes room for a new
    one, and each is closed after a short time: so strangers do not keep the owner out.
    """

    def initialize(self, *arguments: Any, **options: Any) -> None:
        """Begin without connections."""
        super().initialize(*arguments, **options)
        self._open = 0
        self._strangers: dict[IOStream, None] = {}

    def handle_stream(self, stream: IOStream, address: tuple[str, int]) -> None:
        """Serve a connection; of too many, close the oldest that has not shown the token, or else this one."""
        if self._open >= BOUNDS.connections:
            oldest = next(iter(self._strangers), stream)
            self._close_stranger(oldest)
            if oldest is stream:
                return
        self._open += 1
        self._strangers[stream] = None
        asyncio.get_running_loop().call_later(
            FIRST_REQUEST_TIMEOUT, self._close_if_stranger, stream
        )
        super().handle_stream(stream, address)

    def trust(self, stream: IOStream) -> None:
        """Note that a connection has shown the token."""
        self._strangers.pop(stream, None)

    def on_close(self, server_conn: Any) -> None:
        """Note the end of a connection."""
        self._open -= 1
        self._strangers.pop(server_conn.stream, None)
        super().on_close(server_conn)

    def _close_if_stranger(self, stream: IOStream) -> None:
        if stream in self._strangers:
            self._close_stranger(stream)

    def _close_stranger(self, stream: IOStream) -> None:
        self._strangers.pop(stream, None)
        stream.close()


class ViewerServer:
    """A running server; :meth:`close` ends it.

    Parameters
    ----------
    state
        The latest message of every slot.
    answer
        Answers requests of pages: it is called with a request's name and data in a thread of its own, one request after
        the other, and returns a value that JSON can hold, or raises an error whose line the page shows. None for
        pages without panels.
    port, token
        Address of the page, for pages that are to find it again; by default any free port and a new token.

    Raises
    ------
    ModelError
        The meshcat wheel has no viewer, or the server did not start.
    """

    def __init__(
        self,
        state: Mapping[Slot, bytes],
        answer: Answer | None = None,
        port: int = 0,
        token: str | None = None,
    ) -> None:
        self.token = token or secrets.token_urlsafe(16)
        self._answer = answer
        self._worker = ThreadPoolExecutor(1, "dhkit-answers") if answer else None
        self._requested_port = port
        self.files = page_files()
        self._lock = threading.Lock()
        self._sequence = 0
        self._state: dict[int, tuple[int, bytes | Samples]] = {}
        self._changed: dict[int, bytes | Samples] = {}
        self._panels: dict[str, int] = {}
        self.pages: set[Page] = set()
        self._asked: dict[Page, deque[Request]] = {}
        self._closed = False
        for slot, message in state.items():
            self._keep(slot, message)
        self._changed.clear()
        self.port = self._start()

    @property
    def url(self) -> str:
        """Address of the page; the token in it is the permission to see the page."""
        return f"http://{_ADDRESS}:{self.port}/{self.token}/"

    @property
    def hosts(self) -> tuple[str, str]:
        """Values of the Host header that are the server's own: address and port."""
        return f"{_ADDRESS}:{self.port}", f"localhost:{self.port}"

    def publish_state(self, name: str, data: object) -> None:
        """Make a panel's state, of values that JSON can hold, the latest of its name; see :meth:`publish`."""
        self.publish(self._panel_slot(name), encode_state(name, data))

    def append(self, samples: Samples) -> None:
        """Add rows to those of the same name, on every page and for later ones; see :meth:`publish`."""
        self.publish(self._panel_slot(f"samples {samples.name}"), samples)

    def ask(self, page: Page, request: Request) -> None:
        """Queue a page's request, to be answered after those before it."""
        if self._worker is None or self._answer is None:
            text = "this page only shows; it has nothing to ask for"
            page.send_answer(json.dumps({"type": "error", "id": request.id, "error": text}))
            return
        with self._lock:
            self._asked.setdefault(page, deque()).append(request)
        try:
            self._worker.submit(self._answer_next, self._answer)
        except RuntimeError:
            return  # the server was closed meanwhile

    def trust(self, stream: IOStream) -> None:
        """Note that a connection has shown the token."""
        self._http.trust(stream)

    def forget(self, page: Page) -> None:
        """Drop a page that is gone, and its requests."""
        self.pages.discard(page)
        with self._lock:
            self._asked.pop(page, None)

    def publish(self, slot: int, message: bytes | Samples) -> None:
        """Make a message the latest of its slot and send it to every page that has drawn the one before.

        It returns at once; of many messages in a row only the latest is sent.

        Raises
        ------
        ModelError
            The server is closed.
        """
        with self._lock:
            scheduled = bool(self._changed)
            self._keep(slot, message)
        if not scheduled:
            self._call_soon(self._flush)

    def wait(self, timeout: float) -> None:
        """Wait until at least one page is connected and every page has drawn everything.

        Raises
        ------
        TimeoutError
            That takes longer than ``timeout``, s.
        ModelError
            The server is closed.
        """
        self._call_soon(lambda: None)
        deadline = time.monotonic() + timeout
        while (
            not self.pages
            or self._changed
            or not all(page.session.settled for page in tuple(self.pages))
        ):
            if time.monotonic() > deadline:
                problem = (
                    "no page is connected"
                    if not self.pages
                    else "a page has not drawn the latest state"
                )
                raise TimeoutError(f"{problem} after {timeout:g} s; it is at {self.url}")
            if not self._thread.is_alive():
                raise ModelError("the viewer's server has ended")
            time.sleep(_POLL_PERIOD)

    def close(self) -> None:
        """Close the pages' connections and stop the thread; a second call does nothing."""
        if self._closed:
            return
        self._closed = True
        if self._worker is not None:
            self._worker.shutdown(wait=False, cancel_futures=True)
        try:
            self._loop.call_soon_threadsafe(self._stop.set)
        except RuntimeError:
            return
        self._thread.join(_CLOSE_TIMEOUT)
        if self._thread.is_alive():
            _LOG.warning("the viewer's server did not stop within %g s", _CLOSE_TIMEOUT)

    def replay(self) -> Session:
        """Return a session that has the whole state still to send."""
        with self._lock:
            return Session(self._state)

    def _panel_slot(self, name: str) -> int:
        with self._lock:
            return self._panels.setdefault(name, Slot.PANELS + len(self._panels))

    def _keep(self, slot: int, message: bytes | Samples) -> None:
        self._sequence += 1
        if slot == Slot.SCENE:
            for other in OF_ONE_ARM:
                self._state.pop(other, None)
                self._changed.pop(other, None)
        if isinstance(message, Samples):
            _, earlier = self._state.get(slot, (0, None))
            self._state[slot] = (
                self._sequence,
                _join(earlier, replace(message, restart=earlier is None)),
            )
            self._changed[slot] = _join(self._changed.get(slot), message)
            return
        self._state[slot] = (self._sequence, stamped(message, self._sequence))
        self._changed[slot] = self._state[slot][1]

    def _answer_next(self, answer: Answer) -> None:
        """Answer a request of the page whose turn it is: a page with many requests does not delay the others."""
        with self._lock:
            if not self._asked:
                return
            page = next(iter(self._asked))
            requests = self._asked.pop(page)
            request = requests.popleft()
            if requests:
                self._asked[page] = requests
        text = _answer_text(answer, request)
        with suppress(ModelError):  # the server was closed meanwhile
            self._call_soon(lambda: page.send_answer(text))

    def _call_soon(self, call: Callable[[], None]) -> None:
        try:
            if self._closed:
                raise RuntimeError
            self._loop.call_soon_threadsafe(call)
        except RuntimeError:
            raise ModelError("the viewer is closed") from None

    def _flush(self) -> None:
        with self._lock:
            latest = {
                slot: (self._state[slot][0], message) for slot, message in self._changed.items()
            }
            self._changed.clear()
        for page in tuple(self.pages):
            for slot, (sequence, message) in latest.items():
                page.session.offer(slot, sequence, message)
            page.send()

    def _start(self) -> int:
        started: Future[int] = Future()
        self._thread = threading.Thread(
            target=self._run, args=(started,), name="dhkit-viewer", daemon=True
        )
        self._thread.start()
        try:
            return started.result(_START_TIMEOUT)
        except (OSError, FutureTimeout) as error:
            raise ModelError(
                f"the viewer's server did not start on {_ADDRESS}: {str(error) or 'no answer'}"
            ) from None

    def _run(self, started: Future[int]) -> None:
        try:
            asyncio.run(self._serve(started))
        except BaseException as error:
            if not started.done():
                started.set_exception(error)
            else:
                _LOG.exception("the viewer's server failed")

    async def _serve(self, started: Future[int]) -> None:
        self._loop = asyncio.get_running_loop()
        self._stop = asyncio.Event()
        routes = [
            (r"/([^/]*)/socket", Page, {"server": self}),
            (r"/([^/]*)/(.*)", File, {"server": self}),
        ]
        application = Application(
            routes,
            default_handler_class=Refused,
            default_handler_args={"server": self},
            log_function=lambda handler: _LOG.debug(
                "%s %s", handler.get_status(), handler.request.method
            ),
            websocket_ping_interval=_PING_PERIOD,
            websocket_max_message_size=BOUNDS.message_bytes,
        )
        self.sockets = bind_sockets(self._requested_port, _ADDRESS)
        self._http = http = _BoundedServer(
            application,
            max_body_size=BOUNDS.body_bytes,
            max_buffer_size=BOUNDS.buffer_bytes,
            idle_connection_timeout=_IDLE_TIMEOUT,
        )
        http.add_sockets(self.sockets)
        self.port = self.sockets[0].getsockname()[1]
        started.set_result(self.port)
        beat = asyncio.create_task(self._beat())
        await self._stop.wait()
        beat.cancel()
        http.stop()
        for page in tuple(self.pages):
            page.close(1001, "closed")
        await http.close_all_connections()

    async def _beat(self) -> None:
        while True:
            await asyncio.sleep(BEAT_PERIOD)
            for page in tuple(self.pages):
                page.beat()


def _answer_text(answer: Answer, request: Request) -> str:
    """Return the answer to a request as JSON, or its error in one line."""
    reply: dict[str, object] = {"id": request.id}
    try:
        return json.dumps(
            reply | {"type": "answer", "data": answer(request.name, request.data)}, allow_nan=False
        )
    except (DhkitError, ValueError, TypeError) as error:
        text = " ".join(str(error).split()) or type(error).__name__
    except Exception as error:
        _LOG.exception("request %s failed", request.name)
        text = f"{type(error).__name__} in {request.name}; Python's log says more"
    return json.dumps(reply | {"type": "error", "error": text})


def _join(earlier: bytes | Samples | None, later: Samples) -> Samples:
    return earlier.followed_by(later) if isinstance(earlier, Samples) else later
