"""An element for PrairieLearn's question pages: a field for one quantity, judged by the page's own server.

``<dhkit-answer quantity="M" task="task.toml"></dhkit-answer>`` shows a field for text; PrairieLearn calls the four
functions below with the element's markup and the question's data, which they change. dhkit must be installed where
PrairieLearn executes elements. Nothing that a student writes is executed.

Source: PrairieLearn, Developing custom elements.
"""

from __future__ import annotations

import html
import os
from collections.abc import Mapping
from html.parser import HTMLParser
from pathlib import Path
from typing import Any, NoReturn

from dhkit.platforms.contents import Task
from dhkit.platforms.notebook_checks import Check, check

_MAX_CHARACTERS = 20_000
"""Length of an answer."""

Data = dict[str, Any]
"""A question's data, as PrairieLearn's documentation lists it."""


def prepare(element_html: str, data: Data) -> None:
    """Check the element's attributes when a variant is made."""
    quantity = _quantity(element_html)
    asked = Task.read(_task(element_html, data)).asked
    if quantity not in asked:
        raise ValueError(f"dhkit-answer: quantity: found {quantity!r}; expected {', '.join(asked)}")


def render(element_html: str, data: Data) -> str:
    """Return the element as HTML: a field in the question, the answer and its feedback in the other panels."""
    quantity = _quantity(element_html)
    given = data.get("raw_submitted_answers", {}).get(quantity, "")
    if data.get("panel") == "question":
        return (
            f'<label>{html.escape(quantity)} = <textarea name="{html.escape(quantity)}" rows="3" cols="60" '
            f'class="form-control" spellcheck="false">{html.escape(given)}</textarea></label>'
        )
    if data.get("panel") == "answer":
        return ""
    error = data.get("format_errors", {}).get(quantity)
    feedback = error or data.get("partial_scores", {}).get(quantity, {}).get("feedback", "")
    return (
        f"<p>{html.escape(quantity)} = <code>{html.escape(given)}</code></p>"
        f"<pre>{html.escape(str(feedback))}</pre>"
    )


def parse(element_html: str, data: Data) -> None:
    """Take the field's text; an empty one, and one that cannot be read, costs no attempt."""
    quantity = _quantity(element_html)
    text = data["submitted_answers"].get(quantity, "").strip()
    if not text or len(text) > _MAX_CHARACTERS:
        expected = f"an expression of at most {_MAX_CHARACTERS} characters"
        data["format_errors"][quantity] = f"found {len(text)} characters; expected {expected}"
        return
    judged = check(_task(element_html, data), quantity, text)
    if judged.report.error:
        data["format_errors"][quantity] = judged.report.error


def grade(element_html: str, data: Data) -> None:
    """Judge the answer; the score is the share of the quantity's points."""
    quantity = _quantity(element_html)
    judged = check(_task(element_html, data), quantity, data["submitted_answers"][quantity])
    data["partial_scores"][quantity] = {
        "score": judged.points / judged.most if judged.most else 0.0,
        "weight": judged.most,
        "feedback": _feedback(judged),
    }


def _feedback(judged: Check) -> str:
    lines = [f"{entry.name}: {entry.verdict.value}" for entry in judged.report.entries]
    return "\n".join([*lines, *(one.sentence for one in judged.report.diagnosis)])


class _FirstTag(HTMLParser):
    """Reads the attributes of the first element."""

    attributes: Mapping[str, str] | None = None

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if self.attributes is None:
            self.attributes = {name: value or "" for name, value in attrs}


def _attributes(element_html: str) -> Mapping[str, str]:
    parser = _FirstTag()
    parser.feed(element_html)
    return parser.attributes or {}


def _quantity(element_html: str) -> str:
    return _attributes(element_html).get("quantity") or _missing("quantity")


def _task(element_html: str, data: Data) -> Path:
    """Return the task's file, which lies in the question's folder ``tests``."""
    name = _attributes(element_html).get("task", "task.toml")
    if os.sep in name or name.startswith("."):
        raise ValueError(f"dhkit-answer: task: found {name!r}; expected a file in the folder tests")
    return Path(data["options"]["question_path"]) / "tests" / name


def _missing(attribute: str) -> NoReturn:
    raise ValueError(f"dhkit-answer: {attribute}: missing")
