"""A headless Chromium for tests, spoken to by the DevTools protocol; and what to do where there is none."""

from __future__ import annotations

import asyncio
import base64
import io
import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from tornado.websocket import WebSocketClientConnection, websocket_connect

from waiting import HANGS, wait_for

BINARY = next(
    (
        path
        for name in ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
        if (path := shutil.which(name))
    ),
    None,
)
"""The headless shell first: it has no user interface, which takes a third of the time of opening a page."""
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    # WebGL alone is drawn by SwiftShader: text and boxes are drawn faster without it.
    "--disable-gpu-compositing",
    "--disable-gpu-rasterization",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    "--remote-debugging-port=0",
]
KEY_CODES = {
    "Tab": 9,
    "Enter": 13,
    "Escape": 27,
    " ": 32,
    "End": 35,
    "Home": 36,
    "ArrowLeft": 37,
    "ArrowUp": 38,
    "ArrowRight": 39,
    "ArrowDown": 40,
}
"""Windows' codes of keys, by which Chromium knows what a key does."""


def require_chromium() -> None:
    """Skip the test where Chromium is missing; fail where DHKIT_REQUIRE names it."""
    if BINARY is not None:
        return
    if "chromium" in os.environ.get("DHKIT_REQUIRE", "").split(","):
        pytest.fail("Chromium is required by DHKIT_REQUIRE and not installed")
    pytest.skip("Chromium is not installed (apt-get install chromium-headless-shell)")


