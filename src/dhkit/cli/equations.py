"""`dhkit equations`: an arm's equations of motion, to be read or to be run."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import typer

from dhkit.cli.equations_page import equations_page
from dhkit.cli.options import Json, Robot, Uniform, load_arm
from dhkit.cli.output import print_json, report_files
from dhkit.description import Description, write_atomically
from dhkit.description.files import check_place
from dhkit.errors import DescriptionError
from dhkit.symbolic import (
    Lagrangian,
    SymbolicKinematics,
    Symbols,
    base_parameters,
    inverse_derivation,
    lagrangian,
    symbolic_kinematics,
)
from dhkit.symbolic.equations import (
    Quantity,
    equations_c,
    equations_latex,
    equations_matlab,
    equations_python,
    equations_text,
    is_kinematic,
    kinematic_quantities,
    latex_document,
    matlab_files,
    quantities,
    readable,
    rounded,
)
from dhkit.symbolic.equations.quantities import elements_of
from dhkit.symbolic.ring import Element

MAX_TITLE_LENGTH = 200
Source: TypeAlias = Lagrangian | SymbolicKinematics
"""Object that has the exact quantities."""
Printer: TypeAlias = Callable[[Any, Sequence[Quantity], Sequence[str]], str]
"""Printer of a source's quantities with notes."""

INVERSE = "ik"
"""The quantity that stands for the derivation of inverse kinematics."""
CODE = ("python", "c", "matlab")
DEFAULT_DIGITS = 6
"""Significant digits of equations whose numbers have more than a floating-point number."""
FLOAT_DIGITS = 17

app = typer.Typer(rich_markup_mode=None)


def _lagrangian_of(description: Description, symbols: str, base: bool) -> Lagrangian:
    """Return the equations of motion, with these symbols, or in base parameters.

    Raises
    ------
    DescriptionError
        There is no such choice of symbols, or a link has no body.
    """
    choices: Mapping[str, Symbols] = {"none": "none", "file": "file", "inertial": "inertial"}
    if base and symbols not in ("file", "inertial"):
        raise DescriptionError(
            f"--symbols {symbols}: base parameters are made of symbols; leave one of the two out"
        )
    if symbols not in choices:
        raise DescriptionError(f"--symbols: found {symbols!r}; expected {', '.join(choices)}")
    return (
        base_parameters(description).lagrangian
        if base
        else lagrangian(description, choices[symbols])
    )


def _kinematics_of(description: Description, symbols: str, base: bool) -> SymbolicKinematics:
    if base:
        raise DescriptionError("--base-parameters: A, T and J have no inertial parameters")
    if symbols not in ("none", "file"):
        raise DescriptionError(
            f"--symbols: found {symbols!r}; expected none or file for A, T and J"
        )
    return symbolic_kinematics(description, "none" if symbols == "none" else "file")


@app.command()
def equations(
    robot: Robot,
    what: Annotated[
        str,
        typer.Option(
            help="Quantities: any of M, C, h, g, tau, K, V; or any of A (A1 ... An), T, J; or ik, inverse kinematics."
        ),
    ] = "M,C,g",
    form: Annotated[
        str, typer.Option("--format", help="Format: text, latex, python, c, matlab or html.")
    ] = "text",
    symbols: Annotated[
        str,
        typer.Option(
            help="Symbols: none (numbers), file (the file's parameters), or inertial (every inertial parameter)."
        ),
    ] = "file",
    base: Annotated[
        bool,
        typer.Option(
            "--base-parameters",
            help="Use the base parameters (the fewest inertial parameters), and print their definitions.",
        ),
    ] = False,
    digits: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=17,
            help="Significant digits of numbers in text, latex and html; 0 for all. Default: all, but 6 where a number "
            "has more digits than a floating-point number.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="File to write; a folder for matlab, and for ik as code."
        ),
    ] = None,
    uniform: Uniform = False,
    json: Json = False,
) -> None:
    """Print a robot's equations of motion, exactly: M(q) qdd + C(q, qd) qd + g(q) = tau. Or its kinematics."""
    arm = load_arm(robot, uniform)
    if form not in FORMATS:
        raise DescriptionError(f"--format: found {form!r}; expected {', '.join(FORMATS)}")
    if what.strip().lower() == INVERSE:
        if base or symbols != "file":
            option = "--base-parameters" if base else "--symbols"
            raise DescriptionError(
                f"--what ik: names the lengths of the table itself; leave {option} out"
            )
        _inverse(arm.description, form, output, json)
        return
    if INVERSE in what.replace(",", " ").split():
        raise DescriptionError(
            f"--what: found {what!r}; expected ik alone, which is printed by itself"
        )
    if is_kinematic(what):
        kinematics = _kinematics_of(arm.description, symbols, base)
        lag: Source = kinematics
        shown = kinematic_quantities(kinematics, what)
    else:
        lag = derived = _lagrangian_of(arm.description, symbols, base)
        shown = list((quantities if form in CODE else readable)(derived, what))
    rounding: tuple[str, ...] = ()
    if form not in CODE:
        shown, rounding = _to_digits(shown, digits)
    elif digits is not None:
        raise DescriptionError(f"--digits: {form} has all digits; leave it out")
    notes = (*lag.notes, *rounding)
    if output is not None:
        files = _write(lag, shown, notes, form, output)
        report_files(files, json=json)
        return
    text = FORMATS[form](lag, shown, notes)
    if json:
        print_json(_facts(lag, shown, notes, form, text))
    else:
        sys.stdout.write(text)


