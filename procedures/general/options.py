"""Options of commands for tables of any kind only: the role of each column."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from rig.procedures.evaluate.results import QUICK, Options

_IGNORE = "column(s) that the trace does not look at, as in rig trace; those that a further run recorded if left out"
_FORMULA = "the declared model, such as '1 + x + x^2'"


class FitOptions(Options):
    """Options of `rig fit`."""

    traced: bool = Field(False, description="keep a calibration with the effects that a trace finds")
    ignore: list[str] | None = Field(None, description=_IGNORE)
    response: str | None = Field(None, description="the column to be explained")
    formula: str | None = Field(None, description=_FORMULA)
    whole_plot: str | None = Field(None, description="column(s) of whole plots; a,b for two")
    replicate: str | None = Field(None, description="column of replications that hold whole plots")
    model: str | None = Field(
        None,
        description="a standard model in place of a formula, such as callendar-van-dusen (docs/reference/models.md)",
    )
    abscissa: str | None = Field(None, description="column of the abscissa, for --model or --u-x")
    start: list[str] | None = Field(
        None,
        description="parameter and its start value, a=1.5, for a formula that is not linear in its parameters, such as "
        "'a * exp(-b * x)'; repeatable, or a=1.5,b=2",
    )
    weight: str | None = Field(None, description="column of relative weights: one over the variance, up to a factor")
    u_y: str | None = Field(
        None, description="standard uncertainty of the response, known beforehand: a column, or a value"
    )
    u_x: str | None = Field(None, description="standard uncertainty of the abscissa: a column, or a value; with --u-y")
    series: str | None = Field(
        None, description="column of series of rising and falling forces, for the figures of ISO 376; with --direction"
    )
    direction: str | None = Field(None, description="with --series: column that says which rows rise, in words or +-1")
    position: str | None = Field(None, description="with --series: column of the transducer's orientation")
    tolerance: float | None = Field(
        None,
        description="largest accepted 95 % half-width of a value inferred from a reading such as the rows of "
        "the table, in the unit of the abscissa; exit code 3 beyond it",
    )
    between: tuple[float, float] | None = Field(
        None, description="with --tolerance, for a curve that turns: the range in which values are inferred"
    )

    at: list[str] | None = Field(
        None,
        description="values of the model's columns at which the response is predicted, with its uncertainty: x=30, or "
        "x=30,t_degC=20; repeatable",
    )


class BudgetOptions(Options):
    """Options of `rig budget`."""

    traced: bool = Field(False, description="with the effects that a trace finds, and the model error they leave")
    ignore: list[str] | None = Field(None, description=_IGNORE)


class TraceOptions(Options):
    """Options of `rig trace`."""

    doubts_by_left_out: ClassVar[bool] = True

    response: str | None = Field(None, description="the column to be explained, or arithmetic of columns")
    formula: str | None = Field(None, description=_FORMULA)
    group: list[str] | None = Field(
        None, description="column(s) whose levels may have offsets or gains of their own; repeatable, or a,b"
    )
    whole_plot: str | None = Field(None, description="column(s) of whole plots, whose error is declared; a,b for two")
    replicate: str | None = Field(None, description="column of repeats, whose offsets are declared")
    time: str | None = Field(None, description="column of the time, in any unit, or of dates and times as text")
    date: str | None = Field(None, description="column of the date, if --time is a column of times of day")
    date_order: Literal["dmy", "mdy", "ymd"] | None = Field(
        None, description="day, month or year first, for dates such as 03/04/2026 or 20-02-21"
    )
    direction: str | None = Field(
        None,
        description="column of the direction: +-1, words (up, down) or a velocity; for two other words COLUMN=UP,DOWN; "
        "or the column of a setting, for the side from which it was approached",
    )
    candidates: list[str] | None = Field(
        None, description="search these columns only, besides those of the formula; repeatable, or a,b"
    )
    ignore: list[str] | None = Field(None, description="column(s) not to look at; repeatable, or a,b")
    wrap: float | None = Field(
        None, description="the response is an angle with this period: wrap it to half a period on either side of zero"
    )
    quick: bool = Field(False, description=QUICK)


class InferOptions(Options):
    """Options of `rig infer`."""

    quantity: str | None = Field(
        None,
        description="the variable to infer, if the calibration has several; the table has the values of the others; "
        "default: the only one that is not a column of the table",
    )

    u_reading: float | None = Field(
        None, description="standard uncertainty of one new reading, in its unit, in place of the calibration's"
    )

    between: tuple[float, float] | None = Field(
        None,
        description="LOW HIGH: the range in which the variable is known to be, for a curve that turns; readings "
        "outside it are flagged",
    )
