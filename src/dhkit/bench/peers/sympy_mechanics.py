"""sympy.physics.mechanics: the equations of motion by its LagrangesMethod, of the same table and bodies."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from dhkit.bench.contenders import import_peer
from dhkit.description import Convention, Description


def lagranges_equations(description: Description) -> Any:
    """Return its ``LagrangesMethod`` with the equations formed; numbers are rationals, rotor inertia is left out.

    Raises
    ------
    UnavailableError
        sympy is not installed.
    """
    sympy = import_peer("sympy")
    mechanics = import_peer("sympy.physics.mechanics")
    numbers = description.numbers
    n = description.n

    def exact(number: float) -> Any:
        fraction = Fraction(repr(float(number)))
        return sympy.Rational(fraction.numerator, fraction.denominator)

    q = mechanics.dynamicsymbols(f"q1:{n + 1}")
    world = mechanics.ReferenceFrame("N")
    origin = mechanics.Point("O")
    origin.set_vel(world, 0)
    frame = world
    point = origin
    bodies = []
    for i in range(n):
        moved = mechanics.ReferenceFrame(f"A{i + 1}")
        end = mechanics.Point(f"P{i + 1}")
        alpha = _angle(sympy, numbers.alpha[i])
        theta = _angle(sympy, numbers.theta[i]) + (0 if numbers.prismatic[i] else q[i])
        d = exact(numbers.d[i]) + (q[i] if numbers.prismatic[i] else 0)
        a = exact(numbers.a[i])
        middle = mechanics.ReferenceFrame(f"B{i + 1}")
        if description.convention is Convention.STANDARD:
            middle.orient_axis(frame, frame.z, theta)
            moved.orient_axis(middle, middle.x, alpha)
            end.set_pos(point, d * frame.z + a * moved.x)
        else:
            middle.orient_axis(frame, frame.x, alpha)
            moved.orient_axis(middle, middle.z, theta)
            end.set_pos(point, a * frame.x + d * moved.z)
        end.set_vel(world, end.pos_from(origin).dt(world))
        com = mechanics.Point(f"C{i + 1}")
        lever = sum(
            (exact(x) * axis for x, axis in zip(numbers.com[i], moved, strict=True)), 0 * moved.x
        )
        com.set_pos(end, lever)
        com.set_vel(world, com.pos_from(origin).dt(world))
        I = numbers.inertia[i]  # noqa: E741 - the field's letter
        tensor = mechanics.inertia(
            moved, *(exact(x) for x in (I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[1, 2], I[0, 2]))
        )
        mass = exact(numbers.mass[i])
        body = mechanics.RigidBody(f"L{i + 1}", com, moved, mass, (tensor, com))
        gravity = sum(
            (exact(x) * axis for x, axis in zip(numbers.gravity, world, strict=True)), 0 * world.x
        )
        body.potential_energy = -mass * com.pos_from(origin).dot(gravity)
        bodies.append(body)
        frame = moved
        point = end
    method = mechanics.LagrangesMethod(mechanics.Lagrangian(world, *bodies), q)
    method.form_lagranges_equations()
    return method


def _angle(sympy: Any, number: float) -> Any:
    """Return an angle as the multiple of pi/12 that it is, or as its decimal."""
    twelfths = round(float(number) * 12 / float(sympy.pi))
    exact = sympy.pi * twelfths / 12
    return (
        exact if abs(float(exact) - float(number)) < 1e-15 else sympy.Rational(repr(float(number)))
    )
