"""Write the pages of the reference, one a package, from the names that the package exports."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from types import GenericAlias, ModuleType, UnionType
from typing import Any, get_origin

import dhkit
from dhkit import Arm

HERE = Path(__file__).parent
PACKAGES = {
    "description": "Robots as data",
    "kinematics": "Kinematics",
    "dynamics": "Dynamics",
    "symbolic": "Symbolic mechanics",
    "trajectories": "Trajectories",
    "planning": "Optimal motions",
    "control": "Controllers and simulation",
    "grading": "Grading",
    "verification": "Verification",
    "model": "URDF, meshes, Pinocchio",
    "programs": "Programs of users",
    "viewer": "Pictures and pages",
    "lab": "The lab",
    "report": "Reports",
    "platforms": "Teaching platforms",
    "scale": "Many processes or machines",
    "errors": "Errors",
    "expressions": "Expressions",
    "kernels": "Kernels",
}
"""Packages that users import, with the titles of their pages, in the order of the table of contents."""
LONG_TYPE = re.compile(r"numpy\.ndarray\[.*numpy\.dtype\[numpy\.(\w+)\]\]")
"""An array type of NumPy as it prints; the group is the type of its entries."""
MODULE_PATH = re.compile(r"\b(?:[a-z_]\w*\.)+(?=[A-Z])")
"""Modules before the name of a class in a type that prints."""
LONGEST_VALUE = 120
"""Longest constant that a page prints, characters."""
ARM_SECTIONS = {
    "Make or read an arm": ("load", "from_dh", "from_urdf", "save"),
    "Arms derived from an arm": (
        "with_tool",
        "with_base",
        "with_payload",
        "with_parameters",
        "with_limits",
        "with_uniform_links",
        "lock",
    ),
    "The robot as data": (
        "description",
        "name",
        "n",
        "joint_names",
        "limits",
        "dh",
        "configurations",
    ),
    "Kinematics": (
        "fk",
        "frames",
        "jacobian",
        "jacobian_dot",
        "family",
        "ik",
        "ik_chunks",
        "ik_numeric",
        "ik_path",
        "manipulability",
        "singularities",
        "workspace",
        "symbolic",
    ),
    "Dynamics": (
        "mass_matrix",
        "coriolis_matrix",
        "gravity_torque",
        "bias",
        "inverse_dynamics",
        "forward_dynamics",
        "kinetic_energy",
        "potential_energy",
        "power",
        "friction_torque",
        "regressor",
        "casadi",
    ),
    "Equations of motion": ("derive", "lagrangian", "base_parameters", "grade"),
    "Motions": (
        "cubic",
        "quintic",
        "trapezoidal",
        "spline",
        "straight_line",
        "circle",
        "plan",
        "planner",
        "plan_path",
        "certify",
        "distance",
    ),
    "Control": ("simulate", "simulate_batch", "compare", "linearize"),
    "URDF, Pinocchio, code": (
        "urdf",
        "write_urdf",
        "model",
        "pinocchio_model",
        "verify",
        "export_c",
        "export_ik",
        "compile",
    ),
    "Pictures and reports": ("view", "report"),
}
"""Members of Arm on its page. Members that no section names stand in a last one."""


def heading(text: str, mark: str) -> str:
    """Return a heading of reStructuredText."""
    return f"{text}\n{mark * len(text)}\n"


def arm_page() -> str:
    """Return the page of the class Arm: a table and the members for each subject."""
    public = [name for name in vars(Arm) if not name.startswith("_")]
    named = {name for names in ARM_SECTIONS.values() for name in names}
    sections = {
        title: [name for name in names if name in public] for title, names in ARM_SECTIONS.items()
    }
    if further := [name for name in public if name not in named]:
        sections["More"] = further
    blocks = [
        heading("Arm", "="),
        ".. currentmodule:: dhkit\n",
        ".. autoclass:: Arm\n   :no-members:\n",
    ]
    for title, names in sections.items():
        blocks.append(heading(title, "-"))
        blocks.append(summary([f"Arm.{name}" for name in names]))
        for name in names:
            is_method = callable(getattr(Arm, name)) or isinstance(vars(Arm)[name], classmethod)
            blocks.append(f".. {'automethod' if is_method else 'autoproperty'}:: Arm.{name}\n")
    return "\n".join(blocks)


def summary(names: list[str]) -> str:
    """Return a table of names and the first sentences of their docstrings."""
    rows = "\n".join(f"   {name}" for name in names)
    return f".. autosummary::\n   :nosignatures:\n\n{rows}\n"


def package_page(package: str, title: str) -> str:
    """Return the page of a package: its docstring, a table of its names, then each of them."""
    module = importlib.import_module(f"dhkit.{package}")
    places = home_places()
    kinds: dict[str, list[str]] = {"class": [], "function": [], "data": []}
    elsewhere = []
    for name in sorted(exported(module), key=str.lower):
        if places[package, name] == f"dhkit.{package}.{name}":
            kinds[kind_of(getattr(module, name))].append(name)
        else:
            elsewhere.append(places[package, name])
    blocks = [heading(title, "="), f".. automodule:: dhkit.{package}\n   :no-members:\n"]
    blocks.append(f".. currentmodule:: dhkit.{package}\n")
    if elsewhere:
        blocks.append(
            "Also exported here: " + ", ".join(f":py:obj:`{x}`" for x in elsewhere) + ".\n"
        )
    for kind, label in (("class", "Classes"), ("function", "Functions")):
        if kinds[kind]:
            blocks.append(heading(label, "-"))
            blocks.append(summary(kinds[kind]))
            blocks.extend(f".. auto{kind}:: {name}\n" for name in kinds[kind])
    if kinds["data"]:
        blocks.append(heading("Data and types", "-"))
        blocks.extend(data_entry(module, name) for name in kinds["data"])
    return "\n".join(blocks)


def data_entry(module: ModuleType, name: str) -> str:
    """Return the entry of a constant or of an alias of a type."""
    value = getattr(module, name)
    shown = LONG_TYPE.sub(r"NDArray[\1]", " ".join(repr(value).split()))
    if isinstance(value, UnionType) or get_origin(value) is not None or value is Any:
        shown = MODULE_PATH.sub("", shown)
    text = f"``{shown}``" if len(shown) <= LONGEST_VALUE and " object at 0x" not in shown else ""
    documented = documented_constant(module, name)
    body = " ".join(documented.split()) or text or f"A {type(value).__name__}."
    return f".. py:data:: {name}\n\n   {body}\n"


def documented_constant(module: ModuleType, name: str) -> str:
    """Return the text below a constant in the file that defines it; empty if there is none."""
    folder = Path(str(module.__file__)).parent
    for path in sorted(folder.rglob("*.py")):
        body = ast.parse(path.read_text("utf-8")).body
        for one, after in pairwise(body):
            if isinstance(one, ast.AnnAssign):
                targets: list[ast.expr] = [one.target]
            else:
                targets = one.targets if isinstance(one, ast.Assign) else []
            is_text = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            if is_text and any(isinstance(x, ast.Name) and x.id == name for x in targets):
                return str(after.value.value)  # type: ignore[attr-defined]
    return ""


def exported(module: ModuleType) -> list[str]:
    """Return the public names of a module: its ``__all__``, or what it defines."""
    return list(getattr(module, "__all__", ())) or [
        name
        for name, value in vars(module).items()
        if not name.startswith("_") and getattr(value, "__module__", None) == module.__name__
    ]


@lru_cache
def home_places() -> dict[tuple[str, str], str]:
    """Return where each export of each package is documented: by the package that defines it, or by the first."""
    exports: dict[object, list[tuple[str, str]]] = {}
    for package in existing_packages():
        module = importlib.import_module(f"dhkit.{package}")
        for name in exported(module):
            value = getattr(module, name)
            key: object = (
                id(value) if kind_of(value) != "data" or name == "Array" else (package, name)
            )
            exports.setdefault(key, []).append((package, name))
    places = {}
    for owners in exports.values():
        package, name = owners[0]
        value = getattr(importlib.import_module(f"dhkit.{package}"), name)
        source = str(getattr(value, "__module__", ""))
        definers = [one for one in owners if source.startswith(f"dhkit.{one[0]}")]
        package, name = (definers or owners)[0]
        places.update(dict.fromkeys(owners, f"dhkit.{package}.{name}"))
    return places


def kind_of(value: object) -> str:
    """Return "class", "function" or "data"."""
    if inspect.isclass(value) and not isinstance(value, GenericAlias) and value is not Any:
        return "class"
    return "function" if inspect.isroutine(inspect.unwrap(value)) else "data"  # type: ignore[arg-type]


def write_if_new(path: Path, text: str) -> None:
    """Write a file unless it has this text already: Sphinx reads changed files alone."""
    if not path.exists() or path.read_text("utf-8") != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")


def existing_packages() -> dict[str, str]:
    """Return the packages that this version has, with their titles."""
    root = Path(dhkit.__file__).parent
    return {
        name: title
        for name, title in PACKAGES.items()
        if (root / name / "__init__.py").exists() or (root / f"{name}.py").exists()
    }


def main() -> None:
    """Write docs/reference/*.rst."""
    folder = HERE / "reference"
    write_if_new(folder / "arm.rst", arm_page())
    for package, title in existing_packages().items():
        write_if_new(folder / f"{package}.rst", package_page(package, title))


if __name__ == "__main__":
    main()
