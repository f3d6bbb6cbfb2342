"""Marks of a report by a rubric: a pure function of both, so that a report can be marked again."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from datetime import datetime
from fractions import Fraction

from dhkit.display import html_block, html_table, repr_line, value_line
from dhkit.grading.answers.sheet import QUANTITY
from dhkit.grading.grade_report import Diagnosis, Entry, GradeReport, Verdict
from dhkit.grading.lateness import Lateness
from dhkit.grading.rubric import Credit, Rubric

_LAST_ROW = 3
"""Index of the last row of a pose."""


@dataclass(frozen=True)
class Mark:
    """Points of an entry or a quantity, the points possible, and the rule that gave them."""

    name: str
    points: float
    most: float
    rule: str = ""

    __repr__ = value_line


@dataclass(frozen=True)
class Marks:
    """Points of a sheet.

    Attributes
    ----------
    points, most
        Points given, and points possible.
    entries
        Marks of the entries, in the report's order.
    quantities
        Sums by quantity, also for quantities that are asked for and missing; before points are lost by lateness.
    lost
        Points lost by lateness.
    late
        Days late, and the share that is lost; empty for a submission in time.
    """

    points: float
    most: float
    entries: tuple[Mark, ...] = ()
    quantities: tuple[Mark, ...] = ()
    lost: float = 0.0
    late: str = ""

    @property
    def before(self) -> float:
        """Points before any are lost by lateness."""
        return self.points + self.lost

    def data(self) -> dict[str, object]:
        """Return all fields as plain data."""
        return asdict(self)

    def without_rules(self) -> Marks:
        """Return the marks without rules, which may name the mistake that a student is to find."""
        return replace(self, entries=tuple(replace(mark, rule="") for mark in self.entries))

    def __repr__(self) -> str:
        return repr_line("Marks", summary=self._points)

    def _repr_html_(self) -> str:
        rows = [
            (mark.name, f"{mark.points:.4g}", f"{mark.most:.4g}", mark.rule)
            for mark in self.quantities
        ]
        return html_block(
            self._points, html_table(("quantity", "points", "of", "rule"), rows, align="lrrl")
        )

    @property
    def _points(self) -> str:
        late = f", {self.late}" if self.late else ""
        return f"{self.points:.4g} of {self.most:.4g} points{late}"


def marks(report: GradeReport, rubric: Rubric) -> Marks:
    """Return the points of a judged sheet, or of a lab's record; one that could not be judged gets 0.

    Sums are exact until they become floats, so that a sheet without errors gets all points and not nearly all.

    Parameters
    ----------
    report
        Report on a sheet.
    rubric
        Weights and penalties. Goals of a lab have the points of their assignment: of the rubric lateness alone counts.

    Returns
    -------
    Marks
        Points of the sheet, its quantities and its entries, with the rule that decided each.

    Examples
    --------
    >>> from dhkit.description import library_robot
    >>> from dhkit.grading import Rubric, grade_answers
    >>> report = grade_answers(library_robot("planar2r"), {"M": [["m1", 0], [0, "m2*l2^2/3"]]}, explain=False)
    >>> marks(report, Rubric(points=8)).points
    2.0
    """
    if report.is_lab_record:
        return _marks_of_goals(report, rubric)
    if report.error or not report.entries:
        return Marks(0.0, rubric.points)
    weights = _quantity_weights(report, rubric)
    total = sum(weights.values()) or Fraction(1)
    points = _exact(rubric.points)
    entries = []
    sums = {
        quantity: [Fraction(0), points * weight / total] for quantity, weight in weights.items()
    }
    for entry in report.entries:
        most = sums[entry.quantity][1] * _part(entry, report, rubric)
        share, rule = _share(entry, report, rubric.credit)
        sums[entry.quantity][0] += share * most
        entries.append(
            Mark(entry.name, float(share * most), float(most), rule if most else "counts nothing")
        )
    missing = weights.keys() - set(report.quantities)
    quantities = []
    for quantity, (got, most) in sums.items():
        rule = "not on the sheet" if quantity in missing else ""
        quantities.append(Mark(quantity, float(got), float(most), rule))
    total_points = sum((got for got, _ in sums.values()), Fraction(0))
    lateness = _lateness(report, rubric)
    return Marks(
        float(total_points * (1 - lateness.share)),
        rubric.points,
        tuple(entries),
        tuple(quantities),
        lost=float(total_points * lateness.share),
        late=str(lateness) if lateness.days else "",
    )


def _marks_of_goals(report: GradeReport, rubric: Rubric) -> Marks:
    """Return the points of a lab's record: a goal that passes has all its points, another one none."""
    total = Fraction(0)
    entries = []
    for entry in report.entries:
        most = report.goals.get(entry.name, 0.0)
        got = most if entry.verdict.passes else 0.0
        total += _exact(got)
        entries.append(Mark(entry.name, got, most, entry.verdict.value))
    lateness = _lateness(report, rubric)
    return Marks(
        float(total * (1 - lateness.share)),
        float(sum(map(_exact, report.goals.values()))),
        tuple(entries),
        tuple(replace(mark, rule="") for mark in entries),
        lost=float(total * lateness.share),
        late=str(lateness) if lateness.days else "",
    )


