"""Variants: what a task's table ``[variants]`` lets vary, and the arm that each student gets."""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

from dhkit.description import Convention, Description, Named, with_parameters, with_payload
from dhkit.display import counted, repr_line
from dhkit.errors import AnswerError, DescriptionError
from dhkit.expressions import exact
from dhkit.grading.answers.sheet import CHOICES, VARIANT_KEYS, read_task
from dhkit.grading.answers.sheet_values import AnswerSheet
from dhkit.grading.bounds import BOUNDS
from dhkit.grading.entry_points import robot_of
from dhkit.grading.judging.truth import DYNAMICS, truth_of
from dhkit.grading.variants.conventions import in_convention
from dhkit.grading.variants.ranges import MOST_VALUES, Range, is_generic, step_of
from dhkit.grading.variants.students import student_id

PAYLOAD = "mp"
"""Parameter of the payload's mass, kg."""
USUAL_DIGITS = 2
"""Significant digits of drawn numbers, unless the task says it."""
MOST_DIGITS = 6
_MOST_NUMBER_DIGITS = 15
"""Largest number of digits of a bound or a step: a double has them."""
_MOST_DRAWS = 10_000
"""Draws after which ranges are refused in which nearly all numbers coincide."""
_MOST_COUNTED = 100_000
"""Combinations of numbers up to which the distinct variants are counted."""
_DRAW = "dhkit variants 1"
"""Beginning of what is hashed: another way of drawing has another number."""


@dataclass(frozen=True, repr=False)
class Variant:
    """The arm of one student.

    Attributes
    ----------
    student
        The student's id.
    robot
        Robot of the task: a library name or a file.
    values
        Drawn numbers by parameter, SI units and rad, as they are printed.
    description
        The arm with these numbers, without shapes.
    """

    student: str
    robot: str
    values: Named[str]
    description: Description

    @property
    def numbers(self) -> tuple[str, str, Named[str]]:
        """What distinguishes variants: robot, convention and drawn numbers."""
        return self.robot, self.description.convention.value, self.values

    def __repr__(self) -> str:
        numbers = ", ".join(f"{name} {value}" for name, value in self.values.items())
        convention = self.description.convention.value
        return repr_line("Variant", self.student, f"{self.robot}, {convention} DH, {numbers}")


@dataclass(frozen=True)
class _Sample:
    """An arm whose parameters are drawn.

    Attributes
    ----------
    robot
        Its name in the task.
    description
        The arm with the numbers of its file.
    ranges
        Ranges of the parameters that it has.
    fixed
        Values of parameters that are not drawn and not made of others, SI units and rad.
    """

    robot: str
    description: Description
    ranges: Named[Range]
    fixed: Named[Fraction]

    def is_generic(self, values: Mapping[str, Decimal]) -> bool:
        """Return whether drawn numbers coincide neither with each other nor with the fixed ones."""
        drawn = {name: Fraction(value) for name, value in values.items()}
        return is_generic({**self.fixed, **drawn}, drawn)

    @property
    def combination_count(self) -> int:
        """Number of combinations of the ranges' values, those with coincidences included."""
        return math.prod(map(len, self.ranges.values()))

    def combinations(self) -> Iterator[dict[str, Decimal]]:
        """Yield all combinations of the ranges' values."""
        for values in itertools.product(*self.ranges.values()):
            yield dict(zip(self.ranges, values, strict=True))


