"""PrairieLearn's element: its four functions, called with data as PrairieLearn's documentation lists it."""

import pytest

from dhkit.platforms import pack
from dhkit.platforms.prairielearn_element import grade, parse, prepare, render

from .conftest import RIGHT_G, WRONG_G, M

MARKUP = '<dhkit-answer quantity="g"></dhkit-answer>'


@pytest.fixture
def data(tmp_path, task):
    """Return a question's data before anything was handed in."""
    pack("prairielearn", task).write(tmp_path / "question")
    return {
        "params": {},
        "correct_answers": {},
        "submitted_answers": {},
        "raw_submitted_answers": {},
        "format_errors": {},
        "partial_scores": {},
        "score": 0.0,
        "feedback": {},
        "variant_seed": "1",
        "options": {"question_path": str(tmp_path / "question")},
        "editable": True,
        "panel": "question",
        "extensions": {},
    }


def hand_in(data, text, quantity="g"):
    data["submitted_answers"][quantity] = data["raw_submitted_answers"][quantity] = text


@pytest.mark.parametrize(("text", "score"), [(RIGHT_G, 1.0), (WRONG_G, 0.5), ("[0, 0]", 0.0)])
def test_an_answer_is_judged(data, text, score):
    prepare(MARKUP, data)
    assert '<textarea name="g"' in render(MARKUP, data)
    hand_in(data, text)
    parse(MARKUP, data)
    assert data["format_errors"] == {}
    grade(MARKUP, data)
    assert data["partial_scores"]["g"]["score"] == pytest.approx(score)
    assert data["partial_scores"]["g"]["weight"] == pytest.approx(20 / 3)
    data["panel"] = "submission"
    assert "g1:" in render(MARKUP, data)


def test_a_matrix_is_judged(data):
    markup = '<dhkit-answer quantity="M" task="task.toml"></dhkit-answer>'
    hand_in(data, M, "M")
    parse(markup, data)
    grade(markup, data)
    assert data["partial_scores"]["M"]["score"] == 1.0


@pytest.mark.parametrize("text", ["", "  ", "[1, 2, 3]", "cos(", "x" * 30_000])
def test_what_cannot_be_read_costs_no_attempt(data, text):
    hand_in(data, text)
    parse(MARKUP, data)
    assert data["format_errors"]["g"]
    data["panel"] = "submission"
    render(MARKUP, data)


def test_answers_are_escaped(data):
    hand_in(data, "</textarea><script>alert(1)</script>")
    for panel in ("question", "submission"):
        data["panel"] = panel
        assert "<script>" not in render(MARKUP, data)


@pytest.mark.parametrize(
    "markup",
    [
        "<dhkit-answer></dhkit-answer>",
        '<dhkit-answer quantity="g" task="../task.toml"></dhkit-answer>',
        '<dhkit-answer quantity="g2"></dhkit-answer>',
        '<dhkit-answer quantity="V"></dhkit-answer>',
    ],
)
def test_a_bad_element_is_refused_when_a_variant_is_made(data, markup):
    with pytest.raises(ValueError, match="dhkit-answer"):
        prepare(markup, data)
