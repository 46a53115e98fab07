"""Columns that tell series of rising and falling settings."""

from __future__ import annotations

from dataclasses import dataclass

from rig.fitter.arithmetic_text import column_name
from rig.procedures.errors import DataError


@dataclass(frozen=True)
class Series:
    """Columns that say how rows belong to series.

    Attributes:
        series: number or name of the run through the forces.
        direction: rising or falling; words, +-1 or numbers with a sign.
        position: orientation of the transducer; None if it was not turned.
    """

    series: str
    direction: str
    position: str | None = None

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        return [self.series, self.direction, *([self.position] if self.position else [])]


def series_of(series: str | None, direction: str | None, position: str | None) -> Series | None:
    """Series from options; None if none is asked for. Raises `DataError` if one of them lacks its partner."""
    if series is None and direction is None and position is None:
        return None
    if series is None or direction is None:
        raise DataError("--series, the column of series, and --direction, which rows rise, go together")
    return Series(column_name(series), column_name(direction), None if position is None else column_name(position))
