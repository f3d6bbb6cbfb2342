"""Tables in: any order, units, letters, text; and what is no table."""

import numpy as np
import pytest

from dhkit.description import DHTable, from_dh, world_to_tool
from dhkit.errors import DescriptionError
from dhkit.expressions import PI, exact


def test_columns_come_in_any_order():
    one = from_dh([(0.1, 0.3, 0.2, "pi/2")])
    other = from_dh([("pi/2", 0.2, 0.1, 0.3)], order=("alpha", "a", "theta", "d"))
    assert one == other
    assert one.joints[0].alpha == PI / 2


def test_units_of_bare_numbers():
    inches = from_dh([(90, 17, 2.5, -90)], angle="deg", length="in")
    assert inches.joints[0].d == exact(0.4318)
    assert inches == from_dh([("pi/2", 431.8, 63.5, "-90*deg")], length="mm")
    assert inches == from_dh([(np.pi / 2, 0.4318, 0.0635, -np.pi / 2)])


def test_arrays_and_letters():
    arm = from_dh(np.array([[0, 0.3, 0, np.pi / 2], [0, 0, 0.5, 0]]), kinds="rp")
    assert [joint.is_revolute for joint in arm.joints] == [True, False]
    assert arm.joints[0].alpha == PI / 2
    assert world_to_tool(arm, [0, 0.2]).shape == (4, 4)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (dict(rows=[]), "0 joints; expected 1 to 32"),
        (dict(rows=[(0, 0, 0)]), "row 1: found .*; expected theta, d, a, alpha"),
        (dict(rows=["0000"]), "row 1"),
        (dict(rows=[(0, 0, 0, 0)] * 33), "33 joints"),
        (dict(rows=[(0, np.nan, 0, 0)]), "row 1: d: nan is not finite"),
        (dict(rows=[(0, 0, 0, 0), (0, 0, np.inf, 0)]), "row 2: a: inf is not finite"),
        (dict(rows=[(0, 0, "l1", 0)]), "row 1: a: unknown name 'l1'"),
        (dict(rows=[(0, 0, None, 0)]), "row 1: a: None is no number"),
        (dict(rows=[(0, 0, 0, 0)], kinds="RR"), "kinds is 'RR'; expected 1 letters"),
        (dict(rows=[(0, 0, 0, 0)], kinds="X"), "kinds is 'X'"),
        (dict(rows=[(0, 0, 0, 0)], order=("a", "d", "theta", "theta")), "order is"),
        (dict(rows=[(0, 0, 0, 0)], convention="craig"), "convention is 'craig'; expected one of standard, modified"),
        (dict(rows=[(0, 0, 0, 0)], angle="grad"), "angle is 'grad'"),
        (dict(rows=[(0, 0, 0, 0)], length="ft"), "length is 'ft'"),
        (dict(rows=[(0, 0, 0, 0)], name="a/b"), "name: found 'a/b'"),
    ],
)
def test_what_is_no_table_is_said(arguments, complaint):
    with pytest.raises(DescriptionError, match=complaint):
        from_dh(**arguments)


def test_a_table_of_symbols_prints_symbols():
    arm = from_dh(
        [("pi/3", "l1 + 3*mm", 0, 0.3), (0, 0, 0, 0)], kinds="RP", parameters={"l1": 1}, convention="modified"
    )
    text = str(DHTable.of(arm))
    assert "q1 + 60°" in text
    assert "l1 + 3*mm" in text
    assert "0.3 rad" in text
    assert "modified" in text
    assert "a₋₁" in text
    latex = DHTable.of(arm).latex()
    assert r"60^\circ" in latex
    assert "°" not in latex
