"""Hostile clients of a running lab are refused or survived, and it goes on working in bounded memory."""

import asyncio
import base64
import contextlib
import gc
import http.client
import io
import json
import logging
import os
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import threading
import time
import zipfile
from contextlib import asynccontextmanager
from pathlib import Path

import numpy as np
import pytest
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from acceptance import ACCEPTING, in_time, sample_size
from dhkit import Arm
from dhkit.control import make_controller
from dhkit.errors import ModelError
from dhkit.lab import live as live_module
from dhkit.lab.live import MAX_PUSHES, Live
from dhkit.lab.serving import kept_token
from dhkit.viewer.bounds import BOUNDS
from dhkit.viewer.protocol import HEADER, Samples
from lab.test_requests import BAD, states
from viewer.messages import decode_header
from waiting import HANGS, wait_for

LATE = 4.0
"""s within which a slider is answered whatever others do; 0.01 s on an idle machine, 0.3 s in a flood."""
FLOOD = 10_000 if ACCEPTING else 20 * BOUNDS.requests
CYCLES_BEFORE, CYCLES = (200, 2_000) if ACCEPTING else (50, 100)
GROWTH = 20e6
"""Bytes that the process may grow by: the allocator's slack; one kept page is 0.4 MB, one kept message 1 MB."""
MUCH = 50e6
"""Bytes that nobody keeps for a page."""
CLIENTS = 50

NONSENSE = [
    "",
    "{",
    "null",
    "[]",
    "3",
    '"request"',
    "NaN",
    "{}",
    '{"type": "eval", "code": "1"}',
    '{"type": ["request"]}',
    '{"type": "shown"}',
    '{"type": "shown", "sequence": -1}',
    '{"type": "shown", "sequence": 1e400}',
    '{"type": "shown", "sequence": true}',
    '{"type": "request"}',
    '{"type": "request", "id": 0, "name": "python", "data": {}}',
    '{"type": "request", "id": 1.5, "name": "python", "data": {}}',
    '{"type": "request", "id": ' + "9" * 5000 + ', "name": "python", "data": {}}',
    '{"type": "request", "id": 1, "name": "", "data": {}}',
    '{"type": "request", "id": 1, "name": 7, "data": {}}',
    '{"type": "request", "id": 1, "name": "' + "x" * 41 + '", "data": {}}',
    '{"type": "request", "id": 1, "name": "python", "data": []}',
    '{"type": "request", "id": 1, "name": "python", "data": null}',
    '{"type": "request", "id": 1, "name": "joints.set", "data": {"q": [NaN]}}',
    '{"type": "request", "id": 1, "name": "joints.set", "data": {"q": [Infinity]}}',
    '{"type": "request", "id": 1, "name": "joints.set", "data": {"q": [[[[[[[[1]]]]]]]]}}',
    "[" * 100_000,
    '{"a":' * 50_000,
    b"\x00\xff\xfe",
    b"\xff" * 1000,
    bytes(1000),
]
"""Messages that are no requests."""

HOSTILE_NUMBERS = [10**400, -(10**400), 1e300, "1e5", [1], {"x": 1}, None, True]
HOSTILE_ENTRIES = [
    "9^9^9^9",
    "2**1000000",
    "1" * 200,
    "(" * 100,
    "sin(" * 50,
    "1e400",
    "1/0",
    "sqrt(-1)",
    "nan",
    "inf",
    "__import__('os').system('true')",
    "",
    "\0",
    "\ud800",
    "<img src=x onerror=alert(1)>",
]


def memory():
    """Return the resident size of this process, bytes."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


needs_proc = pytest.mark.skipif(
    not Path("/proc/self/statm").exists(), reason="no /proc: memory cannot be read"
)


def run(coroutine):
    return asyncio.run(asyncio.wait_for(coroutine, HANGS))


def headers(url, **changed):
    """Return a page's headers with some of them changed; empty ones are left out."""
    sent = {"Origin": url.rsplit("/", 2)[0], **changed}
    return {name: value for name, value in sent.items() if value}


