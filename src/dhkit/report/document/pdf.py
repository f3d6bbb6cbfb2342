"""Documents as PDF by the package typst, without the network and without TeX."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from dhkit.errors import ModelError, from_checkout
from dhkit.packages import imported
from dhkit.report.document.tree import Document
from dhkit.report.document.typst import PAGES_LABEL, typst_text

_MAIN = "document.typ"


@dataclass(frozen=True, eq=False)
class Pdf:
    """A PDF.

    Attributes
    ----------
    content
        Content of the file.
    pages
        Number of its pages.
    """

    content: bytes
    pages: int


def require_typst() -> Any:
    """Return the package typst.

    Raises
    ------
    MissingPackageError
        It is not installed.
    """
    return imported(
        "typst", "a PDF (the formats html and tex need nothing)", from_checkout("report")
    )


def pdf(document: Document) -> Pdf:
    """Return a document as PDF.

    Raises
    ------
    MissingPackageError
        The package typst is not installed.
    ModelError
        It refuses the document.

    Examples
    --------
    >>> from dhkit.report.document import Paragraph
    >>> pdf(Document("A page", (Paragraph("text"),))).pages  # doctest: +SKIP
    1
    """
    typst = require_typst()
    text, files = typst_text(document)
    # typst reads files below its root alone: a folder with nothing but the document's own.
    with TemporaryDirectory(prefix="dhkit-report-") as root:
        for name, content in files.items():
            (Path(root) / name).write_bytes(content)
        main = Path(root) / _MAIN
        main.write_text(text, "utf-8")
        try:
            compiler = typst.Compiler(str(main), root=root)
            printed = compiler.compile(format="pdf")
            pages = compiler.query(f"<{PAGES_LABEL}>", field="value", one=True)
        except RuntimeError as error:
            reason = " ".join(str(error).split())[:200]
            raise ModelError(f"typst refuses the document: {reason}") from None
    return Pdf(bytes(printed), int(pages))
