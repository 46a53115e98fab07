"""Settings that procedures of every kind have in common."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0, le=1e6)]


class Strict(BaseModel):
    """Settings that refuse what they do not know, and numbers that are none."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class WarningSettings(Strict):
    """Early warnings about the sensors while a run goes on. They never stop it by themselves."""

    enabled: bool = Field(True, description="watch for rising noise, drift, and sensors that died")
    hold: bool = Field(False, description="hold the run at each new warning, until `rig release`")
    against: str | None = Field(
        None,
        min_length=1,
        description="the last calibration of these sensors, or an earlier run of them: a file beside the procedure. "
        "It is kept in the run file, and readings that leave it are warned of",
    )
