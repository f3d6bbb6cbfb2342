"""The names that belong to a robot in a program: its parameters, its joint variables, and vectors of them."""

from __future__ import annotations

import re
from itertools import chain

from dhkit.description import Description
from dhkit.grading.answers.programs.values import Given, Matrix, Scalar, UnreadError, Value
from dhkit.grading.answers.quantity_names import QuantityNames
from dhkit.grading.answers.sheet_values import NO_NAMES, Names
from dhkit.grading.answers.vocabulary import Meaning, plain_name

_JOINT_VARIABLE = re.compile(
    r"(?:dd|DD|ddot|dot|d2|d|D)?(?:q|th|theta|Theta|vartheta)(?:dd|d|ddot|dot|pp|p)?\d*\w*",
    re.ASCII,
)
"""Spellings of joint variables that nobody uses for anything else; x2 or t1 may be a student's own name."""

NUMBER_TOLERANCE = 1e-12
"""Relative difference up to which two numbers are one: 0.1 + 0.2 and 0.3 differ by 1e-16 as doubles."""


def is_same_number(value: float | None, number: float | None) -> bool:
    """Whether a number in a program is a parameter's value, up to :data:`NUMBER_TOLERANCE`; None is not a number."""
    return (
        value is not None
        and number is not None
        and abs(value - number) <= NUMBER_TOLERANCE * abs(value)
    )


class RobotNames:
    """Meanings of names on a robot before a program binds them.

    Parameters
    ----------
    description
        The robot.
    names
        The task's names of the joint variables.
    """

    def __init__(self, description: Description, names: Names = NO_NAMES) -> None:
        self.quantities = QuantityNames(description, names)
        self.vocabulary = self.quantities.vocabulary
        self.values = description.numbers.values
        self.n = description.n

    def find(self, name: str) -> Meaning | None:
        """Return the tokens that a name stands for in the notation."""
        return self.vocabulary.find(plain_name(name))

    def is_reserved(self, name: str) -> bool:
        """Whether a name belongs to the robot: a parameter, a joint variable in a usual spelling, pi."""
        plain = plain_name(name)
        is_joint = _JOINT_VARIABLE.fullmatch(plain) is not None or plain in self.vocabulary.own
        is_state = is_joint and (self.vocabulary.is_state(plain) or self.is_vector(plain))
        return plain == "pi" or self.quantities.is_parameter(name) or is_state

    def is_free_for_scalars(self, name: str) -> bool:
        """Whether a program may give a number this name of a vector: theta = q(1), where the notation has theta1."""
        return self.is_vector(name) and not self.vocabulary.knows(name)

    def is_vector(self, name: str) -> bool:
        """Whether the notation takes a name for the vector of the joint variables or of their rates."""
        return self.vocabulary.is_state(plain_name(name) + "1")

    def has_entry(self, name: str, place: int) -> bool:
        """Whether the notation has a name for the entry at a place, from 0, of a vector: q(1) is q1, m(2) is m2."""
        return self.vocabulary.knows(f"{plain_name(name)}{place + 1}")

    def is_same(self, name: str, other: str) -> bool:
        """Whether two names mean the same."""
        meaning = self.find(other)
        return plain_name(name) == plain_name(other) or (
            meaning is not None and self.find(name) == meaning
        )

    def parameter_value(self, name: str) -> float | None:
        """Return the value that the robot's file gives the parameter of this name."""
        return self.values.get(self.quantities.parameters[plain_name(name)])

    def parameter_of_field(self, field: str) -> str | None:
        """Return the parameter that a field of a structure stands for, such as p.m2; None of another field."""
        parameters = self.quantities.parameters
        cleaned = {re.sub(r"\W", "_", name, flags=re.ASCII): name for name in parameters.values()}
        return parameters.get(plain_name(field)) or cleaned.get(field)

    def keeps_meaning(self, name: str, value: Value) -> bool:
        """Whether a name of the robot means the same where it is bound to a value.

        Raises
        ------
        UnreadError
            A parameter is set to a number that is not the one in the robot's file.
        """
        match value:
            case Given(other):
                return self.is_same(name, other)
            case Scalar() if value.is_name and self.is_same(name, value.text):
                return True
            case Scalar() if self.quantities.is_parameter(name) and value.number is not None:
                file_value = self.parameter_value(name)
                if not is_same_number(file_value, value.number):
                    raise UnreadError(
                        f"{name} is set to {value.text[:40]}; the robot's file has {file_value}"
                    )
                return True
            case Matrix() if self.is_vector(name):
                entries = list(chain.from_iterable(value.rows))
                vector = plain_name(name)
                return len(entries) == self.n and all(
                    entry.is_name and self.is_same(f"{vector}{k}", entry.text)
                    for k, entry in enumerate(entries, 1)
                )
        return False