@dataclass(frozen=True, repr=False)
class Variants:
    r"""What varies between the students of a task.

    Attributes
    ----------
    task
        The task.
    digest
        SHA-256 of the task's file, hexadecimal.
    samples
        Arms from which a student's is drawn: each robot in each convention.

    Examples
    --------
    >>> from pathlib import Path
    >>> text = 'robot = "planar2r"\n[variants.parameters]\nl1 = [0.3, 0.6]\nm1 = [1.0, 3.0]\n'
    >>> size = Path("task.toml").write_text(text)
    >>> variant = Variants.load("task.toml").of("ada", seed=7)
    >>> dict(variant.values)
    {'l1': '0.36', 'm1': '2.3'}
    >>> variant.description.parameters["l1"].text
    '0.36'
    """

    task: AnswerSheet
    digest: str
    samples: tuple[_Sample, ...] = field(repr=False)

    @classmethod
    def load(cls, path: str | Path) -> Variants:
        """Return the variants of a task file.

        Parameters
        ----------
        path
            Task with a table ``[variants]``.

        Returns
        -------
        Variants
            Its arms and ranges.

        Raises
        ------
        AnswerError
            The file is not a task, or its table ``[variants]`` is missing or wrong; names the key, the value found and
            the value expected.
        DescriptionError
            A robot file describes no robot.
        """
        path = Path(path)
        task = read_task(path)
        if not task.variants:
            raise AnswerError(f"{path}: nothing varies; expected a table [variants]")
        form = _Form(path, task)
        return cls(task, hashlib.sha256(path.read_bytes()).hexdigest(), form.samples())

    def of(self, student: str, seed: int) -> Variant:
        """Return a student's variant, which depends on the task, the seed and the student's id alone.

        Parameters
        ----------
        student
            The student's id.
        seed
            Seed of all students.

        Returns
        -------
        Variant
            The arm, in whose numbers no two coincide.

        Raises
        ------
        AnswerError
            The id could not be a folder's name, or nearly all numbers of the ranges coincide.
        """
        student = student_id(student)
        sample = self.samples[_draw(len(self.samples), seed, student, "arm")]
        for attempt in range(_MOST_DRAWS):
            values = {
                name: numbers[_draw(len(numbers), seed, student, name, str(attempt))]
                for name, numbers in sample.ranges.items()
            }
            if sample.is_generic(values):
                texts = Named({name: format(value, "f") for name, value in values.items()})
                description = with_parameters(
                    sample.description, **{name: exact(value) for name, value in values.items()}
                )
                return Variant(student, sample.robot, texts, description)
        raise AnswerError(
            f"{self.task.file}: variants: {_MOST_DRAWS:,} draws have equal numbers, or sums, products or simple ratios "
            "that coincide; expected wider ranges, or more digits"
        )

    def distinct(self, most: int) -> int:
        """Return the number of distinct variants, counted up to a limit.

        Parameters
        ----------
        most
            Number at which counting ends.

        Returns
        -------
        int
            Number of distinct variants, or ``most`` if there are as many or more; ranges of more than 100,000
            combinations are taken to have as many.
        """
        if sum(sample.combination_count for sample in self.samples) > _MOST_COUNTED:
            return most
        found = 0
        for sample in self.samples:
            for values in sample.combinations():
                found += sample.is_generic(values)
                if found >= most:
                    return most
        return found

    def sizes(self) -> dict[str, int]:
        """Return the size of the answer for each arm, by robot and convention: terms of the quantities asked for.

        Parameters stay letters, so the size depends on the arm and not on the drawn numbers.

        Returns
        -------
        dict[str, int]
            Number of terms of all entries together, without tables and inverse kinematics.
        """
        sizes = {}
        for sample in self.samples:
            description = sample.description
            has_bodies = all(joint.bodies for joint in description.joints)
            asked = self.task.task.asked or (("M", "h", "g") if has_bodies else ("T", "J"))
            truth = truth_of(
                description,
                absolute=self.task.names.absolute,
                friction=self.task.task.friction,
            )
            terms = 0
            for quantity in asked:
                if quantity in ("dh", "ik") or (quantity in DYNAMICS and not has_bodies):
                    continue
                terms += sum(len(element.terms) for element in truth.of(quantity).flat)
            sizes[f"{sample.robot}, {description.convention.value} DH"] = terms
        return sizes

    def __repr__(self) -> str:
        names = dict.fromkeys(name for sample in self.samples for name in sample.ranges)
        drawn = ", ".join(names) or "nothing"
        return repr_line(
            "Variants", self.task.file, f"{counted(len(self.samples), 'arm')}, {drawn} drawn"
        )


