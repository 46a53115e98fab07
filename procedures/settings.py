"""Settings that procedures of every kind have in common."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0, le=1e6)]
OnFailure = Literal["skip", "hold", "abort"]


class Strict(BaseModel):
    """Settings that refuse what they do not know, and numbers that are none."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class FaultSettings(Strict):
    """What to do when something goes wrong at a point."""

    retries: int = Field(2, ge=0, le=20, description="attempts after the first before the policy below applies")
    not_settled: OnFailure = "skip"
    overload: OnFailure = "skip"
    no_reply: OnFailure = "abort"
    instrument_error: OnFailure = "abort"
