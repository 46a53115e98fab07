"""Statements of a certificate about its items: results, budgets, statements of conformity, effects, as data.

Numbers are texts, as `rig.verbs.certificate.document` says, with the unrounded numbers beside those of results.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Literal

Stage = Literal["", "as found", "as left"]
"""Which of two runs, before and after an adjustment; "" if there is only one."""
Verdict = Literal["pass", "fail", "conditionalPass", "conditionalFail", "noPass", "noFail"]
"""The words of a digital calibration certificate."""


@dataclass(frozen=True)
class Column:
    """A column of a table of results: what the results are given at."""

    label: str
    unit: str


@dataclass(frozen=True)
class Result:
    """One value with its expanded uncertainty.

    Attributes:
        name: key of the result, unique in its table.
        label: for people.
        at: texts of the table's columns `at`.
        value: rounded by its uncertainty.
        expanded: expanded uncertainty, two digits.
        k: coverage factor, rounded.
        probability: coverage probability, as a text such as "0.95".
        unit: of value and uncertainty; "" for a plain number.
        estimate: the value, unrounded.
        standard: combined standard uncertainty, unrounded.
        factor: coverage factor, unrounded.
        df: effective degrees of freedom.
    """

    name: str
    label: str
    at: tuple[str, ...]
    value: str
    expanded: str
    k: str
    probability: str
    unit: str
    estimate: float
    standard: float
    factor: float
    df: float


@dataclass(frozen=True)
class ResultTable:
    """Results of one sensor.

    Attributes:
        sensor: `Item.name`; "" for results of all items together.
        title: what the results are.
        results: in the order of the rows.
        at: what the results are given at; () for results without settings, such as coefficients.
        stage: as found or as left.
        notes: sentences below the table, such as the formula.
    """

    sensor: str
    title: str
    results: tuple[Result, ...]
    at: tuple[Column, ...] = ()
    stage: Stage = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Contribution:
    """One line of an uncertainty budget; numbers are texts.

    Attributes:
        label: the influence.
        source: what it is traced to.
        kind: evaluation of type A or B.
        standard: standard uncertainty of the result by this influence alone, in the result's unit.
        df: its degrees of freedom.
        share: of the squared combined standard uncertainty; negative where a correlation reduces it.
    """

    label: str
    source: str
    kind: Literal["A", "B"]
    standard: str
    df: str
    share: float


@dataclass(frozen=True)
class Budget:
    """The uncertainty budget of one result, for the annex.

    Attributes:
        sensor: `Item.name`; "" for a result of all items together.
        result: `Result.name`.
        label: of the result.
        unit: of the result.
        contributions: largest share first.
        left: number of smaller contributions that are not listed.
        combined: combined standard uncertainty.
        df: effective degrees of freedom.
        k: coverage factor.
        expanded: expanded uncertainty.
        stage: as found or as left.
    """

    sensor: str
    result: str
    label: str
    unit: str
    contributions: tuple[Contribution, ...]
    combined: str
    df: str
    k: str
    expanded: str
    stage: Stage = ""
    left: int = 0


@dataclass(frozen=True)
class Statement:
    """A statement of conformity.

    Attributes:
        sensor: `Item.name`.
        what: the quantity that is judged.
        tolerance: as words, with the unit.
        rule: the decision rule, as words.
        verdict: its result.
        probability: that the quantity is within the tolerance, as a text.
        sentence: the statement, without the name of the sensor.
        stage: as found or as left.
        basis: by what the tolerance follows from the settings, as words; "" where it is stated as numbers.
        permitted: lowest and highest value that conforms, unrounded; infinite where there is no limit.
    """

    sensor: str
    what: str
    tolerance: str
    rule: str
    verdict: Verdict
    probability: str
    sentence: str
    stage: Stage = ""
    basis: str = ""
    permitted: tuple[float, float] = (-inf, inf)


@dataclass(frozen=True)
class Effect:
    """An effect that was found beside the declared model.

    Attributes:
        sensor: `Item.name`.
        name: in the catalogue.
        cause: the physical mechanism.
        size: with its interval.
        confirmed: whether a further run confirmed it.
        how: by what it was confirmed, or why it was not.
        stage: as found or as left.
        shared: whether all items have it alike, a sentence.
    """

    sensor: str
    name: str
    cause: str
    size: str
    confirmed: bool
    how: str
    stage: Stage = ""
    shared: str = ""
