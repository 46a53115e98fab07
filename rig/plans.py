"""Plans: bench, procedure and world, read and checked; what decides a run, from files or from a run file.

A procedure is held against its bench before anything is opened: what can be known now must not end a night.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from drivers.roles import ByHand, Chamber, Head, PressureController, Source
from fitter.errors import FitError
from procedures.column_names import stem_of, unit_of
from procedures.conduct import Conduct, WholePlotConduct
from procedures.kind import Completed, Procedure, kind_of
from procedures.run_list import RunList
from rig.bench import check_options, playing
from rig.config import BenchConfig, InstrumentConfig, parse_bench, parse_procedure, parse_toml, read_text
from rig.contract_files import files_beside, read_bench, with_contracts, with_files
from rig.engine.guard import Guard
from rig.engine.whole_plots import renewal
from rig.errors import ConfigurationError, RigError, UsageError
from rig.quantities import ATMOSPHERE_PSIA, HEAD, PRESSURE_UNIT, TEMPERATURE_UNIT
from rig.register import DOCUMENT, check_register, parse_register, register_beside
from rig.run_file.bodies import shown
from rig.run_file.events.sessions import Identified
from rig.run_file.reader import RunReader
from rig.toml_text import toml_text

PREVIOUS = "previous.json"
"""Name of the run file's document with the last calibration, if the procedure names one."""


@dataclass(frozen=True)
class Plan:
    """A checked plan: the texts and their values.

    Attributes:
        documents: file texts by document name ("bench.toml", "procedure.toml", "world.toml").
        bench: the bench file.
        procedure: the procedure file.
        run_list: every point.
        dry: whether twins replace the instruments.
        truth: the world file's values; passed only to twins.
    """

    documents: Mapping[str, str]
    bench: BenchConfig
    procedure: Procedure
    run_list: RunList
    dry: bool
    truth: Mapping[str, Any]


def load_plan(procedure: Path, bench: Path, *, dry: bool = False, world: Path | None = None) -> Plan:
    """Read and check all files of a run. Raises `ConfigurationError`."""
    if world is not None and not dry:
        raise UsageError("--world describes a simulated bench; it requires --dry")
    documents = {"bench.toml": read_text(bench, "bench"), "procedure.toml": read_text(procedure, "procedure")}
    if world is not None:
        documents["world.toml"] = read_text(world, "world")
    config = parse_bench(documents["bench.toml"], str(bench))
    documents |= files_beside(config, bench)
    documents |= _register(config, bench)
    against = parse_procedure(documents["procedure.toml"], str(procedure)).warnings.against
    if against is not None:
        from rig.previous import previous_text  # noqa: PLC0415 - imports the fitter, which few runs need

        try:
            documents[PREVIOUS] = previous_text(procedure.parent / against)
        except (RigError, OSError) as error:
            what = f"{procedure}: warnings.against = {against!r}: {error}"
            raise ConfigurationError(f"{what}; name the last calibration, or remove the line") from error
    documents["procedure.toml"] = _with_files(documents["procedure.toml"], procedure)
    plan = _plan(documents, dry, {"bench.toml": str(bench), "procedure.toml": str(procedure), "world.toml": str(world)})
    if world is not None:
        _check_person(plan, world)
    try:
        kind_of(plan.procedure).check_design(plan.procedure, plan.run_list)
    except FitError as error:
        raise ConfigurationError(f"{procedure}: {error}") from error
    misfit, sensors = plan.procedure.conduct.misfit, config.sensors
    columns = {name: f"{name}_{sensor.unit}" for name, sensor in sensors.items()}
    if misfit is not None and (defect := misfit(columns, tuple(config.temperatures))):
        raise ConfigurationError(f"{procedure}: {defect}")
    return plan


def _check_person(plan: Plan, world: Path) -> None:
    """Refuse a simulated person whose number no step by hand with a range accepts: it would be asked again for ever.

    Raises:
        ConfigurationError: with the step and its range.
    """
    person = plan.truth.get("person")
    states = person.get("states") if isinstance(person, Mapping) else None
    for step in plan.run_list.steps:
        if isinstance(states, int | float) and step.value and step.refuses(repr(states)):
            raise ConfigurationError(
                f"{world}: person.states = {states:g} is refused at the step {step.instruction!r}, which accepts "
                f"{step.low:g} to {step.high:g} as {step.value}; leave states out, and the person states the middle"
            )


