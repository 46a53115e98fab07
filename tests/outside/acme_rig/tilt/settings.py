"""`procedure.toml` with `kind = "acme-tilt"`, checked and expanded to a run list."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Literal

from pydantic import Field

from rig.procedures.plan.conduct import Conduct
from rig.procedures.plan.fault_policies import HeadFaults
from rig.procedures.plan.run_list import Factor, Point, RunList, Settle
from rig.procedures.plan.settings import Acceptance, Name, Positive, Strict, WarningSettings


class TiltDesign(Strict):
    """Which angles to visit: all of them upwards, then all of them downwards."""

    pitch_deg: list[float] = Field(min_length=3, max_length=1000)


class TiltSettle(Strict):
    """When an angle counts as reached."""

    band_deg: Positive = 0.0005
    dwell_s: float = Field(3.0, ge=0)


class TiltAcceptance(Acceptance):
    """When a finished calibration is fit for use."""

    sigma_deg: Positive | None = Field(None, description="largest standard error of one observation, as an angle")


def line(given: Mapping[str, float]) -> tuple[float, ...]:
    """What early warnings hold an output against."""
    return (1.0, math.sin(math.radians(given["pitch_deg"])))


class TiltProcedure(Strict):
    """A whole `procedure.toml` of kind acme-tilt."""

    kind: Literal["acme-tilt"]
    name: Name
    seed: int = Field(0, ge=0, description="nothing is random here")
    replications: int = Field(4, ge=1, le=1000)
    design: TiltDesign
    settle: TiltSettle = TiltSettle()
    readings: int = Field(4, ge=1, le=1000, description="sweeps over all channels at a point")
    faults: HeadFaults = HeadFaults()
    warnings: WarningSettings = WarningSettings()
    acceptance: TiltAcceptance = TiltAcceptance()

    @property
    def conduct(self) -> Conduct:
        """How the run is carried out."""
        settle = Settle(self.settle.band_deg, self.settle.dwell_s, drift_per_s=0.001, timeout_s=120.0)
        return Conduct(settle=settle, readings=self.readings, faults=self.faults, warnings=self.warnings, response=line)

    def expand(self) -> RunList:
        """Every point of the run, in order."""
        return RunList([Factor("pitch_deg", "pitch", overtravel=1.0)], self._points(), self.seed)

    def _points(self) -> Iterator[Point]:
        up = sorted(self.design.pitch_deg)
        for replication in range(self.replications):
            ways = [(angle, +1) for angle in up] + [(angle, -1) for angle in reversed(up)]
            for place, (angle, side) in enumerate(ways):
                yield Point(replication * len(ways) + place, replication + 1, None, (angle,), (side,))
