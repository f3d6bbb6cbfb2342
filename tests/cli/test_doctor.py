"""`dhkit doctor` and `dhkit cache`."""

import json

import pytest

from dhkit.cli.app import run
from dhkit.errors import DhkitError


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """Return the folder of a cache of its own."""
    monkeypatch.setenv("DHKIT_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache/kernels"


def test_doctor_names_versions_and_checks_that_it_works(cache, capsys):
    assert run(["doctor", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    packages = {package["name"]: package for package in report["packages"]}
    assert packages["numpy"]["version"].startswith("2.")
    assert packages["ssik"]["extra"]
    assert "ruff" not in packages
    assert [check["ok"] for check in report["checks"]] == [True] * 3
    assert report["cache"]["folder"] == str(cache)
    assert run(["doctor"]) == 0
    assert "14 quantities agree" in capsys.readouterr().out


def test_a_failed_check_is_said(monkeypatch, cache, capsys):
    def fails():
        raise DhkitError("they disagree")

    monkeypatch.setattr("dhkit.cli.doctor._verify", fails)
    assert run(["doctor"]) == 1
    assert "FAILED: they disagree" in capsys.readouterr().out


def test_the_cache_is_shown_and_cleared(cache, capsys):
    assert run(["cache"]) == 0
    assert capsys.readouterr().out.startswith("0 compiled kernels, 0.0 MB, in ")
    (cache / "fk_0.kernel").write_bytes(b"code")
    (cache / "notes.txt").write_text("not a kernel")
    assert run(["cache", "clear"]) == 0
    assert capsys.readouterr().out == "deleted 1 kernel\n"
    assert [path.name for path in cache.iterdir()] == ["notes.txt"]
