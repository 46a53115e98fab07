"""The document: sections of tables, the same for Markdown, HTML and JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, fields
from functools import cache

from proving.paper import printed
from proving.paper.fractions import statements_21
from proving.paper.loci import statements_9_11_12
from proving.paper.one_axis import statements_6_to_8
from proving.paper.outputs import statements_1_to_5
from proving.paper.printed import Row
from proving.paper.statement import SMALL, Statement, short
from proving.paper.table_1 import table_1
from proving.paper.table_2 import critical_values, identities
from proving.paper.three_axes import statements_13_to_20
from proving.paper.two_axes import statements_10
from proving.paper.words import ERRATA, NOT_ALIKE

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
