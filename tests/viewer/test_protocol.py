"""Laws of the protocol: what is encoded comes back, and what is not a message is refused."""

import struct

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from dhkit.description import library_robot
from dhkit.model.shapes import link_parts
from dhkit.viewer import protocol
from dhkit.viewer.bounds import BOUNDS
from dhkit.viewer.protocol import MessageType, ProtocolError, Samples, encode_state
from dhkit.viewer.requests import Request, Shown, decode_message
from dhkit.viewer.scene import build_scene
from viewer import messages
from viewer.messages import decode_samples, decode_state

number = st.floats(-1e3, 1e3, width=32)
joints = st.integers(1, 9)


def drawn(draw, *shape):
    return draw(arrays(float, shape, elements=number))


@given(st.data(), joints, st.floats(0, 1e6))
def test_a_pose_comes_back(data, n, time):
    q, T = drawn(data.draw, n), drawn(data.draw, n + 2, 4, 4)
    message = protocol.encode_pose(q, T, time)
    pose = messages.decode_pose(message)
    assert np.array_equal(pose.q, q)
    assert np.array_equal(pose.transforms, T[:, :3])
    header = messages.decode_header(message)
    assert (header.type, header.joints, header.sequence, header.time) == (
        MessageType.POSE,
        n,
        0,
        time,
    )


@given(st.data(), joints, st.integers(1, 5), st.booleans(), st.booleans())
def test_an_animation_comes_back(data, n, count, trace, accompanied):
    times = np.sort(data.draw(arrays(float, count, elements=st.floats(0, 1e5))))
    q, T = drawn(data.draw, count, n), drawn(data.draw, count, n + 2, 4, 4)
    ghost = (
        (drawn(data.draw, count, n + 2, 4, 4), np.array([1, 2, 3], dtype=np.uint8))
        if accompanied
        else None
    )
    message = protocol.encode_animation(times, q, T, trace=trace, ghost=ghost)
    back = messages.decode_animation(message)
    assert (back.ghost is not None) == accompanied
    if ghost is not None:
        assert np.array_equal(back.ghost, ghost[0][:, :, :3])
        assert message.endswith(b"\x01\x02\x03")
    assert np.array_equal(back.times, times)
    assert np.array_equal(back.q, q)
    assert np.array_equal(back.transforms, T[:, :, :3])
    assert back.trace is trace


@given(st.data(), st.integers(0, 20))
def test_a_trace_comes_back(data, count):
    points = drawn(data.draw, count, 3)
    assert np.array_equal(messages.decode_trace(protocol.encode_trace(points)), points)


@given(st.data(), st.integers(0, 20))
def test_points_come_back(data, count):
    points, colors = drawn(data.draw, count, 3), data.draw(arrays(np.uint8, (count, 3)))
    cloud = messages.decode_points(protocol.encode_points(points, colors))
    assert np.array_equal(cloud.points, points)
    assert np.array_equal(cloud.colors, colors)


@given(st.data(), st.integers(0, 5))
def test_ellipsoids_come_back(data, count):
    T = drawn(data.draw, count, 4, 4)
    assert np.array_equal(messages.decode_ellipsoids(protocol.encode_ellipsoids(T)), T[:, :3])


@given(st.data(), joints, st.integers(0, 8))
def test_ghosts_come_back(data, n, count):
    T, tints = drawn(data.draw, count, n + 2, 4, 4), data.draw(arrays(np.uint8, (count, 3)))
    ghosts = messages.decode_ghosts(protocol.encode_ghosts(T, tints))
    assert np.array_equal(ghosts.transforms, T[:, :, :3])
    assert np.array_equal(ghosts.tints, tints)


@given(st.data(), st.integers(0, 5))
def test_obstacles_come_back(data, count):
    T, half_edges, radii = (
        drawn(data.draw, count, 4, 4),
        drawn(data.draw, count, 3),
        drawn(data.draw, count),
    )
    back = messages.decode_obstacles(protocol.encode_obstacles(T, half_edges, radii))
    assert np.array_equal(back.transforms, T[:, :3])
    assert np.array_equal(back.half_edges, half_edges)
    assert np.array_equal(back.radii, radii)


@pytest.mark.parametrize("name", ["planar2r", "puma560"])
def test_a_scene_comes_back(name):
    arm = library_robot(name)
    scene = build_scene(arm, link_parts(arm))
    about, commands = messages.decode_scene(protocol.encode_scene(scene))
    assert about == scene.about
    assert [c["path"] for c in commands] == [c["path"] for c in scene.commands]
    assert commands == list(scene.commands)


