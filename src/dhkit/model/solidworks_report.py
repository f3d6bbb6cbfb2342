"""The text of SolidWorks' "Mass Properties": its own units, and the sign of its products found by cross-checks.

The block that is read is "Moments of inertia: Taken at the center of mass and aligned with the output coordinate
system", Lxx ... Lzz. Its products are +integral of x y dm ("positive tensor notation", SolidWorks' default), so that
the tensor has -Lxy; newer versions can write them with the opposite sign. The other two blocks decide: the principal
moments and axes are those of one of the two tensors, and Ixx ... Izz at the output coordinate system differ from
Lxx ... Lzz by Steiner's terms, whose products have the same sign.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from dhkit.description import Array
from dhkit.errors import ModelError
from dhkit.model.shape_inertia import MassProperties

REPORT = re.compile(r"^[ \t]*Mass properties of\b[ \t]*(.*?)[ \t]*$", re.IGNORECASE | re.MULTILINE)
_ASSEMBLY = re.compile(
    r"Mass properties of\b.*\.sldasm\b|\([ \t]*Assembly Configuration\b", re.IGNORECASE
)
_DECIMAL = r"[-+]?\d[\d.,]*(?:[eE][-+]?\d+)?"
_MASS = re.compile(
    rf"^[ \t]*Mass[ \t]*=[ \t]*({_DECIMAL})[ \t]*([a-z]+)", re.IGNORECASE | re.MULTILINE
)
_CENTRE = re.compile(r"Cent(?:er|re) of mass:?[ \t]*\([ \t]*([a-z]+)[ \t]*\)", re.IGNORECASE)
_BLOCK = re.compile(r"moments of inertia:?[ \t]*\(([^)]*)\)[^\n]*\n([^\n]*)", re.IGNORECASE)
_NOTATION = re.compile(r"\b(positive|negative)\s+tensor\s+notation", re.IGNORECASE)
_ENTRY = re.compile(rf"\b([LIP])([xyz]{{1,2}})[ \t]*=[ \t]*({_DECIMAL})")
_AXIS = re.compile(
    rf"\bI([xyz])[ \t]*=[ \t]*\([ \t]*({_DECIMAL})[ \t]*,[ \t]+({_DECIMAL})[ \t]*,[ \t]+({_DECIMAL})[ \t]*\)"
)
_COORDINATE = re.compile(rf"^[ \t]*([XYZ])[ \t]*=[ \t]*({_DECIMAL})", re.MULTILINE)
_MASS_UNITS = {
    "grams": 1e-3,
    "gram": 1e-3,
    "kilograms": 1.0,
    "kilogram": 1.0,
    "milligrams": 1e-6,
    "pounds": 0.45359237,
}
"""Mass units by SolidWorks' names, kg."""
_LENGTH_UNITS = {
    "millimeters": 1e-3,
    "centimeters": 1e-2,
    "meters": 1.0,
    "inches": 0.0254,
    "feet": 0.3048,
}
"""Length units by SolidWorks' names, m."""
_ENTRY_NAMES = ("xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz")
_MAX_MISFIT_RATIO = 0.2
"""The sign is decided if one tensor's misfit to another block is below this share of the other tensor's misfit."""
_WARNED_ROUNDING = 1e-3
_MAX_ROUNDING = 0.05
"""Half a unit of the last decimal above which a warning is given, and above which the report is refused.

Relative to the mass, the largest moment, and, for the centre of mass, the radius of gyration."""
_MISFIT_ROUNDINGS = 4.0
"""Half units of the last decimals that blocks may differ by: several rounded numbers enter each comparison."""


class _Block(Enum):
    """The blocks of moments: about the centre of mass, about the origin, and the principal moments."""

    CENTRE = "centre"
    ORIGIN = "origin"
    PRINCIPAL = "principal"


class _Number(NamedTuple):
    """A decimal with half a unit of its last place."""

    value: float
    half: float


class _Misfit(NamedTuple):
    """Deviation of another block from both tensors, kg m^2."""

    block: str
    """The block, for messages."""
    plus: float
    """Deviation if products are listed as +integral."""
    minus: float
    """Deviation if products are listed as the tensor's entries."""
    allowed: float
    """Largest deviation that rounding explains."""


@dataclass(frozen=True, eq=False)
class _Centre:
    """Mass and centre of mass, SI, with half units of their last places."""

    mass: float
    relative_half: float
    """Half a unit of the last place of the mass, relative to the mass."""
    com: Array
    com_half: float