def _register(config: BenchConfig, bench: Path) -> dict[str, str]:
    """The register of equipment of a bench, as a document; none if it has none.

    Raises:
        ConfigurationError: it cannot be used, or contradicts the bench.
    """
    found = register_beside(config, bench)
    if found is None:
        return {}
    path, text = found
    check_register(parse_register(text, str(path)), config, str(path), str(bench))
    return {DOCUMENT: text}


def _with_files(text: str, procedure: Path) -> str:
    """The procedure with the contents of files that it names, or with results of a search, so that a run file has all.

    Raises:
        ConfigurationError: a file cannot be read or used, or the search cannot be made.
    """
    read = parse_procedure(text, str(procedure))
    if not isinstance(read, Completed):
        return text
    texts = {name: read_text(procedure.parent / name, "points") for name in read.files}
    try:
        values = read.completed(texts)
    except ValueError as error:
        raise ConfigurationError(f"{procedure}: {error}") from None
    if values is None:
        return text
    return f"# {procedure.name}, with the points of its design\n{toml_text(values)}"


def _plan(documents: Mapping[str, str], dry: bool, where: Mapping[str, str], *, strict: bool = True) -> Plan:
    for name in ("bench.toml", "procedure.toml"):
        if name not in documents:
            raise ConfigurationError(f"{next(iter(where.values()), 'it')}: there is no {name}, which every run has")
    named = parse_bench(documents["bench.toml"], where["bench.toml"], strict=strict)
    config = with_files(named, documents, where["bench.toml"])
    checked = check_options(config, where["bench.toml"], strict=strict)
    if not strict:
        config = _as_checked(config, checked)
    procedure = parse_procedure(documents["procedure.toml"], where["procedure.toml"], strict=strict)
    run_list = procedure.expand()
    check_match(config, procedure, run_list, where["bench.toml"])
    if strict:
        _check_names(config, procedure.conduct, where["procedure.toml"])
    truth = parse_toml(documents["world.toml"], where["world.toml"]) if "world.toml" in documents else {}
    return Plan(documents, config, procedure, run_list, dry, truth)


def _as_checked(config: BenchConfig, checked: Mapping[str, BaseModel]) -> BenchConfig:
    """The bench with options as the models of its drivers, and assumptions of earlier versions."""
    instruments = {}
    for name, one in config.instruments.items():
        options = checked[name].model_dump(mode="json", exclude_unset=True)
        contract = with_contracts(one.driver, {}).keys() - one.options.keys()
        taken = {k: v for k, v in options.items() if k not in contract}
        instruments[name] = one.model_copy(update={**one.options, **taken})
    return config.model_copy(update={"instruments": instruments})


def plan_of(documents: Mapping[str, str], *, dry: bool, stored: bool = False) -> Plan:
    """Check a run's files, from their texts by document name. Raises `ConfigurationError`.

    Args:
        documents: the texts.
        dry: whether the run is a dry one.
        stored: whether they come from a run file, possibly of an earlier version.
    """
    return _plan(documents, dry, {name: name for name in documents}, strict=not stored)


def _begun_with(run: RunReader, path: Path) -> RunList:
    """The run list in the file, for a run of another version of rig that would generate a different list."""
    stored = run.run_list()
    if stored.sha256() != run.about().run_list:
        raise ConfigurationError(f"{path}: its run list is not the one it began with; `rig verify {path}` says more")
    return stored


def has_plan(run: RunReader) -> bool:
    """Whether a run file contains the files of its begin; those of tests and of other programs need not."""
    return {"bench.toml", "procedure.toml"} <= run.documents().keys()


_OF_THE_LINE = frozenset({"baud", "flow", "frame", "interface", "line_end", "timeout_s"})
"""Options of drivers about the connection, not about measurement or behaviour."""


def _other_settings(name: str, began: BaseModel, now: BaseModel) -> list[str]:
    """Options of an instrument that differ from those at the begin, and change its measurement or behaviour."""
    before, after = began.model_dump(mode="json"), now.model_dump(mode="json")
    return [
        f"instruments.{name}.{option} was {shown(before.get(option))}, is {shown(after.get(option))}"
        for option in sorted((before.keys() | after.keys()) - _OF_THE_LINE)
        if before.get(option) != after.get(option)
    ]


def _other_instrument(name: str, began: InstrumentConfig, now: InstrumentConfig, *, nobody: bool) -> list[str]:
    """Changed declarations. Another instrument is recognised by its identity, except where there is none (`nobody`).

    The same instrument must have the same date.
    """
    if not nobody and (began.asset, began.serial) != (now.asset, now.serial):
        return []
    return [
        f"instruments.{name}.{what} was {getattr(began, what)}, is {getattr(now, what)}"
        for what in ("asset", "serial", "due")
        if getattr(began, what) != getattr(now, what)
    ]


