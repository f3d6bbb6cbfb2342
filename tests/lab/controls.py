"""Controls of the lab's page, found as a person finds them: by name and by text."""

import json


def panel(page, name):
    """Open a panel."""
    # A click on the panel that is open hides it.
    if (
        page.evaluate(f"document.getElementById('tab-{name}').getAttribute('aria-selected')")
        != "true"
    ):
        page.click(f"document.getElementById('tab-{name}')")
    assert page.evaluate(f"document.getElementById('panel-{name}').hidden") is False


def labelled(label):
    """Return the control of this name, as JavaScript."""
    return f"document.querySelector({json.dumps(f'#lab [aria-label={json.dumps(label)}]')})"


def button(text, within="#lab"):
    """Return the visible button that says this, as JavaScript."""
    return (
        f"[...document.querySelectorAll({json.dumps(within + ' button')})]"
        f".find(b => b.offsetWidth && b.textContent.trim() === {json.dumps(text)})"
    )


def set_joints(lab, page, q):
    """Set the joint values in Python; wait until the page has the pose of the tool, which the next click may read."""
    lab.answer("joints.set", {"q": list(q)})
    T = json.dumps(lab.desk.arm.fk(lab.desk.q).ravel().tolist())
    page.until(f"dhkit.lab.state.tool?.T.every((x, k) => x === {T}[k])")
