"""Who may talk to the server, what a new page is told, and that nothing hangs."""

import asyncio
import http.client
import json
import socket
import threading
import time
from contextlib import asynccontextmanager, contextmanager

import pytest
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from acceptance import slow_if
from dhkit.errors import ModelError
from dhkit.viewer.bounds import BOUNDS
from dhkit.viewer.page import MODULES
from dhkit.viewer.protocol import encode_frames
from dhkit.viewer.server import ViewerServer
from dhkit.viewer.session import Slot
from viewer.messages import decode_header
from waiting import HANGS

CONNECTIONS = 200


def message(flag=False):
    return encode_frames(flag)


@pytest.fixture
def server():
    running = ViewerServer({Slot.SCENE: message(), Slot.MOTION: message(True)})
    yield running
    running.close()


def get(server, path, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=HANGS)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, answer.headers, content


@asynccontextmanager
async def connect(server, **headers):
    headers = {"Origin": f"http://127.0.0.1:{server.port}", **headers}
    url = server.url.replace("http", "ws") + "socket"
    socket = await websocket_connect(
        HTTPRequest(url, headers={k: v for k, v in headers.items() if v})
    )
    yield socket
    socket.close()
    while await asyncio.wait_for(socket.read_message(), HANGS) is not None:
        pass


def run(coroutine):
    return asyncio.run(asyncio.wait_for(coroutine, HANGS * 3))


async def read(socket):
    """Return the next binary message; beats are text."""
    while isinstance(text := await asyncio.wait_for(socket.read_message(), HANGS), str):
        assert json.loads(text)["type"] == "beat"
    return text


async def shown(socket, content):
    sequence = decode_header(content).sequence
    await socket.write_message(json.dumps({"type": "shown", "sequence": sequence}))


def test_the_page_and_its_files_are_served(server):
    path = f"/{server.token}/"
    status, headers, content = get(server, path)
    assert status == 200
    assert content.startswith(b"<!doctype html>")
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert "Server" not in headers
    for name in ("viewer.css", "meshcat.js", *MODULES):
        status, headers, _ = get(server, path + name)
        assert status == 200
        assert headers["Content-Type"].startswith(("text/css", "text/javascript"))


def test_it_listens_on_the_loopback_interface_only(server):
    assert server.url.startswith("http://127.0.0.1:")
    own = asyncio.run_coroutine_threadsafe(listening(server), server._loop).result(HANGS)
    assert own == {"127.0.0.1"}


async def listening(server):
    return {sock.getsockname()[0] for sock in server.sockets}


@pytest.mark.parametrize("name", ["", "main.js", "socket"])
@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Host": "127.0.0.1"},
        {"Host": "127.0.0.1:1"},
        {"Origin": "http://evil.example"},
        {"Origin": "https://127.0.0.1:{port}"},
        {"Origin": "null"},
    ],
)
def test_a_foreign_host_or_origin_is_refused(server, name, headers):
    headers = {key: value.format(port=server.port) for key, value in headers.items()}
    status, _, content = get(server, f"/{server.token}/{name}", **headers)
    assert status == 403
    assert server.token.encode() not in content


@pytest.mark.parametrize(
    "path", ["/", "/main.js", "//", "/x/", "/socket", "/{half}/", "/{token}x/main.js"]
)
def test_a_missing_token_is_refused(server, path):
    path = path.format(token=server.token, half=server.token[:8])
    assert get(server, path)[0] == 403


@pytest.mark.parametrize(
    "name", ["../server.py", "%2e%2e/server.py", "index.html", "static/main.js", "favicon.ico"]
)
def test_only_the_pages_own_files_are_there(server, name):
    assert get(server, f"/{server.token}/{name}")[0] in (403, 404)


@pytest.mark.parametrize("origin", ["http://evil.example", "null", ""])
def test_a_websocket_of_another_site_is_refused(server, origin):
    async def intrude():
        async with connect(server, Origin=origin):
            pass

    with pytest.raises(HTTPClientError, match="403"):
        run(intrude())


def test_a_websocket_without_the_token_is_refused(server):
    server.token, token = "guess", server.token

    async def guess():
        url = f"ws://127.0.0.1:{server.port}/{token}/socket"
        await websocket_connect(
            HTTPRequest(url, headers={"Origin": f"http://127.0.0.1:{server.port}"})
        )

    with pytest.raises(HTTPClientError, match="403"):
        run(guess())


def test_a_new_page_is_told_the_latest_state(server):
    server.publish(Slot.MOTION, message(False))
    server.publish(Slot.TRACE, message(True))

    async def replayed():
        flags = []
        async with connect(server) as socket:
            for _ in range(3):
                content = await read(socket)
                flags.append(decode_header(content).flags)
                await shown(socket, content)
        return flags

    assert run(replayed()) == [0, 1, 0]  # scene, trace, motion


