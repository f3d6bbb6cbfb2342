"""Documents and their printers: every block in every format, and texts of others that stay texts."""

from __future__ import annotations

import io

import pytest
from PIL import Image as Picture

from dhkit.errors import MissingPackageError
from dhkit.report.document import (
    Code,
    Document,
    Figure,
    Formulas,
    Heading,
    Image,
    Items,
    Paragraph,
    Prompt,
    References,
    Table,
    html_text,
    latex_text,
    pdf,
    typst_text,
)
from dhkit.symbolic.equations.typst import Math, Row
from report.report_checks import check_html, check_latex

HOSTILE = (
    r"\end{document}\input{/etc/passwd}",
    "</title></h1><script>alert(1)</script><img src=x onerror=alert(1)>",
    '#import "/etc/passwd" #panic("x") $x$ *b* _i_ `c` @a <l> // /* \\',
    '"#eval("1")',
    "% & $ # _ { } ~ ^ \\ \" ' < >",
    "line\nbreak\ttab \x1b[31m \u202e name",
    "Müller 机器人 θ ² ° −",
)


def dot() -> bytes:
    content = io.BytesIO()
    Picture.new("RGB", (8, 6), "red").save(content, format="PNG")
    return content.getvalue()


def document(text: str = "text") -> Document:
    symbol = Math(r"\theta_{1}", "theta_(1)")
    row = Row(symbol, Math(r"\tfrac{1}{2} a + b", "inline(frac(1, 2)) a + b"))
    more = Row(None, Math("+ c", "+ c"))
    return Document(
        text,
        (
            Heading(text),
            Heading(text, 2),
            Heading(text, is_numbered=False),
            Paragraph(text, symbol, text),
            Prompt(text),
            Items(((text, symbol), (text,))),
            Formulas((row, more)),
            Formulas((row,)),
            Table((text, symbol), ((text, symbol), (text, text)), text, "lr"),
            Table((), ((text,),)),
            Figure((Image(dot(), text), Image(dot())), text, 0.5),
            Code(f"x = 1  # {text}\n", text),
            References((text, text)),
        ),
        text,
    )


@pytest.mark.parametrize("text", ["text", *HOSTILE])
def test_every_block_is_printed_and_texts_stay_texts(text):
    shown = document(text)

    latex, files = latex_text(shown, "figures")
    environments = check_latex(latex)
    assert set(files) == {"figures/figure1.png", "figures/figure2.png"}
    assert {"itemize", "align*", "longtable", "figure", "thebibliography"} <= set(environments)

    tags, _ = check_html(html_text(shown))
    assert tags.count("math") > 4 and tags.count("table") == 2 and tags.count("img") == 2

    _, files = typst_text(shown)
    assert set(files) == {"figure1.png", "figure2.png"}


@pytest.mark.parametrize("text", ["text", *HOSTILE])
def test_typst_prints_hostile_texts_as_they_are(text):
    pytest.importorskip("typst")
    printed = pdf(document(text))
    assert printed.content.startswith(b"%PDF") and printed.pages <= 2


def test_html_shows_texts_as_they_are_typed():
    for text in HOSTILE[:5]:
        _, shown = check_html(html_text(Document(text, (Paragraph(text),))))
        assert shown.count(text) == 3  # title, heading and paragraph


def test_verbatim_of_a_program_cannot_end_early():
    latex, _ = latex_text(Document("x", (Code(r"a\end{verbatim}\input{x}"),)))
    assert latex.count(r"\end{verbatim}") == 1


def test_a_pdf_without_typst_is_one_line(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "typst", None)
    with pytest.raises(MissingPackageError, match=r"a PDF .*needs typst.*\[report\]") as caught:
        pdf(document())
    assert "\n" not in str(caught.value)
    assert "html" in str(caught.value)


def test_a_formula_wider_than_the_line_is_made_smaller(tmp_path):
    pytest.importorskip("typst")
    pypdfium = pytest.importorskip("pypdfium2")
    wide = " + ".join(f"a_({k})" for k in range(80))
    row = Row(Math("x", "x"), Math("x", wide))
    page = pypdfium.PdfDocument(pdf(Document("x", (Formulas((row,)),))).content)[0]
    left, _, right, _ = zip(*(each.get_bounds() for each in page.get_objects()), strict=True)
    margin = 25 / 25.4 * 72
    assert min(left) >= margin - 1 and max(right) <= page.get_width() - margin + 1
