"""What the viewer's server answers, and to whom.

Requests must name the server's own address as Host (against DNS rebinding), come from one of its own pages if they
say where they come from (a websocket must), and know the random token in the path.
"""

from __future__ import annotations

import hmac
import json
from typing import TYPE_CHECKING, Any

from tornado.web import HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from dhkit.viewer.page import SECURITY_POLICY
from dhkit.viewer.protocol import ProtocolError, decode_shown

if TYPE_CHECKING:
    from dhkit.viewer.server import ViewerServer
    from dhkit.viewer.session import Session

__all__ = ["File", "Page", "Refused"]


class Guarded(RequestHandler):
    """A request that is refused unless it comes from our own page and knows the token."""

    def initialize(self, server: ViewerServer) -> None:
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

    def prepare(self) -> None:
        """Refuse strangers, and who does not say where it comes from: browsers do."""
        super().prepare()
        if "Origin" not in self.request.headers:
            raise HTTPError(403, reason="Missing Origin")

    def check_origin(self, origin: str) -> bool:
        """Accept: :meth:`prepare` has looked at it."""
        return True

    def open(self, *_: str) -> None:
        """Send the page everything."""
        self.set_nodelay(True)
        self.session = self.server.replay()
        self.server.pages.add(self)
        self.send()

    def on_message(self, message: str | bytes) -> None:
        """Take an acknowledgement, and send what has come up meanwhile."""
        try:
            self.session.shown(decode_shown(message))
        except ProtocolError as error:
            self.say({"type": "error", "error": str(error)})
            return
        self.send()

    def on_close(self) -> None:
        """Forget the page."""
        self.server.pages.discard(self)

    def send(self) -> None:
        """Send what may be sent."""
        message = self.session.next()
        if message is not None:
            self._write(message, binary=True)

    def say(self, message: dict[str, str]) -> None:
        """Send a line of JSON."""
        self._write(json.dumps(message), binary=False)

    def _write(self, message: str | bytes, binary: bool) -> None:
        try:
            self.write_message(message, binary=binary)
        except WebSocketClosedError:
            self.server.pages.discard(self)
