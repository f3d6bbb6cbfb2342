"""Mass properties as CAD programs report them: the same body as integrated from its mesh, whatever units and signs."""

import re

import numpy as np
import pytest

from dhkit.errors import ModelError
from dhkit.model.mass_report import read_mass_report
from dhkit.model.shape_inertia import shape_inertia
from mesh_shapes import box, pose

AGREES = 1e-9
"""Relative, of a report written to all digits."""
SIGNS = (1, -1)


def body(seed=3):
    rng = np.random.default_rng(seed)
    return shape_inertia(
        box((0.1, 0.25, 0.4), (0.03, -0.02, 0.05)).moved(pose(rng)), density=2700.0
    )


def csv_text(found, units=("g", "mm"), sign="-", digits=17, separator=","):
    mass_unit, length_unit = units
    mass, length = {"g": 1e3, "kg": 1.0}[mass_unit], {"mm": 1e3, "m": 1.0}[length_unit]
    moment, tensor = mass * length**2, found.inertia
    k = 1 if sign == "-" else -1
    numbers = [
        found.mass * mass,
        *(found.com * length),
        *(moment * np.diag(tensor)),
        *(k * moment * tensor[[0, 1, 0], [1, 2, 2]]),
    ]
    names = ["mass", "com_x", "com_y", "com_z", "Ixx", "Iyy", "Izz", "Ixy", "Iyz", "Ixz"]
    brackets = [mass_unit, *[length_unit] * 3, *[f"{mass_unit} {length_unit}^2"] * 6]
    heading = separator.join(
        ["link", *(f"{name} [{unit}]" for name, unit in zip(names, brackets, strict=True))]
    )
    row = separator.join(["link2", *(f"{x:.{digits}g}" for x in numbers)])
    return f"# products = {sign}integral\n{heading}\n{row}\n"


def solidworks_text(
    found,
    sign=1,
    digits=17,
    *,
    principal=True,
    origin=True,
    notation="",
    units=("grams", "millimeters"),
):
    """SolidWorks' text; sign +1: its products are +integral, the default."""
    mass, length = (
        {"grams": 1e3, "kilograms": 1.0}[units[0]],
        {"millimeters": 1e3, "meters": 1.0}[units[1]],
    )
    moment = mass * length**2
    diagonal = np.eye(3, dtype=bool)

    def listed(letter, tensor):
        entries = moment * np.where(diagonal, tensor, -sign * tensor)
        names = [[f"{letter}{i}{j}" for j in "xyz"] for i in "xyz"]
        return "\n".join(
            "\t" + "\t".join(f"{n} = {x:.{digits}g}" for n, x in zip(*pair, strict=True))
            for pair in zip(names, entries, strict=True)
        )

    com, inertia = found.com, found.inertia
    about_origin = inertia + found.mass * (com @ com * np.eye(3) - np.outer(com, com))
    values, vectors = np.linalg.eigh(inertia)
    heading = f"moments of inertia: ( {units[0]} *  square {units[1]} )"
    text = f"""Mass properties of Part2
     Configuration: Default
     Coordinate system: -- default --

Density = 0.00 {units[0]} per cubic {units[1][:-1]}

Mass = {found.mass * mass:.{digits}g} {units[0]}

Volume = 1.00  cubic {units[1]}

Center of mass: ( {units[1]} )
\tX = {com[0] * length:.{digits}g}
\tY = {com[1] * length:.{digits}g}
\tZ = {com[2] * length:.{digits}g}
"""
    if principal:
        text += (
            f"\nPrincipal axes of inertia and principal {heading}\nTaken at the center of mass.\n"
            + "".join(
                f"\t I{axis} = ({v[0]:.6f}, {v[1]:.6f}, {v[2]:.6f})   \tP{axis} = {moment * p:.{digits}g}\n"
                for axis, v, p in zip("xyz", vectors.T, values, strict=True)
            )
        )
    text += f"\nM{heading[1:]}\nTaken at the center of mass and aligned with the output coordinate system.{notation}\n"
    text += listed("L", inertia) + "\n"
    if origin:
        text += (
            f"\nM{heading[1:]}\nTaken at the output coordinate system.{notation}\n"
            + listed("I", about_origin)
            + "\n"
        )
    return text


def read(tmp_path, text, name="report.txt"):
    path = tmp_path / name
    path.write_text(text)
    (found,) = read_mass_report(path)
    return found


