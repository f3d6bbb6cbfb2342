"""Figures of the density of the source, by package: for information, never a gate.

A figure that is met while readers still stumble is worthless; CONTRIBUTING.md says how code is read instead.
"""

import ast
import io
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path

COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
CODE = {tokenize.NAME, tokenize.OP, tokenize.NUMBER, tokenize.STRING}
"""Types of the tokens that are counted; layout, comments and docstrings are not."""
HEADINGS = ("package", "lines", "tokens", "multi %", "compr.", "nested", "comments")
LEGEND = """\
lines: code lines, without blank lines, comments and docstrings; tokens: tokens of a code line
multi %: share of assignments that bind several values; compr., comments: in 1,000 code lines
nested: comprehensions with a second loop or a comprehension inside"""


@dataclass
class Density:
    """Counts of some source text.

    Attributes
    ----------
    lines
        Code lines: neither blank nor comment nor docstring.
    tokens
        Names, numbers, strings and signs on code lines.
    comments
        Comments.
    assignments, multiple
        Assignments, and those that bind several values to several names in one statement.
    comprehensions, nested
        Comprehensions, and those with a second loop or another comprehension inside.
    """

    lines: int = 0
    tokens: int = 0
    comments: int = 0
    assignments: int = 0
    multiple: int = 0
    comprehensions: int = 0
    nested: int = 0

    def __add__(self, other: "Density") -> "Density":
        sums = {
            one.name: getattr(self, one.name) + getattr(other, one.name) for one in fields(self)
        }
        return Density(**sums)

    def row(self, package: str) -> tuple[str, ...]:
        """Return the figures as text, in the order of HEADINGS."""
        lines = max(self.lines, 1)
        return (
            package,
            str(self.lines),
            f"{self.tokens / lines:.1f}",
            f"{100 * self.multiple / max(self.assignments, 1):.1f}",
            f"{1000 * self.comprehensions / lines:.0f}",
            str(self.nested),
            f"{1000 * self.comments / lines:.1f}",
        )


def density(text: str) -> Density:
    """Return the counts of a file's text."""
    tree = ast.parse(text)
    documentation = set(docstring_lines(tree))
    found = Density()
    code_lines = set[int]()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            found.comments += 1
        elif token.type in CODE and token.start[0] not in documentation:
            found.tokens += 1
            code_lines.update(range(token.start[0], token.end[0] + 1))
    found.lines = len(code_lines)

    for node in ast.walk(tree):
        if isinstance(node, ast.Assign):
            found.assignments += 1
            found.multiple += isinstance(node.targets[0], ast.Tuple) and isinstance(
                node.value, ast.Tuple
            )
        elif isinstance(node, COMPREHENSIONS):
            found.comprehensions += 1
            found.nested += is_nested(node)
    return found


def docstring_lines(tree: ast.AST) -> Iterator[int]:
    """Yield the lines of docstrings, and of the strings below fields and constants."""
    for node in ast.walk(tree):
        value = node.value if isinstance(node, ast.Expr) else None
        if isinstance(value, ast.Constant) and isinstance(value.value, str):
            yield from range(value.lineno, (value.end_lineno or value.lineno) + 1)


def is_nested(comprehension: ast.ListComp | ast.SetComp | ast.DictComp | ast.GeneratorExp) -> bool:
    """Whether a comprehension has a second loop, or another comprehension inside."""
    inner = [node for node in ast.walk(comprehension) if isinstance(node, COMPREHENSIONS)]
    return len(comprehension.generators) > 1 or len(inner) > 1


def density_by_package(package: Path) -> dict[str, Density]:
    """Return the counts of each package, stubs included, and of all together."""
    found: dict[str, Density] = {}
    total = Density()
    for path in sorted(package.rglob("*.py*")):
        if path.suffix not in (".py", ".pyi"):
            continue
        parts = path.relative_to(package).parts
        name = parts[0] if len(parts) > 1 else package.name
        counted = density(path.read_text())
        found[name] = found.get(name, Density()) + counted
        total += counted
    return dict(sorted(found.items(), key=lambda item: -item[1].lines)) | {"all": total}


def density_table(package: Path) -> str:
    """Return the figures of all packages as an aligned table with its legend."""
    rows = [HEADINGS, *(counted.row(name) for name, counted in density_by_package(package).items())]
    lines = []
    for name, *figures in rows:
        lines.append(name.ljust(14) + "".join(figure.rjust(10) for figure in figures))
    return "\n".join([*lines, LEGEND])
