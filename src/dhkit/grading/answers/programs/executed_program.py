"""Programs that are executed in a process of their own: what their names are, and what their functions return."""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np

from dhkit.description import Array, Description
from dhkit.errors import AnswerError
from dhkit.execution.child import Child
from dhkit.execution.isolation import Isolation
from dhkit.execution.process import Failure, Limits, ProgramError, printable
from dhkit.grading.answers.bounds import BOUNDS
from dhkit.grading.answers.programs.program_answers import answers_of, called_name
from dhkit.grading.answers.programs.robot_names import RobotNames, is_same_number
from dhkit.grading.answers.programs.scope import Binding, Record, Scope
from dhkit.grading.answers.programs.values import (
    Function,
    Index,
    Level,
    Matrix,
    Scalar,
    Several,
    Structure,
    Unread,
    UnreadError,
    Value,
    number,
)
from dhkit.grading.answers.sampled import SampledAnswer
from dhkit.grading.answers.sheet_values import NO_NAMES, AnswerSheet, Entries, Names, Refusal
from dhkit.grading.answers.source_code import SourceCode
from dhkit.grading.answers.vocabulary import plain_name

RUNNERS = {".py": "answers_runner.py", ".m": "answers_runner.m"}
_LIMITS = Limits(seconds=20.0, memory=2 << 30)
"""Limits of one request: derivations by Lagrange in sympy take seconds."""
_SAMPLING_TIME = 60.0
"""Processor time for calling a function at all states, s."""
_SAME_VALUES = 1e-9
"""Relative and absolute difference up to which two functions give the same numbers."""
_KINDS = ("numpy", "sympy", "casadi")
"""Libraries that make the symbols, in the order in which they are tried."""
_PARAMETER_SETS = frozenset(
    ("p", "par", "params", "param", "parameters", "robot", "P", "prm", "constants")
)
"""Names of an argument with the robot's parameters as fields."""
_STATES = frozenset(("x", "y", "s", "state", "z", "X", "Y"))
"""Names of an argument with the joint variables and their rates, in the order that the task gives."""
_TORQUES = frozenset(("tau", "u", "U", "torque", "torques", "F", "Q"))
"""Names of an argument with the motors' torques, on which no quantity depends."""
_NUMBER = re.compile(r"-?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?", re.ASCII)


@contextmanager
def executed_answers(
    path: Path,
    code: SourceCode,
    description: Description,
    names: Names = NO_NAMES,
    *,
    isolation: Isolation,
) -> Iterator[AnswerSheet]:
    """Execute a program, and yield its answers; its process ends with the context.

    Parameters
    ----------
    path
        The file, as messages name it.
    code
        The program.
    description
        The robot.
    names
        The task's names of the joint variables and of a state.
    isolation
        Isolation of the program: files and resources that it can use.

    Yields
    ------
    AnswerSheet
        Answers as text, and as :class:`SampledAnswer` where a function cannot be called with symbols.

    Raises
    ------
    AnswerError
        The program cannot be executed, or gives no answer.
    """
    if code.suffix not in RUNNERS:
        raise AnswerError(
            f"{path}: {code.suffix} files are not executed; expected {', '.join(RUNNERS)} or .ipynb"
        )
    if code.suffix == ".m":
        code = _functions_first(code)
    name = (
        re.sub(r"\W", "_", path.stem, flags=re.ASCII)[: BOUNDS.file_name_characters] + code.suffix
    )
    with tempfile.TemporaryDirectory(prefix="dhkit-answers-") as folder:
        source = Path(folder) / name
        source.write_text(code.text, "utf-8")
        child = Child(source, RUNNERS, _LIMITS, isolation)
        try:
            program = _ExecutedProgram(
                child,
                Record(RobotNames(description, names), "**"),
                str(path),
                code.line_name,
                names,
            )
            yield program.sheet()
        finally:
            child.close()