class Chromium:
    """A browser process with an empty profile; pages are opened by :meth:`page`."""

    def __init__(self) -> None:
        self.profile = tempfile.TemporaryDirectory(
            prefix="dhkit-chromium-", ignore_cleanup_errors=True
        )
        self.process = subprocess.Popen(
            [str(BINARY), *FLAGS, f"--user-data-dir={self.profile.name}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        self.loop = asyncio.new_event_loop()
        port, path = self._announced()
        self.address = f"ws://127.0.0.1:{port}"
        self.browser = Connection(self.loop, f"{self.address}{path}")

    def _announced(self) -> list[str]:
        """Return the port and the path of the browser's own socket, once Chromium has written them."""
        file = Path(self.profile.name) / "DevToolsActivePort"

        def lines() -> list[str]:
            assert self.process.poll() is None, "Chromium did not start"
            return file.read_text().split() if file.exists() else []

        return wait_for(lambda: found if len(found := lines()) == 2 else None, "Chromium's port")

    def page(
        self, width: int = 900, height: int = 700, *, dark: bool = False, scale: float = 1.0
    ) -> Page:
        """Open an empty page of a size in CSS px, in a window of its own: a hidden tab would draw nothing."""
        target = self.browser.call("Target.createTarget", url="about:blank", newWindow=True)
        page = Page(self.loop, f"{self.address}/devtools/page/{target['targetId']}")
        page.resize(width, height, scale)
        page.scheme("dark" if dark else "light")
        return page

    def close(self) -> None:
        """End the process group that this browser started."""
        os.killpg(self.process.pid, signal.SIGTERM)
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        self.loop.close()
        self.profile.cleanup()


class Connection:
    """A socket of the DevTools protocol."""

    def __init__(self, loop: asyncio.AbstractEventLoop, address: str) -> None:
        self.loop = loop
        self.count = 0
        self.socket = loop.run_until_complete(_connect(address))

    def call(self, method: str, **parameters: object) -> dict:
        """Return a DevTools command's result."""
        self.count += 1
        return self.loop.run_until_complete(
            asyncio.wait_for(self._call(self.count, method, parameters), HANGS)
        )

    async def _call(self, number: int, method: str, parameters: dict) -> dict:
        await self.socket.write_message(
            json.dumps({"id": number, "method": method, "params": parameters})
        )
        while True:
            text = await self.socket.read_message()
            assert text is not None, "Chromium closed the page"
            message = json.loads(text)
            if message.get("id") == number:
                assert "error" not in message, message
                return message["result"]
            self._note(message)

    def _note(self, event: dict) -> None:
        """Take notice of an event."""


class Page(Connection):
    """One page, with every address that it has asked for and every error that it has logged."""

    def __init__(self, loop: asyncio.AbstractEventLoop, address: str) -> None:
        super().__init__(loop, address)
        self.requests: list[str] = []
        self.errors: list[str] = []
        for domain in ("Network", "Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")
        self.call("Emulation.setFocusEmulationEnabled", enabled=True)

    def _note(self, event: dict) -> None:
        parameters = event.get("params", {})
        match event.get("method"):
            case "Network.requestWillBeSent":
                self.requests.append(parameters["request"]["url"])
            case "Network.webSocketCreated":
                self.requests.append(parameters["url"])
            case "Runtime.exceptionThrown":
                details = parameters["exceptionDetails"]
                self.errors.append(details.get("exception", {}).get("description", details["text"]))
            case "Log.entryAdded" if parameters["entry"]["level"] == "error":
                self.errors.append(parameters["entry"]["text"])
            case "Runtime.consoleAPICalled" if parameters["type"] == "error":
                self.errors.append(str([argument.get("value") for argument in parameters["args"]]))

    def resize(self, width: int, height: int, scale: float = 1.0) -> None:
        """Change the size, CSS px."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=scale,
            mobile=width < 500,
        )

    def scheme(self, name: str, motion: str = "no-preference") -> None:
        """Prefer light or dark, and motion or ``reduce``."""
        features = [
            {"name": "prefers-color-scheme", "value": name},
            {"name": "prefers-reduced-motion", "value": motion},
        ]
        self.call("Emulation.setEmulatedMedia", features=features)

    def open(self, url: str) -> None:
        """Go to an address and wait until an arm is shown there."""
        self.call("Page.navigate", url=url)
        self.until("document.body?.dataset.ready === 'true' && Boolean(dhkit.motion)")
        self.settle()

    def evaluate(self, expression: str) -> object:
        """Return a JavaScript expression's value."""
        result = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    def until(self, condition: str) -> None:
        """Wait for a JavaScript condition."""
        deadline = time.monotonic() + HANGS
        while not self.evaluate(f"Boolean({condition})"):
            assert time.monotonic() < deadline, (
                f"{condition} not true after {HANGS:g} s; errors: {self.errors}"
            )
            time.sleep(0.02)

    def settle(self) -> None:
        """Wait until two more pictures have been drawn."""
        self.evaluate(
            "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))"
        )

    def images_have_failed(self) -> None:
        """Wait until an image without content has called its handler: handlers of those before it were called too."""
        broken = "image.src = 'data:image/png,none'"
        self.evaluate(
            f"new Promise(done => {{ const image = new Image(); image.onerror = done; {broken}; }})"
        )

    def press(self, key: str, modifiers: int = 0) -> None:
        """Press and release a key; modifiers: 1 Alt, 2 Control, 8 Shift."""
        about: dict[str, object] = {"key": key, "modifiers": modifiers}
        if key in KEY_CODES:
            about |= {"code": key, "windowsVirtualKeyCode": KEY_CODES[key]}
        if key == "Enter":
            about["text"] = "\r"
        elif len(key) == 1:
            about["text"] = key
        self.call("Input.dispatchKeyEvent", type="keyDown", **about)
        self.call(
            "Input.dispatchKeyEvent",
            type="keyUp",
            **{k: v for k, v in about.items() if k != "text"},
        )

    def write(self, text: str) -> None:
        """Replace the text of the focused field, key by key, and press Enter."""
        self.call(
            "Input.dispatchKeyEvent", type="keyDown", key="a", modifiers=2, commands=["selectAll"]
        )
        for letter in text:
            self.press(letter)
        self.press("Enter")

    def centre(self, element: str) -> tuple[float, float]:
        """Return the middle of an element, a JavaScript expression, scrolled into view; px."""
        x, y = self.evaluate(  # type: ignore[misc]
            f"(e => {{ e.scrollIntoView({{block: 'nearest'}}); const box = e.getBoundingClientRect();"
            f" return [box.left + box.width / 2, box.top + box.height / 2]; }})({element})"
        )
        return x, y

    def mouse(self, kind: str, x: float, y: float, *, down: bool = False) -> None:
        """Move, press or release the mouse."""
        button = "none" if kind == "mouseMoved" and not down else "left"
        count = 0 if kind == "mouseMoved" else 1
        self.call(
            "Input.dispatchMouseEvent",
            type=kind,
            x=x,
            y=y,
            button=button,
            buttons=int(down),
            clickCount=count,
        )

    def click(self, element: str) -> None:
        """Click on an element, a JavaScript expression, with the mouse."""
        x, y = self.centre(element)
        self.mouse("mouseMoved", x, y)
        self.mouse("mousePressed", x, y, down=True)
        self.mouse("mouseReleased", x, y)

    def drag(self, places: Sequence[tuple[float, float]]) -> None:
        """Press the mouse at the first place, move it over the others, and release it at the last."""
        self.mouse("mouseMoved", *places[0])
        self.mouse("mousePressed", *places[0], down=True)
        for place in places[1:]:
            self.mouse("mouseMoved", *place, down=True)
        self.mouse("mouseReleased", *places[-1])

    def choose(self, element: str, value: str) -> None:
        """Choose an option of a list, a JavaScript expression, by the keyboard."""
        self.evaluate(f"{element}.focus()")
        here, there = self.evaluate(  # type: ignore[misc]
            f"(e => [e.selectedIndex, [...e.options].findIndex(o => o.value === {json.dumps(value)})])({element})"
        )
        assert there >= 0, f"{element} has no option {value}"
        for _ in range(abs(there - here)):
            self.press("ArrowDown" if there > here else "ArrowUp")

    def screenshot(self, file: Path | None = None, fine: bool = False) -> np.ndarray:
        """Return the picture, shape (height, width, 3), 0 to 255; write it as PNG if a file is given.

        A page without a graphics processor draws a scene at rest once more, finely: it is taken so where ``fine`` says
        so, and else always before, whatever the machine does.
        """
        if fine:
            self.until(
                "!globalThis.dhkit?.stage?.software || dhkit.stage.fine || dhkit.lab?.state.control?.running"
            )
        else:
            self.settle()
            self.evaluate("void globalThis.dhkit?.stage?.dirty?.()")
        self.settle()
        content = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        if file is not None:
            file.write_bytes(content)
        return np.asarray(Image.open(io.BytesIO(content)).convert("RGB")).astype(int)

    def close(self) -> None:
        """Close the page."""
        self.call("Page.close")
        self.loop.run_until_complete(asyncio.wait_for(self._close(), HANGS))

    async def _close(self) -> None:
        self.socket.close()
        while await self.socket.read_message() is not None:
            pass


async def _connect(address: str) -> WebSocketClientConnection:
    return await websocket_connect(address, max_message_size=1 << 30)
