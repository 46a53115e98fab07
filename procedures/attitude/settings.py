"""The pitch-roll procedure: `procedure.toml` with `kind = "pitch-roll"`, checked and expanded to a run list.

It is also the reference of the file format: `rig explain procedure` prints it.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from rig.procedures.attitude.designs import Design, fraction, grid, listed, roll_circle, tumble, uniform
from rig.procedures.attitude.orders import Visit, random_order, reversed_pass, walk
from rig.procedures.plan.by_hand import Steps, check_places, with_steps
from rig.procedures.plan.conduct import Conduct, EnvironmentSettings
from rig.procedures.plan.fault_policies import HeadFaults
from rig.procedures.plan.run_list import Factor, Point, RunList, Settle
from rig.procedures.plan.settings import Acceptance, GoalSettings, LoopSettings, Name, Positive, Strict, WarningSettings

_PASS_KEPT = 10_000
"""Size above which a pass over a design is generated again for each replication instead of stored."""

MOST_POINTS = 1_000_000
"""Maximum number of points of a run; at half a minute each it takes a year."""
Side = Annotated[list[float], Field(min_length=1, max_length=10_000)]


class FractionSettings(Strict):
    """Decimation of the grid's interior, eq. (109)."""

    pitch_every: int = Field(ge=1, description="keep every K_alpha-th pitch row whole")
    roll_every: int = Field(ge=1, description="keep every K_R-th roll column whole")


class DesignSettings(Strict):
    """Angles of the design.

    D1: `pitch_max_deg` and `pitch_count`, uniform and symmetric; roll uniform over the circle. D0: any `pitch_deg`
    list; roll uniform over the circle. D: lists of both. points: a list of points. T6, T4: no further keys.
    """

    type: Literal["D", "D0", "D1", "points", "T6", "T4"]
    pitch_max_deg: Positive | None = Field(None, le=180, description="D1: pitch goes from minus to plus this")
    pitch_count: int | None = Field(None, ge=2, le=10_000, description="D1: number of pitch angles N")
    pitch_deg: Side | None = Field(None, description="D and D0: the pitch angles")
    roll_count: int | None = Field(None, ge=1, le=10_000, description="D0 and D1: number of roll angles M")
    roll_repeat_180: bool = Field(True, description="D0 and D1: end at +180 deg, repeating -180 deg")
    roll_deg: Side | None = Field(None, description="D: the roll angles; [0] for a sensor without roll")
    points_deg: Annotated[list[tuple[float, float]], Field(min_length=1, max_length=100_000)] | None = Field(
        None, description="points: [pitch, roll] of every point; visited in this order, unless it is random"
    )
    fraction: FractionSettings | None = Field(None, description="decimate the interior of the grid")

    @model_validator(mode="after")
    def _fields_fit_the_type(self) -> Self:
        needs = {
            "D": {"pitch_deg", "roll_deg"},
            "D0": {"pitch_deg", "roll_count"},
            "D1": {"pitch_max_deg", "pitch_count", "roll_count"},
            "points": {"points_deg"},
            "T6": set(),
            "T4": set(),
        }[self.type]
        optional = {"type", "roll_repeat_180", "fraction"} if needs and self.type != "points" else {"type"}
        missing = sorted(name for name in needs if getattr(self, name) is None)
        extra = sorted(self.model_fields_set - needs - optional)
        if missing:
            raise ValueError(f"design {self.type} needs {', '.join(missing)}")
        if extra:
            raise ValueError(f"design {self.type} does not use {', '.join(extra)}")
        self.build()
        return self

    def build(self) -> Design:
        """The design of these settings. Raises ValueError if it cannot be built."""
        if self.type in ("T6", "T4"):
            return tumble(roll=self.type == "T6")
        if self.type == "points":
            return listed(self.points_deg or ())
        if self.type == "D1":
            assert self.pitch_max_deg is not None
            assert self.pitch_count is not None
            pitch = uniform(-self.pitch_max_deg, self.pitch_max_deg, self.pitch_count)
        else:
            assert self.pitch_deg is not None
            pitch = tuple(self.pitch_deg)
        if self.type == "D":
            assert self.roll_deg is not None
            roll = tuple(self.roll_deg)
        else:
            assert self.roll_count is not None
            roll = roll_circle(self.roll_count, repeat_180=self.roll_repeat_180 and self.roll_count > 1)
        full = grid(self.type, pitch, roll)
        if len(full) > MOST_POINTS:
            raise ValueError(f"the full grid has {len(full):,} points, more than {MOST_POINTS:,}")
        if self.fraction is None:
            return full
        return fraction(full, pitch_every=self.fraction.pitch_every, roll_every=self.fraction.roll_every)


