"""Declared models of a general procedure: the `[model]` table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Self

from pydantic import ConfigDict, Field, model_validator

from rig.procedures.plan.settings import Strict


class SensorModel(Strict):
    """The declared model of a sensor: a formula, or a standard model."""

    formula: str | None = Field(
        None,
        min_length=1,
        description="terms in the factors, such as `1 + force_kN + force_kN^2` (docs/reference/formulas.md)",
    )
    standard: str | None = Field(
        None,
        min_length=1,
        description="instead: a standard model by name, such as callendar-van-dusen (docs/reference/models.md)",
    )
    abscissa: str | None = Field(
        None, description="the factor that it is about, if there are several: budgets infer it, at the others' values"
    )
    start: dict[str, float] = Field(
        default_factory=dict, description="start values of parameters, for a formula that is not linear in them"
    )

    @model_validator(mode="after")
    def _is_one_model(self) -> Self:
        if (self.formula is None) == (self.standard is None):
            raise ValueError("a model is a formula or the name of a standard model: give one of them")
        return self

    @property
    def linear(self) -> bool:
        """Whether it is linear in its coefficients, as plans, traces and searched designs need it."""
        return self.formula is not None and not self.start


class ModelSettings(SensorModel):
    """The declared model of every sensor; `[model.NAME]` has one of its own."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, SensorModel]

    @property
    def own(self) -> Mapping[str, SensorModel]:
        """Models of sensors with one of their own, by the sensors' names."""
        return dict(self.__pydantic_extra__ or {})

    @property
    def formulas(self) -> tuple[str, ...]:
        """All declared formulas that are linear in their coefficients, each once."""
        models: tuple[SensorModel, ...] = (self, *self.own.values())
        return tuple(dict.fromkeys(one.formula for one in models if one.linear and one.formula is not None))

    def of(self, sensor: str) -> SensorModel:
        """The model of a sensor, by its name on the bench."""
        return self.own.get(sensor, self)
