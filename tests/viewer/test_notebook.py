"""A view in a notebook: a page in a frame that reaches nothing, moved by Python through a widget that only relays."""

# ruff: noqa: E501 - JavaScript in one line

import base64
import importlib.util
import json
import re
import time
from importlib import resources

import numpy as np
import pytest

from dhkit.description import library_robot
from dhkit.viewer import View, notebook
from viewer.messages import decode_ghosts
from viewer.pictures import shows_the_arm
from waiting import HANGS, wait_for

FLOAT32 = 1e-6
"""m, on an arm of 2 m."""
VIEW = "application/vnd.jupyter.widget-view+json"


@pytest.fixture
def without_anywidget(monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        notebook, "find_spec", lambda name: None if name == "anywidget" else find(name)
    )
    notebook._widget_class.cache_clear()
    yield
    notebook._widget_class.cache_clear()


@pytest.mark.parametrize("served", [False, True])
def test_a_static_copy_is_in_a_sandbox_and_names_no_address(without_anywidget, served):
    with View(library_robot("planar2r")) as view:
        address = view.url if served else "http://127.0.0.1"
        bundle = view._repr_mimebundle_()
        assert set(bundle) == {"text/html", "text/plain"}
        for text in (bundle["text/html"], view._repr_html_()):
            assert re.findall(r'sandbox="([^"]*)"', text) == ["allow-scripts"]
            assert address not in text
            assert "127.0.0.1" not in text
            assert "pip install anywidget" in text


def test_a_widget_is_told_what_the_view_shows():
    anywidget = pytest.importorskip("anywidget")
    view = View(library_robot("planar2r"))
    assert VIEW in _first(view._repr_mimebundle_())
    widget, sent = view._widget, []
    assert isinstance(widget, anywidget.AnyWidget)
    widget.send = lambda content, buffers=None: sent.append((content, buffers))
    view.show([0.25, -0.5])
    view.ghosts([[0.1, 0.2]])
    assert sent[0] == ({"q": [0.25, -0.5]}, None)
    assert len(decode_ghosts(sent[1][1][0]).transforms) == 1
    before = widget.page
    view.replace(library_robot("planar3r"))
    assert widget.page != before
    assert "planar3r" in widget.page
    again = view._repr_mimebundle_()
    assert view._widget is widget
    assert VIEW in _first(again)


def _first(bundle):
    return bundle[0] if isinstance(bundle, tuple) else bundle


HARNESS = """<!doctype html><body data-ready="1"><div id="one"></div><div id="other"></div>
<iframe id="stranger" srcdoc="<script>setInterval(() => parent.frames[0]?.postMessage({{q: [9, 9]}}, '*'), 50)</script>"></iframe>
<script type="module">
const handlers = {{}};
globalThis.relayed = 0;
globalThis.model = {{
  values: {{ page: {page}, title: "arm", style: "width: 880px; height: 600px; border: 0" }},
  get(name) {{ return this.values[name]; }},
  on(event, call) {{ (handlers[event] ??= []).push(call); }},
  off(event, call) {{ handlers[event] = handlers[event].filter(other => other !== call); }},
  tell(content, buffers) {{ for (const call of handlers["msg:custom"]) call(content, buffers); }},
}};
const module = await import("data:text/javascript;base64,{script}");
globalThis.close = module.default.render({{ model, el: document.getElementById("one") }});
globalThis.handlers = handlers;
</script>"""


def test_the_widget_moves_the_arm_in_the_frame_and_strangers_do_not(chromium, tmp_path, signal_arm):
    script = (resources.files("dhkit.viewer") / "static" / "notebook.js").read_text("utf-8")
    view = View(signal_arm)
    text = HARNESS.format(
        page=json.dumps(view.html(interactive=True)).replace("</", "<\\/"),
        script=base64.b64encode(script.encode()).decode(),
    )
    (tmp_path / "notebook.html").write_text(text)
    page = chromium.page()
    try:
        page.call("Page.navigate", url=f"file://{tmp_path}/notebook.html")
        page.until("globalThis.close && document.querySelector('#one iframe')")
        assert (
            page.evaluate("document.querySelector('#one iframe').getAttribute('sandbox')")
            == "allow-scripts"
        )
        pictures = []
        # What comes before the page in the frame is ready waits for it.
        for q in ([0.4, 0.2], [-0.9, 0.9]):
            page.evaluate(f"model.tell({{ q: {q} }})")
            view.show(q)
            expected = _still(page)
            assert shows_the_arm(expected)
            pictures.append(expected)
        assert np.any(np.abs(pictures[0] - pictures[1]) > 20, axis=-1).sum() > 500
        assert page.errors == []
        page.evaluate("close()")
        assert page.evaluate("handlers['msg:custom'].length") == 0
    finally:
        page.close()


def _still(page):
    """Return the picture once it shows the arm and two in a row are the same."""
    end, before = time.monotonic() + HANGS, None
    while True:
        time.sleep(0.4)
        now = page.screenshot()
        if before is not None and shows_the_arm(now) and np.array_equal(now, before):
            return now
        before = now
        assert time.monotonic() < end, page.errors


NOTEBOOK = """
import sys
sys.modules["anywidget"] = None
import dhkit
view = dhkit.Arm.load("puma560").view()
view.show(dhkit.Arm.load("puma560").configurations["nominal"])
view
"""


@pytest.mark.slow
def test_a_notebook_that_nbconvert_has_run_and_rendered_shows_the_arm(chromium, tmp_path):
    nbformat, client = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    exporter = pytest.importorskip("nbconvert").HTMLExporter()
    document = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(NOTEBOOK)])
    client.NotebookClient(document, timeout=120, kernel_name="python3").execute()
    text, _ = exporter.from_notebook_node(document)
    assert "127.0.0.1" not in text.replace("http://127.0.0.1:7000", "")
    (tmp_path / "notebook.html").write_text(text)
    page = chromium.page(width=1000, height=800)
    try:
        page.call("Page.navigate", url=f"file://{tmp_path}/notebook.html")
        page.until("document.querySelector('iframe[sandbox]')")
        page.evaluate("document.querySelector('iframe').scrollIntoView()")
        wait_for(lambda: _links(page.screenshot()) > 3000, "the arm")
    finally:
        page.close()


def _links(picture):
    """Return the number of pixels in the cream of the PUMA's links."""
    return ((picture.min(axis=-1) > 150) & (picture[..., 0] - picture[..., 2] > 8)).sum()
