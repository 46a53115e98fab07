"""A procedure held against its bench, before anything is opened: what can be known now must not end a night."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rig.bench.approach import Approach
from rig.bench.bench_file import playing
from rig.bench.plugins import short
from rig.drivers.roles import ByHand, Chamber, Head, PressureController, Source
from rig.engine.guard import Guard
from rig.engine.whole_plots import renewal
from rig.errors import ConfigurationError
from rig.procedures.column_names import stem_of, unit_of
from rig.procedures.present.meant import meant, nearest
from rig.units.of_instruments import ATMOSPHERE_PSIA, HEAD, PRESSURE_UNIT, TEMPERATURE_UNIT

if TYPE_CHECKING:
    from rig.bench.config import BenchConfig
    from rig.procedures.kind import Procedure
    from rig.procedures.plan.conduct import Conduct, WholePlotConduct
    from rig.procedures.plan.run_list import Factor, RunList


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
            f"{where}: the procedure's declared model has temperature (model.temperature), and no temperature in the "
            f"package is read: add one under [temperatures], or leave it out of the model"
        )
    if conduct.environment is not None:
        anywhere = (float("-inf"), float("inf"))
        guard.check_environment(conduct.environment.setpoint_degC, dict.fromkeys(playing(config, Chamber), anywhere))
    if conduct.any_instruments:
        _check_setters(config, run_list, guard, where)
        if conduct.environment is not None:
            _check_environment(config, run_list, where)
    elif conduct.whole_plots is not None:
        _check_factors(config, run_list, guard, where)
    if conduct.whole_plots is not None:
        _check_renewal(conduct.whole_plots, config, run_list, guard, where)


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


def check_names(config: BenchConfig, conduct: Conduct, where: str) -> None:
    """Check that the bench has the sensors and reference standards that the procedure names: a typo has no effect."""
    for names, known, what in (
        (conduct.models_of, [*config.sensors], "sensor"),
        (conduct.max_sd, [*config.sensors, *config.references], "sensor or reference standard"),
    ):
        for name in names:
            if name not in known:
                near = nearest(name, known)
                hint = f"did you mean {near}?" if near else f"it has {', '.join(known)}"
                raise ConfigurationError(f"{where}: the bench has no {what} {name}: {hint}")


def _check_factors(config: BenchConfig, run_list: RunList, guard: Guard, where: str) -> None:
    """Check that every factor has its own instrument that can set it."""
    setting: dict[str, str] = {}
    for factor in run_list.factors:
        name = config.factors.get(factor.name)
        if name is None:
            raise ConfigurationError(
                f'{where} does not say what sets {factor.name}: add it under [factors], {factor.name} = "INSTRUMENT"'
                f"{meant(factor.name, config.factors)}"
            )
        if name in setting:
            raise ConfigurationError(f"{where}: factors: {name} cannot set both {setting[name]} and {factor.name}")
        setting[name] = factor.name
        role = Chamber if factor.hard else PressureController
        if name not in playing(config, role):
            raise ConfigurationError(f"{where}: {name} cannot set {factor.name}: it is no {role.__name__}")
        if role is PressureController:
            _check_atmosphere(factor.name, guard, where)


_SETS: tuple[type[Any], ...] = (Source, PressureController, Chamber, Head, ByHand)
"""Roles that set a factor."""


def _check_setters(config: BenchConfig, run_list: RunList, guard: Guard, where: str) -> None:
    """Check that every factor has an instrument of its own that can set it, whatever it is."""
    taken: dict[str, str] = {}
    for factor in run_list.factors:
        name = config.setters.get(factor.name)
        if name is None and factor.name in HEAD and playing(config, Head):
            continue  # the head's own axes need no entry
        if name is None and factor.name in config.references and (of := config.references[factor.name].of):
            raise ConfigurationError(
                f"{where}: {factor.name} is read, and set by {of}: give levels of {of}, or pairs of {of} and what "
                f"{factor.name} was there: references.{factor.name}.approach = [[SETTING, READING], ...]"
            )
        if name is None:
            setting = [n for n in config.instruments if any(n in playing(config, role) for role in _SETS)]
            here = (
                f"{', '.join(setting)} can" if setting else 'no instrument can; one with driver = "person" asks for it'
            )
            raise ConfigurationError(
                f"{where} does not say what sets {factor.name}: add it under [factors], {factor.name} = "
                f'"INSTRUMENT"; here {here}{meant(factor.name, [*config.factors, *config.references])}'
            )
        several = any(name in playing(config, role) for role in (ByHand, Head))
        if name in taken and not several:
            raise ConfigurationError(f"{where}: factors: {name} cannot set both {taken[name]} and {factor.name}")
        taken[name] = factor.name
        roles = [role for role in _SETS if name in playing(config, role)]
        if not roles:
            raise ConfigurationError(
                f"{where}: factors.{factor.name} = {name!r}: {name} sets nothing "
                f"(driver {short(config.instruments[name].driver)})"
            )
        if Head in roles and factor.name not in HEAD:
            raise ConfigurationError(
                f"{where}: {name} is a head, and {factor.name} none of its angles: {' and '.join(HEAD)}"
            )
        if factor.name in config.steered:
            _check_steered(factor, config, run_list, guard, where)
            continue
        _check_unit(factor.name, name, roles, where)
        if PressureController in roles:
            _check_atmosphere(factor.name, guard, where)


def _check_steered(factor: Factor, config: BenchConfig, run_list: RunList, guard: Guard, where: str) -> None:
    """Check that a source can be set to what the table of approach says of every level, and that a meter reads it."""
    of, standard = config.steered[factor.name], config.references[factor.name]
    name, unit = config.factors[of], unit_of(of)
    if name not in playing(config, Source):
        raise ConfigurationError(f"{where}: references.{factor.name}.approach: {name} sets {of}, and is no source")
    if factor.hard or factor.name in config.typed:
        why = "it is hard to change" if factor.hard else f"{standard.reader} is a person, who reads it at a point only"
        raise ConfigurationError(f"{where}: {factor.name} is not brought to its levels: {why}; give levels of {of}")
    table, (low, high) = Approach.of(standard.approach or ()), guard.limits.get(of, (float("-inf"), float("inf")))
    for level in sorted(set(run_list.column(factor.name))):
        if not low <= (setting := table.setting(level)) <= high:
            raise ConfigurationError(
                f"{where}: {factor.name} = {level:g} takes {setting:.4g} {unit} by references.{factor.name}.approach, "
                f"outside limits.{of}, {low:g} to {high:g}: leave out that level, or correct the table"
            )


def _check_unit(factor: str, instrument: str, roles: Sequence[type[Any]], where: str) -> None:
    """Check the unit of a factor whose instrument's role has one; that of a source is checked when it is opened."""
    units = {PressureController: PRESSURE_UNIT, Chamber: TEMPERATURE_UNIT}
    unit = next((units[role] for role in roles if role in units), None)
    if unit is not None and unit_of(factor) != unit:
        stem = stem_of(factor)
        raise ConfigurationError(
            f"{where}: {instrument} sets {unit}, not {unit_of(factor)}: call the factor {stem}_{unit}, with levels in "
            f"{unit}"
        )