def _functions_first(code: SourceCode) -> SourceCode:
    """Return a MATLAB file as a script with its functions in front: Octave knows them only after their definitions."""
    # A file begins in a new process; clear would take the runner's own names away.
    lines = [
        re.sub(r"^\s*(?:clear|clearvars|clc|close)\b[^=(\n]*$", "", line)
        for line in code.text.split("\n")
    ]
    starts = [k for k, line in enumerate(lines) if re.match(r"\s*function\b", line)]
    if not starts:
        return replace(code, text="\n".join(lines))
    order = [*range(starts[0], len(lines)), *range(starts[0])]

    def line_name(line_number: int) -> str:
        """Return the name of a line that has moved; one more stands in front."""
        return code.line_name(order[min(max(line_number - 2, 0), len(order) - 1)] + 1)

    return replace(code, text="\n".join(["1;", *(lines[k] for k in order)]), line_name=line_name)


class _ExecutedProgram:
    """An executed program, with its names and functions as the readers of programs have them.

    Parameters
    ----------
    child
        Its process.
    record
        What is known of the program.
    file
        Beginning of messages.
    line_name
        How messages name a line, which counts from 1.
    names
        The task's names.

    Raises
    ------
    AnswerError
        It cannot be executed.
    """

    def __init__(
        self, child: Child, record: Record, file: str, line_name: Callable[[int], str], names: Names
    ) -> None:
        self.child = child
        self.record = record
        self.file = file
        self.line_name = line_name
        self.state = names.state
        self.main = Scope(record)
        self.definitions: dict[str, str] = {}
        self._ended = ""
        """Why no function is called with symbols any more."""
        self.problems: list[str] = []
        """Why functions are not called."""
        self.numeric: list[Function] = []
        """Functions that fail with symbols."""
        try:
            first = child.start()
        except ProgramError as error:
            hint = (
                "; Octave needs its symbolic package (octave-symbolic)"
                if "'syms' undefined" in str(error)
                else ""
            )
            raise AnswerError(f"{file}: executed: {self.error_text(error)}{hint}") from None
        record.note(f"executed, {child.isolation}")
        self._lines = {name: _whole(number) for name, number in _fields(first.get("names"))}
        self.functions = [_function(one, self._line) for one in _listed(first.get("functions"))]
        self._bind_names()
        for function in self.functions:
            self.main.set_argument(function.name, function, function.where)

    def error_text(self, error: ProgramError) -> str:
        """Return an error with the line as messages name it."""
        if error.line is None:
            return str(error)
        return f"{self.line_name(error.line)}: {str(error).removeprefix(f'line {error.line}: ')}"

    def _line(self, number: int) -> str:
        return self.line_name(number) if number else "the program"

    # Names

    def _bind_names(self) -> None:
        """Bind the names that may be answers, and refuse all where a joint variable is a number."""
        robot = self.record.robot
        problem = ""
        for name, line_number in self._lines.items():
            where = self._line(line_number)
            is_quantity = bool(robot.quantities.quantity(name) or robot.quantities.entries(name))
            if not is_quantity and not robot.is_reserved(name):
                continue
            value = self._value_of(name)
            if (
                robot.is_reserved(name)
                and isinstance(value, Scalar)
                and _is_constant(value)
                and name != "pi"
            ):
                problem = problem or self._problem_of_number(name, value, where)
            if is_quantity:
                self.main.set_argument(name, value, where)
        if problem:
            for name, binding in list(self.main.names.items()):
                if not isinstance(binding.value, Unread):
                    self.main.names[name] = Binding(Unread(problem), Unread(problem), binding.where)

    def _problem_of_number(self, name: str, value: Scalar, where: str) -> str:
        """Return why answers that are made with a number are not judged; empty for the file's own number."""
        robot = self.record.robot
        if not robot.quantities.is_parameter(name):
            return f"{where}: {name} = {value.text}: the answers are at one state alone; leave {name} a symbol"
        if is_same_number(robot.parameter_value(name), value.number):
            return ""
        return f"{where}: {name} = {value.text}; the robot's file has {robot.parameter_value(name)}"

    def _value_of(self, name: str) -> Value:
        try:
            answer = self.child.ask({"value": name})
        except ProgramError as error:
            return Unread(self.error_text(error))
        return self._value(answer.get("tree"), answer)

    def _value(self, tree: object, answer: Mapping[str, object]) -> Value:
        """Return a tree of text as a value; what CasADi's formulas have in common becomes definitions."""
        renamed = {}
        for name, text in _fields(answer.get("definitions")):
            renamed[name] = f"casadi{len(self.definitions) + 1}"
            self.definitions[renamed[name]] = _renamed(str(text), renamed)
        return _value_of_tree(tree, renamed)

    # Functions

    def arguments_as_given(self, function: Function) -> dict[str, Value]:
        """Return nothing: a function is called with symbols by its process."""
        return {}

    def applied(self, function: Function, arguments: dict[str, Value]) -> tuple[Value, Scope]:
        """Return a function's result when it is called with symbols, and its local names.

        Raises
        ------
        UnreadError
            An argument is not known, or it fails with all kinds of symbols.
        """
        if not self._may_answer(function):
            raise UnreadError(f"{function.name}(...) has no quantity in it")
        meaning = {name: self.symbols(name, function) for name in function.parameters}
        problem = self._ended
        for kind in _KINDS if self.child.name.endswith(".py") and not self._ended else ():
            try:
                answer = self.child.ask(
                    {
                        "call": function.name,
                        "arguments": meaning,
                        "as": kind,
                        "locals": self._local_names(function),
                    }
                )
            except ProgramError as error:
                problem = problem or self.error_text(error)
                # It hangs, or has ended: nothing else is called with symbols.
                if error.failure is not Failure.RAISED:
                    self._ended = f"after {function.name}: {problem}"
                    raise UnreadError(f"{function.name}(...): {problem}") from None
                continue
            value = self._value(answer.get("tree"), answer)
            if isinstance(value, Unread):
                problem = problem or value.reason
                continue
            scope = Scope(self.record, self.main, frozenset(function.definition))
            for name, tree in _fields(answer.get("locals")):
                scope.set_argument(name, self._value(tree, answer), function.where)
            self._refuse_changed(function, value, scope)
            return self._with_names(value, scope), scope
        self.numeric.append(function)
        raise UnreadError(f"{function.name}(...) is not computed with symbols: {problem}")

    def _may_answer(self, function: Function) -> bool:
        """Whether a function's name, a local name or a key in it is that of a quantity: others are not called."""
        quantities = self.record.robot.quantities
        names = (called_name(function), *function.definition, *function.captured)
        return any(quantities.quantity(name) or quantities.entries(name) for name in names)

    def _refuse_changed(self, function: Function, value: Value, scope: Scope) -> None:
        """Refuse a function's only local quantity where it returns something else of the same shape."""
        quantities = self.record.robot.quantities
        own = [name for name in scope.names if name in self.local_quantities(function)]
        if len(own) != 1 or quantities.quantity(called_name(function)):
            return
        local = scope.names[own[0]].value
        are_scalars = isinstance(value, Scalar) and isinstance(local, Scalar)
        are_alike = (
            isinstance(value, Matrix) and isinstance(local, Matrix) and value.shape == local.shape
        )
        if (are_scalars or are_alike) and value != local:
            reason = f"{function.name} returns something else that it makes of {own[0]}, in {function.where}"
            scope.set_argument(own[0], Unread(reason), function.where)

    def local_quantities(self, function: Function) -> list[str]:
        """Return the local names of a function, its arguments aside, that are called like a quantity."""
        quantities = self.record.robot.quantities
        return [
            name
            for name in function.definition
            if quantities.quantity(name) and name not in function.parameters
        ]

    def _local_names(self, function: Function) -> list[str]:
        """Return the local names of a function that may be quantities."""
        quantities = self.record.robot.quantities
        return [
            name
            for name in function.definition
            if quantities.quantity(name) or quantities.entries(name)
        ]

    @staticmethod
    def _with_names(value: Value, scope: Scope) -> Value:
        """Return several values with the local names that they are."""
        if not isinstance(value, Several):
            return value

        def local_name(result: Value) -> str:
            """Return the first local name that stands for a result; empty if none does."""
            for name, binding in scope.names.items():
                if binding.value == result:
                    return name
            return ""

        return replace(value, names=tuple(local_name(result) for result in value.values))

    def returned_names(self, function: Function) -> list[str]:
        """Return the names in a function's result, which are not known of an executed one."""
        return []

    def assigned_anywhere(self) -> Iterator[tuple[str, str]]:
        """Yield the names that the program assigns, with their lines."""
        for name, line_number in self._lines.items():
            yield name, self._line(line_number)

    def symbols(self, name: str, function: Function) -> object:
        """Return an argument as names of symbols."""
        robot = self.record.robot
        plain = plain_name(name)
        if name in ("t", "time"):
            return "t"
        if name in _STATES and self.state:
            return list(self._state_names())
        if robot.vocabulary.is_state(plain) or robot.quantities.is_parameter(name):
            return name
        if robot.is_vector(plain):
            return [f"{plain}{k + 1}" for k in range(robot.n)]
        if name in _PARAMETER_SETS:
            return {}
        if name in _TORQUES:
            return [f"torque{k + 1}" for k in range(robot.n)]
        more = (
            ', or a state whose order the task gives ([names] state = "q, qd")'
            if name in _STATES
            else ""
        )
        found = f"the argument {name[:40]} of {function.name}"
        self.problems.append(f"{found} is not known; expected joint variables, parameters{more}")
        raise UnreadError(self.problems[-1])

    def _state_names(self) -> Iterator[str]:
        """Yield the joint variables and rates in the order of the task's state."""
        robot = self.record.robot
        for part in self.state:
            plain = plain_name(part)
            if robot.vocabulary.is_state(plain):
                yield plain
            else:
                yield from (f"{plain}{k + 1}" for k in range(robot.n))

    # The answers

    def sheet(self) -> AnswerSheet:
        """Return the answers.

        Raises
        ------
        AnswerError
            There is none.
        """
        try:
            sheet = answers_of(self, self.file)
        except AnswerError:
            sheet = AnswerSheet(
                names=Names(lenient=True), file=self.file, notes=tuple(self.record.notes)
            )
            sampled = self._sampled({})
            if not sampled and self.problems:
                raise AnswerError(f"{self.file}: {self.problems[0]}") from None
            if not sampled:
                raise
        else:
            sampled = self._sampled(sheet.answers)
        parameters = {**self.definitions, **sheet.names.parameters}
        answers = {name: _without_advice(answer) for name, answer in sheet.answers.items()}
        return replace(
            sheet,
            answers={**answers, **sampled},
            names=replace(sheet.names, parameters=parameters),
            notes=(*sheet.notes, *self._notes_of_imports()),
        )

    def _notes_of_imports(self) -> tuple[str, ...]:
        return ("it imports dhkit",) if self.child.imported else ()

    def _sampled(self, answers: Mapping[str, object]) -> dict[str, SampledAnswer]:
        """Return the quantities that are given by functions of numbers alone."""
        quantities = self.record.robot.quantities
        in_main = self._in_main()
        found: dict[str, _SampledFunction] = {}
        for function in self.numeric:
            for local in ("", *function.definition):
                name = local or called_name(function)
                quantity = quantities.quantity(name)
                is_given = quantity in answers and not isinstance(answers[quantity], Refusal)
                if not quantity or is_given or quantity in in_main or quantities.is_parameter(name):
                    continue
                before = found.get(quantity)
                if local and (
                    local in function.parameters
                    or (before is not None and before.function is function)
                ):
                    continue
                one = _SampledFunction(self, function, local)
                # Several functions may give a quantity; all must give the same.
                found[quantity] = (
                    one if before is None else replace(before, others=(*before.others, one))
                )
        return dict(found)

    def _in_main(self) -> set[str]:
        """Return the quantities that the program's own names give, whole or in part."""
        quantities = self.record.robot.quantities
        given = set()
        for name in self._lines:
            if not quantities.is_parameter(name):
                given |= {
                    quantities.quantity(name),
                    *(target.quantity for target in quantities.entries(name)),
                }
        return given - {""}


