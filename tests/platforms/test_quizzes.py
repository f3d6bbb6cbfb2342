"""Numeric questions: their numbers against Pinocchio, and the formats of Moodle and Canvas."""

import io
import re
import xml.etree.ElementTree as ET
import zipfile
from dataclasses import replace

import numpy as np
import pinocchio
import pytest

from dhkit import Arm, pose
from dhkit.description import to_toml
from dhkit.errors import AnswerError
from dhkit.platforms import pack
from dhkit.platforms.contents import Task
from dhkit.platforms.quizzes import TOLERANCE, questions

QTI = "{http://www.imsglobal.org/xsd/ims_qtiasiv1p2}"
MANIFEST = "{http://www.imsglobal.org/xsd/imsccv1p1/imscp_v1p1}"
ROBOTS = ["planar2r", "polar_rp", "puma560", "stanford", "panda"]


def task_of(folder, robot, asked=("T", "J", "M", "g", "h", "tau", "K")):
    path = folder / "quiz.toml"
    path.write_text(f'robot = "{robot}"\n[task]\nasked = {list(asked)}\n')
    return path


def state(text, n):
    """Return the state that a question prints: q, qd, qdd; zero where it prints none."""
    values = np.zeros((3, n))
    for k, name in enumerate(("q", "qd", "qdd")):
        for number, value in re.findall(rf"\b{name}(\d+) = (-?[\d.e-]+)", text):
            values[k, int(number) - 1] = float(value)
    return values


def entry(text):
    return re.search(r"What is (\w+?)_?(\d*)(?:_(\d+))?, ", text) or re.search(
        r"What is (\w+?)(\d*)()[,?]", text
    )


def truth(arm, quantity, q, qd, qdd):
    """Return a quantity by Pinocchio, in the axes of the question."""
    model = arm.model
    data = model.createData()
    if quantity == "M":
        M = pinocchio.crba(model, data, q)
        return np.triu(M) + np.triu(M, 1).T
    if quantity == "g":
        return pinocchio.computeGeneralizedGravity(model, data, q)
    if quantity == "tau":
        return pinocchio.rnea(model, data, q, qd, qdd)
    if quantity == "h":
        g = pinocchio.computeGeneralizedGravity(model, data, q)
        return pinocchio.rnea(model, data, q, qd, 0 * q) - g
    return np.asarray(pinocchio.computeKineticEnergy(model, data, q, qd))


@pytest.mark.parametrize("robot", ROBOTS)
def test_answers_are_pinocchios(tmp_path, robot):
    task = Task.read(task_of(tmp_path, robot, ("M", "g", "h", "tau", "K")))
    # The statement has the links' bodies, and no rotors.
    description = Arm.load(robot).description
    joints = tuple(replace(joint, drive=None) for joint in description.joints)
    arm = Arm(replace(description, joints=joints, couplings=()))
    for question in questions(task, 5, 1):
        values = truth(arm, question.quantity, *state(question.text, arm.n))
        name = re.search(r"What is ([\w]+)", question.text)[1]
        indices = re.findall(r"\d", name.removeprefix(question.quantity))
        found = values[tuple(int(i) - 1 for i in indices)]
        assert question.value == pytest.approx(found, rel=1e-6)
        assert question.tolerance == pytest.approx(TOLERANCE * abs(found))
        assert abs(question.value) > 0


@pytest.mark.parametrize("robot", ROBOTS)
def test_poses_and_jacobians_are_those_of_the_printed_state(tmp_path, robot):
    arm = Arm.load(robot)
    for question in questions(Task.read(task_of(tmp_path, robot, ("T", "J"))), 5, 2):
        q = state(question.text, arm.n)[0]
        name = re.search(r"What is ([\w]+)", question.text)[1]
        i, j = (int(digit) - 1 for digit in re.findall(r"\d", name))
        values = arm.fk(q) if question.quantity == "T" else arm.jacobian(q)
        assert question.value == values[i, j]


