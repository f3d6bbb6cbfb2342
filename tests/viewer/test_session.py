"""Laws of a session: a page ends with the latest of everything, and has one picture to draw at a time."""

from hypothesis import given, strategies as st

from dhkit.viewer.bounds import BOUNDS
from dhkit.viewer.session import OF_ONE_ARM, Session, Slot

PANELS = [Slot.PANELS + k for k in range(20)]
SLOTS = [*(slot for slot in Slot if slot < Slot.PANELS), *PANELS]
offers = st.lists(
    st.one_of(st.sampled_from(SLOTS), st.sampled_from(["picture shown", "panel shown"])),
    max_size=40,
)


@given(offers, st.sets(st.sampled_from(SLOTS)))
def test_the_latest_wins_and_few_are_under_way(steps, replayed):
    latest = {slot: (k, b"old %d" % k) for k, slot in enumerate(sorted(replayed), start=1)}
    session = Session(latest)
    sent = {message: (slot, sequence) for slot, (sequence, message) in latest.items()}
    page, under_way = {}, {"picture shown": [], "panel shown": []}

    def pump():
        while (message := session.next()) is not None:
            slot, sequence = sent[message]
            lane = under_way["panel shown" if slot in PANELS else "picture shown"]
            lane.append(sequence)
            assert len(lane) <= (BOUNDS.panel_messages if slot in PANELS else 1)
            if slot == Slot.SCENE:
                for other in OF_ONE_ARM:
                    page.pop(other, None)
            page[slot] = message

    pump()
    for sequence, step in enumerate(steps, start=100):
        if isinstance(step, str):
            session.acknowledge(under_way[step].pop(0) if under_way[step] else 0)
        else:
            message = b"%d" % sequence
            if step == Slot.SCENE:
                for slot in OF_ONE_ARM:
                    latest.pop(slot, None)
            latest[step], sent[message] = (sequence, message), (step, sequence)
            session.offer(step, sequence, message)
        pump()
    while any(under_way.values()):
        for lane in under_way.values():
            session.acknowledge(lane.pop(0) if lane else 0)
        pump()
    assert session.settled
    assert page == {slot: message for slot, (_, message) in latest.items()}


def test_a_new_page_gets_the_scene_first():
    session = Session(
        {Slot.MOTION: (1, b"pose"), Slot.SCENE: (2, b"scene"), Slot.FRAMES: (3, b"frames")}
    )
    order = []
    while (message := session.next()) is not None:
        order.append(message)
        session.acknowledge({b"pose": 1, b"scene": 2, b"frames": 3}[message])
    assert order == [b"scene", b"frames", b"pose"]


def test_an_acknowledgement_of_something_else_frees_nothing():
    session = Session({Slot.SCENE: (5, b"scene"), Slot.MOTION: (6, b"pose")})
    assert session.next() == b"scene"
    session.acknowledge(6)
    assert session.next() is None