@given(st.integers(0, 2**40), st.booleans())
def test_a_stamp_changes_the_sequence_only(sequence, visible):
    message = protocol.encode_frames(visible)
    stamped = protocol.stamped(message, sequence)
    header = messages.decode_header(stamped)
    assert header.sequence == sequence % 2**32
    assert header.flags == visible
    assert protocol.stamped(stamped, 0) == message


def test_a_pose_of_a_six_axis_arm_is_small():
    message = protocol.encode_pose(np.zeros(6), np.zeros((8, 4, 4)))
    assert len(message) == 16 + 4 * 6 + 48 * 8


@given(st.binary(max_size=40))
def test_foreign_bytes_are_refused_or_a_header(content):
    try:
        assert messages.decode_header(content).type in MessageType
    except ProtocolError:
        assert len(content) < 16 or content[0] not in list(MessageType)


def test_a_message_of_another_kind_is_named():
    with pytest.raises(ProtocolError, match="message type is FRAMES; expected POSE"):
        messages.decode_pose(protocol.encode_frames(True))


@given(st.integers(0, 2**32 - 1))
def test_an_acknowledgement_is_read(sequence):
    assert decode_message(f'{{"type": "shown", "sequence": {sequence}}}') == Shown(sequence)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("{", "not JSON"),
        (b"\xff", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("[1]", "message is list; expected an object"),
        ("NaN", "not JSON"),
        ('{"type": "eval"}', "type is 'eval'; expected 'shown' or 'request'"),
        ('{"type": "shown"}', "sequence is None"),
        ('{"type": "shown", "sequence": true}', "sequence is True"),
        ('{"type": "shown", "sequence": -1}', "sequence is -1"),
        ('{"type": "shown", "sequence": 1.0}', "sequence is 1.0"),
        ('{"type": "request", "name": "x"}', "id is None"),
        ('{"type": "request", "id": 0, "name": "x"}', "id is 0; expected a whole number from 1"),
        ('{"type": "request", "id": 1, "name": 2}', "name is '2'"),
        ('{"type": "request", "id": 1, "name": ""}', "name is ''"),
        (f'{{"type": "request", "id": 1, "name": "{"x" * 41}"}}', "expected the name of a request"),
        ('{"type": "request", "id": 1, "name": "x", "data": [1]}', "data is list"),
        ('{"type": "request", "id": 1, "name": "x", "data": {"q": [NaN]}}', "not JSON"),
        (
            '{"type": "request", "id": 1, "name": "x", "data": {"q": [[[[[[[1]]]]]]]}}',
            "nested 6 levels at most",
        ),
    ],
)
def test_what_is_no_message_is_named(text, complaint):
    with pytest.raises(ProtocolError, match=complaint):
        decode_message(text)


def test_header_is_sixteen_bytes_little_endian():
    assert protocol.stamped(protocol.encode_trace(np.zeros((0, 3))), 7) == struct.pack(
        "<BBHId", 4, 0, 0, 7, 0.0
    )


def test_requests_states_and_samples_come_back():
    text = '{"type": "request", "id": 3, "name": "joints.set", "data": {"q": [0.5, 1]}}'
    assert decode_message(text) == Request(3, "joints.set", {"q": [0.5, 1]})
    assert decode_state(encode_state("arm", {"name": "<b>ä", "n": 2})) == (
        "arm",
        {"name": "<b>ä", "n": 2},
    )
    first = Samples(
        "control", ("t", "e1"), np.arange(6, dtype=np.float32).reshape(3, 2), restart=True
    )
    both = first.followed_by(Samples("control", ("t", "e1"), np.ones((1, 2), np.float32)))
    found = decode_samples(both.encoded())
    assert (found.name, found.columns, found.restart, found.rows.shape) == (
        "control",
        ("t", "e1"),
        True,
        (4, 2),
    )
    assert np.array_equal(found.rows, both.rows)
    many = both.followed_by(
        Samples("control", ("t", "e1"), np.zeros((BOUNDS.sample_numbers, 2), np.float32))
    )
    assert many.rows.size == BOUNDS.sample_numbers
    anew = both.followed_by(Samples("control", ("t", "e1", "e2"), np.zeros((1, 3), np.float32)))
    assert anew.restart and anew.rows.shape == (1, 3)