def _lateness(report: GradeReport, rubric: Rubric) -> Lateness:
    """Return the lateness of a sheet; without a rule, or a time of the sheet, it is in time."""
    if rubric.late is None or not report.handed_in:
        return Lateness(0, Fraction(0))
    return rubric.late.lateness(datetime.fromisoformat(report.handed_in))


def _quantity_weights(report: GradeReport, rubric: Rubric) -> dict[str, Fraction]:
    """Return the weights of the quantities on the sheet, and of those that should be on it."""
    named = {
        name: _exact(weight) for name, weight in rubric.weights.items() if QUANTITY.fullmatch(name)
    }
    others = Fraction(0 if any(named.values()) else 1)
    weights = {quantity: named.get(quantity, others) for quantity in report.quantities}
    for quantity in weights:
        if not any(_entry_weight(entry, rubric) for entry in report.of(quantity)):
            weights[quantity] = Fraction(0)
    return weights | {
        quantity: weight for quantity, weight in named.items() if weight and quantity not in weights
    }


def _entry_weight(entry: Entry, rubric: Rubric) -> Fraction:
    """Return the weight of an entry in its quantity; the last row of a pose, which everybody knows, has none."""
    if not entry.index:
        return Fraction(1)
    is_known = entry.quantity.startswith(("A", "T")) and entry.index[0] == _LAST_ROW
    return _exact(rubric.weights.get(entry.name, 0.0 if is_known else 1.0))


def _part(entry: Entry, report: GradeReport, rubric: Rubric) -> Fraction:
    """Return the share of an entry in the weight of its quantity."""
    total = sum(_entry_weight(other, rubric) for other in report.of(entry.quantity))
    return _entry_weight(entry, rubric) / total if total else Fraction(0)


def _share(entry: Entry, report: GradeReport, credit: Credit) -> tuple[Fraction, str]:
    """Return the share of its points that an entry gets, and the rule: the best of several."""
    simple = {
        Verdict.CORRECT: 1.0,
        Verdict.ROUNDED: credit.rounding,
        Verdict.SAMPLED: 0.0 if report.proof_required else credit.sampled,
        Verdict.UNDECIDED: 0.0 if report.proof_required else credit.undecided,
        Verdict.RECORDED: 1.0,
        Verdict.INCOMPLETE: 0.0,
        Verdict.UNREADABLE: 0.0,
    }
    if entry.verdict in simple:
        reasons = [(_exact(simple[entry.verdict]), entry.verdict.value)]
    else:
        reasons = [(Fraction(0), "wrong"), *_reasons(entry, report.diagnosis, credit)]
    share, rule = max(reasons, key=lambda reason: reason[0])
    return share, rule if share in (0, 1) else f"{rule}: {100 * float(share):g} %"


def _reasons(
    entry: Entry, diagnosis: tuple[Diagnosis, ...], credit: Credit
) -> list[tuple[Fraction, str]]:
    """Return the shares that a wrong entry may get, with their rules."""
    mistakes = [one for one in diagnosis if one.mistake and entry.name in one.entries]
    # Zeros follow from zeros: that is no work.
    has_work = bool(entry.follows) and entry.read != "0"
    reasons = [(_exact(credit.follow_on), f"follows from {entry.follows}")] if has_work else []
    if any(one.mistake == "other_frames" for one in mistakes):
        reasons.append((_exact(credit.other_frames), "right in other frames"))
    elif mistakes:
        otherwise = credit.diagnosed if len(mistakes) == 1 else 0.0
        shares = [_mistake_share(one, credit, otherwise) for one in mistakes]
        reasons.append((_exact(min(shares)), " and ".join(str(one.mistake) for one in mistakes)))
    return reasons


def _mistake_share(diagnosis: Diagnosis, credit: Credit, otherwise: float) -> float:
    """Return the rubric's share for a mistake, or for an equivalent one that gets more."""
    names = (str(diagnosis.mistake), *diagnosis.equivalent)
    # half_forgotten (link 2).
    bare = [name if name in credit.mistakes else name.partition(" (")[0] for name in names]
    return max(
        (credit.mistakes[name] for name in bare if name in credit.mistakes), default=otherwise
    )


def _exact(number: float) -> Fraction:
    return Fraction(repr(float(number)))
