"""A module counts as tested where a test of its own folder names it, or something that it alone defines."""

import pytest

from tools import architecture

MODULES = {
    "__init__.py": "def entrance(): ...",
    "top.py": "SPEED = 1",
    "arms/links.py": "class Link: ...\ndef run(): ...\n_hidden = 0",
    "arms/joints.py": "LOWER, UPPER = (left_out for left_out in (0, 1))\ndef run(): ...",
    "arms/wrists/roll.py": "angle: float = 0.0",
    "bases/plate.py": "import top",
}


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Return what writes tests by their paths and says which modules none of them names."""
    monkeypatch.setattr(architecture, "ROOT", tmp_path)
    monkeypatch.setattr(architecture, "TESTS", tmp_path / "tests")
    monkeypatch.setattr(architecture, "PACKAGE", tmp_path / "src" / "kit")

    def write(folder, texts):
        for name, text in texts.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)

    def untested(**tests):
        write(tmp_path / "tests", {f"{name.replace('__', '/')}.py": text for name, text in tests.items()})
        architecture.words.cache_clear()
        return list(architecture.untested(architecture.modules()))

    write(tmp_path / "src" / "kit", MODULES)
    return untested


def test_without_tests_every_module_is_named_with_its_folder(package):
    assert package() == [
        "kit.arms.joints: named in no test below tests/arms",
        "kit.arms.links: named in no test below tests/arms",
        "kit.arms.wrists.roll: named in no test below tests/arms",
        "kit.bases.plate: named in no test below tests/bases",
        "kit.top: named in no test below tests",
    ]


def test_any_name_of_its_own_will_do(package):
    assert (
        package(
            test_top="assert SPEED == 1",
            arms__test_links="Link()\nUPPER",
            arms__wrists__test="angle",
            bases__test="plate",
        )
        == []
    )


@pytest.mark.parametrize("text", ["run()", "_hidden", "left_out", "Links", "my_joints", "SPEED"])
def test_names_that_others_share_or_that_are_private_parts_or_values_do_not_count(package, text):
    faults = package(arms__test_arms=text)
    assert {fault.partition(":")[0] for fault in faults} >= {"kit.arms.joints", "kit.arms.links"}


def test_only_the_own_folder_counts(package):
    said = "top links joints roll plate"
    assert package(arms__test_arms=said) == [
        "kit.bases.plate: named in no test below tests/bases",
        "kit.top: named in no test below tests",
    ]
    assert package(arms__test_arms="", arms__wrists__test_roll="angle", test_all=said) == [
        "kit.arms.joints: named in no test below tests/arms",
        "kit.arms.links: named in no test below tests/arms",
        "kit.bases.plate: named in no test below tests/bases",
    ]