def stored_plan(run: RunReader, path: Path, bench: Path | None) -> Plan:
    """The plan of an existing run file.

    Args:
        run: the file, opened.
        path: its path, for messages.
        bench: another bench file, for instruments with new addresses; None for the stored one.

    Raises:
        ConfigurationError: its run list differs from the original one, or the other bench is not the same bench.
    """
    documents = run.documents()
    where = {name: f"{path} ({name})" for name in documents}
    plan = _plan(documents, run.about().runs_dry, where, strict=False)
    if plan.run_list.sha256() != run.about().run_list:
        plan = replace(plan, run_list=_begun_with(run, path))
    if bench is None:
        return plan
    other, _ = read_bench(bench)
    options = check_options(other, str(bench))
    for what in (
        "name",
        "sensors",
        "temperatures",
        "factors",
        "references",
        "limits",
        "interlocks",
        "safety",
        "simulated",
    ):
        if getattr(other, what) != getattr(plan.bench, what):
            raise ConfigurationError(f"{bench}: {what} differ from the bench the run began on; only instruments may")
    if {n: i.driver for n, i in other.instruments.items()} != {n: i.driver for n, i in plan.bench.instruments.items()}:
        raise ConfigurationError(f"{bench}: its instruments differ from those of the bench the run began on")
    began = check_options(plan.bench, str(path), strict=False)
    nobody = next(run.chained("kind = ?", (Identified.kind,)), None) is None  # which another instrument could replace
    other_settings = [
        what
        for name in other.instruments
        for what in (
            *_other_settings(name, began[name], options[name]),
            *_other_instrument(name, plan.bench.instruments[name], other.instruments[name], nobody=nobody),
        )
    ]
    if other_settings:
        raise ConfigurationError(
            f"{bench}: only addresses may differ from the bench the run began on, and settings of lines "
            f"({', '.join(sorted(_OF_THE_LINE))}): {'; '.join(other_settings)}. Restore them, or begin a new run"
        )
    return Plan(plan.documents, other, plan.procedure, plan.run_list, plan.dry, plan.truth)


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


def _check_names(config: BenchConfig, conduct: Conduct, where: str) -> None:
    """Check that the bench has the sensors and reference standards that the procedure names: a typo has no effect."""
    for names, known, what in (
        (conduct.models_of, [*config.sensors], "sensor"),
        (conduct.max_sd, [*config.sensors, *config.references], "sensor or reference standard"),
    ):
        for name in names:
            if name not in known:
                near = get_close_matches(name, known, n=1)
                hint = f"did you mean {near[0]}?" if near else f"it has {', '.join(known)}"
                raise ConfigurationError(f"{where}: the bench has no {what} {name}: {hint}")


def _check_factors(config: BenchConfig, run_list: RunList, guard: Guard, where: str) -> None:
    """Check that every factor has its own instrument that can set it."""
    setting: dict[str, str] = {}
    for factor in run_list.factors:
        name = config.factors.get(factor.name)
        if name is None:
            raise ConfigurationError(
                f'{where} does not say what sets {factor.name}: add it under [factors], {factor.name} = "INSTRUMENT"'
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
        name = config.factors.get(factor.name)
        if name is None and factor.name in HEAD and playing(config, Head):
            continue  # the head's own axes need no entry
        if name is None:
            setting = [n for n in config.instruments if any(n in playing(config, role) for role in _SETS)]
            here = (
                f"{', '.join(setting)} can" if setting else 'no instrument can; one with driver = "person" asks for it'
            )
            raise ConfigurationError(
                f"{where} does not say what sets {factor.name}: add it under [factors], {factor.name} = "
                f'"INSTRUMENT"; here {here}'
            )
        several = any(name in playing(config, role) for role in (ByHand, Head))
        if name in taken and not several:
            raise ConfigurationError(f"{where}: factors: {name} cannot set both {taken[name]} and {factor.name}")
        taken[name] = factor.name
        roles = [role for role in _SETS if name in playing(config, role)]
        if not roles:
            raise ConfigurationError(
                f"{where}: factors.{factor.name} = {name!r}: {name} sets nothing "
                f"(driver {config.instruments[name].driver})"
            )
        if Head in roles and factor.name not in HEAD:
            raise ConfigurationError(
                f"{where}: {name} is a head, and {factor.name} none of its angles: {' and '.join(HEAD)}"
            )
        _check_unit(factor.name, name, roles, where)
        if PressureController in roles:
            _check_atmosphere(factor.name, guard, where)


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
