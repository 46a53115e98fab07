"""Plots as data: what is drawn, apart from how."""

from __future__ import annotations

from dataclasses import dataclass

from rig.fitter.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Line:
    """A curve, or marks.

    Attributes:
        x: (n,).
        y: (n,); NaN where there is nothing to draw.
        label: for the legend; empty for none.
        style: "-", "--", ":", "-." or a mark such as "o".
        color: of the default cycle if empty.
        faint: among many of its kind.

    """

    x: FloatArray
    y: FloatArray
    label: str = ""
    style: str = "-"
    color: str = ""
    faint: bool = False


@dataclass(frozen=True, eq=False)
class Field:
    """A function of two variables, its size drawn in grey.

    Attributes:
        x: (n,).
        y: (m,).
        values: (m, n).
        level: lines are drawn where it is this; None for none.

    """

    x: FloatArray
    y: FloatArray
    values: FloatArray
    level: float | None = None


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes.

    Attributes:
        title: short.
        x_label: with unit.
        y_label: with unit.
        lines: drawn in order.
        y_range: limits; None for those that the lines have.
        field: drawn beneath the lines.

    """

    title: str
    x_label: str
    y_label: str
    lines: tuple[Line, ...]
    y_range: tuple[float, float] | None = None
    field: Field | None = None


@dataclass(frozen=True, eq=False)
class Figure:
    """One figure of the paper.

    Attributes:
        number: as in the paper.
        caption: what it shows.
        panels: one or more.
        simulated: whether it is of simulated measurements.

    """

    number: str
    caption: str
    panels: tuple[Panel, ...]
    simulated: bool = False

    @property
    def file_name(self) -> str:
        """Of its picture."""
        return f"figure-{self.number.replace(' ', '-').replace('(', '').replace(')', ''):0>2}.png"


PITCH, ROLL = "pitch / deg", "roll / deg"
NORMALISED = "sd / sigma x (number of points)^1/2"