@dataclass(frozen=True)
class _SampledFunction(SampledAnswer):
    """A function that is called with numbers; ``local`` is the local name that is the answer, empty for its value."""

    program: _ExecutedProgram
    function: Function
    local: str
    others: tuple[_SampledFunction, ...] = ()

    @property
    def name(self) -> str:
        """Name in reports."""
        return f"{self.function.name}(...)" + (f": {self.local}" if self.local else "")

    @property
    def parameters(self) -> frozenset[str]:
        """The robot's parameters that are arguments."""
        robot = self.program.record.robot
        names = self.function.parameters
        if any(name in _PARAMETER_SETS for name in names):
            return frozenset(robot.quantities.parameters.values())
        plain = map(plain_name, names)
        return frozenset(
            robot.quantities.parameters[x] for x in plain if x in robot.quantities.parameters
        )

    def at(self, states: Sequence[Mapping[str, float]], shape: tuple[int, ...]) -> Array:
        """Return its values at states, shape (states, *shape); see :class:`SampledAnswer`."""
        values = self._own_values(states, shape)
        for other in self.others:
            if not _are_same(other._own_values(states, shape), values):
                raise AnswerError(f"{self.name} and {other.name} give different values; keep one")
        # Of Octave's functions the locals are the results.
        if self.local and self.program.child.name.endswith(".py"):
            self._refuse_changed(states, values)
        return values

    def _refuse_changed(self, states: Sequence[Mapping[str, float]], values: Array) -> None:
        """Refuse the only local quantity of a function that returns something else of its shape."""
        if len(self.program.local_quantities(self.function)) > 1:
            return
        try:
            returned = replace(self, local="", others=())._own_values(states, values.shape[1:])
        except AnswerError:
            return  # it returns another shape: the quantity is a step of its own
        if not _are_same(returned, values):
            raise AnswerError(
                f"{self.function.name} returns something else that it makes of {self.local}"
            )

    def _own_values(self, states: Sequence[Mapping[str, float]], shape: tuple[int, ...]) -> Array:
        """Return the values of this function alone, at random times and torques: no quantity depends on them."""
        rng = np.random.default_rng()
        others = ("t", *(f"torque{k + 1}" for k in range(self.program.record.robot.n)))
        known = frozenset((*states[0], *others))
        keys = {name: self._keys(name, known) for name in self.function.parameters}
        samples = []
        for state in states:
            numbers = {**state, **{name: float(rng.uniform(-5, 5)) for name in others}}
            samples.append({name: _numbers_of(key, numbers) for name, key in keys.items()})
        try:
            answer = self.program.child.ask(
                {"call": self.function.name, "samples": samples, "local": self.local},
                _SAMPLING_TIME,
            )
        except ProgramError as error:
            raise AnswerError(f"{self.name}: {self.program.error_text(error)}") from None
        values = answer.get("values")
        try:
            array = np.array(values, dtype=float)
        except (TypeError, ValueError, OverflowError):
            raise AnswerError(f"{self.name}: returns no array of numbers of one shape") from None
        if array.size != len(states) * int(np.prod(shape, dtype=int)):
            raise AnswerError(f"{self.name}: returns shape {array.shape[1:]}; expected {shape}")
        return array.reshape(len(states), *shape)

    def _keys(self, name: str, known: frozenset[str]) -> object:
        """Return the names in a state of an argument's numbers, in the structure of the argument."""
        symbols = self.program.symbols(name, self.function)
        if isinstance(symbols, dict):
            return {
                parameter: parameter
                for parameter in self.program.record.robot.quantities.parameters.values()
            }
        if isinstance(symbols, list):
            return [self._key(one, known) for one in symbols]
        return self._key(str(symbols), known)

    def _key(self, symbol: str, known: frozenset[str]) -> str:
        """Return the name of a symbol in a state: that of the robot's variable or parameter."""
        robot = self.program.record.robot
        if symbol == "t" or symbol.startswith("torque"):
            return symbol
        parameter = robot.quantities.parameters.get(plain_name(symbol))
        if parameter is not None:
            return parameter
        meaning = robot.find(symbol)
        if meaning is None or len(meaning) != 1 or meaning[0] not in known:
            raise AnswerError(
                f"{self.name}: the argument {symbol[:40]} is not a single joint variable"
            )
        return meaning[0]


