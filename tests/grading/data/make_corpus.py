"""Write heldout.jsonl: answer sheets with labels, made of truths by energies and checked in numbers, without dhkit.

Run ``python tests/grading/data/make_corpus.py``; the file is the same every time.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from functools import cache
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))

from grading.data import derive  # noqa: E402
from grading.data.checking import differing, trees  # noqa: E402
from grading.data.layouts import (  # noqa: E402
    entry_texts,
    matlab_file,
    notebook,
    python_file,
    tex_file,
    toml_sheet,
    whole_texts,
)
from grading.data.trees import NOTATIONS, Notation  # noqa: E402

ROBOTS = derive.library()
OWN = {path.stem for path in (HERE / "robots").glob("*.toml")}
RIGHT = ("correct", "correct within rounding")
WRONG = ("wrong",)
WHOLE = {
    "latex",
    "latex_short",
    "latex_roman",
    "latex_bare",
    "latex_q",
    "latex_braces",
    "mathematica",
    "maxima",
    "maple",
}


@cache
def truth(name: str) -> dict:
    """Return everything about a robot."""
    robot = ROBOTS[name]
    return {**derive.derive(robot), **derive.kinematics(robot)}


class Corpus:
    """Sheets so far, and turns taken among notations."""

    def __init__(self):
        self.sheets = []
        self.turns = Counter()

    def turn(self, key, choices):
        """Return the next of some choices."""
        self.turns[key] += 1
        return choices[(self.turns[key] - 1) % len(choices)]

    def raw(self, name, robot, suffix, text, expected, label=None, kind="text"):
        """Add a sheet as it is."""
        assert name not in {one["name"] for one in self.sheets}, name
        self.sheets.append(
            {
                "name": name,
                "robot": robot,
                "suffix": suffix,
                "notation": kind,
                "expected": list(expected),
                "label": label,
                "text": text,
            }
        )

    def add(
        self,
        name,
        robot,
        answers,
        notation,
        layout,
        expected,
        label,
        names=None,
        task=None,
        whole=None,
    ):
        """Write answers (trees by quantity) as a sheet or a document."""
        style = self.turns["style" + layout]
        self.turns["style" + layout] += 1
        if layout == "toml":
            chosen = NOTATIONS[notation] if isinstance(notation, str) else notation
            turned = isinstance(notation, str) and notation in WHOLE and style % 2
            by_text = whole_texts if (turned and whole is None) or whole else entry_texts
            place = f"{robot}.toml" if robot in OWN else robot
            text, suffix = toml_sheet(place, by_text(answers, chosen), names, task), ".toml"
        else:
            maker, suffix = {
                "m": (matlab_file, ".m"),
                "py": (python_file, ".py"),
                "tex": (tex_file, ".tex"),
                "ipynb": (notebook, ".ipynb"),
            }[layout]
            # g last: a program that names its vector g has no gravity constant left.
            text = maker(dict(sorted(answers.items(), key=lambda item: item[0] == "g")), style)
            notation = layout
        self.raw(
            name,
            robot,
            suffix,
            text,
            expected,
            label,
            notation if isinstance(notation, str) else notation.kind,
        )

    def right(
        self,
        name,
        robot,
        answers,
        notation="python",
        layout="toml",
        expected=RIGHT,
        reference=None,
        **how,
    ):
        """Add answers that are right: checked here."""
        answers = {key: trees(value) for key, value in answers.items()}
        known = reference or truth(robot)
        tolerance = how.pop("tolerance", None)
        for key, value in answers.items():
            extra = {"tolerance": tolerance} if tolerance else {}
            values = how.get("values")
            wrong = differing(key, value, known[key], values, **extra)
            assert not wrong, (name, key, wrong)
        how.pop("values", None)
        self.add(name, robot, answers, notation, layout, expected, None, **how)

    def wrong(
        self,
        name,
        robot,
        answers,
        mistake,
        accept,
        notation="python",
        layout="toml",
        reference=None,
        **how,
    ):
        """Add answers with one mistake: which entries it spoils is found here."""
        answers = {key: trees(value) for key, value in answers.items()}
        known = reference or truth(robot)
        values = how.pop("values", None)
        spoiled = [
            entry
            for key, value in answers.items()
            for entry in differing(key, value, known[key], values)
        ]
        if not spoiled:
            return False
        label = {
            "mistake": mistake,
            "accept": sorted({mistake, *([accept] if isinstance(accept, str) else accept)}),
            "entries": spoiled,
            "quantities": sorted(
                {key for key in answers if any(entry.startswith(key) for entry in spoiled)}
            ),
        }
        self.add(name, robot, answers, notation, layout, WRONG, label, **how)
        return True


def main():
    """Write the corpus and say what is in it."""
    from grading.data import nasty_sheets, right_sheets, wrong_sheets

    corpus = Corpus()
    right_sheets.write(corpus)
    wrong_sheets.write(corpus)
    nasty_sheets.write(corpus)
    with (HERE / "heldout.jsonl").open("w") as out:
        out.writelines(json.dumps(one, ensure_ascii=False) + "\n" for one in corpus.sheets)
    for key in ("robot", "notation", "suffix"):
        print(key, dict(Counter(one[key] for one in corpus.sheets)))
    print(
        len(corpus.sheets),
        "sheets,",
        sum(one["label"] is not None for one in corpus.sheets),
        "labelled wrong",
    )
    print((HERE / "heldout.jsonl").stat().st_size, "bytes")


__all__ = ["Corpus", "Notation", "truth"]

if __name__ == "__main__":
    sys.modules["grading.data.make_corpus"] = sys.modules["__main__"]
    main()