def test_a_slow_page_gets_the_latest_and_nothing_in_between(server):
    """Of 500 poses only the last; before it perhaps what waited when the first was drawn."""
    before, published = 2, 500  # scene and motion that the server begins with

    async def slow():
        async with connect(server) as socket:
            received = [await read(socket)]
            for k in range(published):
                server.publish(Slot.MOTION, message(k == published - 1))
            while decode_header(received[-1]).sequence != before + published:
                await shown(socket, received[-1])
                received.append(await read(socket))
            await shown(socket, received[-1])
            deadline = time.monotonic() + HANGS
            while not all(page.session.settled for page in server.pages):
                assert time.monotonic() < deadline, "a page is owed a frame that it never gets"
                await asyncio.sleep(0.01)
            return [decode_header(content).sequence for content in received], decode_header(
                received[-1]
            ).flags

    sequences, flags = run(slow())
    assert set(sequences) <= {1, before, before + published}
    assert flags == 1


def test_it_survives_many_connections(server):
    async def come_and_go():
        for _ in range(CONNECTIONS):
            async with connect(server) as socket:
                await read(socket)
        async with connect(server) as socket:
            await shown(socket, await read(socket))
            return decode_header(await read(socket)).flags

    assert run(come_and_go()) == 1
    deadline = time.monotonic() + HANGS
    while server.pages and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not server.pages


@contextmanager
def strangers(server, count, text=b"GET /x"):
    """Connections that begin a request, without the token."""
    opened = []
    try:
        for _ in range(count):
            opened.append(socket.create_connection(("127.0.0.1", server.port), timeout=HANGS))
            opened[-1].sendall(text)
        yield opened
    finally:
        for one in opened:
            one.close()


@pytest.mark.parametrize(
    "text", [slow_if(True, b""), b"GET /x", b"GET /wrong/ HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"]
)
def test_strangers_do_not_keep_the_owner_out(server, text):
    """The oldest of them makes room, and a page that is open stays."""

    async def owner():
        async with connect(server) as page:
            decode_header(await page.read_message())
            with strangers(server, BOUNDS.connections + 20, text) as opened:
                for _ in range(3):
                    assert (await asyncio.to_thread(get, server, f"/{server.token}/"))[0] == 200
                while opened[0].recv(10_000):  # refused or closed
                    pass
            page.close()

    run(owner())


def test_a_stranger_who_says_nothing_is_sent_away(server, monkeypatch):
    monkeypatch.setattr("dhkit.viewer.server.FIRST_REQUEST_TIMEOUT", 0.01)
    with strangers(server, 1) as (one,):
        assert one.recv(1) == b""
    assert get(server, f"/{server.token}/")[0] == 200


def test_nonsense_from_a_page_gets_an_error_and_the_page_lives(server):
    async def babble():
        errors = []
        async with connect(server) as socket:
            first = await read(socket)
            for text in ("{", '{"type": "eval", "code": "1"}', b"\x00"):
                await socket.write_message(text, binary=isinstance(text, bytes))
                while (answer := json.loads(await socket.read_message()))["type"] == "beat":
                    pass
                errors.append(answer["type"])
            await shown(socket, first)
            await read(socket)
        return errors

    assert run(babble()) == ["error"] * 3


def test_a_page_hears_a_sign_of_life(monkeypatch):
    monkeypatch.setattr("dhkit.viewer.server.BEAT_PERIOD", 0.05)
    server = ViewerServer({Slot.SCENE: message()})

    async def listen():
        async with connect(server) as socket:
            await read(socket)
            return json.loads(await asyncio.wait_for(socket.read_message(), HANGS))

    try:
        assert run(listen()) == {"type": "beat"}
    finally:
        server.close()


def test_waiting_without_a_page_ends(server):
    with pytest.raises(
        TimeoutError, match=r"no page is connected after 0.05 s; it is at http://127.0.0.1"
    ):
        server.wait(0.05)


def test_waiting_for_a_page_that_does_not_draw_ends(server):
    async def idle():
        async with connect(server) as socket:
            await read(socket)
            loop = asyncio.get_running_loop()
            with pytest.raises(TimeoutError, match="a page has not drawn the latest state"):
                await loop.run_in_executor(None, server.wait, 0.05)

    run(idle())


def test_a_closed_server_is_gone_and_says_so():
    threads = threading.active_count()
    server = ViewerServer({Slot.SCENE: message()})
    port = server.port
    server.close()
    server.close()
    assert threading.active_count() == threads
    for call in (lambda: server.publish(Slot.MOTION, message()), lambda: server.wait(1.0)):
        with pytest.raises(ModelError, match="the viewer is closed"):
            call()
    with pytest.raises(ConnectionRefusedError):
        http.client.HTTPConnection("127.0.0.1", port, timeout=HANGS).connect()


def test_a_page_is_told_good_bye(server):
    async def last_words():
        async with connect(server) as socket:
            await read(socket)
            await asyncio.get_running_loop().run_in_executor(None, server.close)
        return socket.close_code

    assert run(last_words()) == 1001


def test_pages_leave_connections_for_files():
    assert BOUNDS.pages < BOUNDS.connections
