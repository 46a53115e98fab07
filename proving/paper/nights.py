"""The calibrations behind figures 22 to 54: which angles, which sensors, and the truth behind the simulated bench.

The bench and the procedure are those of `examples/attitude-lab`, with other sensors on them and other angles. The truth
is chosen so that Table 2's sizes come out: what each figure stands on is said beside it. 1e-4 deg is 8.7 uV at 5 V/g.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from rig.bench.config import parse_toml, read_text
from rig.examples import example
from rig.files.toml_text import toml_text
from rig.procedures.attitude.designs import uniform

_SECONDS_A_POINT = 32.0
_COLDEST_UTC = datetime(2026, 1, 16, 4, 20, tzinfo=UTC)
"""Nights are centred on this: what follows temperature and what follows time are then not one thing."""


@dataclass(frozen=True)
class Night:
    """One calibration.

    Attributes:
        name: short, for messages.
        section: of the paper.
        axes: nominal axis by sensor name; outputs are NAME_V.
        design: the `[design]` table of its procedure.
        points: visits in one replication.
        replications: n.
        order: "serpentine", or "up-and-down" to the last row and back.
        sensors: by name, what a world file says of a sensor.
        effects: tables of the world file's `[effects]`.
        swing_degC: half of the day's swing that gets past the enclosure.

    """

    name: str
    section: str
    axes: Mapping[str, str]
    design: Mapping[str, Any]
    points: int
    replications: int
    sensors: Mapping[str, Mapping[str, float]]
    effects: Mapping[str, Any]
    order: str = "serpentine"
    swing_degC: float = 0.5

    def bench_text(self) -> str:
        """The bench file: that of the example, with these sensors on its scanner."""
        bench = _example("bench.toml")
        bench["sensors"] = {
            name: {"axis": axis, "reader": "scanner", "channel": str(101 + i)}
            for i, (name, axis) in enumerate(self.axes.items())
        }
        return toml_text(bench)

    def procedure_text(self) -> str:
        """The procedure file: that of the example, at these angles."""
        procedure = _example("procedure.toml")
        procedure |= {"name": self.name, "replications": self.replications, "design": self.design}
        procedure["order"] = {"type": self.order, "replications": "abba"}
        return toml_text(procedure)

    def world_text(self, seed: int) -> str:
        """The world file."""
        half = timedelta(seconds=_SECONDS_A_POINT * self.points * self.replications / 2.0)
        return toml_text(
            {
                "seed": seed,
                "epoch": (_COLDEST_UTC - half).replace(microsecond=0),
                "sensors": self.sensors,
                "lab": {"mean_degC": 21.5, "daily_amplitude_degC": 4.0 * self.swing_degC, "warmest_hour_utc": 16.0},
                "enclosure": {"leak": 0.25},
                "effects": self.effects,
            }
        )


def _example(name: str) -> dict[str, Any]:
    path = example("attitude-lab") / name
    return parse_toml(read_text(path, name), str(path))


def _d1(pitch_max_deg: float, pitch_count: int, roll_count: int) -> dict[str, Any]:
    return {"type": "D1", "pitch_max_deg": pitch_max_deg, "pitch_count": pitch_count, "roll_count": roll_count}


def _no_roll(pitch_max_deg: float, count: int) -> dict[str, Any]:
    return {"type": "D", "pitch_deg": list(uniform(-pitch_max_deg, pitch_max_deg, count)), "roll_deg": [0.0]}


def _sensor(offset_V: float, coning_deg: float, azimuth_deg: float, noise_uV: float) -> dict[str, float]:
    return {
        "offset_V": offset_V,
        "sensitivity_V_per_g": 5.0,
        "coning_deg": coning_deg,
        "azimuth_deg": azimuth_deg,
        "noise_V": noise_uV * 1e-6,
    }


_AOA_SENSOR = {"aoa": _sensor(0.0123, 0.3, 90.0, 22.0)}
_TWO_SENSORS = {"sensor_1": _sensor(0.0123, 0.21, 37.0, 17.0), "sensor_2": _sensor(0.027, 0.5, -60.0, 30.0)}
_PACKAGE = {
    "x": _sensor(0.0123, 0.21, 37.0, 18.0),
    "y": _sensor(-0.0087, 0.34, -118.0, 16.0),
    "z": _sensor(0.0045, 0.15, 152.0, 22.0),
}
_BOTH_X, _X_Y_Z = {"sensor_1": "x", "sensor_2": "x"}, {"x": "x", "y": "y", "z": "z"}
_TWO_SENSORS_EFFECTS: dict[str, Any] = {
    # sigma_bias of rows 28(b) and 37: (c/2) times the rms of sin 2a cos R, 0.41 over +-30 deg and 0.5 all round
    "isolation_pad": {"pitch_compliance_deg_per_g": 1.75e-3},
    # row 28(a) against 28(b)
    "sensitivity_temperature": {"ppm_per_degC": {"sensor_1": 140.0, "sensor_2": 60.0}},
    "offset_temperature": {"uV_per_degC": {"sensor_1": 45.0, "sensor_2": 100.0}},
    # T_b and T_S of rows 28(b) and 37; of 34 and 42
    "offset_drift": {"uV_per_h": {"sensor_1": 2.4, "sensor_2": 28.0}},
    "sensitivity_drift": {"ppm_per_h": {"sensor_1": 0.4, "sensor_2": 9.0}},
}
_PACKAGE_EFFECTS: dict[str, Any] = {
    # sigma_bias of rows 47(a) and 47(b)
    "isolation_pad": {"pitch_compliance_deg_per_g": 1.3e-3, "roll_compliance_deg_per_g": 2.1e-3},
    # rows 50: at cardinal angles pads leave nothing, these do; rows 47(c) and 52 z
    "second_order": {"ug_per_g2": {"x": 7.0, "y": 5.0, "z": 15.0}},
    "head_error": [{"axis": "roll", "amplitude_arcsec": 2.9, "periods_per_turn": 1, "phase_deg": 180.0}],
    "sensitivity_temperature": {"ppm_per_degC": {"x": 110.0, "y": 80.0, "z": 95.0}},
    "offset_temperature": {"uV_per_degC": {"x": 45.0, "y": -30.0, "z": 60.0}},
}
_AOA_EFFECTS: dict[str, Any] = {
    # rows 24 and 26
    "isolation_pad": {"pitch_compliance_deg_per_g": 0.65e-3},
    "second_order": {"ug_per_g2": {"aoa": 5.0}},
}

NIGHTS: Mapping[str, Night] = {
    "no roll, +-36": Night(
        name="no roll, +-36",
        section="9.1",
        design=_no_roll(36.0, 37),
        points=74,
        replications=6,
        order="up-and-down",
        effects=_AOA_EFFECTS,
        axes={"aoa": "x"},
        sensors=_AOA_SENSOR,
        swing_degC=0.02,
    ),
    "no roll, +-180": Night(
        name="no roll, +-180",
        section="9.1",
        design=_no_roll(180.0, 73),
        points=146,
        replications=6,
        order="up-and-down",
        effects=_AOA_EFFECTS,
        axes={"aoa": "x"},
        sensors=_AOA_SENSOR,
        swing_degC=0.02,
    ),
    "13 x 25": Night(
        name="13 x 25",
        section="9.2.1",
        design=_d1(30.0, 13, 25),
        points=325,
        replications=6,
        effects=_TWO_SENSORS_EFFECTS,
        axes=_BOTH_X,
        sensors=_TWO_SENSORS,
    ),
    "25 x 13": Night(
        name="25 x 13",
        section="9.2.3",
        design=_d1(180.0, 25, 13),
        points=325,
        replications=4,
        effects=_TWO_SENSORS_EFFECTS,
        axes=_BOTH_X,
        sensors=_TWO_SENSORS,
    ),
    "19 x 13": Night(
        name="19 x 13",
        section="9.3.1",
        design=_d1(90.0, 19, 13),
        points=247,
        replications=6,
        effects=_PACKAGE_EFFECTS
        | {
            "offset_drift": {"uV_per_h": {"x": 2.0, "y": 1.8, "z": -0.8}},
            "sensitivity_drift": {"ppm_per_h": {"x": 0.9, "y": 0.1, "z": -0.7}},
        },
        axes=_X_Y_Z,
        sensors=_PACKAGE,
    ),
    "37 x 13": Night(
        name="37 x 13",
        section="9.3.2",
        design=_d1(180.0, 37, 13),
        points=481,
        replications=6,
        effects=_PACKAGE_EFFECTS
        | {
            "offset_drift": {"uV_per_h": {"x": 0.8, "y": 0.2, "z": -1.2}},
            "sensitivity_drift": {"ppm_per_h": {"x": 0.5, "y": 0.05, "z": -0.6}},
        },
        axes=_X_Y_Z,
        sensors=_PACKAGE,
    ),
}