def _numbers_of(keys: object, numbers: Mapping[str, float]) -> object:
    """Return the numbers under some names, in their structure."""
    match keys:
        case str():
            return numbers[keys]
        case list():
            return [numbers[key] for key in keys]
        case dict():
            return {name: numbers[key] for name, key in keys.items()}
    raise TypeError(f"found {keys!r}; expected a name, a list or names by name")


def _are_same(values: Array, others: Array) -> bool:
    return bool(np.allclose(values, others, rtol=_SAME_VALUES, atol=_SAME_VALUES, equal_nan=True))


# Messages of the process, which are not trusted


def _fields(value: object) -> list[tuple[str, Any]]:
    """Return the fields of an object; none of anything else."""
    if not isinstance(value, dict):
        return []
    return [
        (name, one)
        for name, one in list(value.items())[: BOUNDS.executed_names]
        if _is_identifier(name)
    ]


def _listed(value: object) -> list[dict[str, Any]]:
    if not isinstance(value, list):
        return []
    return [one for one in value[: BOUNDS.executed_names] if isinstance(one, dict)]


def _is_identifier(value: object) -> TypeGuard[str]:
    return isinstance(value, str) and value.isidentifier()


def _texts(value: object) -> tuple[str, ...]:
    if not isinstance(value, list):
        return ()
    return tuple(one for one in value if _is_identifier(one))