def difference(one, other):
    return max(
        abs(one.mass - other.mass) / other.mass,
        np.abs(one.com - other.com).max(),
        np.abs(one.inertia - other.inertia).max() / np.abs(other.inertia).max(),
    )


def test_a_report_is_the_body_integrated(tmp_path, law):
    for seed in range(law.samples(200)):
        found = body(seed)
        for units in (("g", "mm"), ("kg", "m"), ("g", "m")):
            for sign in "+-":
                table = read(tmp_path, csv_text(found, units, sign), "report.csv")
                law.holds("CSV, relative", difference(table.properties, found), AGREES)
        for units in (("grams", "millimeters"), ("kilograms", "meters")):
            for sign in SIGNS:
                report = read(tmp_path, solidworks_text(found, sign, units=units))
                law.holds("SolidWorks, relative", difference(report.properties, found), AGREES)
                assert "found by" in report.notes[1]
        T = pose(np.random.default_rng(seed))
        seen = read(tmp_path, solidworks_text(found.moved(T)))
        law.holds(
            "moved into its frame, relative",
            difference(seen.properties.moved(np.linalg.inv(T)), found),
            AGREES,
        )


@pytest.mark.parametrize("sign", SIGNS)
@pytest.mark.parametrize(("principal", "origin"), [(True, False), (False, True), (True, True)])
def test_the_sign_of_products_is_found_by_either_block_with_rounded_numbers(
    tmp_path, sign, principal, origin
):
    found = body()
    report = read(tmp_path, solidworks_text(found, sign, 7, principal=principal, origin=origin))
    assert difference(report.properties, found) < 1e-5
    assert ("+integral" if sign == 1 else "entries of the tensor") in report.notes[1]
    assert "Lxx" in report.notes[0] and report.part == "Part2"


@pytest.mark.parametrize("sign", SIGNS)
def test_two_decimal_places_as_solidworks_prints_them(tmp_path, sign):
    found = body()
    text = re.sub(
        r"(= )(-?\d+\.?\d*(?:e-?\d+)?)",
        lambda m: f"{m[1]}{float(m[2]):.2f}",
        solidworks_text(found, sign),
    )
    report = read(tmp_path, text)
    assert difference(report.properties, found) < 1e-4
    assert ("+integral" if sign == 1 else "entries of the tensor") in report.notes[1]
    small = shape_inertia(box((0.1, 0.25, 0.4), (0.03, -0.02, 0.05)), density=50.0)
    coarse = re.sub(
        r"(= )(-?\d+\.?\d*(?:e-?\d+)?)",
        lambda m: f"{m[1]}{float(m[2]):.2f}",
        solidworks_text(small, sign, units=("kilograms", "meters")),
    )
    with pytest.raises(ModelError, match="too few digits"):
        read(tmp_path, coarse)


def test_masses_and_centres_with_too_few_digits_are_refused_or_warned_of(tmp_path):
    text = solidworks_text(body(), units=("kilograms", "meters"))

    def with_numbers(mass, x):
        changed = re.sub(r"Mass = \S+", f"Mass = {mass}", text)
        return re.sub(
            r"\tX = \S+",
            f"\tX = {x}",
            re.sub(r"(?s)\nMoments of inertia[^M]*\nTaken at the output.*", "", changed),
        )

    with pytest.raises(
        ModelError, match=r"line 7: its mass has too few digits, 50 %; choose smaller units or more"
    ):
        read(tmp_path, with_numbers("0.01", 0.03))
    with pytest.raises(
        ModelError, match=r"its centre of mass has too few digits, \d+ % of its radius of gyration"
    ):
        read(tmp_path, with_numbers("27.0000", "0.0"))
    rounded = read(tmp_path, with_numbers("27.0", "0.030"))
    assert "warning: its mass is rounded to 0.2 %" in rounded.notes
    assert any("warning: its centre of mass is rounded to" in note for note in rounded.notes)


@pytest.mark.parametrize(
    "title",
    [
        "Mass properties of robot.SLDASM",
        "Mass properties of robot\n( Assembly Configuration - Default )",
    ],
)
def test_a_report_of_an_assembly_is_refused(tmp_path, title):
    with pytest.raises(
        ModelError, match=r"line [12]: a report of an assembly; expected one of the part of a link"
    ):
        read(tmp_path, solidworks_text(body()).replace("Mass properties of Part2", title))


