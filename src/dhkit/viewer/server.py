"""A web server on the loopback interface that shows a scene's latest state to every page that opens it.

It runs in a daemon thread with an event loop of its own; :mod:`dhkit.viewer.handlers` says who may talk to it.
"""

from __future__ import annotations

import asyncio
import logging
import secrets
import threading
import time
from collections.abc import Mapping
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeout
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application

from dhkit.errors import ModelError
from dhkit.viewer.handlers import File, Page, Refused
from dhkit.viewer.page import page_files
from dhkit.viewer.protocol import stamped
from dhkit.viewer.session import Session, Slot

__all__ = ["ViewerServer"]

LOG = logging.getLogger(__name__)
ADDRESS = "127.0.0.1"
START_TIMEOUT = 10.0
CLOSE_TIMEOUT = 5.0
BEAT = 2.0
"""Seconds between signs of life to a page; the page gives up on us after three are missing."""
PING = 15.0
"""Seconds after which a browser that vanished without a word is dropped."""
MAX_MESSAGE = 1_000_000
POLL = 0.005


class ViewerServer:
    """A running server; :meth:`close` ends it.

    Parameters
    ----------
    state
        The latest message of every slot.

    Raises
    ------
    ModelError
        No viewer in the meshcat wheel, or the server did not start.
    """

    def __init__(self, state: Mapping[Slot, bytes]) -> None:
        self.token = secrets.token_urlsafe(16)
        self.files = page_files()
        self._lock = threading.Lock()
        self._sequence = 0
        self._state: dict[Slot, tuple[int, bytes]] = {}
        self._changed: set[Slot] = set()
        self.pages: set[Page] = set()
        self._closed = False
        for slot, message in state.items():
            self._keep(slot, message)
        self._changed.clear()
        self.port = self._start()

    @property
    def url(self) -> str:
        """Where the page is; the token in it is the permission to see it."""
        return f"http://{ADDRESS}:{self.port}/{self.token}/"

    @property
    def hosts(self) -> tuple[str, str]:
        """What a browser may call us."""
        return f"{ADDRESS}:{self.port}", f"localhost:{self.port}"

    def publish(self, slot: Slot, message: bytes) -> None:
        """Make a message the latest of its slot and send it to every page that has drawn the one before.

        Returns at once; many calls in a row are one transmission of the latest.

        Raises
        ------
        ModelError
            The server is closed.
        """
        with self._lock:
            scheduled = bool(self._changed)
            self._keep(slot, message)
        if not scheduled:
            self._soon(self._flush)

    def wait(self, timeout: float) -> None:
        """Return when at least one page is connected and every page has drawn everything.

        Raises
        ------
        TimeoutError
            Not within so many seconds.
        ModelError
            The server is closed.
        """
        self._soon(lambda: None)
        deadline = time.monotonic() + timeout
        while not self.pages or self._changed or not all(page.session.settled for page in tuple(self.pages)):
            if time.monotonic() > deadline:
                what = "no page is connected" if not self.pages else "a page has not drawn the latest state"
                raise TimeoutError(f"{what} after {timeout:g} s; it is at {self.url}")
            if not self._thread.is_alive():
                raise ModelError("the viewer's server has ended")
            time.sleep(POLL)

    def close(self) -> None:
        """Say good-bye to every page and stop the thread; a second time, nothing."""
        if self._closed:
            return
        self._closed = True
        try:
            self._loop.call_soon_threadsafe(self._stop.set)
        except RuntimeError:
            return
        self._thread.join(CLOSE_TIMEOUT)
        if self._thread.is_alive():
            LOG.warning("the viewer's server did not stop within %g s", CLOSE_TIMEOUT)

    def replay(self) -> Session:
        """Return a session that has everything still to send."""
        with self._lock:
            return Session(self._state)

    def _keep(self, slot: Slot, message: bytes) -> None:
        self._sequence += 1
        self._state[slot] = (self._sequence, stamped(message, self._sequence))
        self._changed.add(slot)

    def _soon(self, call: Any) -> None:
        try:
            if self._closed:
                raise RuntimeError
            self._loop.call_soon_threadsafe(call)
        except RuntimeError:
            raise ModelError("the viewer is closed") from None

    def _flush(self) -> None:
        with self._lock:
            latest = {slot: self._state[slot] for slot in self._changed}
            self._changed.clear()
        for page in tuple(self.pages):
            for slot, (sequence, message) in latest.items():
                page.session.offer(slot, sequence, message)
            page.send()

    def _start(self) -> int:
        started: Future[int] = Future()
        self._thread = threading.Thread(target=self._run, args=(started,), name="dhkit-viewer", daemon=True)
        self._thread.start()
        try:
            return started.result(START_TIMEOUT)
        except (OSError, FutureTimeout) as error:
            raise ModelError(f"the viewer's server did not start on {ADDRESS}: {str(error) or 'no answer'}") from None

    def _run(self, started: Future[int]) -> None:
        try:
            asyncio.run(self._serve(started))
        except BaseException as error:
            if not started.done():
                started.set_exception(error)
            else:
                LOG.exception("the viewer's server failed")

    async def _serve(self, started: Future[int]) -> None:
        self._loop = asyncio.get_running_loop()
        self._stop = asyncio.Event()
        routes = [(r"/([^/]*)/socket", Page, {"server": self}), (r"/([^/]*)/(.*)", File, {"server": self})]
        application = Application(
            routes,
            default_handler_class=Refused,
            default_handler_args={"server": self},
            log_function=lambda handler: LOG.debug("%s %s", handler.get_status(), handler.request.method),
            websocket_ping_interval=PING,
            websocket_max_message_size=MAX_MESSAGE,
        )
        self.sockets = bind_sockets(0, ADDRESS)
        http = HTTPServer(application)
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
            await asyncio.sleep(BEAT)
            for page in tuple(self.pages):
                page.say({"type": "beat"})