class OrderSettings(Strict):
    """Order of the points."""

    type: Literal["serpentine", "up-and-down", "random"] = Field(
        "serpentine",
        description="serpentine: every point once a replication; up-and-down: to the last row and back, every "
        "point twice; random: shuffled within each replication, sides of approach balanced",
    )
    replications: Literal["abba", "alternate", "same"] = Field(
        "abba", description="which replications walk the path backwards (serpentine and up-and-down)"
    )


class ApproachSettings(Strict):
    """Approach of an axis from its planned side."""

    overtravel_deg: Positive = Field(2.0, le=45, description="beyond backlash and hysteresis together")


class SettleSettings(Strict):
    """Criterion for reaching an angle."""

    band_deg: Positive = Field(0.0005, le=1, description="readback within this of the setpoint")
    dwell_s: float = Field(3.0, ge=0, le=1e6, description="for this long")
    drift_deg_per_s: Positive = Field(0.001, description="and drifting slower than this")
    poll_s: Positive = Field(0.5, le=60, description="time between readbacks")
    timeout_s: Positive = Field(120.0, description="then the settling has failed")

    def judged(self) -> Settle:
        """This criterion as the sequencer takes it."""
        return Settle(self.band_deg, self.dwell_s, self.drift_deg_per_s, self.timeout_s)


class MeasureSettings(Strict):
    """Measurement at a point."""

    readings: int = Field(10, ge=1, le=50_000, description="sweeps over all channels; their mean is the observation")
    max_sd_V: Positive | None = Field(None, description="noisier than this: read again")
    repeats: int = Field(
        2,
        ge=0,
        le=10,
        description="maximum number of repeated readings; after them the reading is accepted and flagged",
    )


class RecoverySettings(Strict):
    """Handling of interruptions."""

    max_gap_s: Positive = Field(1800.0, description="after a longer gap the environment is settled again")
    hold_max_s: Positive = Field(
        12 * 3600.0, description="a hold that is not released ends the session after this time"
    )


class ExpectSettings(Strict):
    """Expected properties of the sensors; used by `rig plan` and never by a fit."""

    sigma_deg: Positive = Field(2e-4, description="standard error of one observation")
    sigma_y_deg: Positive | None = Field(None, description="value for a y sensor, if it differs")
    sigma_z_deg: Positive | None = Field(None, description="value for a z sensor, if it differs")
    coning_deg: float = Field(1.0, ge=0, lt=90, description="largest coning angle Omega of the sensors")
    sensitivity_V_per_g: Positive | None = Field(
        None,
        description="sensitivity of the sensors; with it, errors of the voltmeter are forecast, too",
    )


class UsageSettings(Strict):
    """Use of the calibrated package; `rig plan` advises and compares by it."""

    pitch_deg: Positive | None = Field(None, le=180, description="pitch from minus to plus this")
    roll_deg: Positive = Field(180.0, le=180, description="roll from minus to plus this")
    roll_sd_deg: Positive | None = Field(
        None, description="one sensor: standard deviation of a roll measured otherwise"
    )
    pitch_sd_deg: Positive | None = Field(None, description="standard deviation wanted of inferred pitch")


class MountingSettings(Strict):
    """Rotation of the package on the head's table from its usual mounting; a person turns it before the run.

    The rotation is first about its own x axis, then about its y axis, then about its z axis. Errors of the head stay
    with the head, those of package and sensors rotate with the package: so the two are separable (`rig confirm`).
    """

    x_deg: float = Field(0.0, gt=-180, le=180, description="about its x axis: the package sees this much more roll")
    y_deg: float = Field(
        0.0, gt=-180, le=180, description="about its y axis: at zero roll it sees this much more pitch"
    )
    z_deg: float = Field(0.0, gt=-180, le=180, description="about its z axis; 180 is end for end")

    @property
    def turned(self) -> bool:
        """Whether it is another mounting than the usual one."""
        return bool(self.x_deg or self.y_deg or self.z_deg)


class ModelSettings(Strict):
    """Terms of the declared model in addition to attitude; `rig fit` and `rig trace` take them from the run file."""

    temperature: bool = Field(False, description="offset and sensitivity follow the sensor temperature")


