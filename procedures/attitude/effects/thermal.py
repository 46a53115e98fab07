"""Effects of temperature on one sensor: on its offset, sensitivity and alignment, at once or with a lag."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.effects.entry import Alias
from rig.fitter.effects.sizes import each, micro, relative
from rig.fitter.errors import FitError
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects.effect import Effect, Term, fixed
from rig.procedures.attitude.effects.scene import Scene

TIME_CONSTANTS_H = (0.1, 0.2, 0.4, 0.8, 1.5, 3.0, 6.0)
"""Searched values; a found one is then refined."""
_WINDOW_S = 900.0
"""Time to each side for the rate of the temperature."""
_ONE_WAY = "if the temperature rose or fell all night"
OTHER_TEMPERATURE = "repeat a few points at another enclosure temperature, at the same time of day"
_STEP = "step the enclosure's temperature once and read one point until nothing changes: a lag decays, an offset stays"
_DEGREE = np.radians(1.0)

_OF_TEMPERATURE = partial(Effect, source="temperature", scope="sensor", stratum="point-by-replication")
"""A sensor follows its temperature."""

OFFSET_TEMPERATURE = _OF_TEMPERATURE(
    name="offset-temperature",
    cause="the offset follows the sensor's temperature",
    unit="V/degC",
    size=micro("uV/degC"),
    against="sensor_temperature_degC",
    terms=fixed(Term("temperature", lambda scene, _sensor: scene.warmth())),
    separate_by=OTHER_TEMPERATURE,
    usual_size="5e-5 g/degC",
    known_aliases={"offset-drift": Alias(_ONE_WAY, OTHER_TEMPERATURE)},
    needs=("temperature",),
)

SENSITIVITY_TEMPERATURE = _OF_TEMPERATURE(
    name="sensitivity-temperature",
    cause="the sensitivity follows the sensor's temperature",
    unit="V/g/degC",
    size=relative("ppm/degC"),
    against="sensor_temperature_degC",
    terms=fixed(Term("temperature*gravity", lambda scene, sensor: scene.warmth() * scene.along(sensor))),
    separate_by=OTHER_TEMPERATURE,
    usual_size="1e-4 of the sensitivity per degC",
    known_aliases={"sensitivity-drift": Alias(_ONE_WAY, OTHER_TEMPERATURE)},
    needs=("temperature",),
)


def _across(nth: int) -> Term:
    """Gravity along one of the transverse axes of the sensor, times temperature."""

    def column(scene: Scene, sensor: str) -> FloatArray:
        S = np.linalg.norm(scene.axes[sensor])
        return np.asarray(_DEGREE * S * scene.warmth() * scene.g[:, (scene.nominal[sensor] + nth) % 3])

    return Term(f"temperature*gravity along axis+{nth}", column, group="alignment")


ALIGNMENT_TEMPERATURE = _OF_TEMPERATURE(
    name="alignment-temperature",
    cause="the sensitive axis turns in the package as the temperature changes",
    unit="deg/degC",
    size=each("deg/degC"),
    against="sensor_temperature_degC",
    terms=fixed(_across(1), _across(2)),
    separate_by=OTHER_TEMPERATURE,
    usual_size="1e-4 deg/degC",
    needs=("temperature", "roll"),
)


def lagged(data: AttitudeData, tau_h: float) -> FloatArray:
    """(n,) temperature of a body with one time constant behind the recorded one, degC; at rest at the start of the run.

    Exact for a temperature that changes linearly from one record to the next.

    Raises:
        FitError: the sensor's temperature was not recorded.
    """
    if data.temperatures is None:
        raise FitError("an effect of temperature cannot be computed: no sensor temperature was recorded")
    (at, degC), tau = data.temperatures, tau_h * 3600.0
    if tau not in data.lags:
        data.lags[tau] = degC + _behind(at, degC, tau)
    return np.asarray(np.interp(data.elapsed_s, at, data.lags[tau]))


def _behind(at: FloatArray, degC: FloatArray, tau: float) -> FloatArray:
    """(m,) what a body lacks of temperatures (m,) at seconds (m,)."""
    dt = np.diff(at)
    decay, slope = np.exp(-dt / tau), np.diff(degC) / np.maximum(dt, 1e-9)
    gained = np.where(dt > 0, -slope * tau * (1.0 - decay), -np.diff(degC))
    behind, last = np.zeros(at.size), 0.0
    for i, (kept, added) in enumerate(zip(decay.tolist(), gained.tolist(), strict=True)):
        last = last * kept + added
        behind[i + 1] = last
    return behind


def _lagged(scene: Scene, tau_h: float) -> FloatArray:
    """(n,) lagged temperature above the reference, degC."""
    if tau_h not in scene.lagged:
        scene.lagged[tau_h] = lagged(scene.data, tau_h) - (scene.temperature_degC or 0.0)
    return scene.lagged[tau_h]


def _lag(tau_h: float) -> Term:
    def column(scene: Scene, _sensor: str) -> FloatArray:
        return _lagged(scene, tau_h) - scene.warmth()

    return Term(f"temperature lagging {tau_h:g} h - temperature", column, finer=_finer(_lag, tau_h))


def _late(tau_h: float) -> Term:
    def column(scene: Scene, _sensor: str) -> FloatArray:
        return _lagged(scene, tau_h)

    return Term(f"temperature lagging {tau_h:g} h", column, finer=_finer(_late, tau_h))


def _finer(term: Callable[[float], Term], tau_h: float) -> Callable[[AttitudeData], tuple[tuple[Term, ...], ...]]:
    """Time constants from half to twice this one."""
    return lambda _data: tuple((term(round(tau_h * 2.0 ** (k / 6), 3)),) for k in range(-6, 7))


THERMAL_LAG = _OF_TEMPERATURE(
    name="thermal-lag",
    cause="the part of the sensor that matters follows the thermometer late: the offset depends on a temperature that "
    "lags, or on by how much it lags",
    unit="V/degC",
    size=micro("uV/degC"),
    against="sensor_temperature_degC",
    terms=fixed(*(term(tau) for tau in TIME_CONSTANTS_H for term in (_lag, _late))),
    separate_by=_STEP,
    usual_size="5e-5 g/degC, 1 h",
    needs=("temperature",),
    searched=True,
    dynamic=True,
)


def _rate(scene: Scene, _sensor: str) -> FloatArray:
    scene.warmth()
    assert scene.data.temperatures is not None
    at, degC = scene.data.temperatures
    late = np.clip(scene.data.elapsed_s + _WINDOW_S, at[0], at[-1])
    early = np.clip(scene.data.elapsed_s - _WINDOW_S, at[0], at[-1])
    hours = np.maximum(late - early, 1.0) / 3600.0
    return np.asarray((np.interp(late, at, degC) - np.interp(early, at, degC)) / hours)


THERMAL_GRADIENT = _OF_TEMPERATURE(
    name="thermal-gradient",
    cause="while the temperature changes the sensor is warmer on one side, and its offset follows the rate of change",
    unit="V/(degC/h)",
    size=micro("uV/(degC/h)"),
    against="elapsed_s",
    terms=fixed(Term("d(temperature)/dt", _rate)),
    separate_by=_STEP,
    usual_size="1e-5 g/(degC/h)",
    known_aliases={"thermal-lag": Alias("where the time constant is short against the changes", _STEP)},
    needs=("temperature",),
)