class Client:
    """A page that acknowledges what it is sent, and asks."""

    def __init__(self, connection):
        self.connection, self.count, self.states = connection, 0, {}
        self.ended = False

    async def send(self, message):
        await self.connection.write_message(message, binary=isinstance(message, bytes))

    async def request(self, name, data):
        """Ask, and return the question's number at once."""
        self.count += 1
        await self.send(
            json.dumps({"type": "request", "id": self.count, "name": name, "data": data})
        )
        return self.count

    async def receive(self):
        """Return the next message; None, also again, when the connection has ended."""
        message = (
            None if self.ended else await asyncio.wait_for(self.connection.read_message(), HANGS)
        )
        self.ended = message is None
        return message

    async def take(self):
        """Take the next message; return it if it is a text that is no beat."""
        message = await self.receive()
        if isinstance(message, bytes):
            await self.send(
                json.dumps({"type": "shown", "sequence": decode_header(message).sequence})
            )
            self._note(message)
            return None
        found = json.loads(message or "null")
        return found if found and found["type"] != "beat" else None

    async def read(self):
        """Return the next text that is no beat; None when the connection has ended."""
        while not self.ended:
            if (found := await self.take()) is not None:
                return found
        return None

    async def ask(self, name, data=None):
        """Return the answer to a question."""
        number = await self.request(name, data or {})
        while (answer := await self.read()) is not None:
            if answer.get("id") == number:
                return answer
        raise AssertionError("the connection has ended")

    def _note(self, message):
        with contextlib.suppress(ValueError, KeyError):
            found = json.loads(message[HEADER.size :])
            self.states[found["name"]] = found["data"]


@asynccontextmanager
async def page(url, **changed):
    address = url.replace("http", "ws", 1) + "socket"
    connection = await websocket_connect(HTTPRequest(address, headers=headers(url, **changed)))
    client = Client(connection)
    try:
        yield client
    finally:
        connection.close()
        while await client.receive() is not None:
            pass


async def slider_works(url, value=0.25):
    """Move the first joint from a page of its own, in time, and hear of it."""
    async with page(url) as client:
        begin = time.monotonic()
        answer = await client.ask("joints.named", {"name": "zero"})
        q = [value, *([0.0] * (len(answer["data"]["q"]) - 1))]
        assert (await client.ask("joints.set", {"q": q}))["type"] == "answer"
        in_time(time.monotonic() - begin, LATE)


@pytest.fixture
def lab(open_lab, caplog):
    """A lab of a PUMA in whose log nothing goes wrong."""
    with caplog.at_level(logging.WARNING):
        yield open_lab("puma560")
    assert not [record.getMessage() for record in caplog.records if record.levelno >= logging.ERROR]


@pytest.fixture(scope="module")
def imported():
    """What labs import to look for links that touch, 30 MB, which stays in memory."""
    Arm.load("puma560").distance(np.zeros((1, 6)), self_collision=True)


def raw_socket(lab):
    """Return a websocket without a library, so that it can leave its answers lying."""
    server = lab.view._live()
    connection = socket.create_connection(("127.0.0.1", server.port), timeout=HANGS)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    host = f"127.0.0.1:{server.port}"
    lines = [
        f"GET /{server.token}/socket HTTP/1.1",
        f"Host: {host}",
        f"Origin: http://{host}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Version: 13",
        f"Sec-WebSocket-Key: {base64.b64encode(bytes(16)).decode()}",
        "\r\n",
    ]
    connection.sendall("\r\n".join(lines).encode())
    assert b"101" in connection.recv(20)
    return connection


def frame(text, opcode=1, final=True):
    """Return a websocket frame under the mask 0."""
    payload = text if isinstance(text, bytes) else text.encode()
    size = len(payload)
    length = bytes([0x80 | size]) if size < 126 else b"\xfe" + size.to_bytes(2, "big")
    if size >= 65_536:
        length = b"\xff" + size.to_bytes(8, "big")
    return bytes([(0x80 if final else 0) | opcode]) + length + bytes(4) + payload


# Who may ask


@pytest.mark.parametrize(
    "changed",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": ""},
        {"Origin": "https://127.0.0.1"},
        {"Origin": "http://127.0.0.1:1"},
        {"Host": "evil.example"},
        {"Host": "127.0.0.1.evil.example:80"},
        {"Host": "0.0.0.0"},
    ],
)
def test_a_stranger_cannot_ask(lab, changed):
    async def intrude():
        async with page(lab.url, **changed):
            pass

    with pytest.raises(HTTPClientError, match="403"):
        run(intrude())