class AcceptanceSettings(Acceptance):
    """Acceptance limits of a finished calibration; outside them `rig run` ends with exit code 3."""

    sigma_E_deg: Positive | None = Field(None, description="largest standard error of the fit")


def gravity(given: Mapping[str, float]) -> tuple[float, ...]:
    """One, and gravity along the package's axes, from "pitch_deg" and "roll_deg"."""
    pitch, roll = math.radians(given["pitch_deg"]), math.radians(given["roll_deg"])
    return (1.0, math.sin(pitch), math.cos(pitch) * math.sin(roll), math.cos(pitch) * math.cos(roll))


class PitchRollProcedure(Strict):
    """A whole `procedure.toml` of kind pitch-roll."""

    kind: Literal["pitch-roll"]
    name: Name
    seed: int = Field(0, ge=0, le=2**63 - 1, description="seed of every random choice in the order")
    replications: int = Field(6, ge=1, le=1000)
    design: DesignSettings
    order: OrderSettings = OrderSettings()
    approach: ApproachSettings = ApproachSettings()
    settle: SettleSettings = SettleSettings()
    measure: MeasureSettings = MeasureSettings()
    environment: EnvironmentSettings | None = None
    recovery: RecoverySettings = RecoverySettings()
    faults: HeadFaults = HeadFaults()
    warnings: WarningSettings = WarningSettings()
    mounting: MountingSettings = MountingSettings()
    model: ModelSettings = ModelSettings()
    expect: ExpectSettings = ExpectSettings()
    usage: UsageSettings = UsageSettings()
    acceptance: AcceptanceSettings = AcceptanceSettings()
    by_hand: Steps = ()
    loop: LoopSettings = LoopSettings()
    goal: GoalSettings | None = None

    @model_validator(mode="after")
    def _can_be_run(self) -> Self:
        points = self.replications * len(self.design.build())
        if points > MOST_POINTS:
            raise ValueError(
                f"{self.replications} replications of the design are {points:,} points, more than {MOST_POINTS:,}"
            )
        check_places(self.by_hand, points=points * self._visits_each, replications=self.replications)
        return self

    @property
    def _visits_each(self) -> int:
        """How often a replication visits every point."""
        return 2 if self.order.type == "up-and-down" else 1

    @property
    def conduct(self) -> Conduct:
        """Execution of the run."""
        return Conduct(
            settle=self.settle.judged(),
            poll_s=self.settle.poll_s,
            readings=self.measure.readings,
            repeats=self.measure.repeats,
            max_sd_V=self.measure.max_sd_V,
            faults=self.faults,
            warnings=self.warnings,
            hold_max_s=self.recovery.hold_max_s,
            environment=self.environment,
            max_gap_s=self.recovery.max_gap_s,
            mounting=self.mounting.model_dump(),
            output_unit="V",
            sensor_axes=True,
            package_temperature=self.model.temperature,
            response=gravity,
            least_jump=0.02,
        )

    def expand(self) -> RunList:
        """Every point of the run, in order."""
        overtravel = self.approach.overtravel_deg
        factors = (Factor("pitch_deg", "pitch", overtravel), Factor("roll_deg", "roll", overtravel))
        return with_steps(RunList(factors, self._points(), self.seed), self.by_hand)

    def _points(self) -> Iterator[Point]:
        design = self.design.build()
        rng = random.Random(self.seed)
        passes: dict[bool, list[Visit]] = {}
        index = 0
        for replication in range(1, self.replications + 1):
            for visit in self._visits(design, replication, rng, passes):
                setpoints = (design.pitch_deg[visit.row], design.roll_deg[visit.column])
                yield Point(index, replication, None, setpoints, (visit.pitch_side, visit.roll_side))
                index += 1

    def _visits(
        self, design: Design, replication: int, rng: random.Random, passes: dict[bool, list[Visit]]
    ) -> Iterable[Visit]:
        """One pass over the design; `passes` caches those that are used more than once, by direction."""
        if self.order.type == "random":
            return random_order(design, rng)
        backwards = reversed_pass(replication, self.order.replications)
        visits = walk(design, backwards=backwards, up_and_down=self.order.type == "up-and-down")
        if len(design) > _PASS_KEPT:
            return visits
        if backwards not in passes:
            passes[backwards] = list(visits)
        return passes[backwards]
