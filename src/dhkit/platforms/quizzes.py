"""Numeric questions about an arm at random states, as quizzes of Moodle and Canvas."""

from __future__ import annotations

import html
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from dhkit.description import Array, Description
from dhkit.errors import AnswerError
from dhkit.grading.grade_report import entry_name
from dhkit.platforms.contents import Package, Task
from dhkit.report.statement import arm_html

if TYPE_CHECKING:
    from dhkit.arm import Arm

ASKED = ("T", "J", "M", "g", "h", "tau", "K")
"""Quantities that have one value at a state; C and V depend on a choice, and tables are no numbers."""
_BODIES_ALONE = "Rotors of drives and friction are left out."
_MEANINGS = {
    "T": "T is the pose of the tool in the world: 4 rows of 4, lengths in m.",
    "J": "J is the Jacobian of the tool, 6 rows: velocity of its origin, then angular velocity, in world axes.",
    "M": f"M is the mass matrix. {_BODIES_ALONE}",
    "g": "g are the joint torques (forces of slides) that hold the arm against gravity.",
    "h": f"h = C qd are the Coriolis and centrifugal torques (forces of slides). {_BODIES_ALONE}",
    "tau": f"tau = M qdd + h + g are the joint torques (forces of slides). {_BODIES_ALONE}",
    "K": f"K is the kinetic energy. {_BODIES_ALONE}",
}
"""Definitions of what is asked."""
TOLERANCE = 1e-3
"""Relative error up to which a number is right: answers have four significant digits."""
_SMALLEST = 1e-2
"""Smallest value that is asked for, as a share of the largest entry at that state: no answer is 0 to rounding."""
_MAX_TRIES = 1_000
MAX_COUNT = 1_000
_QTI = "http://www.imsglobal.org/xsd/ims_qtiasiv1p2"
_MANIFEST = "http://www.imsglobal.org/xsd/imsccv1p1/imscp_v1p1"


@dataclass(frozen=True)
class Question:
    """A question with one number as its answer."""

    quantity: str
    name: str
    text: str
    """HTML."""
    value: float
    points: float

    @property
    def tolerance(self) -> float:
        """Largest error of an answer that is right."""
        return TOLERANCE * abs(self.value)


def questions(task: Task, count: int, seed: int) -> list[Question]:
    """Return variants of a question on each quantity that is asked for, at random states.

    Parameters
    ----------
    task
        The task.
    count
        Number of variants of each question, at most 1,000.
    seed
        Seed of the states; the same seed gives the same questions.

    Raises
    ------
    AnswerError
        The task asks for nothing that is a number at a state, or for dynamics of an arm without bodies.
    """
    if not 1 <= count <= MAX_COUNT:
        raise AnswerError(f"count: found {count}; expected 1 to {MAX_COUNT}")
    asked = [name for name in task.asked if name in ASKED]
    if not asked:
        raise AnswerError(
            f"{task.name}: task.asked: nothing of {', '.join(ASKED)}, which are numbers at a state"
        )
    from dhkit.arm import Arm

    arm = Arm(_without_drives(task.description))
    return [
        _question(task, arm, quantity, k, np.random.default_rng([seed, ASKED.index(quantity), k]))
        for quantity in asked
        for k in range(count)
    ]


def _without_drives(description: Description) -> Description:
    """Return an arm without rotors: questions give the links' bodies alone."""
    joints = tuple(replace(joint, drive=None) for joint in description.joints)
    return replace(description, joints=joints, couplings=())


def _question(
    task: Task, arm: Arm, quantity: str, number: int, rng: np.random.Generator
) -> Question:
    for _ in range(_MAX_TRIES):
        q, qd, qdd = _state(task.description, rng)
        values = _values(arm, quantity, q, qd, qdd)
        is_large = np.abs(values) >= _SMALLEST * np.abs(values).max()
        # Constant entries are read off the table, not computed.
        other = _values(arm, quantity, *_state(task.description, rng))
        candidates = np.argwhere(is_large & (values != other))
        if len(candidates):
            break
    else:
        raise AnswerError(
            f"{task.name}: {quantity} of {arm.name} has no entry that depends on the state"
        )
    index = tuple(int(i) for i in candidates[rng.integers(len(candidates))])
    entry = entry_name(quantity, index)
    text = _text(
        task.description, quantity, entry, _unit(task.description, quantity, index), q, qd, qdd
    )
    return Question(
        quantity,
        f"{arm.name} {quantity} {number + 1}",
        text,
        float(values[index]),
        task.points_of(quantity),
    )


