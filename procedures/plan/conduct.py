"""Execution of a run apart from its points and their order: requirements of the engine on procedures of any kind."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Self

from pydantic import Field, model_validator

from rig.procedures.plan.fault_policies import FaultSettings
from rig.procedures.plan.run_list import Settle
from rig.procedures.plan.settings import Positive, Strict, WarningSettings


class EnvironmentSettings(Strict):
    """The enclosure's temperature before the first point and after a long gap."""

    setpoint_degC: float = Field(23.0, ge=-80, le=200)
    tolerance_degC: Positive = Field(0.5, le=20, description="enclosure within this of the setpoint")
    dwell_s: float = Field(900.0, ge=0, le=1e6, description="for this long")
    drift_degC_per_h: Positive = Field(1.0, description="and drifting slower than this")
    poll_s: Positive = Field(10.0, le=600, description="time between readbacks")
    timeout_s: Positive = Field(4 * 3600.0)


class SoakSettings(Strict):
    """Criterion for settled temperatures of a whole plot: chamber and thermometers, by readings, not by time.

    Thermometers are those that have the factor's name, or its name as their `place`.
    """

    tolerance_degC: Positive = Field(0.5, le=20, description="chamber within this of the setpoint")
    sensor_tolerance_degC: Positive = Field(1.0, le=20, description="each thermometer at the sensors within this of it")
    dwell_s: float = Field(1200.0, ge=0, le=1e6, description="all for this long")
    drift_degC_per_h: Positive = Field(0.5, description="and the drift of each slower than this")
    renew_degC: Positive = Field(
        5.0,
        le=100,
        description="a temperature that is already reached is first left by this much, and then set again",
    )
    poll_s: Positive = Field(30.0, le=600, description="time between readbacks")
    timeout_s: Positive = Field(8 * 3600.0, description="then the soak has failed")

    @model_validator(mode="after")
    def _leaving_is_more_than_tolerance(self) -> Self:
        tolerated = max(self.tolerance_degC, self.sensor_tolerance_degC)
        if self.renew_degC < 2.0 * tolerated:
            raise ValueError(
                f"soak.renew_degC = {self.renew_degC:g} must be twice what is tolerated at least ({2 * tolerated:g}), "
                f"or leaving a temperature would be no change of it"
            )
        return self


@dataclass(frozen=True, kw_only=True)
class WholePlotConduct:
    """Handling of whole plots in a run with hard-to-change factors.

    Attributes:
        soak: criterion for settled temperatures.
        continue_gap_s: a whole plot after a longer gap is measured again under a new identity.
        repeats: maximum number of repeats of a lost whole plot in one session.
    """

    soak: SoakSettings
    continue_gap_s: float
    repeats: int


@dataclass(frozen=True, kw_only=True)
class Conduct:
    """Approach, measurement and recovery of points.

    Attributes:
        settle: criterion for the arrival of an easy-to-change factor.
        settles: criteria of factors with one of their own, by axis.
        tolerances: largest difference between setpoint and reading of a factor's reference standard, by factor.
        near: how near its level the reading of a factor's reference standard is brought, where it is, by factor.
        poll_s: time between readbacks meanwhile.
        readings: sweeps over all channels at a point.
        repeats: maximum number of repeats of too noisy readings before they are accepted with a flag.
        max_sd_V: limit of the noise of one reading; None for no limit.
        max_sd: the same of one sensor, or of a factor's reference standard, in its own unit, by name.
        faults: policies for faults.
        warnings: early warnings about the sensors.
        hold_max_s: a hold that nobody releases ends the session after this.
        environment: the enclosure's temperature; None if not required.
        max_gap_s: after a longer gap the environment is settled again.
        whole_plots: handling of whole plots in a run with hard-to-change factors; None for others.
        mounting: orientation of the package, "x_deg" and so on; empty if not applicable.
        output_unit: unit of the sensors' recorded outputs; "" for any.
        sensor_axes: whether every sensor must have a nominal axis, or none may have one; None if irrelevant.
        package_temperature: whether the declared model requires a temperature in the package.
        response: columns of a simple model of every output, from set or measured quantities by name; early warnings
            compare outputs with it. None if unknown.
        any_instruments: whether the bench file says what sets each factor, and any instrument that can may do it.
        models_of: sensors that the procedure names; the bench must have them.
        misfit: what is wrong with the declared models on a bench with these sensors' columns, by name, that reads these
            quantities beside the factors, each with the factor in whose place it is read, or ""; "" if nothing is. None
            if nothing can be.
        least_jump: deviation of an output without a warning, as a fraction of its span.
    """

    settle: Settle
    settles: Mapping[str, Settle] = field(default_factory=dict)
    tolerances: Mapping[str, float] = field(default_factory=dict)
    near: Mapping[str, float] = field(default_factory=dict)
    poll_s: float = 0.5
    readings: int = 10
    repeats: int = 2
    max_sd_V: float | None = None
    max_sd: Mapping[str, float] = field(default_factory=dict)
    faults: FaultSettings = field(default_factory=FaultSettings)
    warnings: WarningSettings = field(default_factory=WarningSettings)
    hold_max_s: float = 12 * 3600.0
    environment: EnvironmentSettings | None = None
    max_gap_s: float = float("inf")
    whole_plots: WholePlotConduct | None = None
    mounting: Mapping[str, float] = field(default_factory=dict)
    output_unit: str = ""
    sensor_axes: bool | None = None
    package_temperature: bool = False
    response: Callable[[Mapping[str, float]], tuple[float, ...]] | None = None
    any_instruments: bool = False
    models_of: Collection[str] = ()
    misfit: Callable[[Mapping[str, str], Mapping[str, str]], str] | None = None
    least_jump: float = 0.05

    def settled(self, axis: str) -> Settle:
        """Criterion for the arrival of an axis."""
        return self.settles.get(axis, self.settle)