def read_solidworks_report(
    text: str, path: str, first: int = 1
) -> tuple[str, MassProperties, tuple[str, ...]]:
    """Read one report; return the part's name, its mass properties in SI, and notes.

    Parameters
    ----------
    text
        From "Mass properties of ..." to the next of them.
    path, first
        File and line of the text's beginning, for messages.

    Raises
    ------
    ModelError
        A quantity or its unit is missing or unknown, or the blocks contradict each other.
    """
    return _ReportReader(text, path, first).report()


class _ReportReader:
    def __init__(self, text: str, path: str, first: int) -> None:
        self.text = text
        self.path = path
        self.first = first

    def report(self) -> tuple[str, MassProperties, tuple[str, ...]]:
        title = REPORT.search(self.text)
        if assembly := _ASSEMBLY.search(self.text):
            raise self._error(
                "a report of an assembly; expected one of the part of a link: select the part alone in Mass Properties",
                assembly,
            )
        mass_line = self._match(_MASS, "a line 'Mass = ... grams'")
        number = self._number(mass_line[1], mass_line)
        mass = number.value * self._unit(mass_line[2], _MASS_UNITS, mass_line)
        if not mass > 0:
            raise self._error(f"mass is {mass_line[1]}; expected a positive number", mass_line)
        centre = _Centre(mass, number.half / number.value, *self._centre_of_mass())
        warnings = self._rounding_warning("mass", centre.relative_half, "", mass_line)
        blocks = {self._block_kind(match): match for match in _BLOCK.finditer(self.text)}
        if _Block.CENTRE not in blocks:
            raise ModelError(
                f"{self.path}, line {self.first}: no block 'Moments of inertia: Taken at the center of mass and "
                "aligned with the output coordinate system'; expected SolidWorks' text of Mass Properties, in English"
            )
        listed, half = self._tensor(blocks[_Block.CENTRE], "L")
        tiny = np.finfo(float).tiny
        rounding = float(half.max() / max(np.abs(listed).max(), tiny))
        warnings += self._rounding_warning(
            "moments", rounding, " of the largest", blocks[_Block.CENTRE]
        )

        # The mean square distance from the centre of mass is k^2 = integral of r^2 dm / m = (Lxx + Lyy + Lzz) / (2 m).
        gyration = np.sqrt(max(float(np.trace(listed)), tiny) / (2 * mass))
        rounding = centre.com_half / gyration
        warnings += self._rounding_warning(
            "centre of mass", rounding, " of its radius of gyration", mass_line
        )
        sign, sign_note = self._sign(listed, half, centre, blocks)
        block_note = "block read: moments about the centre of mass, axes of the output coordinate system (Lxx ... Lzz)"
        properties = MassProperties(mass, centre.com, _with_products_times(-sign, listed))
        return title[1].strip() if title else "", properties, (block_note, sign_note, *warnings)

    def _rounding_warning(
        self, what: str, share: float, of: str, at: re.Match[str]
    ) -> tuple[str, ...]:
        """Return a warning if half a unit of the last decimal is a large share of a quantity; refuse a larger one."""
        verb, are = ("have", "are") if what == "moments" else ("has", "is")
        if share > _MAX_ROUNDING:
            raise self._error(
                f"its {what} {verb} too few digits, {100 * min(share, 1.0):.0f} %{of}; choose smaller units or more "
                "decimal places in the options of Mass Properties",
                at,
            )
        is_warned = share > _WARNED_ROUNDING
        return (
            (f"warning: its {what} {are} rounded to {100 * share:.1g} %{of}",) if is_warned else ()
        )

    def _centre_of_mass(self) -> tuple[Array, float]:
        """Return the centre of mass, shape (3,), m, and half a unit of its last decimals."""
        heading = self._match(_CENTRE, "a line 'Center of mass: ( millimeters )'")
        unit = self._unit(heading[1], _LENGTH_UNITS, heading)
        matches = _COORDINATE.finditer(self.text, heading.end())
        numbers = {match[1]: self._number(match[2], match) for match in matches}
        if set(numbers) != set("XYZ"):
            raise self._error(
                "no X, Y and Z of the centre of mass; expected three lines 'X = ...'", heading
            )
        return unit * np.array([numbers[k].value for k in "XYZ"]), unit * max(
            numbers[k].half for k in "XYZ"
        )

    def _block_kind(self, block: re.Match[str]) -> _Block:
        """Return the kind of a block by the line below its heading."""
        line = block[2].lower()
        if "aligned" in line:
            return _Block.CENTRE
        return _Block.ORIGIN if "output coordinate system" in line else _Block.PRINCIPAL

    def _tensor(self, block: re.Match[str], letter: str) -> tuple[Array, Array]:
        """Return a block's nine entries as listed, kg m^2, and half a unit of the last decimals, shape (3, 3)."""
        unit = self._moment_unit(block)
        entries = self._entries(block, letter)
        if missing := [name for name in _ENTRY_NAMES if name not in entries]:
            raise self._error(
                f"no {letter}{missing[0]}; expected nine entries {letter}xx ... {letter}zz", block
            )
        numbers = np.array([entries[name] for name in _ENTRY_NAMES]).reshape(3, 3, 2)
        listed = unit * numbers[..., 0]
        half = unit * numbers[..., 1]
        if np.any(np.abs(listed - listed.T) > 2 * (half + half.T)):
            raise self._error(
                f"{letter}xy and {letter}yx differ; expected a symmetric tensor", block
            )
        return (listed + listed.T) / 2, half

    def _entries(self, block: re.Match[str], letter: str) -> dict[str, _Number]:
        following = _BLOCK.search(self.text, block.end())
        matches = _ENTRY.finditer(
            self.text, block.end(), following.start() if following else len(self.text)
        )
        return {match[2]: self._number(match[3], match) for match in matches if match[1] == letter}

    def _axis(self, match: re.Match[str]) -> tuple[_Number, _Number, _Number]:
        """Return the coordinates of a principal axis from its line."""
        return (
            self._number(match[2], match),
            self._number(match[3], match),
            self._number(match[4], match),
        )

    def _moment_unit(self, block: re.Match[str]) -> float:
        words = block[1].lower().replace("*", " ").split()
        if len(words) != 3 or words[1] != "square":
            raise self._error(
                f"the unit {block[1].strip()[:40]!r}; expected such as 'grams * square millimeters'",
                block,
            )
        return (
            self._unit(words[0], _MASS_UNITS, block)
            * self._unit(words[2], _LENGTH_UNITS, block) ** 2
        )

    def _sign(
        self, listed: Array, half: Array, centre: _Centre, blocks: Mapping[_Block, re.Match[str]]
    ) -> tuple[float, str]:
        """Return +1 if products are listed as +integral, -1 if as the tensor's entries, and a note on the evidence."""
        misfits = []
        if _Block.PRINCIPAL in blocks:
            misfits.append(self._principal_misfit(listed, half, blocks[_Block.PRINCIPAL]))
        if _Block.ORIGIN in blocks:
            misfits.append(self._steiner_misfit(listed, half, centre, blocks[_Block.ORIGIN]))
        for block, plus, minus, allowed in misfits:
            if min(plus, minus) > allowed:
                raise self._error(
                    f"{block} contradict Lxx ... Lzz by {min(plus, minus):.3g} kg m^2, more than their rounding",
                    blocks[_Block.CENTRE],
                )
        if not np.any(listed[np.triu_indices(3, 1)]):
            return 1.0, "no products of inertia"
        evidence = {
            block: 1.0 if plus < minus else -1.0
            for block, plus, minus, allowed in misfits
            if max(plus, minus) > allowed
            and min(plus, minus) < _MAX_MISFIT_RATIO * max(plus, minus)
        }
        signs = set(evidence.values())
        if len(signs) > 1:
            raise self._error(
                "its blocks disagree about the sign of the products", blocks[_Block.CENTRE]
            )
        names = {1.0: "+integral of x y dm", -1.0: "entries of the tensor, -integral of x y dm"}
        if signs:
            sign = signs.pop()
            return sign, f"products listed as {names[sign]}, found by {' and '.join(evidence)}"
        if notation := _NOTATION.search(self.text):
            word = notation[1].lower()
            sign = 1.0 if word == "positive" else -1.0
            return (
                sign,
                f"products listed as {names[sign]}, as the report states ({word} tensor notation)",
            )
        return (
            1.0,
            f"products taken as {names[1.0]}, SolidWorks' default: the other blocks do not decide their sign",
        )

    def _principal_misfit(self, listed: Array, half: Array, block: re.Match[str]) -> _Misfit:
        """Return the deviation of both tensors from the principal moments and axes."""
        unit = self._moment_unit(block)
        entries = self._entries(block, "P")
        if missing := [k for k in "xyz" if k not in entries]:
            raise self._error(f"no P{missing[0]}; expected the principal moments Px, Py, Pz", block)
        moments = unit * np.array([entries[k].value for k in "xyz"])
        rounding = _MISFIT_ROUNDINGS * (
            np.abs(half).max() + unit * max(entries[k].half for k in "xyz")
        )
        deviations = []
        axes = {match[1]: match for match in _AXIS.finditer(self.text, block.end())}
        for sign in (1.0, -1.0):
            # The right tensor I has the listed moments m_k as eigenvalues, and the listed axes e_k: I e_k = m_k e_k.
            tensor = _with_products_times(-sign, listed)
            deviation = float(np.abs(np.linalg.eigvalsh(tensor) - np.sort(moments)).max())
            if set(axes) == set("xyz"):
                listed_axes = [self._axis(axes[k]) for k in "xyz"]
                rows = np.array([[x.value, y.value, z.value] for x, y, z in listed_axes])
                last = max(number.half for number in listed_axes[0])
                residual = (
                    np.abs(rows @ tensor - moments[:, None] * rows).max()
                    - 4 * last * np.abs(moments).max()
                )
                deviation = max(deviation, float(residual))
            deviations.append(deviation)
        allowed = float(rounding + 1e-9 * np.abs(moments).max())
        return _Misfit("the principal moments and axes", deviations[0], deviations[1], allowed)

    def _steiner_misfit(
        self, listed: Array, half: Array, centre: _Centre, block: re.Match[str]
    ) -> _Misfit:
        """Return the deviation of both tensors, with Steiner's terms, from the block at the origin."""
        origin, origin_half = self._tensor(block, "I")
        mass = centre.mass
        com = centre.com
        com_half = centre.com_half

        # I_origin = I_com + m (c^2 1 - c c^T) (Steiner).
        steiner = mass * (com @ com * np.eye(3) - np.outer(com, com))

        # Half units of the last places of all numbers are carried through the same formula.
        reach = float(np.abs(com).max()) + com_half
        allowed = (
            _MISFIT_ROUNDINGS
            * (float(half.max() + origin_half.max()) + mass * com_half * 2 * reach)
            + 1e-9 * np.abs(origin).max()
        )
        allowed += _MISFIT_ROUNDINGS * centre.relative_half * float(np.abs(steiner).max())
        difference = origin - listed
        plus, minus = (
            float(np.abs(difference - _with_products_times(-s, steiner)).max()) for s in (1.0, -1.0)
        )
        return _Misfit(
            "Steiner's terms of the block at the output coordinate system",
            plus,
            minus,
            float(allowed),
        )

    def _match(self, pattern: re.Pattern[str], expected: str) -> re.Match[str]:
        match = pattern.search(self.text)
        if match is None:
            raise ModelError(
                f"{self.path}, line {self.first}: expected {expected}, as SolidWorks writes it in English"
            )
        return match

    def _unit(self, word: str, known: dict[str, float], at: re.Match[str]) -> float:
        if word.lower() not in known:
            raise self._error(f"the unit {word[:30]!r}; expected one of {', '.join(known)}", at)
        return known[word.lower()]

    def _number(self, text: str, at: re.Match[str]) -> _Number:
        if "," in text or text.count(".") > 1:
            raise self._error(
                f"found {text[:40]!r}; decimal commas are not read, write 1.5 for 1,5", at
            )
        mantissa, _, exponent_text = text.lower().partition("e")
        places = len(mantissa.partition(".")[2])
        exponent = int(exponent_text or 0)
        return _Number(
            float(text), 0.5 * 10.0 ** (exponent - places) if abs(exponent) < 300 else 0.0
        )

    def _error(self, message: str, at: re.Match[str]) -> ModelError:
        line = self.first + self.text.count("\n", 0, at.start())
        return ModelError(f"{self.path}, line {line}: {message}")


def _with_products_times(factor: float, tensor: Array) -> Array:
    """Return a tensor, shape (3, 3), with the entries off its diagonal multiplied by a factor."""
    return np.where(np.eye(3, dtype=bool), tensor, factor * tensor)
