"""Folders that are written whole or not at all."""

from pathlib import Path

import pytest

from dhkit.description.files import whole_folder


def test_a_folder_is_whole_or_as_it_was(tmp_path):
    place = tmp_path / "results"
    with whole_folder(place) as folder:
        (folder / "first").write_text("1")
    with pytest.raises(KeyboardInterrupt), whole_folder(place) as folder:
        (folder / "second").write_text("2")
        raise KeyboardInterrupt
    assert [path.name for path in place.iterdir()] == ["first"]
    with whole_folder(place) as folder:
        (folder / "second").write_text("2")
    assert [path.name for path in place.iterdir()] == ["second"]
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_a_folder_that_cannot_be_put_in_its_place_leaves_the_old_one(tmp_path, monkeypatch):
    place = tmp_path / "results"
    place.mkdir()
    (place / "first").write_text("1")
    replace = Path.replace

    def fails(path, target):
        if path.name == "made":
            raise OSError("no room")
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", fails)
    with pytest.raises(OSError, match="no room"), whole_folder(place) as folder:
        (folder / "second").write_text("2")
    assert [path.name for path in place.iterdir()] == ["first"]
