"""Derivations of inverse kinematics as text and as LaTeX."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator

from dhkit.display import html_table
from dhkit.symbolic.equations.inverse_writing import LATEX, TEXT, Phrases, phi_label, solved_before
from dhkit.symbolic.equations.latex_document import escaped
from dhkit.symbolic.equations.sentences import sentence_parts
from dhkit.symbolic.equations.text import WIDTH, broken_lines
from dhkit.symbolic.inverse.derivation import InverseDerivation
from dhkit.symbolic.inverse.steps import Choice, DerivationStep

GIVEN = "Given is the pose T of the tool in the world: its position px, py, pz and its rotation r11 ... r33."
"""Sentence on the pose that the derivation starts from."""
_LONGEST_LINE = 200
"""Largest number of characters of an equation in a notebook's table."""


def inverse_text(derivation: InverseDerivation) -> str:
    """Return a derivation as text, step by step."""
    write = Phrases(derivation, TEXT)
    lines = [f"{derivation.description.name}: inverse kinematics, step by step", ""]
    for sentence in introduction(derivation):
        lines += textwrap.wrap(sentence, WIDTH)
    for number, step in enumerate(derivation.steps, start=1):
        lines += ["", f"{number}. {_title(write, step)}", *_step(derivation, write, step)]
    joints = list(write.joint_values())
    if joints:
        lines += [
            "",
            "Joint values, turned into (-pi, pi]",
            *(f"   {name} = {value}" for name, value in joints),
        ]
    for condition in derivation.conditions:
        left = write.element(condition.left)
        right = write.element(condition.right)
        lines += ["", *textwrap.wrap(condition.look, WIDTH), *broken_lines(f"   {left} = ", right)]
    lines += ["", *textwrap.wrap(branches_sentence(derivation), WIDTH)]
    for note in derivation.notes:
        lines += textwrap.wrap(f"note: {note}", WIDTH)
    return "\n".join(lines) + "\n"


def inverse_table(derivation: InverseDerivation) -> str:
    """Return a derivation's definitions, equations and solutions as a table of HTML, a row for each step."""
    write = Phrases(derivation, TEXT)
    rows = []
    for step in derivation.steps:
        # Title, equation and solution; the title stands in the step's first row alone.
        step_rows = [
            ["", f"{write.name(d.name)} = {write.element(d.element)}", ""] for d in step.definitions
        ]
        if step.form is not None:
            solution = write.solution(step.form)
            solved = f"{solution.unknown} = {' or '.join(solution.alternatives)}"
            for left, right in write.equations(step):
                equation = f"{left} = {right}"
                if equation != solved:
                    step_rows.append(["", equation, ""])
            step_rows += [["", f"{letter} = {value}", ""] for letter, value in solution.letters]
            step_rows.append(["", "", solved])
        if step_rows:
            step_rows[0][0] = _title(write, step)
        rows += step_rows
    caption = f"{derivation.description.name}: joint by joint"
    return html_table(
        ("what is found", "equations", "solution"),
        rows,
        caption,
        most=len(rows),
        longest=_LONGEST_LINE,
    )


def introduction(derivation: InverseDerivation) -> list[str]:
    """Return the sentences before the first step."""
    kinds = derivation.description.kinds
    has_offsets = any(
        kind == "R" and not offset.is_zero
        for kind, offset in zip(kinds, derivation.chain.offsets, strict=True)
    )
    angle = "theta_i is the table's angle of joint i: "
    angle += "the joint value q_i plus its offset" if has_offsets else "the joint value q_i"
    symbols = "s1 and c1 are sin(theta1) and cos(theta1)"
    label = phi_label(derivation)
    if derivation.sum and label != "phi":
        summed = " + ".join(f"theta{i}" for i, _ in derivation.sum)
        symbols += f", s{label} and c{label} those of {summed}"
    elif derivation.sum:
        symbols += ", sphi and cphi those of phi"
    return [
        f"{derivation.geometry[0].upper()}{derivation.geometry[1:]}.",
        GIVEN,
        f"{angle}; {symbols}.",
    ]


def branches_sentence(derivation: InverseDerivation) -> str:
    """Return a sentence about the branches."""
    count = len(derivation.branches)
    aims = (
        " They point the tool at the pose's origin, at whatever distance."
        if derivation.family.aims
        else ""
    )
    return f"{count} branches: {', '.join(derivation.branches)}.{aims}"


