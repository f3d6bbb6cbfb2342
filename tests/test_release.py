"""Files of a release agree with each other: versions, dependencies, and what the source distribution holds."""

import re
import tomllib
from pathlib import Path

import pytest

import dhkit

ROOT = Path(__file__).parents[1]
CONDA_NAMES = {
    "pin": "pinocchio-python",
    "meshcat": "meshcat-python",
    "msgpack": "msgpack-python",
    "matplotlib": "matplotlib-base",
}
"""Names of packages on conda-forge that differ from PyPI's."""

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


@pytest.mark.parametrize(
    ("file", "pattern"),
    [
        ("pyproject.toml", r'^version = "(.+)"$'),
        ("CITATION.cff", r"^version: (.+)$"),
        ("package.xml", r"<version>(.+)</version>"),
        ("recipe/meta.yaml", r'set version = "(.+)"'),
        ("CHANGELOG.md", r"^## \[(.+)\] - "),
    ],
)
def test_the_version_is_everywhere_the_same(file, pattern):
    found = re.search(pattern, (ROOT / file).read_text(), re.MULTILINE)
    assert found is not None
    assert found[1] == dhkit.__version__


def test_the_recipe_has_the_dependencies_of_the_wheel():
    recipe = (ROOT / "recipe/meta.yaml").read_text().partition("  run:")[2].partition("\ntest:")[0]
    listed = {line.replace(" ", "") for line in re.findall(r"- (.+)", recipe)}
    wanted = {f"python{PROJECT['project']['requires-python']}"}
    for line in PROJECT["project"]["dependencies"]:
        name, bound = re.match(r"([\w-]+)(>=[\d.]+)", line).groups()
        wanted.add(CONDA_NAMES.get(name, name) + bound)
    assert listed == wanted


def test_the_source_distribution_holds_what_it_needs():
    included = PROJECT["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]
    for name in ("src", "urdf", "meshes", "tests", "benchmarks", "docs", "examples", "LICENSE"):
        assert name in included
        assert (ROOT / name).exists()
