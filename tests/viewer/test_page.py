"""Facts of the page's files, and what happens where meshcat's viewer is missing."""

import base64
import json
import re
from importlib import resources

import pytest

from dhkit.errors import ModelError
from dhkit.viewer import page
from dhkit.viewer.diagrams import CURVE_COLORS
from dhkit.viewer.overlays import AXIS_COLORS, TINTS


def test_every_module_is_known_and_imports_known_ones():
    files = page.page_files()
    for name in page.MODULES:
        source = files[name][1].decode()
        for imported in re.findall(r'from "([^"]+)"', source):
            assert imported.startswith("./")
            assert imported.removeprefix("./") in page.MODULES


def test_the_live_page_names_only_files_that_are_served():
    files = page.page_files()
    for link in re.findall(r'(?:src|href)="([^"]+)"', files[""][1].decode()):
        assert link.startswith("data:") or link in files


def test_an_offline_page_holds_its_messages_and_no_address():
    text = page.offline_page([b"\x01\x02", b"</script>"], "a < b & c")
    data = re.search(r'id="messages">(.*?)</script>', text).group(1)
    assert [base64.b64decode(x) for x in json.loads(data)] == [b"\x01\x02", b"</script>"]
    assert "<title>a &lt; b &amp; c</title>" in text
    assert not re.findall(r'(?:src|href)="(?!data:)', text)
    assert set(re.findall(r"(?:https?|wss?)://[\w.]+", text)) <= {
        "http://www.w3.org",
        "https://feross.org",
    }


@pytest.mark.parametrize(
    ("spec", "content", "complaint"),
    [
        (None, None, "needs the package meshcat, which is not installed"),
        ("meshcat", None, "main.min.js: No such file or directory; expected meshcat's viewer"),
        ("meshcat", b"something else", "is not the viewer of meshcat 0.3"),
    ],
)
def test_a_missing_viewer_is_named(monkeypatch, tmp_path, spec, content, complaint):
    class Spec:
        origin = str(tmp_path / "__init__.py")

    monkeypatch.setattr(page, "find_spec", lambda name: Spec if spec else None)
    if content is not None:
        (tmp_path / "viewer/dist").mkdir(parents=True)
        (tmp_path / "viewer/dist/main.min.js").write_bytes(content)
    with pytest.raises(ModelError, match=complaint):
        page.meshcat_bundle()


def test_the_page_draws_in_the_colors_of_python():
    script = (resources.files("dhkit.viewer") / "static" / "colors.js").read_text("utf-8")
    _, axes, ghosts, grey = (
        re.findall(r'"(#[0-9a-f]{6})"', part) for part in script.split("export const")
    )
    assert (tuple(axes), tuple(ghosts)) == (AXIS_COLORS, TINTS)
    assert (*TINTS[:6], *grey) == CURVE_COLORS