@pytest.mark.parametrize("token", ["", "x", "{half}", "{token}x", "%00", "..", "{token}%2f"])
def test_who_does_not_know_the_token_cannot_ask(lab, token):
    server = lab.view._live()
    wrong = token.format(half=server.token[:8], token=server.token)
    url = f"http://127.0.0.1:{server.port}/{wrong}/"

    async def guess():
        async with page(url, Origin=f"http://127.0.0.1:{server.port}"):
            pass

    with pytest.raises(HTTPClientError, match=r"40[034]"):
        run(guess())


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "TRACE"])
@pytest.mark.parametrize("size", [0, 10_000_000])
def test_other_methods_and_bodies_are_refused(lab, method, size):
    server = lab.view._live()
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=HANGS)
    with contextlib.suppress(ConnectionError):  # it hangs up on a body that it does not want
        connection.request(method, f"/{server.token}/", body=bytes(size))
        assert connection.getresponse().status in (400, 403, 404, 405, 413)
    connection.close()
    run(slider_works(lab.url))


# What they say


def test_nonsense_gets_an_error_and_the_page_lives(lab):
    async def babble():
        async with page(lab.url) as client:
            for text in NONSENSE:
                await client.send(text)
                answer = await client.read()
                assert answer["type"] == "error" and "id" not in answer, text
                assert "\n" not in answer["error"] and len(answer["error"]) < 300
            return await client.ask("joints.set", {"q": [0.1] * 6})

    assert run(babble())["type"] == "answer"
    assert states(lab)["joints"]["q"] == [0.1] * 6


def test_bad_requests_of_every_type_get_an_error_and_change_nothing(lab):
    before = {name: data for name, data in states(lab).items() if name != "control"}
    kinds = [(name, data) for name, wrongs in BAD.items() for data in wrongs]
    kinds += [(name, {"junk": 1}) for name in lab._requests]
    kinds += [("joints.set", {"q": [x] * 6}) for x in HOSTILE_NUMBERS]
    kinds += [("tool.jog", {"axis": 0, "step": x}) for x in HOSTILE_NUMBERS]
    kinds += [("motion.plan", {"kind": "quintic", "goal": {"q": [x] * 6}}) for x in HOSTILE_NUMBERS]
    kinds += [("control.push", {"force": [0, 0, x]}) for x in HOSTILE_NUMBERS]

    async def ask_all():
        async with page(lab.url) as client:
            for name, data in kinds:
                answer = await client.ask(name, data)
                assert answer["type"] == "error", (name, data)
                assert "\n" not in answer["error"] and len(answer["error"]) < 300
                assert "Python's log" not in answer["error"], (name, data, answer)

    run(ask_all())
    assert len(kinds) >= 60 and {name for name, _ in kinds} >= set(lab._requests)
    assert {name: data for name, data in states(lab).items() if name != "control"} == before
    run(slider_works(lab.url))


def test_impossible_entries_of_the_table_are_marked_at_once(lab):
    async def edit_all():
        async with page(lab.url) as client:
            for text in HOSTILE_ENTRIES:
                begin = time.monotonic()
                answer = await client.ask("table.edit", {"row": 2, "column": "a", "text": text})
                assert answer["type"] == "answer" and answer["data"]["error"], text
                in_time(time.monotonic() - begin, LATE)

    run(edit_all())
    assert lab.desk.arm.description.numbers.a[2] == pytest.approx(0.0203)


def test_a_message_of_10_MB_ends_its_page_and_no_other(lab):
    async def shout():
        async with page(lab.url) as other, page(lab.url) as client:
            with contextlib.suppress(Exception):  # the server may hang up while we still send
                await client.send("x" * 10_000_000)
            while await client.receive() is not None:
                pass
            assert (await other.ask("joints.set", {"q": [0.2] * 6}))["type"] == "answer"

    run(shout())


