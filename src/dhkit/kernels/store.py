"""Compiled kernels on disk: a second process neither derives nor compiles."""

from __future__ import annotations

import hashlib
import importlib.util
import logging
import os
import sys
import types
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import platformdirs

from dhkit.description import write_atomically

__all__ = ["cache_folder", "digest", "load"]

log = logging.getLogger(__name__)

END = "# end of kernel\n"
"""The last line of a kernel's file."""


def cache_folder() -> Path | None:
    """Return the user's own folder of kernels, made if missing: ``DHKIT_CACHE_DIR`` or the platform's cache folder.

    None where it cannot be written, or could be written by others: what lies in it is run.
    """
    root = os.environ.get("DHKIT_CACHE_DIR") or platformdirs.user_cache_dir("dhkit", appauthor=False)
    folder = Path(root).expanduser() / "kernels"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.stat()
    except OSError:
        return None
    if hasattr(os, "geteuid") and (status.st_uid != os.geteuid() or status.st_mode & 0o022):
        log.warning("kernels are not cached: %s can be written by other users", folder)
        return None
    return folder if os.access(folder, os.W_OK | os.X_OK) else None


def digest(name: str, pattern: str, derivation: str) -> str:
    """Return what a kernel is found by: its function and pattern, the code that derives and compiles it, versions, CPU.

    Parameters
    ----------
    name, pattern
        What the kernel computes, and for which arms.
    derivation
        Path of the file, or of the folder of files, that derives it.
    """
    return hashlib.sha256("\0".join((name, pattern, _sources(derivation), _machine())).encode()).hexdigest()[:32]


def load(name: str, key: str, text: Callable[[bool], str]) -> Callable[..., None]:
    """Return a kernel from the disk, or from new text; ``text(cached)`` derives it."""
    folder = cache_folder()
    if folder is None:
        return _in_memory(name, text)
    path = folder / f"{name}_{key}.py"
    known = _is_whole(path)
    if not (known and any((folder / "__pycache__").glob(f"{path.stem}.kernel-*.nbc"))):
        log.info("compiling %s for the first time; later processes load it from %s", name, folder)
    new = "" if known else text(True)
    try:
        if not known:
            write_atomically(path, new + END)
        return _from_file(path)
    except Exception as error:
        # A damaged or vanished cache must never stop a computation.
        log.warning("the kernel cache in %s is unusable (%s): compiling in memory", folder, error)
        for damaged in (path, *(folder / "__pycache__").glob(f"{path.stem}.*")):
            damaged.unlink(missing_ok=True)
        return _in_memory(name, text)


def _is_whole(path: Path) -> bool:
    """Return whether a kernel's text was written to its end: a full disk or a power cut may have left part of it."""
    try:
        return path.read_text(encoding="utf-8").endswith(END)
    except (OSError, UnicodeDecodeError):
        return False


def _in_memory(name: str, text: Callable[[bool], str]) -> Callable[..., None]:
    log.info("compiling %s", name)
    module = types.ModuleType(f"dhkit_kernel_{name}")
    exec(compile(text(False), f"<{module.__name__}>", "exec"), vars(module))  # noqa: S102 - text of our own making
    function: Callable[..., None] = module.kernel
    return function


def _from_file(path: Path) -> Callable[..., None]:
    name = f"dhkit_kernel_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is no module")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # Numba looks there for the module of what it unpickles
    spec.loader.exec_module(module)
    function: Callable[..., None] = module.kernel
    return function


@cache
def _sources(derivation: str) -> str:
    here, own = Path(__file__).parent, Path(derivation)
    total = hashlib.sha256()
    symbolic = here.parent / "symbolic"
    for folder in (here, symbolic / "differentiable", symbolic / "programs", own):
        for path in sorted(folder.glob("*.py")) if folder.is_dir() else [folder]:
            total.update(path.read_bytes())
    return total.hexdigest()


@cache
def _machine() -> str:
    import llvmlite.binding
    import numba

    cpu = f"{llvmlite.binding.get_host_cpu_name()} {sorted(llvmlite.binding.get_host_cpu_features().items())}"
    return f"{sys.version} {numba.__version__} {np.__version__} {os.environ.get('NUMBA_CPU_NAME', cpu)}"
