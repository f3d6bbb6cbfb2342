"""Numbers on the command line: expressions with units in every option that takes a number, and never executed."""

import json
from importlib import import_module
from typing import get_type_hints

import pytest

from dhkit import Arm
from dhkit.cli import main
from dhkit.cli.app import COMMANDS, load_command
from dhkit.cli.arguments import joint_limits, target
from dhkit.cli.quantities import quantity, with_plain_numbers
from dhkit.errors import DescriptionError, ExpressionError


def options_of_numbers():
    """Yield each command with its function and its options that take a number."""
    for name, module in COMMANDS.items():
        command = load_command(name)
        function = getattr(import_module(f"dhkit.cli.{module}"), name.replace("-", "_"))
        hints = get_type_hints(function)
        for parameter in command.params:
            if hints.get(parameter.name) in (float, float | None):
                yield pytest.param(
                    command, function, parameter.opts[0], id=f"{name} {parameter.opts[0]}"
                )


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("20*mm", 0.02),
        ("0.02", 0.02),
        ("2*cm", 0.02),
        ("0.02*m", 0.02),
        ("1e-2", 0.01),
        ("180*deg", 3.141592653589793),
        ("pi/2", 1.5707963267948966),
        ("500*ms", 0.5),
        ("2*s", 2.0),
        ("1/3*rad", 1 / 3),
    ],
)
def test_a_number_with_a_unit(text, value):
    assert quantity(text) == value


@pytest.mark.parametrize("text", ["__import__('os')", "print(1)", "2 ** 10 ** 10", "km", "", "1;2"])
def test_what_is_not_an_expression_is_refused(text):
    with pytest.raises(ExpressionError):
        quantity(text)


@pytest.mark.parametrize(("command", "function", "option"), list(options_of_numbers()))
def test_every_option_that_takes_a_number_takes_an_expression(command, function, option):
    def plain(*words):
        return with_plain_numbers(command, function, words)

    assert plain(option, "20*mm") == [option, "0.02"]
    assert plain(f"{option}=20*mm") == [f"{option}=0.02"]
    assert plain("x", option, "-1e-3", "--json") == ["x", option, "-1e-3", "--json"]
    assert plain("--", option, "20*mm") == ["--", option, "20*mm"]
    assert plain(option) == [option]
    with pytest.raises(DescriptionError, match=f"^{option}: unknown name 'km'"):
        plain(option, "2*km")


def test_a_command_reads_units(tmp_path, capsys):
    def planned(*options):
        with pytest.raises(SystemExit) as ended:
            main(["plan", "planar2r", "--to", "1", "1", "--intervals", "8", "--json", *options])
        return ended.value.code, *capsys.readouterr()

    ball = ("--sphere", "5*cm", "@", "3", "0", "0")
    code, out, _ = planned("--clearance", "20*mm", "--duration", "1500*ms", *ball)
    assert code == 0
    facts = json.loads(out)
    assert facts["clearance_m"] == 0.02
    assert facts["duration_s"] == pytest.approx(1.5, rel=1e-2)
    code, _, err = planned("--clearance", "2*km")
    assert (code, err.count("\n")) == (2, 1)
    assert err.startswith("dhkit: --clearance: unknown name 'km'")
    code, _, err = planned("--clearance", "-20*mm")
    assert code == 2
    assert "greater than or equal to 0" in err or "x>=0" in err


def test_degrees_are_not_converted_twice():
    """With --degrees an angle that has a unit of its own is refused by every option of angles."""
    arm = Arm.load("planar2r")
    with pytest.raises(
        DescriptionError, match=r"--velocity: found '90\*deg'; expected bare numbers"
    ):
        joint_limits(arm, {"velocity": "90*deg"}, degrees=True, speed=1.0)
    options = {"xyz": "0 0 0", "order": "XYZ", "matrix": None, "like": None}
    with pytest.raises(DescriptionError, match="--euler: found 'pi/2'; expected bare numbers"):
        target(arm, **options, euler="pi/2 0 0", degrees=True)
    assert joint_limits(arm, {"torque": "2*pi"}, degrees=True, speed=1.0).torque[0] > 6
