"""The document: sections of tables, the same for Markdown, HTML and JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, fields
from functools import cache

from proving.paper import printed
from proving.paper.loci import statements_9_11_12
from proving.paper.one_axis import statements_6_to_8
from proving.paper.outputs import statements_1_to_5
from proving.paper.printed import Row
from proving.paper.statement import SMALL, Statement, short
from proving.paper.table_1 import table_1
from proving.paper.table_2 import critical_values, identities, statements_21
from proving.paper.three_axes import statements_13_to_20
from proving.paper.two_axes import statements_10

TITLE = "NASA/TP-1999-209835 done again"


@dataclass(frozen=True)
class Section:
    """A heading, a few words, and a table.

    Attributes:
        title: heading.
        words: paragraphs before the table.
        header: of the table; empty for none.
        rows: of the table.
        statements: what the rows were made of, if they were.

    """

    title: str
    words: tuple[str, ...] = ()
    header: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    statements: tuple[Statement, ...] = ()


_HEADER = ("where", "the paper", "printed", "computed", "difference", "criterion", "", "note")
_ROW_NAMES = ("sigma_E", "sigma_bias", "sigma_prec", "T_bias", "limit", "sigma_b", "sigma_S", "T_b", "T_S", "limit")


@cache
def computed_sections() -> tuple[Section, ...]:
    """What needs no measurement: Table 1, figures 1 to 21, critical values, errata."""
    return (
        _section("Table 1", "Mean normalised standard deviations V^1/2, eq. (53); mean over pitch.", table_1()),
        _section(
            "Figures 1 to 5, section 5.3",
            f"The criterion for words: insignificant, nearly constant and small mean below {SMALL:g} %.",
            statements_1_to_5(),
        ),
        _section("Figures 6 to 8, sections 6.1 and 6.3", "Packages of one axis.", statements_6_to_8()),
        _section("Figures 9, 11 and 12, sections 6.4 to 6.6", "Singular attitudes.", statements_9_11_12()),
        _section("Figure 10, sections 6.4 and 6.5", "Packages of two axes.", statements_10()),
        _section(
            "Figures 13 to 20, sections 6.6 and 6.7",
            "Packages of three axes. Eqs. (104) to (108) give all sensors the same weight. According to the paper, the "
            "figures are from weighted least squares. The two differ if sensors differ. The paper's words about the "
            "figures are true for weighted least squares.",
            statements_13_to_20(),
        ),
        _section("Figure 21 and eq. (109), section 7", "Fractional designs.", statements_21()),
        _section(
            "Limits of Table 2, section 8",
            "F at 95 % for the points, replications and parameters of each row. K is 73 and 145 in figures 22 and 24 "
            "(up and back down), 325 in 28 and 34, and 42 has four replications: the limits agree with these counts, "
            "and not with the printed counts.",
            critical_values(),
        ),
        _section("T_bias of Table 2 from its own sigmas", "Every row is consistent.", identities()),
        Section("Errata", (), ("where", "what"), ERRATA),
    )


def experiment_sections(
    rows: dict[str, Row],
    checks: Sequence[Statement],
    sizes: Sequence[Statement],
    held: Counter[tuple[str, str]],
    seeds: int,
) -> tuple[Section, ...]:
    """Table 2 and what was checked on the simulated nights.

    Args:
        rows: simulated rows by figure.
        checks: patterns, of the first seed.
        sizes: sizes that the sensors were made to have, likewise.
        held: on how many seeds each agreed, by where and what.
        seeds: how many there were.

    """
    return (
        Section(
            "Table 2",
            (
                "First row: printed. Second row: from simulated sensors, measured by the real controller on the "
                "simulated bench. Standard errors in 1e-4 deg. The sensors are not the paper's, so the digits cannot "
                "agree. The pattern agrees, see below.",
            ),
            ("figure", "K", "n", "", *_ROW_NAMES),
            tuple(_table_2(rows)),
        ),
        _counted("Statements of section 9 on experiments 22 to 54", checks, held, seeds),
        _counted("Sizes chosen for the simulated sensors", sizes, held, seeds),
        Section("Differences that must remain, with reasons", NOT_ALIKE),
    )


def markdown(sections: Iterable[Section], command: str) -> str:
    """The whole document."""
    intro = (
        f"# {TITLE}\n\n"
        "Tripp and Tcheng, *Uncertainty Analysis of Inertial Model Attitude Sensor Calibration and Application With a\n"
        "Recommended New Calibration Method*, NASA Langley, 1999. This page has its tables, its figures, and its\n"
        "statements about them, computed with the methods of this program. Sections up to the errata need no\n"
        "measurement; a test compares them with the results of the code. The experiments are simulated.\n\n"
        f"Made by `{command}`, which also draws figures 1 to 54 as pictures, and in one `paper.html`.\n"
    )
    return intro + "".join(f"\n{section_markdown(s)}" for s in sections)


def section_markdown(section: Section) -> str:
    """One section."""
    lines = [f"## {section.title}", ""]
    for words in section.words:
        lines += [words, ""]
    if section.header:
        lines += [_line(section.header), _line(["---"] * len(section.header)), *map(_line, section.rows), ""]
    return "\n".join(lines)


def _line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _section(title: str, words: str, statements: Sequence[Statement]) -> Section:
    agree = sum(s.agrees for s in statements)
    counted = f"{words} {agree} of {len(statements)} agree."
    return Section(title, (counted,), _HEADER, tuple(map(_cells, statements)), tuple(statements))


def _counted(title: str, statements: Sequence[Statement], held: Counter[tuple[str, str]], seeds: int) -> Section:
    """With a column that says on how many seeds each held."""
    header = ("figure", "the paper", "printed", "simulated", "criterion", "", f"held, of {seeds}")
    rows = tuple(
        (s.where, s.says, s.printed, s.computed, s.criterion, _verdict(s), str(held[s.where, s.says]))
        for s in statements
    )
    agree = sum(s.agrees for s in statements)
    return Section(title, (f"{agree} of {len(statements)} hold on the first seed.",), header, rows, tuple(statements))


def _cells(s: Statement) -> tuple[str, ...]:
    return s.where, s.says, s.printed, s.computed, s.difference, s.criterion, _verdict(s), s.note


def _verdict(s: Statement) -> str:
    return "agrees" if s.agrees else "**differs**"


def _table_2(rows: dict[str, Row]) -> Iterable[tuple[str, ...]]:
    for figure, row in rows.items():
        was = printed.ROWS[figure]
        yield (figure, str(was.points), str(was.replications), "printed", *_numbers(was))
        yield ("", str(row.points), str(row.replications), "simulated", *_numbers(row))


def _numbers(row: Row) -> list[str]:
    first = [f.name for f in fields(Row)].index("sigma_E")
    return [short(value) for value in astuple(row)[first:-1]]


ERRATA = (
    ("eq. (37)", "sin Omega_z is correct, not sin Omega_y"),
    (
        "eq. (67)",
        "C_a is correct, not C_2a, wherever it multiplies cos a, and where its square is in the denominator: at 0 deg "
        "the variance is 0.0688, not 0.0345 (N = 33, +-30 deg)",
    ),
    ("eq. (75)", "the minus sign is missing, unlike in eq. (87)"),
    (
        "eq. (108)",
        "is for least squares with equal weights of all sensors; the figures beside it are for weighted least squares: "
        "at 45 deg with y and z ten times worse 7.1 against 1.4 sd of x",
    ),
    ("eq. (148)", "h_z ends in -cos a cos R, which it contains already; -cos a sin R is correct"),
    ("eq. (159)", "cos^2 a / rho_AA is in the denominator; its correct place is beside the fraction"),
    ("5.3", "a tumble with roll is worse by (65 M/6)^1/2, not (65/6)^1/2: the design has MN points"),
    ("5.3.1", "17 percent is above the centre of +-90 deg; above the centres of +-30 and +-45 deg it is 21 percent"),
    ("5.3.2", "10 percent of figure 3 is 9 percent by Table 1"),
    (
        "5.3.2",
        "9 percent within +-10 deg against D1, stated for both designs of figure 3, compares 1.811 within +-10 deg "
        "with D1's 1.989 within +-30 deg; within +-10 deg D1 has 1.814, so there is no gain",
    ),
    ("5.3.2", "the single curve beside figure 5 is from figure 2(a), not from figure 1"),
    ("6.4", "A_x of figures 9(a), (b) is 20 deg in the captions and 0 in the text"),
    ("6.4", "a ten times worse y does not change pitch up to 85 deg of roll with coning 0.1 deg, but not with 1 deg"),
    ("6.5", "figures 11(c), (d) depart from R = 0 and 180 deg, not from +-90 deg"),
    ("figure 12", "with the signs of eqs. (87), (88), (95) azimuths of -90 deg have the locus, not of +90 deg"),
    ("6.6", "the curves are in figures 13 to 20; figure 12 is a locus"),
    ("9.1", "the standard error given for figure 36 is the one of figure 26"),
    ("9.2.2", "the step of pitch that becomes 15 deg was 5 deg, not 3"),
    ("figures 31 to 33", "the captions have +-180 deg; the data are from figure 28(b), +-30 deg"),
    ("9.3.2", "the pattern of the x sensor is in figure 47(a), not 44(c)"),
    (
        "9.3.2",
        "drift is said to be significant for x and z only; by row 47(b) it is significant for y too (T_b = T_S = "
        "2.98, limit 2.22). The sigma_b and sigma_S of this row are also the same number",
    ),
    ("9.3.3", "bias is said to be significant for x and y; by row 50 it is significant for z too (4.28, limit 3.32)"),
    (
        "9.3.3",
        "0.000433 of figure 47(a) is the value of the tumble; 47(a) has 0.000409. Figure 50 is of the six-point tumble",
    ),
    ("9.3.4", "the 481-point calibration is the one of section 9.3.2"),
    ("Table 2", "the remark of row 36 refers to figure 28(a), the text and the numbers to 28(b)"),
    ("Table 2", "rows 22 and 24 have 73 and 145 points, rows 28, 34, 36 have 325, row 42 four replications"),
    ("Table 2", "by their T, sigma_S of rows 28(a), 34, 53 z is 123, 145, 13.5, and sigma_prec of row 34 is 16.4"),
    (
        "Table 2",
        "drift limits of rows 24 and 26 are F(K - L, 3K), of row 22 nearly (1.36): the limit of T_bias for four "
        "replications. No explanation was found for the limits of row 53 (1.59)",
    ),
)  # fmt: skip
"""Place and erratum; each was found by a computation of both sides."""

NOT_ALIKE = (
    "Sensors. The sizes of noise, pads, temperature coefficients and drifts were chosen to give the sizes of Table 2. "
    "All other results follow from them.",
    "Drift. The simulated world drifts with time at a steady rate. The paper's sensors changed irregularly between "
    "replications. Row 22's offset drift (T_b 5.82, with a sigma_b hardly above sigma_E) is a change between "
    "replications that the simulated world does not have. So T_b is not significant there.",
    "Tumbles. The deflection of isolation pads is a product of two components of gravity and is zero at every cardinal "
    "angle. So pads alone give a tumble no bias. The paper's tumbles show a bias (T_bias 30, 85, 19), so its sensors "
    "had another effect as well. A nonlinearity of 5 to 15 ug/g^2 in each sensor and an eccentricity of 2.9 arc "
    "seconds of the roll axis give sizes like those in rows 24, 26, 47, 50, 53 at once, and were chosen for this "
    "reason. Both are guesses.",
    "Rows 44(b) and (c). With these sizes the y and z sensors have a smaller bias over +-90 deg than the paper's "
    "sensors (T_bias of z about 3 instead of 17), and row 47(b) has no drift.",
    "Seeds. Another seed gives other noise for the same sensors, effects and drifts. Sizes and criteria were chosen "
    "with the results of seeds 1 to 3 known, and the noise of one sensor after a first look at ten seeds.",
    "Sensor 2. Its sigma_E of 16.6 comes from its drift: sigma_b / T_b^1/2 is 3.7, which is all its scatter within a "
    "replication. So its noise was chosen as twice the noise of sensor 1, not ten times, with a steady drift of 28 "
    "uV/h and 9 ppm/h. This gives both rows 34 and 42.",
    "Figure 48. Its unusual scatter at -90 deg of pitch is not simulated.",
    "Order. Replications alternate as A B B A here, which balances time and direction against the points. The paper "
    "does not state its order.",
)
