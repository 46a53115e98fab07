"""Checks that a procedure fits a bench, before anything is opened."""

from __future__ import annotations

from drivers.roles import Chamber, PressureController
from procedures.conduct import Conduct, WholePlotConduct
from procedures.kind import Procedure
from procedures.run_list import RunList
from rig.bench import playing
from rig.config import BenchConfig
from rig.engine.guard import Guard
from rig.engine.whole_plots import renewal
from rig.errors import ConfigurationError
from rig.quantities import ATMOSPHERE_PSIA


def check_match(config: BenchConfig, procedure: Procedure, run_list: RunList, where: str) -> None:
    """Refuse a procedure that this bench cannot carry out.

    Args:
        config: the bench file.
        procedure: the procedure.
        run_list: every point of it.
        where: the bench file's name, for messages.

    Raises:
        ConfigurationError: with the defect and the next step.
    """
    guard, conduct = Guard(config.limits, config.factors), procedure.conduct
    guard.check_run_list(run_list, {})
    _check_sensors(config, where, conduct)
    if conduct.package_temperature and not any(t.place == "package" for t in config.temperatures.values()):
        raise ConfigurationError(
            f"{where}: the procedure's declared model has temperature (model.temperature), but no temperature in the "
            f"package is read: add one under [temperatures], or leave it out of the model"
        )
    if conduct.environment is not None:
        anywhere = (float("-inf"), float("inf"))
        guard.check_environment(conduct.environment.setpoint_degC, dict.fromkeys(playing(config, Chamber), anywhere))
    if conduct.whole_plots is not None:
        _check_factors(config, run_list, guard, where)
        _check_renewal(conduct.whole_plots, run_list, guard, where)


def _check_sensors(config: BenchConfig, where: str, conduct: Conduct) -> None:
    unit = conduct.output_unit
    for name, sensor in config.sensors.items():
        if conduct.sensor_axes is not None and (sensor.axis is not None) != conduct.sensor_axes:
            needs = "needs its axis, x, y or z" if conduct.sensor_axes else "must not have an axis"
            raise ConfigurationError(f"{where}: sensors.{name} {needs}, for this kind of procedure")
        if unit and sensor.unit != unit:
            raise ConfigurationError(
                f'{where}: sensors.{name}: this kind of procedure records it in {unit}: unit = "{unit}"'
            )


def _check_factors(config: BenchConfig, run_list: RunList, guard: Guard, where: str) -> None:
    """Check that every factor has its own instrument that can set it."""
    setting: dict[str, str] = {}
    for factor in run_list.factors:
        name = config.factors.get(factor.name)
        if name is None:
            raise ConfigurationError(
                f'{where} lacks the instrument of {factor.name}: add it under [factors], {factor.name} = "INSTRUMENT"'
            )
        if name in setting:
            raise ConfigurationError(f"{where}: factors: {name} cannot set both {setting[name]} and {factor.name}")
        setting[name] = factor.name
        role = Chamber if factor.hard else PressureController
        if name not in playing(config, role):
            raise ConfigurationError(f"{where}: {name} cannot set {factor.name}: it is not a {role.__name__}")
        if role is PressureController:
            _check_atmosphere(factor.name, guard, where)


def _check_atmosphere(factor: str, guard: Guard, where: str) -> None:
    """Check that the atmosphere is within the limits: a pressure controller may vent its line."""
    low, high = guard.limits.get(factor, (0.0, ATMOSPHERE_PSIA + 1.0))
    if not low <= ATMOSPHERE_PSIA <= high:
        raise ConfigurationError(
            f"{where}: limits.{factor} = {low:g} to {high:g} does not include the atmosphere, about "
            f"{ATMOSPHERE_PSIA:g} psia, where a vented line is; keep setpoints low by the controller's own high_psia"
        )


def _check_renewal(whole_plots: WholePlotConduct, run_list: RunList, guard: Guard, where: str) -> None:
    """Check the limits for a renewed setpoint: the chamber leaves its temperature before it is set again."""
    for factor in run_list.hard:
        low, high = guard.limits.get(factor.name, (float("-inf"), float("inf")))
        for target in run_list.levels(factor):
            away = renewal(target, whole_plots.soak.renew_degC)
            if not low <= away <= high:
                raise ConfigurationError(
                    f"{where}: {factor.name}: a temperature already in force is changed to {away:g} degC first "
                    f"(soak.renew_degC), outside {low:g} to {high:g}; widen the limits or reduce soak.renew_degC"
                )
