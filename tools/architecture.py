"""Check the shape of the package: no import circles, no splinters.

Imports inside functions and under ``TYPE_CHECKING`` count, and so do the lazy imports of a package's stub.

    python -m tools.architecture            # the checks; exit status 1 and one line a fault
    python -m tools.architecture --density  # code lines and their density, by package, for information
"""

import argparse
import ast
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

from tools.density import density_table

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "dhkit"
FEWEST_LINES = 60
"""A file with fewer lines and a single importer belongs into that importer."""

ENTRANCES = {"__init__.py", "__main__.py"}
"""Files that only lead into a package: they may be short."""


def modules() -> dict[str, Path]:
    """Return the file of every module, by its dotted name; a package stands for its ``__init__``."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported(tree: ast.AST, known: Mapping[str, Path]) -> Iterator[str]:
    """Yield the modules that a file imports anywhere; ``from a import b`` names a.b where that is a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                if inner in known:
                    yield inner
                elif node.module in known:
                    yield node.module


def lazily_imported(stub: Path, package: str, known: Mapping[str, Path]) -> Iterator[str]:
    """Yield the modules of the lazy imports that a package's ``__init__.pyi`` lists."""
    for node in ast.walk(ast.parse(stub.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and f"{package}.{node.module}" in known:
            yield f"{package}.{node.module}"


def imports(known: Mapping[str, Path]) -> dict[str, set[str]]:
    """Return which modules of the package each module imports, itself left out."""
    found = {}
    for name, path in known.items():
        tree = ast.parse(path.read_text())
        targets = set(imported(tree, known))
        if path.with_suffix(".pyi").exists():
            targets |= set(lazily_imported(path.with_suffix(".pyi"), name, known))
        found[name] = targets - {name}
    return found


def circles(graph: Mapping[str, set[str]]) -> list[list[str]]:
    """Return the strongly connected components of more than one module (Tarjan 1972), each sorted."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for target in sorted(graph[node]):
            if target not in index:
                visit(target)
                low[node] = min(low[node], low[target])
            elif target in stack:
                low[node] = min(low[node], index[target])
        if low[node] == index[node]:
            component = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(component) > 1:
                found.append(sorted(component))

    for node in sorted(graph):
        if node not in index:
            visit(node)
    return found


def faults() -> Iterator[str]:
    """Yield one line for each place where the package breaks a rule of its shape."""
    known = modules()
    graph = imports(known)
    for circle in circles(graph):
        yield f"circle of {len(circle)}: {', '.join(circle)}"
    importers = Counter(target for targets in graph.values() for target in targets)
    for name, path in known.items():
        length = len(path.read_text().splitlines())
        if path.name in ENTRANCES or length >= FEWEST_LINES:
            continue
        if importers[name] == 1:
            (user,) = (module for module, targets in graph.items() if name in targets)
            yield f"{name}: {length} lines, imported by {user} alone"


def main() -> int:
    """Print the faults, or the figures of density."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--density", action="store_true", help="print figures by package; no figure is a fault"
    )
    if parser.parse_args().density:
        print(density_table(PACKAGE))
        return 0
    found = list(faults())
    print("\n".join(found) or "no import circles, no splinters")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