def test_a_message_of_10_MB_in_fragments_too(lab):
    connection = raw_socket(lab)
    with contextlib.suppress(ConnectionError):
        connection.sendall(frame("x" * 60_000, final=False))
        for _ in range(10_000_000 // 60_000):
            connection.sendall(frame("x" * 60_000, opcode=0, final=False))
    wait_for(lambda: not lab.view._live().pages)
    connection.close()
    run(slider_works(lab.url))


@pytest.mark.parametrize(
    "data", [b"\x00" * 100, b"\xff" * 100, b"\xc1\x85" + bytes(4) + b"aaaaa", b"\x81\x05hello"]
)
def test_frames_that_are_no_websocket_end_their_page(lab, data):
    connection = raw_socket(lab)
    connection.sendall(data)
    connection.close()
    wait_for(lambda: not lab.view._live().pages)
    run(slider_works(lab.url))


# How much they say


def test_a_page_that_only_shows_says_so_however_often_it_is_asked():
    async def ask(url):
        async with page(url) as client:
            return {(await client.ask("python"))["error"] for _ in range(2 * BOUNDS.requests)}

    with Arm.load("planar2r").view() as view:
        assert run(ask(view.url)) == {"this page only shows; it has nothing to ask for"}


@pytest.mark.slow
def test_a_flood_of_requests_is_answered_or_refused(lab):
    server, most = lab.view._live(), []

    async def flood(client):
        for _ in range(FLOOD):
            await client.request("joints.set", {"q": [0.3] * 6})

    async def count(client):
        kinds = {"answer": 0, "error": 0}
        while sum(kinds.values()) < FLOOD:
            kinds[(await client.read())["type"]] += 1
            most.append(max(page._unanswered for page in server.pages))
        return kinds

    async def both():
        async with page(lab.url) as client:
            kinds, *_ = await asyncio.gather(count(client), flood(client), slider_works(lab.url))
            return kinds

    kinds = run(both())
    assert kinds["answer"] >= 1
    assert max(most) <= BOUNDS.requests


def fill(connection, message, url):
    """Send a message again and again until nobody reads it, though another page is answered; return the bytes sent."""
    connection.setblocking(False)
    sent, rest, unread = 0, b"", 0
    while unread < 2 and sent < MUCH:
        rest = rest or message * 1000
        try:
            count = connection.send(rest)
        except BlockingIOError:
            unread += 1
            run(slider_works(url))
        else:
            sent, rest, unread = sent + count, rest[count:], 0
    return sent


@needs_proc
@pytest.mark.usefixtures("imported")
@pytest.mark.slow
def test_a_page_that_takes_no_answers_is_not_read_from(lab):
    """A page asks for megabytes of answers and never reads."""
    lab._requests["table.download"] = lambda data: {"content": "x" * 50_000}
    request = frame(
        json.dumps(
            {"type": "request", "id": 1, "name": "table.download", "data": {"format": "toml"}}
        )
    )
    nonsense = frame("{")
    before = memory()
    for message in (request, nonsense):
        connection = raw_socket(lab)
        assert fill(connection, message, lab.url) < MUCH
        assert memory() - before < GROWTH
        assert all(page._unanswered <= BOUNDS.requests for page in lab.view._live().pages)
        connection.close()


@pytest.mark.slow
@needs_proc
@pytest.mark.usefixtures("imported")
def test_thousands_of_pages_come_and_go(lab):
    async def come_and_go(times):
        for k in range(times):
            async with page(lab.url) as client:
                if k % 3 == 0:
                    await client.request("joints.set", {"q": [0.001 * (k % 100)] * 6})
                if k % 3 == 1:
                    await client.receive()

    run(come_and_go(CYCLES_BEFORE))
    before = memory()
    run(come_and_go(CYCLES))
    run(slider_works(lab.url, 0.5))
    assert states(lab)["joints"]["q"][0] == 0.5
    assert memory() - before < GROWTH
    wait_for(lambda: not lab.view._live().pages)


@pytest.mark.slow
def test_many_pages_at_once_are_each_answered_and_see_the_same(lab):
    async def work(client, k):
        for turn in range(5):
            answer = await client.ask("tool.jog", {"axis": k % 6, "step": 1e-4, "frame": "world"})
            assert answer["id"] == client.count == turn + 1

    async def together():
        async with contextlib.AsyncExitStack() as stack:
            clients = [await stack.enter_async_context(page(lab.url)) for _ in range(CLIENTS)]
            await asyncio.gather(*(work(client, k) for k, client in enumerate(clients)))
            last = states(lab)["joints"]
            deadline = time.monotonic() + HANGS
            while any(client.states.get("joints") != last for client in clients):
                assert time.monotonic() < deadline, "a page shows something else"
                await asyncio.gather(
                    *(client.ask("tool.order", {"order": "XYZ"}) for client in clients)
                )

    run(together())


def test_more_pages_than_can_be_served_are_turned_away(lab):
    async def crowd():
        async with contextlib.AsyncExitStack() as stack:
            for _ in range(BOUNDS.pages):
                await stack.enter_async_context(page(lab.url))
            with pytest.raises(HTTPClientError, match="503"):
                await stack.enter_async_context(page(lab.url))
        await asyncio.to_thread(wait_for, lambda: not lab.view._live().pages)
        await slider_works(lab.url)

    run(crowd())


@pytest.mark.parametrize("abrupt", [False, True])
def test_a_page_may_go_while_it_is_answered(lab, abrupt):
    request = frame(
        json.dumps({"type": "request", "id": 1, "name": "joints.named", "data": {"name": "random"}})
    )
    for _ in range(20):
        connection = raw_socket(lab)
        connection.sendall(request * 20)
        if abrupt:  # no good-bye, but a reset
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        connection.close()
    run(slider_works(lab.url))
    wait_for(lambda: not lab.view._live().pages)


def test_what_a_page_asked_for_is_not_done_when_it_has_gone(lab):
    """Or who connects, asks for much and goes could queue more than anybody can answer."""
    begun, release = threading.Event(), threading.Event()
    calls = []

    def slow(data):
        calls.append(data)
        begun.set()
        release.wait(HANGS)
        return {}

    lab._requests["joints.named"] = slow
    connection = raw_socket(lab)
    connection.sendall(
        frame(json.dumps({"type": "request", "id": 1, "name": "joints.named", "data": {}})) * 30
    )
    assert begun.wait(HANGS)
    connection.close()
    wait_for(lambda: not lab.view._live().pages)
    release.set()
    wait_for(lambda: lab.view._live()._worker._work_queue.qsize() == 0)
    assert not lab.view._live()._asked
    assert len(calls) == 1


# Pages that are slow, runs that are long


@pytest.mark.slow
def test_what_waits_for_a_page_that_never_acknowledges_is_bounded(lab):
    """A page takes the scene and never says that it has drawn it, while a simulation streams."""
    server = lab.view._live()
    connection = raw_socket(lab)
    wait_for(lambda: server.pages)
    lab.answer("control.start", {"reference": "sine"})
    wait_for(lambda: states(lab)["control"]["time"] > 0.3)
    columns = next(m.columns for _, m in server._state.values() if isinstance(m, Samples))
    rows = np.zeros((1000, len(columns)), np.float32)
    for _ in range(30):
        lab.view.append(Samples("control", columns, rows))
        time.sleep(0.01)
    (slow,) = server.pages
    waiting = slow.session._waiting
    assert len(waiting) <= len(server._state)
    for kept in (waiting, server._state):
        assert all(
            m.rows.size <= BOUNDS.sample_numbers
            for *_, m in kept.values()
            if isinstance(m, Samples)
        )
    assert (
        not slow.ws_connection.stream.writing()
        or len(slow.ws_connection.stream._write_buffer) < 2e6
    )
    run(slider_works(lab.url))
    lab.answer("control.stop", {})
    connection.close()


@pytest.mark.slow
@needs_proc
@pytest.mark.usefixtures("imported")
def test_memory_stays_where_it_is_while_a_simulation_streams_to_a_slow_page(lab):
    connection = raw_socket(lab)
    lab.answer("control.start", {"reference": "sine"})
    span = sample_size(60) / 10  # s of the run
    sizes = []
    for k in range(3):
        wait_for(lambda end=0.5 + k * span: states(lab)["control"]["time"] > end)
        sizes.append(memory())
    # What grows grows all the time; what is made once, such as a compiled kernel, is in one half.
    assert min(np.diff(sizes)) < GROWTH / 4
    assert states(lab)["control"]["error"] is None
    lab.answer("control.stop", {})
    connection.close()


def short_run(monkeypatch, most):
    monkeypatch.setattr(live_module, "MAX_ROWS", most)
    arm = Arm.load("planar2r")
    run = Live(arm, arm, None, np.zeros(2), 1000.0)
    run.take(make_controller("pd-gravity", arm.description, 20.0, 1.0, np.zeros(2)))
    return run


def test_a_long_run_is_kept_whole_in_bounded_memory(monkeypatch):
    run = short_run(monkeypatch, 100)
    for _ in range(1500):
        run.advance()
    result = run.result()
    assert 50 <= len(result.t) <= 100
    assert result.t[0] == 0.0
    steps = np.diff(result.t)
    assert np.allclose(steps, steps[0], rtol=1e-9)
    assert result.t[-1] + steps[0] >= run.t - 1e-9
    assert run._rows.nbytes == 100 * 15 * 8


@pytest.mark.slow
def test_pushes_at_a_time_are_bounded(monkeypatch):
    run = short_run(monkeypatch, 100)
    for _ in range(MAX_PUSHES):
        run.push(None, np.array([1.0, 0.0, 0.0]), 0.05)
    with pytest.raises(ValueError, match="pushes act already"):
        run.push(None, np.array([1.0, 0.0, 0.0]), 0.05)
    for _ in range(60):
        run.advance()
    run.push(None, np.array([1.0, 0.0, 0.0]), 0.05)


def test_a_closed_lab_answers_no_more_and_leaves_no_thread(lab):
    before = threading.active_count()
    lab.answer("control.start", {"reference": "sine"})
    lab.answer("motion.plan", {"kind": "least-time", "goal": {"q": [0.5] * 6}})
    lab.close()
    with pytest.raises(ModelError, match="the lab is closed"):
        lab.answer("control.start", {})
    lab.close()
    wait_for(lambda: threading.active_count() < before)


@pytest.mark.parametrize("kind", ["line", "quintic"])
def test_a_pose_to_go_to_needs_no_preparation(lab, kind):
    """ssik would prepare itself for 16 s where an edit has destroyed the closed form."""
    T = lab.desk.arm.fk([0.1, 0.8, -2.9, 0.1, 0.8, 0.1])
    lab.answer("table.edit", {"row": 4, "column": "d", "text": "0.01"})
    lab.answer("joints.named", {"name": "nominal"})
    begin = time.monotonic()
    lab.answer("motion.plan", {"kind": kind, "goal": {"T": T.ravel().tolist()}, "duration": 3.0})
    state = wait_for(lambda: states(lab)["motion"] or (states(lab)["job"] or {}).get("error"))
    in_time(time.monotonic() - begin, LATE)
    assert not isinstance(state, str), state


@pytest.mark.parametrize("kind", ["least-time", "quintic"])
@pytest.mark.slow
def test_a_flood_of_plans_is_one_thread(lab, kind):
    before = threading.active_count()
    most = 0
    for k in range(100):
        lab.answer("motion.plan", {"kind": kind, "goal": {"q": [0.1 + 0.001 * k] * 6}})
        most = max(most, threading.active_count())
    assert most <= before + 1
    lab.answer("motion.cancel", {})
    assert states(lab)["job"] is None
    wait_for(lambda: threading.active_count() <= before)


def test_a_result_that_cannot_be_shown_is_an_error_of_its_job(lab):
    def refused(result):
        raise ValueError(f"{result} lasts too long")

    lab._motions.jobs.start("plan", lambda job: "the motion", refused)
    assert wait_for(lambda: (states(lab)["job"] or {}).get("error")) == "the motion lasts too long"
    assert not states(lab)["job"]["running"]


@needs_proc
@pytest.mark.usefixtures("imported")
@pytest.mark.slow
def test_a_file_that_unpacks_to_gigabytes_is_refused(lab):
    packed = io.BytesIO()
    with (
        zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("q.npy", "w") as entry,
    ):
        np.lib.format.write_array_header_1_0(
            entry, {"descr": "<f8", "fortran_order": False, "shape": (50_000_000,)}
        )
        for _ in range(400):
            entry.write(bytes(1_000_000))
    before = memory()
    content = base64.b64encode(packed.getvalue()).decode()
    assert len(content) < 700_000
    with pytest.raises(ValueError, match=r"x\.npz"):
        lab.answer("motion.file", {"name": "x.npz", "content": content})
    assert memory() - before < GROWTH


# The file system

WATCHED = []
"""Paths that are opened, made, renamed or removed; None while nobody wants to know."""
WATCHING = threading.Event()


def _watch(event, arguments):
    if WATCHING.is_set() and event in ("open", "os.mkdir", "os.rename", "os.remove", "os.symlink"):
        WATCHED.append((event, str(arguments[0]), arguments))


def test_nothing_that_a_page_says_reaches_the_file_system(lab):
    names = [
        "../../marked.csv",
        "/tmp/marked.csv",
        "marked\0.csv",
        "~/marked.csv",
        "%2e%2e/marked.csv",
        "C:\\marked.csv",
        "\\\\host\\marked.csv",
        "file:///marked.csv",
        "marked" + "x" * 180 + ".csv",
        "marked/../marked.npz",
        "marked.mat",
        "marked.yaml",
    ]
    table = (
        "t,"
        + ",".join(f"q{i}" for i in range(1, 7))
        + "\n"
        + "".join(f"{k},0,0,0,0,0,{k}\n" for k in range(5))
    )
    content = base64.b64encode(table.encode()).decode()
    before = set(Path(tempfile.gettempdir()).glob("dhkit-lab-*"))
    lab.answer("motion.file", {"name": "first.csv", "content": content})  # imports what it needs
    lab.answer("motion.download", {"format": "csv"})
    sys.addaudithook(_watch)
    WATCHED.clear()
    WATCHING.set()

    async def ask_all():
        kinds = []
        async with page(lab.url) as client:
            for name in names:
                kinds.append(
                    (await client.ask("motion.file", {"name": name, "content": content}))["type"]
                )
            for request in ("table.download", "motion.download", "control.download"):
                for form in ("../marked", "/marked", "marked\0", "csv/../marked"):
                    kinds.append((await client.ask(request, {"format": form}))["type"])
            for name in ("joints.named", "tool.choose"):
                await client.ask(name, {"name": "../marked", "branch": "../marked"})
            await client.ask("motion.download", {"format": "csv"})
        return kinds

    try:
        kinds = run(ask_all())
    finally:
        WATCHING.clear()
    assert kinds[:9] == ["answer"] * 9
    assert kinds[9:] == ["error"] * (len(kinds) - 9)
    assert not [path for _, path, _ in WATCHED if "marked" in path]
    changed = [path for event, path, arguments in WATCHED if _changes(event, arguments)]
    own = str(Path(tempfile.gettempdir()) / "dhkit-lab-")
    assert changed
    assert not [path for path in changed if not path.startswith(own) and not path.isdigit()]
    assert set(Path(tempfile.gettempdir()).glob("dhkit-lab-*")) == before


def _changes(event, arguments):
    """Whether something in the file system is changed; what a removed folder held is named within it."""
    if event == "os.remove":
        return arguments[1] == -1
    if event != "open":
        return True
    mode, flags = (*arguments[1:3], None, None)[:2]
    return any(letter in str(mode or "") for letter in "wax+") or bool(
        isinstance(flags, int) and flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
    )


# Beginning and end of the program


@contextlib.contextmanager
def program(*arguments):
    """Run `dhkit` and return the process and the page's address."""
    process = subprocess.Popen(
        [sys.executable, "-m", "dhkit", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # Where the tests run in the background, Ctrl-C is ignored, and so it would be here.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        line = process.stdout.readline()
        yield (
            process,
            next((word.rstrip(";") for word in line.split() if word.startswith("http")), None),
        )
    finally:
        process.kill()
        process.communicate(timeout=HANGS)


def interrupt(process):
    """Press Ctrl-C, and return the exit status and what stderr said."""
    process.send_signal(signal.SIGINT)
    begin = time.monotonic()
    _, errors = process.communicate(timeout=HANGS)
    in_time(time.monotonic() - begin, LATE)
    return process.returncode, errors


SIMULATE = ("control.start", {"reference": "sine"})
PLAN = ("motion.plan", {"kind": "least-time", "goal": {"q": [0.5, 0.1, -0.2, 0.3, 0.4, 0.5]}})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "asked", "begun"),
    [
        ("lab", [], lambda seen: True),
        ("lab", [SIMULATE], lambda seen: seen.get("control", {}).get("time", 0.0) > 0.1),
        ("lab", [PLAN], lambda seen: seen.get("motion") or (seen.get("job") or {}).get("progress")),
        ("view", [SIMULATE, PLAN], lambda seen: True),  # which does neither
    ],
    ids=["idle", "simulating", "planning", "view"],
)
def test_ctrl_c_ends_it_cleanly(command, asked, begun):
    async def ask_and_interrupt(process, url):
        async with page(url) as client:
            for name, data in asked:
                assert (await client.ask(name, data))["type"] == (
                    "answer" if command == "lab" else "error"
                )
            while not begun(client.states):
                await client.take()
                assert not client.ended
            ended = await asyncio.get_running_loop().run_in_executor(None, interrupt, process)
            while await client.receive() is not None:
                pass
        return ended, client.connection.close_code

    with program(command, "puma560", "--no-browser") as (process, url):
        (status, errors), code = run(ask_and_interrupt(process, url))
    assert status == 0, errors
    assert errors == ""
    assert code == 1001


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        return taken.getsockname()[1]


@pytest.mark.slow
def test_a_page_finds_a_restarted_lab_at_the_same_address(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    port = free_port()
    begin = ("lab", "planar2r", "--no-browser", "--port", str(port))
    with program(*begin) as (process, url):
        assert f":{port}/" in url
        run(slider_works(url))
        process.kill()
        process.wait(HANGS)
        with pytest.raises(OSError):  # noqa: PT011 - the class is the test
            run(slider_works(url))
    with program(*begin) as (_, again):
        assert again == url
        run(slider_works(url))
        with program(*begin) as (second, none):
            assert none is None
            _, errors = second.communicate(timeout=HANGS)
            assert second.returncode == 2
            assert (
                errors.startswith("dhkit: the viewer's server did not start")
                and errors.count("\n") == 1
            )


@pytest.fixture
def state_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    umask = os.umask(0)
    yield tmp_path / "state" / "dhkit"
    os.umask(umask)


posix = pytest.mark.skipif(os.name != "posix", reason="no modes")


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


@posix
def test_a_kept_token_is_this_users_alone(state_folder):
    token = kept_token(5000)
    assert len(token) >= 22
    assert kept_token(5000) == token != kept_token(5001)
    assert mode(state_folder) == 0o700
    assert mode(state_folder / "lab-5000.token") == 0o600


@posix
def test_a_folder_that_others_can_write_is_refused(state_folder):
    kept_token(5000)
    for open_mode in (0o770, 0o702, 0o777):
        state_folder.chmod(open_mode)
        with pytest.raises(ModelError, match="can be written by others"):
            kept_token(5000)


@posix
@pytest.mark.parametrize(
    "damage", ["readable", "writable", "short", "foreign", "link", "folderless"]
)
def test_a_token_that_others_may_know_is_not_used_again(state_folder, damage, tmp_path):
    token = kept_token(5000)
    path = state_folder / "lab-5000.token"
    if damage == "readable":
        path.chmod(0o644)
    elif damage == "writable":
        path.chmod(0o622)
    elif damage == "short":
        path.write_text("x")
    elif damage == "foreign":
        path.write_bytes("ä/../<script>".encode() * 10)
    elif damage == "link":
        path.unlink()
        (tmp_path / "elsewhere").write_text(token)
        (tmp_path / "elsewhere").chmod(0o600)
        path.symlink_to(tmp_path / "elsewhere")
    else:
        path.unlink()
        state_folder.rmdir()
    new = kept_token(5000)
    assert new != token
    assert kept_token(5000) == new
    assert mode(path) == 0o600 and not path.is_symlink()


@posix
@pytest.mark.skipif(os.name == "posix" and os.getuid() == 0, reason="root may write everywhere")
def test_a_state_folder_that_cannot_be_written_is_an_error(state_folder):
    state_folder.parent.mkdir(mode=0o500)
    with pytest.raises(ModelError, match="expected a place for the lab's token"):
        kept_token(5000)
