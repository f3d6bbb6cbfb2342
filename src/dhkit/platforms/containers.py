"""Packages for platforms that judge a submission in a container: Gradescope and PrairieLearn."""

from __future__ import annotations

import json
import uuid
from collections.abc import Mapping

from dhkit.grading.empty_sheet import template
from dhkit.grading.variants import VariantKey
from dhkit.platforms.contents import Installation, Package, Task, key_contents
from dhkit.report.statement import task_html

KEY = "key"
"""Folder of a package that has the key of variants."""
_ANSWER_FILE = "answer.toml"
_TIMEOUT = 300
"""Time for a submission on the clock, s; PrairieLearn permits up to 600."""

_SETUP = """\
#!/usr/bin/env bash
# Runs once, when Gradescope builds the image. dhkit needs Python 3.11 or later: choose Ubuntu 24.04.
set -e
apt-get update
apt-get install -y python3 python3-venv
cd "$(dirname "$0")"
python3 -m venv /opt/dhkit
/opt/dhkit/bin/pip install --no-cache-dir "{requirement}"
"""
_RUN_AUTOGRADER = """\
#!/usr/bin/env bash
# Runs for every submission, as run_autograder in Gradescope's folder /autograder.
exec "${DHKIT_PYTHON:-/opt/dhkit/bin/python}" -m dhkit.platforms.running gradescope "$(dirname "$(realpath "$0")")"
"""
_RUN_GRADER = """\
#!/usr/bin/env bash
# Runs for every submission, as tests/run.sh in PrairieLearn's folder /grade.
exec "${DHKIT_PYTHON:-python3}" -m dhkit.platforms.running prairielearn "$(dirname "$(dirname "$(realpath "$0")")")"
"""
_DOCKERFILE = """\
# The image that judges submissions: containers have no network, so dhkit is in it.
FROM python:3.12-slim
{copy}RUN pip install --no-cache-dir "{requirement}"
"""
_QUESTION = """\
<pl-question-panel>
{statement}
  <p>Write each answer as text into the sheet below; what stays empty is not handed in.</p>
  <pl-file-editor file-name="{answer}" ace-mode="ace/mode/toml" source-file-name="{answer}"></pl-file-editor>
</pl-question-panel>
<pl-submission-panel>
  <pl-external-grader-results></pl-external-grader-results>
  <pl-file-preview></pl-file-preview>
</pl-submission-panel>
"""


def gradescope_package(task: Task, installation: Installation) -> Package:
    """Return the autograder's zip file for Gradescope.

    Source: Gradescope, Autograder Specifications.
    """
    return _autograder(task.files, installation)


def gradescope_key_package(key: VariantKey, installation: Installation) -> Package:
    """Return the autograder's zip file for variants: each student is judged by the own robot.

    Source: Gradescope, Autograder Specifications, "Submission Metadata".
    """
    files = {f"{KEY}/{name}": content for name, content in key_contents(key).items()}
    return _autograder(files, installation)


def _autograder(contents: Mapping[str, bytes], installation: Installation) -> Package:
    scripts = {
        "setup.sh": _SETUP.format(requirement=installation.requirement),
        "run_autograder": _RUN_AUTOGRADER,
    }
    files = {name: text.encode() for name, text in scripts.items()}
    return Package({**contents, **installation.files, **files}, frozenset(scripts))


def prairielearn_package(task: Task, installation: Installation, image: str) -> Package:
    """Return a question's folder for PrairieLearn, and the recipe of its image.

    Source: PrairieLearn, External Grading, and its schema of ``info.json``.

    Parameters
    ----------
    task, installation
        As :func:`~dhkit.platforms.packing.pack` reads them.
    image
        Name of the image that the recipe is built as.
    """
    info = {
        # The same task is the same question, also after it was packed again.
        "uuid": str(uuid.uuid5(uuid.NAMESPACE_URL, f"dhkit:{task.digest}")),
        "title": task.title,
        "topic": "Robot arms",
        "tags": ["dhkit"],
        "type": "v3",
        "singleVariant": True,
        "gradingMethod": "External",
        "partialCredit": True,
        "externalGradingOptions": {
            "enabled": True,
            "image": image,
            "entrypoint": "/grade/tests/run.sh",
            "timeout": _TIMEOUT,
        },
    }
    question = _QUESTION.format(
        statement=task_html(task.description, task.sheet),
        answer=_ANSWER_FILE,
    )
    copy = f"COPY {installation.wheel_name} ./\n" if installation.wheel_name else ""
    recipe = _DOCKERFILE.format(copy=copy, requirement=installation.requirement)
    files = {
        "info.json": json.dumps(info, indent=2),
        "question.html": question,
        _ANSWER_FILE: template(task.description, task=task.sheet),
        "tests/run.sh": _RUN_GRADER,
        "image/Dockerfile": recipe,
    }
    tests = {f"tests/{name}": content for name, content in task.files.items()}
    wheel = {f"image/{name}": content for name, content in installation.files.items()}
    texts = {name: text.encode() for name, text in files.items()}
    return Package({**texts, **tests, **wheel}, frozenset({"tests/run.sh"}))