def test_without_other_blocks_the_stated_notation_or_the_default_counts(tmp_path):
    found = body()
    default = read(tmp_path, solidworks_text(found, 1, principal=False, origin=False))
    assert "default" in default.notes[1] and difference(default.properties, found) < AGREES
    negative = " (Using negative tensor notation.)"
    stated = read(
        tmp_path, solidworks_text(found, -1, principal=False, origin=False, notation=negative)
    )
    assert (
        "as the report states" in stated.notes[1] and difference(stated.properties, found) < AGREES
    )


def test_several_parts_in_one_file(tmp_path):
    texts = [solidworks_text(body(k)).replace("Part2", f"Part{k}") for k in (1, 2, 3)]
    path = tmp_path / "all.txt"
    path.write_text("\n".join(texts), encoding="utf-16")
    found = read_mass_report(path)
    assert [one.part for one in found] == ["Part1", "Part2", "Part3"]
    assert all(difference(one.properties, body(k)) < AGREES for k, one in enumerate(found, start=1))


GOOD = solidworks_text(body())
TABLE = csv_text(body())
BAD = {
    "empty": ("a.txt", "", "expected a line 'Mass"),
    "another language": ("a.txt", GOOD.replace("Mass =", "Masse ="), "in English"),
    "decimal commas": (
        "a.txt",
        GOOD.replace("Mass = 27000", "Mass = 27,000"),
        "line 7.*decimal commas",
    ),
    "no mass": ("a.txt", re.sub("Mass = [0-9.]+", "Mass = 0", GOOD), "mass is 0"),
    "an unknown unit": ("a.txt", GOOD.replace("( grams *", "( slugs *"), "unit 'slugs'"),
    "half a unit": (
        "a.txt",
        GOOD.replace("( grams *  square millimeters )", "( grams )"),
        "the unit 'grams'",
    ),
    "an unknown length": (
        "a.txt",
        GOOD.replace("Center of mass: ( millimeters )", "Center of mass: ( furlongs )"),
        "furlongs",
    ),
    "no block": ("a.txt", GOOD.replace("aligned", "turned"), "no block 'Moments of inertia"),
    "a missing entry": ("a.txt", GOOD.replace("Lyz =", "Lyw ="), "no Lyz"),
    "no Z": ("a.txt", GOOD.replace("\tZ =", "\tW ="), "no X, Y and Z"),
    "contradicting blocks": ("a.txt", GOOD.replace("Px = ", "Px = 9"), "contradict"),
    "binary": ("a.txt", b"\xff\xd8\x00\x80", "not UTF-8"),
    "empty table": ("a.csv", "", "0 lines"),
    "no units": ("a.csv", TABLE.replace("mass [g]", "mass"), "mass has the unit ''"),
    "an unknown column": ("a.csv", TABLE.replace("com_x [mm]", "centre [mm]"), "column 'centre"),
    "a missing column": ("a.csv", "link,mass [kg]\n1,2\n", "no column com_x"),
    "products without a sign": ("a.csv", TABLE.split("\n", 1)[1], "without their sign"),
    "a table with decimal commas": (
        "a.csv",
        csv_text(body(), separator=";").replace(".", ","),
        "decimal commas",
    ),
    "too many entries": (
        "a.csv",
        TABLE.rstrip() + ",1\n",
        "12 entries; expected 11; decimal commas",
    ),
    "an expression": ("a.csv", TABLE.replace("link2,", "link2,1+"), "expected a number"),
    "NaN": ("a.csv", TABLE.replace("link2,", "link2,nan"), "expected a number"),
    "a negative mass": ("a.csv", TABLE.replace("link2,", "link2,-"), "expected a positive number"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_report_is_one_line(tmp_path, case):
    name, content, complaint = BAD[case]
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ModelError, match=complaint) as error:
        read_mass_report(path)
    assert str(error.value).startswith(str(path)) and "\n" not in str(error.value)


def test_a_large_or_missing_report_is_not_read(tmp_path):
    with (tmp_path / "a.txt").open("wb") as file:
        file.truncate(10_000_000)
    with pytest.raises(ModelError, match="more than 1 MB"):
        read_mass_report(tmp_path / "a.txt")
    with pytest.raises(ModelError, match="no such file"):
        read_mass_report(tmp_path / "b.txt")
