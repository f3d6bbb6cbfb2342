"""Tables in: any order, units, letters, text; and what is not a table."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from dhkit.description import DHTable, from_dh, from_toml, to_toml, world_to_tool
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
        (dict(rows=[(0, 0, None, 0)]), "row 1: a: None is not a number"),
        (dict(rows=[(0, 0, 0, 0)], kinds="RR"), "kinds is 'RR'; expected 1 letters"),
        (dict(rows=[(0, 0, 0, 0)], kinds="X"), "kinds is 'X'"),
        (dict(rows=[(0, 0, 0, 0)], order=("a", "d", "theta", "theta")), "order is"),
        (
            dict(rows=[(0, 0, 0, 0)], convention="craig"),
            "convention is 'craig'; expected one of standard, modified",
        ),
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
        [("pi/3", "l1 + 3*mm", 0, 0.3), (0, 0, 0, 0)],
        kinds="RP",
        parameters={"l1": 1},
        convention="modified",
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


def test_rows_may_name_their_entries_and_write_the_joint_variable():
    """As a table is printed by arm.dh."""
    by_place = from_dh([(0, 0.3, 0, "pi/2"), ("-pi/2", 0, 0.2, 0)], kinds="RP")
    by_name = from_dh(
        [{"theta": "q1", "d": 0.3, "alpha": "pi/2"}, {"theta": "-pi/2", "d": "q2", "a": 0.2}],
        kinds="RP",
    )
    assert by_name == by_place
    offset = from_dh([("q1 + pi/2", 0, 0.5, 0), ("q_2 - 0.1", 0, 0.5, 0)])
    assert offset.numbers.theta == pytest.approx([np.pi / 2, -0.1])
    with pytest.raises(DescriptionError, match="row 1: found 'phi'; expected theta, d, a, alpha"):
        from_dh([{"phi": 0}])
    for entry in ("q2", "2*q1", "q1*2", "sin(q1)"):
        with pytest.raises(DescriptionError, match="row 1: theta"):
            from_dh([(entry, 0, 1, 0)])


def test_a_number_as_text_has_no_unit():
    """243.3 in a table of mm would be 243.3 m as an expression."""
    with pytest.raises(
        DescriptionError,
        match=r"row 1: d: '243.3' is text without a unit; expected the number 243.3",
    ):
        from_dh([(0, "243.3", 0, 0)], length="mm")
    with pytest.raises(DescriptionError, match=r"row 1: alpha: '90' is text .* such as 90\*deg"):
        from_dh([(0, 0, 1, "90")], angle="deg")
    found = from_dh([("0", "243.3*mm", "280*mm", "90*deg")], length="mm", angle="deg")
    assert found.numbers.d[0] == 0.2433 and found.numbers.alpha[0] == np.pi / 2
    assert from_dh([(0, "0.2433", "0", "pi/2")]).numbers.d[0] == 0.2433


@pytest.mark.parametrize("entry", ["486.6/2", "243.3*1", "243.3 + 0", "(243.3)*(1)", "2.433e2"])
def test_numbers_alone_as_text_are_refused_where_numbers_are_in_another_unit(entry):
    with pytest.raises(
        DescriptionError, match=r"row 1: d: .* is text without a unit; .*\*mm; in parentheses"
    ):
        from_dh([(0, entry, 0, 0)], length="mm")
    assert from_dh([(0, f"({entry})", 0, 0)], length="mm").numbers.d[0] == pytest.approx(243.3)
    assert from_dh([(0, entry, 0, 0)]).numbers.d[0] == pytest.approx(243.3)


def test_a_parameter_is_not_called_as_a_joint_variable():
    with pytest.raises(DescriptionError, match="'q1' is taken: joint variables are q1"):
        from_dh([("q1", 0.5, 0, 0)], parameters={"q1": 1.0})


def test_rows_may_come_one_by_one():
    assert from_dh((0, 0.1, 0, 0) for _ in range(2)).n == 2


def test_numbers_without_a_finite_decimal_are_written_as_expressions():
    """0.3 m in inches, and 1 rad in degrees."""
    arm = from_dh([("(1*1)", "(0.3*1)", 1, 0)], length="in", angle="deg")
    text = to_toml(arm)
    assert from_toml(text).numbers.d[0] == 0.3
    plain = replace(arm.joints[0], d=exact(Fraction(3, 10)), theta=exact(1))
    assert from_toml(to_toml(replace(arm, joints=(plain,)))).numbers.d[0] == 0.3