def _draw(count: int, seed: int, *parts: str) -> int:
    """Return a number below ``count`` that the seed and texts determine, on every system and in every order."""
    text = "\0".join([_DRAW, str(seed), *parts])
    return int.from_bytes(hashlib.sha256(text.encode()).digest(), "big") % count


class _Form:
    """Reads a task's table ``[variants]``; messages begin with the file and the key."""

    def __init__(self, path: Path, task: AnswerSheet) -> None:
        self.path = path
        self.task = task
        self.table = task.variants
        for key in self.table:
            if key not in VARIANT_KEYS:
                raise AnswerError(
                    f"{path}: unknown key {f'variants.{key}'[:60]!r}; expected {', '.join(VARIANT_KEYS)}"
                )

    def samples(self) -> tuple[_Sample, ...]:
        """Return the arms: each robot in each convention, with the payload's mass as a parameter."""
        robots = self._texts("robots", (self.task.robot,), 'robots such as ["planar2r"]')
        conventions = self._texts(
            "conventions", ("",), " or ".join(map(repr, CHOICES["convention"]))
        )
        for convention in conventions:
            if convention and convention not in CHOICES["convention"]:
                raise self._error("conventions", convention, "standard, modified")
        digits = self.table.get("digits", USUAL_DIGITS)
        if type(digits) is not int or not 1 <= digits <= MOST_DIGITS:
            raise self._error("digits", digits, f"a whole number from 1 to {MOST_DIGITS}")
        ranges = self._ranges(digits)
        arms = {robot: self._arm(robot) for robot in robots}
        if not ranges and len(arms) == len(conventions) == 1:
            raise AnswerError(
                f"{self.path}: variants: nothing varies; expected {', '.join(VARIANT_KEYS[:-1])}"
            )
        self._require_parameters(ranges, arms)

        samples = []
        for robot, arm in arms.items():
            for convention in conventions:
                chosen = Convention(convention) if convention else arm.convention
                samples.append(self._sample(robot, in_convention(arm, chosen), ranges))
        return tuple(samples)

    def _arm(self, robot: str) -> Description:
        """Return a robot of the task, with the payload's mass as a parameter if a payload varies."""
        arm = robot_of(replace(self.task, robot=robot), self.path.parent)
        if "payload" not in self.table:
            return arm
        if PAYLOAD in arm.parameters:
            raise self._error(
                "payload",
                f"a parameter {PAYLOAD} of {robot}",
                f"its range as variants.parameters.{PAYLOAD}",
            )
        parameters = Named({**arm.parameters, PAYLOAD: exact(1)})
        try:
            return with_payload(replace(arm, parameters=parameters), PAYLOAD)
        except DescriptionError as error:
            raise AnswerError(f"{self.path}: variants.payload: {robot}: {error}") from None

    def _sample(self, robot: str, arm: Description, ranges: Mapping[str, Range]) -> _Sample:
        own = Named({name: numbers for name, numbers in ranges.items() if name in arm.parameters})
        fixed = {
            name: value.rational
            for name, value in arm.parameters.items()
            if name not in own and value.rational is not None
        }
        for name, numbers in own.items():
            for number in (numbers[0], numbers[len(numbers) - 1]):
                try:
                    with_parameters(arm, **{name: exact(number)})
                except DescriptionError as error:
                    raise AnswerError(
                        f"{self.path}: variants: {robot} with {name} = {number:f}: {error}"
                    ) from None
        return _Sample(robot, arm, own, Named(fixed))

    def _ranges(self, digits: int) -> dict[str, Range]:
        """Return the ranges of the parameters and of the payload's mass, by parameter."""
        table = self.table.get("parameters", {})
        if not isinstance(table, Mapping):
            raise self._error("parameters", table, "a table such as { l1 = [0.3, 0.6] }")
        if len(table) > BOUNDS.varied_parameters:
            raise self._error(
                "parameters", counted(len(table), "name"), f"at most {BOUNDS.varied_parameters}"
            )
        ranges = {
            name: self._range(f"parameters.{name[:40]}", value, digits)
            for name, value in table.items()
        }
        if "payload" in self.table:
            mass = self._range("payload", self.table["payload"], digits)
            if PAYLOAD in ranges or mass[0] <= 0:
                raise self._error("payload", self.table["payload"], "masses above 0, kg, once")
            ranges[PAYLOAD] = mass
        return ranges

    def _range(self, key: str, value: object, digits: int) -> Range:
        expected = "[lowest, highest] or [lowest, highest, step], numbers of at most 15 digits"
        if not isinstance(value, list) or len(value) not in (2, 3):
            raise self._error(key, value, expected)
        numbers = []
        for entry in value:
            if isinstance(entry, bool) or not isinstance(entry, int | Decimal):
                raise self._error(key, value, expected)
            number = Decimal(entry)
            if (
                not number.is_finite()
                or len(number.as_tuple().digits) > _MOST_NUMBER_DIGITS
                or (number and abs(number.adjusted()) > _MOST_NUMBER_DIGITS)
            ):
                raise self._error(key, value, expected)
            numbers.append(number)
        low, high, *rest = numbers
        if low > high:
            raise self._error(key, value, "the lowest number first: the range is empty")
        if low == high == 0:
            raise self._error(key, value, "numbers other than 0")
        step = rest[0] if rest else step_of(low, high, digits)
        if step <= 0 or (high - low) / step > MOST_VALUES:
            raise self._error(key, value, f"a step above 0 with at most {MOST_VALUES:,} values")
        found = Range(low, high, step)
        if len(found) < 2:
            raise self._error(
                key, value, f"at least 2 values; there is {len(found)} at a step of {step:f}"
            )
        return found

    def _require_parameters(
        self, ranges: Mapping[str, Range], arms: Mapping[str, Description]
    ) -> None:
        """Refuse ranges of parameters that no arm has, or that an arm makes of others."""
        for name in ranges:
            having = [arm for arm in arms.values() if name in arm.parameters]
            if not having:
                known = dict.fromkeys(known for arm in arms.values() for known in arm.parameters)
                raise AnswerError(
                    f"{self.path}: variants.parameters: {', '.join(arms)} has no parameter {name[:40]!r}; "
                    f"it has {', '.join(known) or 'none'}"
                )
            for arm in having:
                if arm.parameters[name].rational is None:
                    raise AnswerError(
                        f"{self.path}: variants.parameters: {arm.name} makes {name} of others, "
                        f"{arm.parameters[name].text[:60]}; expected a range of these"
                    )

    def _texts(self, key: str, usual: Sequence[str], expected: str) -> tuple[str, ...]:
        """Return a list of different texts."""
        value = self.table.get(key, list(usual))
        if (
            not isinstance(value, list)
            or not 1 <= len(value) <= BOUNDS.varied_parameters
            or not all(isinstance(entry, str) for entry in value)
        ):
            raise self._error(key, value, f"a list of {expected}")
        if len(set(value)) < len(value):
            raise self._error(key, value, "each one once")
        return tuple(value)

    def _error(self, key: str, value: object, expected: str) -> AnswerError:
        text = value if isinstance(value, str) else _shown(value)
        short = text if len(text) <= 60 else f"{text[:57]}..."
        return AnswerError(f"{self.path}: variants.{key}: found {short}; expected {expected}")


def _shown(value: object) -> str:
    """Return a value of a table as it was typed, nearly."""
    if isinstance(value, list):
        return f"[{', '.join(map(_shown, value))}]"
    if isinstance(value, Mapping):
        return "a table"
    return str(value) if isinstance(value, Decimal) else repr(value)
