"""A derivation of inverse kinematics as a page of HTML with MathML and figures, without scripts or other files."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from dhkit.description import DHTable
from dhkit.symbolic.equations.html import equation_mathml, html_page
from dhkit.symbolic.equations.inverse_figures import figure_of, sample_pose
from dhkit.symbolic.equations.inverse_text import (
    GIVEN,
    branches_sentence,
    introduction,
    rule_in_dollars,
)
from dhkit.symbolic.equations.inverse_writing import LATEX, Phrases, solved_before
from dhkit.symbolic.equations.sentences import sentence_parts
from dhkit.symbolic.inverse.derivation import InverseDerivation
from dhkit.symbolic.inverse.steps import DerivationStep

_STYLE = """<style>
.ik-step { display: flow-root; }
.ik-step svg.figure { float: right; max-width: 100%; height: auto; margin: 0 0 .5rem 1.5rem; }
svg.figure text { font: 13px sans-serif; paint-order: stroke; stroke: var(--paper, #fff); stroke-width: 4px; }
.ik-step .solution { background: var(--tint, #f3f6fa); border-left: 3px solid var(--mark, #0b5cad); }
.ik-step .display { padding-top: .25rem; padding-bottom: .25rem; } .ik-step p { margin: .35rem 0; }
.ik-known { color: var(--faint, #57606a); }
</style>"""


def inverse_page(derivation: InverseDerivation) -> str:
    """Return a derivation as one page of HTML."""
    name = derivation.description.name
    source = derivation.description.source
    parts = [f"<h1>{escape(name)}: inverse kinematics, step by step</h1>"]
    if source:
        parts.append(f'<p class="source">{escape(source)}</p>')
    parts.append("<h2>Denavit-Hartenberg table</h2>")
    parts.append(DHTable.of(derivation.description)._repr_html_())
    parts.append(_body(derivation))
    return html_page(f"{name}: inverse kinematics", "\n".join(parts))


def _body(derivation: InverseDerivation) -> str:
    """Return a derivation as HTML to stand inside a page or a notebook."""
    write = Phrases(derivation, LATEX)
    T = sample_pose(derivation)
    first, given, angles = introduction(derivation)
    opening = f"{first} {given or GIVEN}"
    parts = [_STYLE, f"<p>{_words(opening)}</p>", f"<p>{_words(angles)}</p>"]
    for number, step in enumerate(derivation.steps, start=1):
        title = _words(step.unknown.name if step.unknown else step.title)
        parts.append(f'<section class="ik-step"><h2>{number}. {title}</h2>')
        parts.append(figure_of(derivation, step, T))
        parts += [*_step(derivation, write, step), "</section>"]
    joints = list(write.joint_values())
    if joints:
        parts.append("<h2>Joint values</h2><p>Turned into (−π, π]:</p>")
        parts += [_display(f"{name} = {value}") for name, value in joints]
    for condition in derivation.conditions:
        parts.append(f"<p>{_words(condition.look)}</p>")
        parts.append(
            _display(f"{write.element(condition.left)} = {write.element(condition.right)}")
        )
    parts.append(f"<p>{_words(branches_sentence(derivation))}</p>")
    parts += [f'<p class="note">{_words(note)}</p>' for note in derivation.notes]
    return "\n".join(filter(None, parts))


def _step(derivation: InverseDerivation, write: Phrases, step: DerivationStep) -> Iterator[str]:
    """Yield the paragraphs and equations of a step after its title and figure."""
    yield f"<p>{_words(step.look)}</p>"
    used = solved_before(derivation, step)
    if used:
        yield f'<p class="ik-known">Known from before: {_words(", ".join(used))}.</p>'
    for definition in step.definitions:
        yield _display(f"{write.name(definition.name)} = {write.element(definition.element)}")
    if step.form is None:
        return
    solution = write.solution(step.form)
    solved = (solution.unknown, solution.alternatives[0])
    for left, right in write.equations(step):
        if (left, right) != solved:
            yield _display(f"{left} = {right}")
    for letter, value in solution.letters:
        yield _display(f"{letter} = {value}")
    alternatives = r" \quad\text{or}\quad ".join(solution.alternatives)
    yield _display(f"{solution.unknown} = {alternatives}", "display solution")
    if step.choice:
        yield f"<p>The two solutions: {_sentence(rule_in_dollars(write, step.choice))}.</p>"
    if step.nothing:
        yield f"<p>No solution where {_words(step.nothing)}.</p>"
    if step.singular:
        yield f"<p>Singular where {_words(step.singular)}.</p>"


def _display(latex: str, kind: str = "display") -> str:
    """Return a displayed equation as MathML."""
    return f'<div class="{kind}">{equation_mathml(latex)}</div>'


def _sentence(text: str) -> str:
    """Return a sentence with its formulas between dollar signs as MathML in the line."""
    parts = text.split("$")
    return "".join(_inline(part) if k % 2 else escape(part) for k, part in enumerate(parts))


def _inline(latex: str) -> str:
    """Return a formula inside a line as MathML."""
    return equation_mathml(latex).replace('display="block"', 'display="inline"')


def _words(text: str) -> str:
    """Return words with formulas, such as px, abs(d3) and theta2, as MathML."""
    return "".join(
        escape(part) if isinstance(part, str) else _inline(part.latex)
        for part in sentence_parts(text)
    )