def _to_digits(shown: list[Quantity], digits: int | None) -> tuple[list[Quantity], tuple[str, ...]]:
    """Return quantities with numbers of so many digits, and a note that says so; None decides by their length."""
    is_long = any(_is_long(element) for element in elements_of(shown))
    if digits is None:
        digits = DEFAULT_DIGITS if is_long else 0
    if not digits:
        return shown, ()
    note = (
        f"numbers are rounded to {digits} significant digits; --digits 0 prints them exactly, "
        "--base-parameters prints symbols instead"
    )
    return [rounded(quantity, digits) for quantity in shown], (note,)


def _is_long(element: Element) -> bool:
    """Return whether a coefficient has more digits than a floating-point number."""
    return any(
        max(abs(coefficient.numerator), coefficient.denominator) > 10**FLOAT_DIGITS
        for coefficient in element.terms.values()
    )


def _inverse(description: Description, form: str, output: Path | None, json: bool) -> None:
    """Print or write the derivation of an arm's inverse kinematics."""
    derivation = inverse_derivation(description)
    if form in CODE and output is not None:
        report_files(list(derivation.export(output, form)), json=json)
        return
    if form in CODE:
        files = derivation.code(form)
        text = (
            "\n".join(files.values())
            if len(files) == 1
            else "\n".join(f"/* {k} */\n{v}" for k, v in files.items())
        )
    elif form == "latex":
        text = latex_document(
            derivation.latex(), f"{description.name[:MAX_TITLE_LENGTH]}: inverse kinematics"
        )
    else:
        text = derivation.html() if form == "html" else derivation.text()
    if output is not None:
        if output.is_dir() or output.suffix == ".toml":
            raise DescriptionError(
                f"{output}: expected the name of a file that is not a robot file"
            )
        check_place(output)
        write_atomically(output, text)
        report_files([output], json=json)
    elif json:
        facts = {"robot": description.name, "what": [INVERSE], "format": form, "text": text}
        proof = derivation.prove()
        facts |= {"family": derivation.family.name, "branches": list(derivation.branches)}
        print_json(
            {
                **facts,
                "proved": bool(proof),
                "proof": proof.statement,
                "notes": list(derivation.notes),
            }
        )
    else:
        sys.stdout.write(text)


def _write(
    lag: Source, shown: Sequence[Quantity], notes: Sequence[str], form: str, output: Path
) -> list[Path]:
    """Write a file, or for MATLAB a file for each function into a folder; return the paths."""
    if output.suffix == ".toml":
        raise DescriptionError(
            f"{output}: equations would overwrite a robot file; expected another name"
        )
    if form == "matlab":
        if output.suffix or (output.exists() and not output.is_dir()):
            raise DescriptionError(
                f"{output}: expected a folder; MATLAB wants a file for every function"
            )
        contents = {output / name: text for name, text in matlab_files(lag, shown).items()}
    else:
        if output.is_dir():
            raise DescriptionError(f"{output} is a folder; expected the name of a file")
        check_place(output)
        contents = {output: FORMATS[form](lag, shown, notes)}
    for path, text in contents.items():
        write_atomically(path, text)
    return list(contents)


def _text(lag: Source, shown: Sequence[Quantity], notes: Sequence[str]) -> str:
    lines = "".join(f"note: {note}\n" for note in notes)
    return f"{equations_text(shown)}\n{lines}"


def _latex(lag: Source, shown: Sequence[Quantity], notes: Sequence[str]) -> str:
    document = latex_document(equations_latex(shown), lag.description.name[:MAX_TITLE_LENGTH])
    return "".join(f"% note: {note}\n" for note in notes) + document


def _code(printer: Callable[[Any, Sequence[Quantity]], str]) -> Printer:
    """Return the printer of a language, which writes the notes of the source itself."""
    return lambda lag, shown, notes: printer(lag, shown)


FORMATS: Mapping[str, Printer] = {
    "text": _text,
    "latex": _latex,
    "python": _code(equations_python),
    "c": _code(equations_c),
    "matlab": _code(equations_matlab),
    "html": equations_page,
}
"""Printers of equations with their notes, by the name of the format."""


def _facts(
    lag: Source, shown: Sequence[Quantity], notes: Sequence[str], form: str, text: str
) -> dict[str, Any]:
    term_counts = {}
    for quantity in shown:
        term_counts[quantity.name] = [len(element) for element in quantity.elements.flat]
    return {
        "robot": lag.description.name,
        "what": [quantity.name for quantity in shown],
        "format": form,
        "text": text,
        "terms": term_counts,
        "constants": lag.constants,
        "notes": list(notes),
    }
