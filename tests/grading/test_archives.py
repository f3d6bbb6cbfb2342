"""Archives that others make: what is in them comes out, and nothing else happens."""

import gzip
import io
import stat
import tarfile
import zipfile
from dataclasses import replace

import pytest

from dhkit.errors import AnswerError
from dhkit.grading import archives
from dhkit.grading.archives import unpacked
from dhkit.grading.bounds import BOUNDS

FILES = {"ada/answer.py": b"g1 = 0", "Zoë Ångström/answer.m": b"g1 = 0;", "bob/deep/er/a.toml": b""}


def zip_of(path, files, mode=None):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name)
            entry.external_attr = (mode or 0o644) << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content)
    return path


def tar_of(path, files, **fields):
    with tarfile.open(path, "w:gz" if path.name.lower().endswith("gz") else "w") as archive:
        for name, content in files.items():
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            for key, value in fields.items():
                setattr(entry, key, value)
            archive.addfile(entry, io.BytesIO(content))
    return path


def refusal(path):
    with pytest.raises(AnswerError) as caught, unpacked(path):
        pass
    line = str(caught.value)
    assert line.count(str(path)) == 1
    assert line.startswith(f"{path}: ")
    assert "\n" not in line
    return line.removeprefix(f"{path}: ")


@pytest.mark.parametrize(
    ("name", "make"),
    [("c.zip", zip_of), ("c.tar", tar_of), ("c.tar.gz", tar_of), ("c.TGZ", tar_of)],
)
def test_what_was_packed_comes_out_and_the_folder_is_removed(tmp_path, name, make):
    with unpacked(make(tmp_path / name, FILES)) as folder:
        found = {
            path.relative_to(folder).as_posix(): path.read_bytes()
            for path in folder.rglob("*")
            if path.is_file()
        }
        assert found == FILES
    assert not folder.exists()


@pytest.mark.parametrize("make", [zip_of, tar_of])
@pytest.mark.parametrize(
    "name",
    [
        "../evil.py",
        "a/../../evil.py",
        "/etc/evil.py",
        "C:/evil.py",
        r"..\evil.py",
        r"\\host\evil.py",
    ],
)
def test_nothing_leaves_the_folder(tmp_path, make, name):
    path = make(tmp_path / ("c.zip" if make is zip_of else "c.tar"), {"ok.py": b"", name: b"evil"})
    assert "leads out of the archive; nothing was unpacked" in refusal(path)
    assert not list(tmp_path.rglob("evil*"))


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFCHR, stat.S_IFIFO])
def test_zip_entries_are_files_or_folders(tmp_path, kind):
    path = zip_of(tmp_path / "c.zip", {"ada.py": b"/etc/passwd"}, mode=kind | 0o777)
    assert "'ada.py' is a link or a device" in refusal(path)


@pytest.mark.parametrize(
    "kind", [tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.CHRTYPE, tarfile.BLKTYPE, tarfile.FIFOTYPE]
)
def test_tar_entries_are_files_or_folders(tmp_path, kind):
    path = tar_of(tmp_path / "c.tar.gz", {"ada.py": b""}, type=kind, linkname="/etc/passwd")
    assert "'ada.py' is a link or a device" in refusal(path)


def test_a_name_that_is_there_twice(tmp_path):
    path = zip_of(tmp_path / "c.zip", {"ada.py": b"1", "bob.py": b"2"})
    path.write_bytes(path.read_bytes().replace(b"bob.py", b"ada.py"))
    assert "'ada.py' is there twice" in refusal(path)


def test_a_file_that_is_also_a_folder(tmp_path):
    path = zip_of(tmp_path / "c.zip", {"ada": b"", "ada/answer.py": b""})
    assert "'ada/answer.py' is there twice" in refusal(path)


def test_bombs_are_refused_by_ratio_size_number_and_depth(tmp_path, monkeypatch):
    zeros = {"ada.py": bytes(BOUNDS.archive_free_bytes + 1)}
    assert "over 100 times" in refusal(zip_of(tmp_path / "c.zip", zeros))
    (tmp_path / "c.tar.gz").write_bytes(gzip.compress(bytes(BOUNDS.archive_free_bytes + 1)))
    assert "over 100 times" in refusal(tmp_path / "c.tar.gz")
    deep = zip_of(tmp_path / "d.zip", {"a/" * 30 + "ada.py": b""})
    assert "nested deeper than 20 folders" in refusal(deep)
    monkeypatch.setattr(archives, "BOUNDS", replace(BOUNDS, files=2))
    assert "more than 2 files" in refusal(zip_of(tmp_path / "e.zip", FILES))


def test_damage_is_a_line(tmp_path):
    good = zip_of(tmp_path / "c.zip", FILES).read_bytes()
    (tmp_path / "c.zip").write_bytes(good[:40])
    assert "not an archive that can be read" in refusal(tmp_path / "c.zip")
    whole = tar_of(tmp_path / "c.tar.gz", {"ada.py": bytes(range(256)) * 99}).read_bytes()
    for damaged in (whole[:-20], b"no gzip", whole[:30] + b"\0\1\2" + whole[33:], b""):
        (tmp_path / "c.tar.gz").write_bytes(damaged)
        with (
            pytest.raises(AnswerError, match="not an archive that can be read") as caught,
            unpacked(tmp_path / "c.tar.gz"),
        ):
            pass
        assert "\n" not in str(caught.value)


def test_names_of_other_programs(tmp_path):
    """UTF-8 without its flag, backslashes for slashes, and what macOS adds."""
    path = tmp_path / "c.zip"
    zip_of(path, {"ASCIIASCIIAA": b"x", r"bob\answer.py": b"y", "__MACOSX/._bob": b"z"})
    raw = path.read_bytes().replace(b"ASCIIASCIIAA", "Zoë/answer.".encode())
    path.write_bytes(raw)
    with unpacked(path) as folder:
        found = sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    assert found == ["Zoë/answer.", "bob/answer.py"]


def test_encrypted_entries_are_refused(tmp_path):
    path = zip_of(tmp_path / "c.zip", {"ada.py": b"1"})
    raw = bytearray(path.read_bytes())
    for signature, offset in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        raw[raw.index(signature) + offset] |= 1
    path.write_bytes(bytes(raw))
    assert "'ada.py' is encrypted" in refusal(path)