def _title(write: Phrases, step: DerivationStep) -> str:
    """Return the name of a step's unknown, or its title if it only defines quantities."""
    return write.unknown(step.unknown) if step.unknown else step.title


def _step(derivation: InverseDerivation, write: Phrases, step: DerivationStep) -> Iterator[str]:
    """Yield the lines of a step after its title."""
    indent = "   "

    def wrapped(sentence: str) -> list[str]:
        return textwrap.wrap(sentence, WIDTH, initial_indent=indent, subsequent_indent=indent)

    yield from wrapped(step.look)
    used = solved_before(derivation, step)
    if used:
        yield f"{indent}known from before: {', '.join(used)}"
    for definition in step.definitions:
        yield from broken_lines(
            f"{indent}{write.name(definition.name)} = ", write.element(definition.element)
        )
    if step.form is None:
        return
    equations = write.equations(step)
    solution = write.solution(step.form)
    if equations != [(solution.unknown, solution.alternatives[0])]:
        for left, right in equations:
            yield from broken_lines(f"{indent}{left} = ", right)
    for letter, value in solution.letters:
        yield from broken_lines(f"{indent}{letter} = ", value)
    yield f"{indent}{solution.unknown} = {' or '.join(solution.alternatives)}"
    if step.choice:
        yield from wrapped(f"the two solutions: {write.rule(step.choice)}")
    if step.nothing:
        yield from wrapped(f"no solution where {step.nothing}")
    if step.singular:
        yield from wrapped(f"singular where {step.singular}")


def inverse_latex(derivation: InverseDerivation) -> str:
    """Return a derivation in LaTeX, for a page that loads amsmath."""
    write = Phrases(derivation, LATEX)
    parts = [" ".join(_sentence(sentence) for sentence in introduction(derivation))]
    for step in derivation.steps:
        title = f"${write.unknown(step.unknown)}$" if step.unknown else _sentence(step.title)
        parts += [rf"\subsection*{{{title}}}", _sentence(step.look)]
        displays = [
            (write.name(definition.name), write.element(definition.element))
            for definition in step.definitions
        ]
        if step.form is not None:
            solution = write.solution(step.form)
            solved = (solution.unknown, r" \quad\text{or}\quad ".join(solution.alternatives))
            displays += [pair for pair in write.equations(step) if pair != solved]
            displays += [*solution.letters, solved]
        rows = [f"{left} &= {right}" for left, right in displays]
        parts.append("\\begin{align*}\n" + " \\\\\n".join(rows) + "\n\\end{align*}")
        if step.choice:
            parts.append(
                _latex_sentence(f"The two solutions: {rule_in_dollars(write, step.choice)}.")
            )
        if step.nothing:
            parts.append(_sentence(f"No solution where {step.nothing}."))
        if step.singular:
            parts.append(_sentence(f"Singular where {step.singular}."))
    joints = [f"{name} &= {value}" for name, value in write.joint_values()]
    if joints:
        parts += [
            r"\subsection*{Joint values, turned into $(-\pi, \pi]$}",
            "\\begin{align*}\n" + " \\\\\n".join(joints) + "\n\\end{align*}",
        ]
    for condition in derivation.conditions:
        sides = f"{write.element(condition.left)} &= {write.element(condition.right)}"
        parts += [_sentence(condition.look), f"\\begin{{align*}}\n{sides}\n\\end{{align*}}"]
    parts += [
        _sentence(branches_sentence(derivation)),
        *(_sentence(f"Note: {note}.") for note in derivation.notes),
    ]
    return "\n\n".join(parts) + "\n"


def rule_in_dollars(write: Phrases, choice: Choice) -> str:
    """Return the rule that names two roots, with its formulas between dollar signs."""
    factors = [write.element(factor) for factor in choice.factors]
    text = write.rule(choice)
    # Longest first: a factor may be a part of another.
    for factor in sorted(factors, key=len, reverse=True):
        inequality = f"{factor} > 0"
        if len(factor) <= 1:
            continue
        formula = inequality if inequality in text else factor
        text = text.replace(formula, f"${formula}$")
    return text


def _latex_sentence(text: str) -> str:
    """Return a sentence whose formulas stand between dollar signs in LaTeX."""
    parts = text.split("$")
    return "$".join(part if k % 2 else escaped(part) for k, part in enumerate(parts))


def _sentence(text: str) -> str:
    """Return a sentence of words and formulas in LaTeX."""
    return "".join(
        escaped(part) if isinstance(part, str) else f"${part.latex}$"
        for part in sentence_parts(text)
    )
