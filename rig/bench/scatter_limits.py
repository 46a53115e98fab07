"""Limits of the scatter of readings: which quantities have one, and which of an observation is the noisiest.

Quantities without a limit are compared with the run's own scatter, see `rig.run_file.state.own_scatter`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rig.bench.config import BenchConfig
from rig.procedures.column_names import unit_of
from rig.procedures.plan.conduct import Conduct
from rig.units.of_instruments import VOLT, per_volt


@dataclass(frozen=True)
class MostScatter:
    """The largest standard deviation of the readings of one column.

    Attributes:
        sd: in the column's unit.
        per_told: number of these units in one `unit`.
        unit: in which people are told of it.
    """

    sd: float
    per_told: float
    unit: str

    def told(self, sd: float) -> str:
        """A standard deviation in words."""
        return f"{sd / self.per_told:.2g} {self.unit}"

    @property
    def most(self) -> str:
        """The limit in words."""
        return f"{self.sd / self.per_told:g} {self.unit}"


def most_scatter(conduct: Conduct, config: BenchConfig) -> Mapping[str, MostScatter]:
    """Limits of what instruments read, see `declared_scatter`; for what a person reads see `rig.bench.typed`."""
    return {name: most for name, most in declared_scatter(conduct, config).items() if name not in config.typed}


def declared_scatter(conduct: Conduct, config: BenchConfig) -> Mapping[str, MostScatter]:
    """Limits by column: of a sensor or reference standard its own, else that of all voltages; others have none."""
    found = {}
    for name, sensor in config.sensors.items():
        column, volts = f"{name}_{sensor.unit}", per_volt(sensor.unit)
        if name in conduct.max_sd:
            found[column] = MostScatter(conduct.max_sd[name], 1.0, sensor.unit)
        elif conduct.max_sd_V is not None and volts is not None:
            found[column] = MostScatter(conduct.max_sd_V * volts, volts, VOLT)
    own = {name: conduct.max_sd[name] for name in config.references if name in conduct.max_sd}
    return {**found, **{name: MostScatter(sd, 1.0, unit_of(name)) for name, sd in own.items()}}


def without_limit(conduct: Conduct, config: BenchConfig) -> Sequence[str]:
    """Columns of instruments whose readings have no limit of scatter: outputs, reference standards, thermometers."""
    limited = {*declared_scatter(conduct, config), *config.typed}
    outputs = (f"{name}_{sensor.unit}" for name, sensor in config.sensors.items())
    return [name for name in (*outputs, *config.references, *config.temperatures) if name not in limited]


def noisiest(sds: Mapping[str, float], limits: Mapping[str, MostScatter]) -> str | None:
    """The column whose standard deviation is the largest beside its limit; None where none has a limit."""
    judged = [name for name in sds if name in limits]
    return max(judged, key=lambda name: sds[name] / limits[name].sd, default=None)
