"""`dhkit grade --template` and `--explain`: what a student starts from, and what an instructor compares with."""

from __future__ import annotations

import sys
from pathlib import Path

from dhkit.arm import Arm
from dhkit.cli.output import say
from dhkit.description import write_atomically
from dhkit.errors import AnswerError
from dhkit.grading.explanation import explanation_html, explanation_text
from dhkit.grading.template import template


def write_template(robot: str, output: Path | None) -> int:
    """Print or write an empty answer sheet."""
    description = Arm.load(robot).description
    # A sheet finds robot files only in its own folder.
    name = Path(robot).name if robot.endswith(".toml") else description.name
    return _deliver(template(description, name), output)


def write_explanation(arm: Arm, form: str, output: Path | None) -> int:
    """Print or write a worked solution as text or HTML.

    Raises
    ------
    AnswerError
        Another format.
    """
    forms = {"text": explanation_text, "html": explanation_html}
    if form not in forms:
        raise AnswerError(f"--format: found {form!r}; expected {', '.join(forms)} for a worked solution")
    return _deliver(forms[form](arm.description), output)


def _deliver(text: str, output: Path | None) -> int:
    if output is None:
        sys.stdout.write(text)
    else:
        write_atomically(output, text)
        say(f"wrote {output}")
    return 0
