"""`[[tolerance]]` of `certificate.toml`: permitted values of results, as numbers or by the settings at their points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Self

import numpy as np
from pydantic import Field, model_validator

from rig.fitter.arithmetic_text import parse_expression
from rig.fitter.decision import Tolerance
from rig.fitter.errors import FitError
from rig.procedures.plan.settings import Strict

EVERY = "every "
_LIMITS, _FORMULAS = ("lower", "upper"), ("lower", "upper", "nominal", "deviation")
_PERCENT = {"percent_of_reading": "", "percent_of_span": "span", "percent_of_full_scale": "full_scale"}
_PARTS = ("deviation", *_PERCENT)


class ToleranceSettings(Strict):
    """One `[[tolerance]]`: permitted values of one result, or of all results of a sort."""

    result: str = Field(
        min_length=1,
        description="label of the result in its table, such as `offset`; `every output` for the outputs at all points",
    )
    sensor: str = Field("", description="of this sensor only; left out: of every sensor that has such a result")
    unit: str = Field(description="unit of the limits: that of the result")
    from_customer: bool = Field(False, description="whether the customer supplied the limits")
    lower: float | str | None = Field(
        None,
        description='lowest permitted value; a number, or a formula of the settings at the point: `"2 * force_kN"`',
    )
    upper: float | str | None = Field(None, description="highest permitted value; a number or a formula")
    nominal: float | str | None = Field(
        None, description="ideal value, instead of lower and upper; a number or a formula"
    )
    deviation: float | str | None = Field(
        None,
        description="largest permitted deviation from `nominal`; a number or a formula. Deviation and percentages are "
        "added",
    )
    percent_of_reading: float | None = Field(
        None, gt=0, description="permitted deviation, percent of the size of `nominal` at the point"
    )
    percent_of_span: float | None = Field(None, gt=0, description="permitted deviation, percent of `span`")
    span: float | None = Field(None, gt=0, description="largest less smallest value of the item's range, in `unit`")
    percent_of_full_scale: float | None = Field(None, gt=0, description="permitted deviation, percent of `full_scale`")
    full_scale: float | None = Field(None, gt=0, description="largest value of the item's range, in `unit`")

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        parts = [name for name in _PARTS if getattr(self, name) is not None]
        around = parts + (["nominal"] if self.nominal is not None else [])
        if bool(around) == any(getattr(self, name) is not None for name in _LIMITS):
            raise ValueError(f"a tolerance is lower or upper or both, or nominal with {' or '.join(_PARTS)}")
        if around and not parts:
            raise ValueError(f"nominal needs {' or '.join(_PARTS)}")
        if around and self.nominal is None:
            raise ValueError(
                f"{parts[0]} needs nominal, the ideal value in {self.unit}: a number, or a formula of the settings, "
                'such as nominal = "2 * force_kN"'
            )
        for percent, of in _PERCENT.items():
            if of and (getattr(self, percent) is None) != (getattr(self, of) is None):
                raise ValueError(f"{percent} and {of} belong together")
        try:
            if not self._names():
                self.permitted({})
        except FitError as error:
            raise ValueError(str(error)) from None
        return self

    def _names(self) -> dict[str, str]:
        """Settings in the formulas, with the key that has them. Raises `FitError` if one is not understood."""
        found: dict[str, str] = {}
        for key in _FORMULAS:
            if isinstance(text := getattr(self, key), str):
                try:
                    found |= dict.fromkeys(parse_expression(text).names, key)
                except FitError as error:
                    raise FitError(f"{key}: {error}") from error
        return found

    @property
    def named(self) -> str:
        """Label of its results, and their sensor, for messages."""
        return repr(self.result) + (f" of {self.sensor!r}" if self.sensor else "")

    @property
    def stated(self) -> str:
        """Its keys as they are in the file."""
        given = self.model_dump(exclude_none=True, exclude_defaults=True, exclude={"result", "sensor"})
        return ", ".join(f"{key} = {value}" for key, value in given.items())

    def applies_to(self, label: str) -> bool:
        """Whether a result with this label is judged."""
        every = self.result.startswith(EVERY) and label.partition(" ")[0] == self.result.removeprefix(EVERY)
        return every or label == self.result

    def permitted(self, at: Mapping[str, float]) -> Tolerance:
        """The interval of a result.

        Args:
            at: settings at its point, by column; none of a coefficient.

        Raises:
            FitError: a formula has another name or no value there, or no value is permitted.
        """
        for name, key in self._names().items():
            if name not in at:
                known = f"they are {', '.join(at)}" if at else "a coefficient has none"
                raise FitError(f"{key}: {name} is none of the settings at the point: {known}")
        if self.nominal is None:
            limits = {name: self._value(name, at) for name in _LIMITS if getattr(self, name) is not None}
            return Tolerance(**limits)
        nominal, deviation = self._around(at)
        if not deviation > 0.0:
            raise FitError(
                f"nominal = {nominal:g} with a permitted deviation of {deviation:g} {self.unit}: it must be above 0; "
                f"add deviation or percent_of_full_scale, or leave the point out of `at`"
            )
        return Tolerance.around(nominal, deviation)

    def _around(self, at: Mapping[str, float]) -> tuple[float, float]:
        """Nominal value and permitted deviation."""
        nominal = self._value("nominal", at)
        own = 0.0 if self.deviation is None else self._value("deviation", at)
        of = {"": abs(nominal), "span": self.span, "full_scale": self.full_scale}
        return nominal, own + sum((getattr(self, p) or 0.0) / 100.0 * (of[o] or 0.0) for p, o in _PERCENT.items())

    def _value(self, key: str, at: Mapping[str, float]) -> float:
        given = getattr(self, key)
        if not isinstance(given, str):
            return float(given)
        with np.errstate(all="ignore"):
            value = float(parse_expression(given).value({name: np.float64(one) for name, one in at.items()}))
        if not np.isfinite(value):
            raise FitError(f"{key}: {given!r} has no value at the point")
        return value

    def text(self, at: Mapping[str, float], unit: str) -> str:
        """The limits at the settings of a result, for people."""
        if self.nominal is not None:
            nominal, deviation = self._around(at)
            return f"{_number(nominal)} ± {deviation:.6g} {unit}"
        lower, upper = (None if getattr(self, n) is None else _number(self._value(n, at)) for n in _LIMITS)
        if lower is None:
            return f"up to {upper} {unit}".strip()
        return f"from {lower} {f'to {upper} ' if upper is not None else ''}{unit}".strip()

    @property
    def basis(self) -> str:
        """By what the limits follow from the settings, with the result's label; "" where they are stated as numbers."""
        parts = [f"{key} = {text}" for key in _FORMULAS if isinstance(text := getattr(self, key), str)]
        for percent, of in _PERCENT.items():
            if (share := getattr(self, percent)) is not None:
                size = f"{of.replace('_', ' ')}, {getattr(self, of):g} {self.unit}" if of else "the nominal value"
                parts.append(f"{share:g} % of {size}")
        if parts and isinstance(self.deviation, float):
            parts.append(f"{self.deviation:g} {self.unit}")
        return f"{self.result}: {'; '.join(parts)}" if parts else ""


def _number(value: float) -> str:
    return f"{value:.9g}"
