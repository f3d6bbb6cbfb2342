"""Settings of a run, and the references that it follows."""

import numpy as np
import pytest

from dhkit import Arm
from dhkit.lab.requests import Fields
from dhkit.lab.run_settings import (
    REST_TIME,
    SETTING_NAMES,
    FrictionKind,
    ReferenceKind,
    Settings,
    back_and_forth,
    gentle_sine,
)


def test_settings_change_by_the_fields_of_a_request():
    fields = Fields("control.change", {"friction": "smooth", "payload": 2}, SETTING_NAMES)
    settings = Settings().changed(fields)
    assert settings == Settings(friction=FrictionKind.SMOOTH, payload=2.0)
    assert settings.friction_model is not None and Settings().friction_model is None
    with pytest.raises(ValueError, match="reference is 'backwards'; expected one of hold, sine"):
        settings.changed(Fields("control.change", {"reference": "backwards"}, SETTING_NAMES))
    assert set(ReferenceKind) == {"hold", "sine", "motion", "target", "sliders"}


def test_a_repeated_motion_rests_at_both_ends_and_returns():
    motion = Arm.load("planar2r").quintic([0.0, 0.0], [1.0, -0.5], 2.0)
    period = 2 * (2.0 + REST_TIME)
    for t in (0.3, 1.1):
        there, back, again = (
            back_and_forth(motion, s, [1]) for s in (t, period - REST_TIME - t, t + period)
        )
        assert np.allclose(there[0], again[0], atol=1e-12) and np.allclose(
            there[0], back[0], atol=1e-12
        )
        assert np.allclose(there[1], -back[1], atol=1e-12)
    q, qd, qdd = back_and_forth(motion, 2.0 + REST_TIME / 2, [0, 1])
    assert np.allclose(q, [1.0, -0.5]) and not qd.any() and not qdd.any()


def test_a_sine_begins_at_rest_where_the_arm_is():
    arm = Arm.load("puma560")
    q = np.array(arm.configurations["ready"])
    sine = gentle_sine(arm, q, list(range(6)))
    first_q, first_qd, _ = (rows[0] for rows in sine.sampled(np.zeros(1)))
    assert np.allclose(first_q, q) and np.allclose(first_qd, 0.0, atol=1e-12)