def _check_environment(config: BenchConfig, run_list: RunList, where: str) -> None:
    """Check that no factor is set by a chamber, which the environment would set too."""
    for factor in run_list.factors:
        name = config.factors.get(factor.name, "")
        bath = unit_of(factor.name) == TEMPERATURE_UNIT and name in playing(config, Source)
        if bath or name in playing(config, Chamber):
            raise ConfigurationError(
                f"{where}: environment.setpoint_degC is for every chamber, and {name} sets {factor.name}: leave out "
                f"[environment]"
            )


def _check_atmosphere(factor: str, guard: Guard, where: str) -> None:
    """Check that the atmosphere is within the limits: a pressure controller may vent its line."""
    low, high = guard.limits.get(factor, (0.0, ATMOSPHERE_PSIA + 1.0))
    if not low <= ATMOSPHERE_PSIA <= high:
        raise ConfigurationError(
            f"{where}: limits.{factor} = {low:g} to {high:g} does not include the atmosphere, about "
            f"{ATMOSPHERE_PSIA:g} psia, where a vented line is; keep setpoints low by the controller's own high_psia"
        )


def _check_renewal(
    whole_plots: WholePlotConduct, config: BenchConfig, run_list: RunList, guard: Guard, where: str
) -> None:
    """Check the limits for a renewed setpoint: the chamber leaves its temperature before it is set again."""
    for factor in run_list.hard:
        if unit_of(factor.name) != TEMPERATURE_UNIT or config.factors.get(factor.name) in playing(config, ByHand):
            continue  # no temperature soaks for it
        low, high = guard.limits.get(factor.name, (float("-inf"), float("inf")))
        for target in run_list.levels(factor):
            away = renewal(target, whole_plots.soak.renew_degC)
            if not low <= away <= high:
                raise ConfigurationError(
                    f"{where}: {factor.name}: the temperature is changed to {away:g} degC first "
                    f"(soak.renew_degC), outside {low:g} to {high:g}; widen the limits or leave it by less"
                )