def _state(description: Description, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Return joint values, rad or m, rates and accelerations with few digits, as they are printed."""
    is_prismatic = description.numbers.prismatic
    size = np.where(is_prismatic, 0.5, 3.0)
    q = np.round(rng.uniform(-size, size), 2)
    qd, qdd = np.round(rng.uniform(-2.0, 2.0, (2, description.n)), 1)
    return q, qd, qdd


def _values(arm: Arm, quantity: str, q: Array, qd: Array, qdd: Array) -> Array:
    """Return a quantity at a state, SI."""
    match quantity:
        case "T":
            return arm.fk(q)[:3]
        case "J":
            return arm.jacobian(q)
        case "M":
            return arm.mass_matrix(q)
        case "g":
            return arm.gravity_torque(q)
        case "h":
            return arm.inverse_dynamics(q, qd, np.zeros_like(q)) - arm.gravity_torque(q)
        case "tau":
            return arm.inverse_dynamics(q, qd, qdd)
    return np.asarray(arm.kinetic_energy(q, qd))


def _unit(description: Description, quantity: str, index: Sequence[int]) -> str:
    """Return the unit of an entry; empty for a number without unit."""
    slides = description.numbers.prismatic
    match quantity:
        case "T":
            return "m" if index[1] == 3 else ""
        case "J":
            joint = "m" if slides[index[1]] else "rad"
            rate = "m" if index[0] < 3 else "rad"
            return "" if rate == joint else f"{rate}/{joint}"
        case "M":
            return ("kg m²", "kg m", "kg")[int(slides[index[0]]) + int(slides[index[1]])]
        case "K":
            return "J"
    return "N" if slides[index[0]] else "N m"


def _text(
    description: Description,
    quantity: str,
    entry: str,
    unit: str,
    q: Array,
    qd: Array,
    qdd: Array,
) -> str:
    """Return the statement of a question as HTML."""
    of_state = {"q": q}
    if quantity in ("h", "tau", "K"):
        of_state["qd"] = qd
    if quantity == "tau":
        of_state["qdd"] = qdd
    lines = []
    for name, values in of_state.items():
        units = ["m" if slides else "rad" for slides in description.numbers.prismatic]
        per = {"q": "", "qd": "/s", "qdd": "/s²"}[name]
        numbers = ", ".join(
            f"{name}{i + 1} = {value:g} {unit}{per}"
            for i, (value, unit) in enumerate(zip(values, units, strict=True))
        )
        lines.append(f"<p>{numbers}</p>")
    asked = f"{entry}, in {unit}" if unit else entry
    about = f"{arm_html(description, [quantity])}<p>{html.escape(_MEANINGS[quantity])}</p>"
    return (
        f"{about}<p>What is {html.escape(asked)}, at this state?</p>{''.join(lines)}"
        "<p>Give at least four significant digits.</p>"
    )


def moodle_package(task: Task, drawn: Sequence[Question]) -> Package:
    """Return a file of Moodle XML: a category for each quantity, from which a quiz draws a random question.

    Source: Moodle documentation, Moodle XML format.
    """
    quiz = ET.Element("quiz")
    for quantity, variants in groupby(drawn, lambda question: question.quantity):
        category = ET.SubElement(quiz, "question", type="category")
        _with_text(category, "category", f"$course$/dhkit/{task.title}/{quantity}")
        for question in variants:
            item = ET.SubElement(quiz, "question", type="numerical")
            _with_text(item, "name", question.name)
            _with_text(item, "questiontext", question.text, format="html")
            ET.SubElement(item, "defaultgrade").text = f"{question.points:.7g}"
            ET.SubElement(item, "penalty").text = "0.3333333"
            ET.SubElement(item, "hidden").text = "0"
            answer = ET.SubElement(item, "answer", fraction="100", format="moodle_auto_format")
            ET.SubElement(answer, "text").text = f"{question.value:.8g}"
            ET.SubElement(answer, "tolerance").text = f"{question.tolerance:.3g}"
            _with_text(answer, "feedback", "", format="html")
    return Package({f"{task.name}.xml": _document(quiz)})


def _with_text(parent: ET.Element, tag: str, text: str, **attributes: str) -> None:
    ET.SubElement(ET.SubElement(parent, tag, attributes), "text").text = text


def canvas_package(task: Task, drawn: Sequence[Question]) -> Package:
    """Return the files of a QTI 1.2 package as Canvas imports them: of each quantity's variants a quiz shows one.

    Source: IMS QTI 1.2 ASI and Content Packaging; Canvas' numerical questions and question groups.
    """
    ident = f"dhkit_{task.digest[:24]}"
    root = ET.Element("questestinterop", xmlns=_QTI)
    assessment = ET.SubElement(root, "assessment", ident=ident, title=task.title)
    whole = ET.SubElement(assessment, "section", ident="root_section")
    for quantity, variants in groupby(drawn, lambda question: question.quantity):
        group = ET.SubElement(whole, "section", ident=f"{ident}_{quantity}", title=quantity)
        alike = list(variants)
        _pick_one(group, alike[0].points)
        group.extend(_items(ident, alike))
    name = f"{ident}/{ident}.xml"
    return Package({"imsmanifest.xml": _document(_manifest(ident, name)), name: _document(root)})


def _pick_one(group: ET.Element, points: float) -> None:
    selection = ET.SubElement(ET.SubElement(group, "selection_ordering"), "selection")
    ET.SubElement(selection, "selection_number").text = "1"
    extension = ET.SubElement(selection, "selection_extension")
    ET.SubElement(extension, "points_per_item").text = f"{points:.7g}"


def _items(ident: str, alike: Sequence[Question]) -> Iterator[ET.Element]:
    for number, question in enumerate(alike):
        item = ET.Element(
            "item", ident=f"{ident}_{question.quantity}_{number}", title=question.name
        )
        metadata = ET.SubElement(ET.SubElement(item, "itemmetadata"), "qtimetadata")
        fields = {
            "question_type": "numerical_question",
            "points_possible": f"{question.points:.7g}",
        }
        for label, entry in fields.items():
            one = ET.SubElement(metadata, "qtimetadatafield")
            ET.SubElement(one, "fieldlabel").text = label
            ET.SubElement(one, "fieldentry").text = entry
        presentation = ET.SubElement(item, "presentation")
        material = ET.SubElement(presentation, "material")
        ET.SubElement(material, "mattext", texttype="text/html").text = question.text
        response = ET.SubElement(
            presentation, "response_str", ident="response1", rcardinality="Single"
        )
        fill_in = ET.SubElement(response, "render_fib", fibtype="Decimal")
        ET.SubElement(fill_in, "response_label", ident="answer1")
        item.append(_processing(question))
        yield item


def _processing(question: Question) -> ET.Element:
    """Return the rule by which an answer gets all points: the number itself, or one within the tolerance."""
    processing = ET.Element("resprocessing")
    outcomes = ET.SubElement(processing, "outcomes")
    ET.SubElement(
        outcomes, "decvar", maxvalue="100", minvalue="0", varname="SCORE", vartype="Decimal"
    )
    condition = ET.SubElement(processing, "respcondition", {"continue": "No"})
    either = ET.SubElement(ET.SubElement(condition, "conditionvar"), "or")
    ET.SubElement(either, "varequal", respident="response1").text = f"{question.value:.8g}"
    within = ET.SubElement(either, "and")
    low, high = question.value - question.tolerance, question.value + question.tolerance
    ET.SubElement(within, "vargte", respident="response1").text = f"{low:.8g}"
    ET.SubElement(within, "varlte", respident="response1").text = f"{high:.8g}"
    ET.SubElement(condition, "setvar", action="Set", varname="SCORE").text = "100"
    return processing


def _manifest(ident: str, name: str) -> ET.Element:
    manifest = ET.Element("manifest", identifier=f"{ident}_manifest", xmlns=_MANIFEST)
    metadata = ET.SubElement(manifest, "metadata")
    ET.SubElement(metadata, "schema").text = "IMS Content"
    ET.SubElement(metadata, "schemaversion").text = "1.1.3"
    ET.SubElement(manifest, "organizations")
    resources = ET.SubElement(manifest, "resources")
    resource = ET.SubElement(resources, "resource", identifier=ident, type="imsqti_xmlv1p2")
    ET.SubElement(resource, "file", href=name)
    return manifest


def _document(root: ET.Element) -> bytes:
    ET.indent(root)
    content: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return content