def test_units_are_those_of_joints_and_entries(tmp_path):
    texts = [q.text for q in questions(Task.read(task_of(tmp_path, "polar_rp")), 30, 0)]
    asked = {re.search(r"What is ([^?]*), at this state", text)[1] for text in texts}
    assert "M11, in kg m²" in asked
    assert "tau1, in N m" in asked
    assert "tau2, in N" in asked
    assert any(one.startswith("J") and "in m/rad" in one for one in asked)
    assert any(one.startswith("T") and one.endswith("in m") for one in asked)


def test_a_question_can_be_solved_from_its_page(tmp_path):
    texts = [q.text for q in questions(Task.read(task_of(tmp_path, "puma560")), 1, 0)]
    assert all("Rz(theta) Tz(d)" in text for text in texts)
    moving = [text for text in texts if "kg m²" in text]
    assert len(moving) == 5
    assert all("centre of mass" in text and "Free fall" in text for text in moving)


def test_the_place_of_the_base_is_printed(tmp_path):
    raised = to_toml(Arm.load("planar2r").with_base(pose([0, 0, 0.5])).description)
    (tmp_path / "raised.toml").write_text(raised)
    (text,) = [q.text for q in questions(Task.read(task_of(tmp_path, "raised.toml", ("T",))), 1, 0)]
    assert "Frame 0 lies in the world" in text
    assert "0.5" in text


def test_variants_differ_and_are_repeatable(tmp_path):
    task = Task.read(task_of(tmp_path, "planar2r", ("M",)))
    first = questions(task, 50, 0)
    assert [q.text for q in first] == [q.text for q in questions(task, 50, 0)]
    assert len({q.text for q in first}) == 50
    assert [q.text for q in questions(task, 20, 0)] == [q.text for q in first[:20]]


def test_moodles_file_has_a_category_a_quantity(tmp_path):
    package = pack("moodle", task_of(tmp_path, "planar2r", ("M", "g")), count=3)
    root = ET.fromstring(package.files["quiz.xml"])
    assert root.tag == "quiz"
    kinds = [question.get("type") for question in root]
    assert kinds == ["category", *["numerical"] * 3] * 2
    for question in root.findall("question[@type='numerical']"):
        assert question.findtext("name/text")
        assert question.find("questiontext").get("format") == "html"
        answer = question.find("answer")
        assert answer.get("fraction") == "100"
        value = float(answer.findtext("text"))
        assert float(answer.findtext("tolerance")) == pytest.approx(
            abs(value) * TOLERANCE, rel=0.01
        )


def test_canvas_package_names_its_file_and_picks_one_variant(tmp_path):
    package = pack("canvas", task_of(tmp_path, "planar2r", ("M", "g")), count=4)
    with zipfile.ZipFile(io.BytesIO(package.zipped())) as archive:
        manifest = ET.fromstring(archive.read("imsmanifest.xml"))
        resource = manifest.find(f".//{MANIFEST}resource")
        assert resource.get("type") == "imsqti_xmlv1p2"
        root = ET.fromstring(archive.read(resource.find(f"{MANIFEST}file").get("href")))
    assert root.tag == f"{QTI}questestinterop"
    groups = root.findall(f"{QTI}assessment/{QTI}section/{QTI}section")
    assert [group.get("title") for group in groups] == ["M", "g"]
    identities = [item.get("ident") for item in root.iter(f"{QTI}item")]
    assert len(identities) == len(set(identities)) == 8
    for group in groups:
        assert group.findtext(f".//{QTI}selection_number") == "1"
        for item in group.findall(f"{QTI}item"):
            low = float(item.findtext(f".//{QTI}vargte"))
            high = float(item.findtext(f".//{QTI}varlte"))
            assert low < float(item.findtext(f".//{QTI}varequal")) < high


@pytest.mark.parametrize(
    ("asked", "count", "message"),
    [(("C", "dh"), 5, "nothing of T, J"), (("M",), 0, "count: found 0")],
)
def test_what_is_no_quiz_is_refused(tmp_path, asked, count, message):
    with pytest.raises(AnswerError, match=message):
        pack("moodle", task_of(tmp_path, "planar2r", asked), count=count)