def _whole(value: object) -> int:
    return (
        value if isinstance(value, int) and not isinstance(value, bool) and 0 < value < 10**7 else 0
    )


def _function(one: Mapping[str, Any], line_name: Callable[[int], str]) -> Function:
    """Return a function of the program; its definition is its local names, and ``captured`` has keys in it."""
    name = one.get("name")
    return Function(
        name if _is_identifier(name) else "function",
        _texts(one.get("parameters")),
        _texts(one.get("locals")),
        line_name(_whole(one.get("line"))),
        captured=dict.fromkeys(_texts(one.get("keys")), Unread("")),
    )


def _without_advice(answer: object) -> object:
    """Return an answer; a refusal without the advice to execute the program."""
    if isinstance(answer, Refusal):
        return replace(answer, advice="")
    if isinstance(answer, Entries):
        return Entries({index: _without_advice(entry) for index, entry in answer.texts.items()})  # type: ignore[misc]
    return answer


def _renamed(text: str, names: Mapping[str, str]) -> str:
    if not names:
        return text
    return re.sub(
        r"\bcasadi\d+\b", lambda match: names.get(match[0], match[0]), text, flags=re.ASCII
    )


def _is_constant(value: Scalar) -> bool:
    """Whether a formula has no symbol: 0.3, pi/2, sqrt(2)."""
    return not set(re.findall(r"[A-Za-z_]\w*", value.text)) - {"pi", "E", "sqrt", "sin", "cos", "e"}


