"""Laws of a session: a page ends with the latest of everything, and never has two messages to draw."""

from hypothesis import given
from hypothesis import strategies as st

from dhkit.viewer.session import Session, Slot

offers = st.lists(st.one_of(st.sampled_from(Slot), st.just("shown")), max_size=40)


@given(offers, st.sets(st.sampled_from(Slot)))
def test_the_latest_wins_and_one_is_under_way(steps, replayed):
    latest = {slot: (k, b"old %d" % slot) for k, slot in enumerate(sorted(replayed), start=1)}
    session = Session(latest)
    page, under_way, sequence = {}, None, 100
    names = {message: slot for slot, (_, message) in latest.items()}

    def pump():
        nonlocal under_way
        message = session.next()
        if message is not None:
            assert under_way is None
            slot = names[message]
            under_way = latest_sequences[message]
            page[slot] = message

    latest_sequences = {message: k for k, message in latest.values()}
    pump()
    for step in steps:
        if step == "shown":
            session.shown(under_way if under_way is not None else 0)
            under_way = None
        else:
            sequence += 1
            message = b"%d" % sequence
            latest[step], names[message], latest_sequences[message] = (sequence, message), step, sequence
            session.offer(step, sequence, message)
        pump()
    while under_way is not None:
        session.shown(under_way)
        under_way = None
        pump()
    assert session.settled
    assert page == {slot: message for slot, (_, message) in latest.items()}


def test_a_new_page_gets_the_scene_first():
    session = Session({Slot.MOTION: (1, b"pose"), Slot.SCENE: (2, b"scene"), Slot.FRAMES: (3, b"frames")})
    order = []
    while (message := session.next()) is not None:
        order.append(message)
        session.shown({b"pose": 1, b"scene": 2, b"frames": 3}[message])
    assert order == [b"scene", b"frames", b"pose"]


def test_an_acknowledgement_of_something_else_frees_nothing():
    session = Session({Slot.SCENE: (5, b"scene"), Slot.MOTION: (6, b"pose")})
    assert session.next() == b"scene"
    session.shown(6)
    assert session.next() is None
