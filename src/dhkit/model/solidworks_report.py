"""The text of SolidWorks' "Mass Properties": its own units, and the sign of its products found by cross-checks.

The block that is read is "Moments of inertia: Taken at the center of mass and aligned with the output coordinate
system", Lxx ... Lzz. Its products are +integral of x y dm ("positive tensor notation", SolidWorks' default), so that
the tensor has -Lxy; newer versions can write them the other way round. The other two blocks decide: the principal
moments and axes are those of one of the two tensors, and Ixx ... Izz at the output coordinate system differ from
Lxx ... Lzz by Steiner's terms, whose products have the same sign.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from dhkit.description import Array
from dhkit.errors import ModelError
from dhkit.model.shape_inertia import MassProperties

REPORT = re.compile(r"^[ \t]*Mass properties of\b[ \t]*(.*?)[ \t]*$", re.IGNORECASE | re.MULTILINE)
ASSEMBLY = re.compile(r"Mass properties of\b.*\.sldasm\b|\([ \t]*Assembly Configuration\b", re.IGNORECASE)
DECIMAL = r"[-+]?\d[\d.,]*(?:[eE][-+]?\d+)?"
MASS = re.compile(rf"^[ \t]*Mass[ \t]*=[ \t]*({DECIMAL})[ \t]*([a-z]+)", re.IGNORECASE | re.MULTILINE)
CENTRE = re.compile(r"Cent(?:er|re) of mass:?[ \t]*\([ \t]*([a-z]+)[ \t]*\)", re.IGNORECASE)
BLOCK = re.compile(r"moments of inertia:?[ \t]*\(([^)]*)\)[^\n]*\n([^\n]*)", re.IGNORECASE)
NOTATION = re.compile(r"\b(positive|negative)\s+tensor\s+notation", re.IGNORECASE)
ENTRY = re.compile(rf"\b([LIP])([xyz]{{1,2}})[ \t]*=[ \t]*({DECIMAL})")
AXIS = re.compile(
    rf"\bI([xyz])[ \t]*=[ \t]*\([ \t]*({DECIMAL})[ \t]*,[ \t]+({DECIMAL})[ \t]*,[ \t]+({DECIMAL})[ \t]*\)"
)
COORDINATE = re.compile(rf"^[ \t]*([XYZ])[ \t]*=[ \t]*({DECIMAL})", re.MULTILINE)
MASS_UNITS = {"grams": 1e-3, "gram": 1e-3, "kilograms": 1.0, "kilogram": 1.0, "milligrams": 1e-6, "pounds": 0.45359237}
LENGTH_UNITS = {"millimeters": 1e-3, "centimeters": 1e-2, "meters": 1.0, "inches": 0.0254, "feet": 0.3048}
NAMES = [["xx", "xy", "xz"], ["yx", "yy", "yz"], ["zx", "zy", "zz"]]
CLEARER = 0.2
"""The sign is decided where one tensor misses the other blocks by less than this share of what the other one does."""
ROUGH, COARSEST = 1e-3, 0.05
"""Half a unit of the last decimal, as a share of the mass, the largest moment, the radius of gyration for the centre of
mass: warned of, and refused."""
ROUNDED = 4.0
"""Half units of the last decimals that blocks may differ by: several rounded numbers enter each comparison."""


@dataclass(frozen=True)
class _Number:
    """A decimal with half a unit of its last place."""

    value: float
    half: float


@dataclass(frozen=True, eq=False)
class _Centre:
    """Mass and centre of mass, SI, with half units of their last places."""

    mass: float
    mass_share: float
    """As a share of the mass."""
    com: Array
    com_half: float


@dataclass(frozen=True, eq=False)
class SolidWorksReport:
    """What the report says of one part."""

    part: str
    properties: MassProperties
    notes: tuple[str, ...]

    @classmethod
    def of(cls, text: str, path: str, first: int = 1) -> SolidWorksReport:
        """Read one report.

        Parameters
        ----------
        text
            From "Mass properties of ..." to the next of them.
        path, first
            File and line of the text's beginning, for messages.

        Raises
        ------
        ModelError
            A quantity or its unit is missing or none that is known, or the blocks contradict each other.
        """
        return _Reader(text, path, first).report()


class _Reader:
    def __init__(self, text: str, path: str, first: int) -> None:
        self.text, self.path, self.first = text, path, first

    def report(self) -> SolidWorksReport:
        title = REPORT.search(self.text)
        if assembly := ASSEMBLY.search(self.text):
            raise self._error(
                "a report of an assembly; expected one of the part of a link: select the part alone in Mass Properties",
                assembly,
            )
        mass_at = self._found(MASS, "a line 'Mass = ... grams'")
        written = self._number(mass_at[1], mass_at)
        mass = written.value * self._unit(mass_at[2], MASS_UNITS, mass_at)
        if not mass > 0:
            raise self._error(f"mass is {mass_at[1]}; expected a positive number", mass_at)
        com, com_half = self._centre()
        rounded = list(self._coarse("mass", written.half / written.value, "", mass_at))
        blocks = {self._kind(match): match for match in BLOCK.finditer(self.text)}
        if "centre" not in blocks:
            raise ModelError(
                f"{self.path}, line {self.first}: no block 'Moments of inertia: Taken at the center of mass and "
                "aligned with the output coordinate system'; expected SolidWorks' text of Mass Properties, in English"
            )
        listed, half = self._tensor(blocks["centre"], "L")
        coarse = float(half.max() / max(np.abs(listed).max(), np.finfo(float).tiny))
        rounded += self._coarse("moments", coarse, " of the largest", blocks["centre"])
        gyration = np.sqrt(max(float(np.trace(listed)), np.finfo(float).tiny) / (2 * mass))
        rounded += self._coarse("centre of mass", com_half / gyration, " of its radius of gyration", mass_at)
        centre = _Centre(mass, written.half / written.value, com, com_half)
        sign, said = self._sign(listed, half, centre, blocks)
        tensor = np.where(np.eye(3, dtype=bool), listed, -sign * listed)
        block = "block read: moments about the centre of mass, axes of the output coordinate system (Lxx ... Lzz)"
        part = title[1].strip() if title else ""
        return SolidWorksReport(part, MassProperties(mass, com, tensor), (block, said, *rounded))

    def _coarse(self, what: str, share: float, of: str, at: re.Match[str]) -> tuple[str, ...]:
        """Return a warning where half a unit of the last decimal is much of a quantity; refuse where it is too much."""
        verb, are = ("have", "are") if what == "moments" else ("has", "is")
        if share > COARSEST:
            raise self._error(
                f"its {what} {verb} too few digits, {100 * min(share, 1.0):.0f} %{of}; choose smaller units or more "
                "decimal places in the options of Mass Properties",
                at,
            )
        return (f"warning: its {what} {are} rounded to {100 * share:.1g} %{of}",) if share > ROUGH else ()

    def _centre(self) -> tuple[Array, float]:
        at = self._found(CENTRE, "a line 'Center of mass: ( millimeters )'")
        unit = self._unit(at[1], LENGTH_UNITS, at)
        found = {match[1]: self._number(match[2], match) for match in COORDINATE.finditer(self.text, at.end())}
        if set(found) != set("XYZ"):
            raise self._error("no X, Y and Z of the centre of mass; expected three lines 'X = ...'", at)
        return unit * np.array([found[k].value for k in "XYZ"]), unit * max(found[k].half for k in "XYZ")

    def _kind(self, block: re.Match[str]) -> str:
        """Tell the three blocks apart by the line below their heading."""
        line = block[2].lower()
        if "aligned" in line:
            return "centre"
        return "origin" if "output coordinate system" in line else "principal"

    def _tensor(self, block: re.Match[str], letter: str) -> tuple[Array, Array]:
        """Return a block's nine entries as listed, kg m^2, and half a unit of the last decimals, shape (3, 3)."""
        unit, entries = self._moment_unit(block), self._entries(block, letter)
        if missing := [name for row in NAMES for name in row if name not in entries]:
            raise self._error(f"no {letter}{missing[0]}; expected nine entries {letter}xx ... {letter}zz", block)
        listed = unit * np.array([[entries[name].value for name in row] for row in NAMES])
        half = unit * np.array([[entries[name].half for name in row] for row in NAMES])
        if np.any(np.abs(listed - listed.T) > 2 * (half + half.T)):
            raise self._error(f"{letter}xy and {letter}yx differ; expected a symmetric tensor", block)
        return (listed + listed.T) / 2, half

    def _entries(self, block: re.Match[str], letter: str) -> dict[str, _Number]:
        following = BLOCK.search(self.text, block.end())
        end = following.start() if following else len(self.text)
        found = ENTRY.finditer(self.text, block.end(), end)
        return {match[2]: self._number(match[3], match) for match in found if match[1] == letter}

    def _moment_unit(self, block: re.Match[str]) -> float:
        words = block[1].lower().replace("*", " ").split()
        if len(words) != 3 or words[1] != "square":
            raise self._error(
                f"the unit {block[1].strip()[:40]!r}; expected such as 'grams * square millimeters'", block
            )
        return self._unit(words[0], MASS_UNITS, block) * self._unit(words[2], LENGTH_UNITS, block) ** 2

    def _sign(self, listed: Array, half: Array, centre: _Centre, blocks: dict[str, re.Match[str]]) -> tuple[float, str]:
        """Return +1 where products are listed as +integral, -1 where as the tensor's entries, and how it was found."""
        products = listed[np.triu_indices(3, 1)]
        checks = []
        if "principal" in blocks:
            checks.append(
                ("the principal moments and axes", *self._principal_misses(listed, half, blocks["principal"]))
            )
        if "origin" in blocks:
            misses = self._steiner_misses(listed, half, centre, blocks["origin"])
            checks.append(("Steiner's terms of the block at the output coordinate system", *misses))
        for what, plus, minus, allowed in checks:
            if min(plus, minus) > allowed:
                raise self._error(
                    f"{what} contradict Lxx ... Lzz by {min(plus, minus):.3g} kg m^2, more than their rounding",
                    blocks["centre"],
                )
        if not np.any(products):
            return 1.0, "no products of inertia"
        decided = [
            (1.0 if plus < minus else -1.0, what)
            for what, plus, minus, allowed in checks
            if max(plus, minus) > allowed and min(plus, minus) < CLEARER * max(plus, minus)
        ]
        signs = {sign for sign, _ in decided}
        if len(signs) > 1:
            raise self._error("its blocks disagree about the sign of the products", blocks["centre"])
        names = {1.0: "+integral of x y dm", -1.0: "entries of the tensor, -integral of x y dm"}
        if signs:
            sign = signs.pop()
            return sign, f"products listed as {names[sign]}, found by {' and '.join(what for _, what in decided)}"
        if stated := NOTATION.search(self.text):
            sign = 1.0 if stated[1].lower() == "positive" else -1.0
            return sign, f"products listed as {names[sign]}, as the report states ({stated[1].lower()} tensor notation)"
        return 1.0, f"products taken as {names[1.0]}, SolidWorks' default: the other blocks do not decide their sign"

    def _principal_misses(self, listed: Array, half: Array, block: re.Match[str]) -> tuple[float, float, float]:
        """Return by how much both tensors miss the principal moments, kg m^2, and what rounding explains."""
        unit, entries = self._moment_unit(block), self._entries(block, "P")
        if missing := [k for k in "xyz" if k not in entries]:
            raise self._error(f"no P{missing[0]}; expected the principal moments Px, Py, Pz", block)
        moments = unit * np.array([entries[k].value for k in "xyz"])
        rounding = ROUNDED * (np.abs(half).max() + unit * max(entries[k].half for k in "xyz"))
        allowed = float(rounding + 1e-9 * np.abs(moments).max())
        misses = []
        axes = {match[1]: match for match in AXIS.finditer(self.text, block.end())}
        for sign in (1.0, -1.0):
            tensor = np.where(np.eye(3, dtype=bool), listed, -sign * listed)
            miss = float(np.abs(np.linalg.eigvalsh(tensor) - np.sort(moments)).max())
            if set(axes) == set("xyz"):
                rows = np.array([[self._number(axes[k][j], axes[k]).value for j in (2, 3, 4)] for k in "xyz"])
                last = max(self._number(axes["x"][j], axes["x"]).half for j in (2, 3, 4))
                off = np.abs(rows @ tensor - moments[:, None] * rows).max() - 4 * last * np.abs(moments).max()
                miss = max(miss, float(off))
            misses.append(miss)
        return misses[0], misses[1], allowed

    def _steiner_misses(
        self, listed: Array, half: Array, centre: _Centre, block: re.Match[str]
    ) -> tuple[float, float, float]:
        """Return by how much both signs miss the block at the origin, kg m^2, and what rounding explains."""
        origin, origin_half = self._tensor(block, "I")
        diagonal, mass, com, com_half = np.eye(3, dtype=bool), centre.mass, centre.com, centre.com_half
        steiner = mass * (com @ com * np.eye(3) - np.outer(com, com))
        reach = float(np.abs(com).max()) + com_half
        allowed = (
            ROUNDED * (float(half.max() + origin_half.max()) + mass * com_half * 2 * reach)
            + 1e-9 * np.abs(origin).max()
        )
        allowed += ROUNDED * centre.mass_share * float(np.abs(steiner).max())
        difference = origin - listed
        expected = [np.where(diagonal, steiner, -sign * steiner) for sign in (1.0, -1.0)]
        plus, minus = (float(np.abs(difference - one).max()) for one in expected)
        return plus, minus, float(allowed)

    def _found(self, pattern: re.Pattern[str], expected: str) -> re.Match[str]:
        match = pattern.search(self.text)
        if match is None:
            raise ModelError(f"{self.path}, line {self.first}: expected {expected}, as SolidWorks writes it in English")
        return match

    def _unit(self, word: str, known: dict[str, float], at: re.Match[str]) -> float:
        if word.lower() not in known:
            raise self._error(f"the unit {word[:30]!r}; expected one of {', '.join(known)}", at)
        return known[word.lower()]

    def _number(self, text: str, at: re.Match[str]) -> _Number:
        if "," in text or text.count(".") > 1:
            raise self._error(f"found {text[:40]!r}; decimal commas are not read, write 1.5 for 1,5", at)
        digits, _, exponent = text.lower().partition("e")
        places = len(digits.partition(".")[2])
        return _Number(
            float(text), 0.5 * 10.0 ** (int(exponent or 0) - places) if abs(int(exponent or 0)) < 300 else 0.0
        )

    def _error(self, message: str, at: re.Match[str]) -> ModelError:
        line = self.first + self.text.count("\n", 0, at.start())
        return ModelError(f"{self.path}, line {line}: {message}")
