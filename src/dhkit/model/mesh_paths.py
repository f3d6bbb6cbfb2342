"""Files of the meshes that a URDF names, and checks that they lie in the robot's own folders."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree

from dhkit.errors import ModelError
from dhkit.model.bounds import BOUNDS

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.\-]*:")


class MeshFinder:
    """Finds the files that a URDF's mesh elements name.

    A file must lie in the robot's root or below one of the package folders, also when links are followed. The root is
    the nearest folder above the URDF with a package.xml, or else the URDF's own folder. Nothing is downloaded: of URIs
    only ``package://NAME/...`` is read, with NAME a folder in ``package_dirs``, or the URDF's own package.

    Parameters
    ----------
    urdf
        The file.
    package_dirs
        Folders with packages in them.
    """

    def __init__(self, urdf: Path, package_dirs: str | Path | Sequence[str | Path] = ()) -> None:
        self.folder = urdf.resolve().parent
        self.packages = _packages_above(self.folder)
        self.root = self.packages[0][0] if self.packages else self.folder
        folders = [package_dirs] if isinstance(package_dirs, str | Path) else package_dirs
        try:
            self.package_dirs = [Path(folder).resolve() for folder in folders]
        except (OSError, RuntimeError, ValueError, TypeError) as error:
            raise ModelError(f"package_dirs: {error}") from None
        for folder in self.package_dirs:
            if not folder.is_dir():
                raise ModelError(f"package_dirs: {folder} is not a folder")

    @property
    def mesh_folder(self) -> Path:
        """The folder that all meshes' paths are relative to."""
        return (
            Path(os.path.commonpath([self.root, *self.package_dirs]))
            if self.package_dirs
            else self.root
        )

    def path(self, uri: str) -> str:
        """Return a mesh's path relative to :attr:`mesh_folder`.

        Raises
        ------
        ModelError
            Another scheme, an unknown package, no such file, or one outside the robot's folders.
        """
        if not uri.isprintable():
            raise ModelError(f"mesh {uri[:80]!r}: not a file name")
        mesh = f"mesh {uri[:120]!r}"
        try:
            file = self._file(uri.replace("\\", "/"), mesh).resolve()
            is_file = file.is_file()
        except (
            OSError,
            RuntimeError,
            ValueError,
        ):
            # A loop of links, or a name that no file can have.
            raise ModelError(f"{mesh} cannot be found") from None
        if not any(file.is_relative_to(root) for root in (self.root, *self.package_dirs)):
            raise ModelError(f"{mesh} lies outside the robot's folder {self.root}")
        if not is_file:
            raise ModelError(f"{mesh} is not there")
        return file.relative_to(self.mesh_folder).as_posix()

    def _file(self, name: str, mesh: str) -> Path:
        """Return the file of a name or URI, which need not exist; ``mesh`` begins messages."""
        if name.startswith("package://"):
            package, _, rest = name.removeprefix("package://").lstrip("/").partition("/")
            inner = PurePosixPath(rest)
            if not package or package in (".", "..") or inner.is_absolute():
                raise ModelError(f"{mesh}: expected package://NAME/path")
            folders = [
                folder / package for folder in self.package_dirs if (folder / package).is_dir()
            ]
            folders += [folder for folder, own in self.packages if package in (own, folder.name)]
            folders += [self.root] if package == self.root.name else []
            if not folders:
                raise ModelError(
                    f"{mesh}: no package {package!r}; package_dirs names the folder it lies in"
                )
            return folders[0] / inner
        if _SCHEME.match(name):
            raise ModelError(f"{mesh}: expected package:// or a path relative to the URDF")
        if PurePosixPath(name).is_absolute():
            raise ModelError(f"{mesh} is an absolute path; expected one relative to the URDF")
        return self.folder / PurePosixPath(name)


def _packages_above(folder: Path) -> list[tuple[Path, str]]:
    """Return the folders at and above a folder that are packages, with their names, the nearest first."""
    packages = []
    for parent in (folder, *folder.parents)[: BOUNDS.parent_folders]:
        manifest = parent / "package.xml"
        try:
            if not manifest.is_file() or manifest.stat().st_size > BOUNDS.package_bytes:
                continue
            packages.append(
                (parent, _package_name(manifest.read_text(encoding="utf-8", errors="replace")))
            )
        except OSError:
            continue
    return packages


def _package_name(manifest: str) -> str:
    """Return the name that a package.xml states; empty if it cannot be read safely."""
    if "<!DOCTYPE" in manifest or "<!ENTITY" in manifest:
        return ""
    try:
        name = ElementTree.fromstring(manifest).findtext("name")  # noqa: S314 - no entities, bounded
    except (ElementTree.ParseError, ValueError):
        return ""
    return (name or "").strip()