def _value_of_tree(tree: object, names: Mapping[str, str], depth: int = 0) -> Value:
    if depth > BOUNDS.value_nesting:
        return Unread("nested too deep")
    match tree:
        case str(text):
            text = _renamed(text, names)
            if _NUMBER.fullmatch(text) and not text.startswith("-"):
                return number(text)
            with suppress(ValueError):
                return Scalar(text, Level.SUM, float(text) if _NUMBER.fullmatch(text) else None)
        case list(rows):
            if len(rows) > BOUNDS.list_values:
                return Unread(f"a list of more than {BOUNDS.list_values} values")
            return _value_of_list([_value_of_tree(row, names, depth + 1) for row in rows])
        case {"fields": dict(fields)}:
            return Structure(
                {name: _value_of_tree(one, names, depth + 1) for name, one in _fields(fields)}
            )
        case {"error": error}:
            return Unread(" ".join(printable(str(error)).split())[:300])
    return Unread("no formula and no numbers")


def _value_of_list(values: Sequence[Value]) -> Value:
    """Return a matrix of rows, a vector of scalars, or several values."""
    entries: dict[Index, Scalar] = {}
    for i, one in enumerate(values):
        if isinstance(one, Unread):
            return one
        if isinstance(one, Scalar):
            entries[(i,)] = one
        elif isinstance(one, Matrix) and one.is_flat:
            entries |= {(i, j): entry for (j,), entry in one.entries.items()}
        else:
            return Several(tuple(values))
    lengths = set(Counter(index[0] for index in entries).values())
    is_even = len({len(index) for index in entries}) == 1 and len(lengths) == 1
    return Matrix(entries) if entries and is_even else Several(tuple(values))
