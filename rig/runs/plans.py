"""Plans: bench, procedure and world, read and checked; what decides a run, from files or from a run file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.bench.bench_file import check_options
from rig.bench.config import BenchConfig, InstrumentConfig, parse_bench, parse_procedure, parse_toml, read_text
from rig.bench.contract_files import files_beside, read_bench, with_contracts, with_files
from rig.errors import ConfigurationError, RigError, UsageError
from rig.files.toml_text import toml_text
from rig.fitter.errors import FitError
from rig.lab import Laboratory, laboratory_of
from rig.lab.proposals import Permission, permission
from rig.procedures.kind import Completed, Procedure
from rig.procedures.kinds import kind_of
from rig.procedures.present.shell import shell_word
from rig.register import DOCUMENT, check_register, parse_register, register_beside
from rig.run_file.approval import digest_of
from rig.run_file.bodies import shown
from rig.run_file.events.sessions import Identified
from rig.runs.certificate_fields import SETTINGS, lacking_beside
from rig.runs.matching import check_match, check_names

if TYPE_CHECKING:
    from pydantic import BaseModel

    from rig.procedures.plan.run_list import RunList
    from rig.run_file.read.reader import RunReader

PREVIOUS = "previous.json"
"""Name of the run file's document with the last calibration, if the procedure names one."""


CONFORMITY = "conformity.toml"
"""Name of the run file's document with tolerances and decision rule, if `certificate.toml` beside the bench has any."""


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
        world: name of the world file, for messages.
        unsettled: fields that a certificate needs and the settings beside the bench file lack, as sentences.
        laboratory: the laboratory with people in which the bench file is; None if there is none, or it is no file.
        path: the procedure file; None if it is none.
        bench_path: likewise.
    """

    documents: Mapping[str, str]
    bench: BenchConfig
    procedure: Procedure
    run_list: RunList
    dry: bool
    truth: Mapping[str, Any]
    world: str = "world.toml"
    unsettled: tuple[str, ...] = ()
    laboratory: Laboratory | None = None
    path: Path | None = None
    bench_path: Path | None = None

    @property
    def needs_approval(self) -> bool:
        """Whether it is a real run on a bench with two keys."""
        return self.bench.approval and not self.dry

    def check_only(self, digest: str) -> None:
        """Refuse other files than those of which a run was put into a queue; "" for any.

        Raises:
            ConfigurationError: one was changed meanwhile.
        """
        if digest and digest_of(self.documents, self.run_list.sha256()) != digest:
            raise ConfigurationError(
                f"{self.path} or a file with it was changed after the run was put into the queue: propose it again"
            )

    def permission(self) -> Permission | None:
        """The permission to run; None if none is needed. Raises `UsageError` if there is none."""
        if not self.needs_approval:
            return None
        return permission(self.laboratory, self.documents, self.run_list.sha256(), self.path or "PROCEDURE")


def load_plan(procedure: Path, bench: Path, *, dry: bool = False, world: Path | None = None) -> Plan:
    """Read and check all files of a run. Raises `ConfigurationError`."""
    if world is not None and not dry:
        raise UsageError("--world describes a simulated bench; it requires --dry")
    documents = {"bench.toml": read_text(bench, "bench"), "procedure.toml": read_text(procedure, "procedure")}
    if world is not None:
        documents["world.toml"] = read_text(world, "world")
    config = parse_bench(documents["bench.toml"], str(bench))
    documents |= files_beside(config, bench)
    documents |= _register(config, bench) | _conformity(bench.parent / SETTINGS)
    against = parse_procedure(documents["procedure.toml"], str(procedure)).warnings.against
    if against is not None:
        from rig.runs.previous import previous_text  # noqa: PLC0415 - imports the fitter, which few runs need

        try:
            documents[PREVIOUS] = previous_text(procedure.parent / against)
        except (RigError, OSError) as error:
            what = f"{procedure}: warnings.against = {against!r}: {error}"
            raise ConfigurationError(f"{what}; name the last calibration, or remove the line") from error
    documents["procedure.toml"] = _with_files(documents["procedure.toml"], procedure)
    where = {"bench.toml": str(bench), "procedure.toml": str(procedure)}
    plan = _plan(documents, dry, where if world is None else {**where, "world.toml": str(world)})
    if world is not None:
        _check_person(plan, world)
    try:
        kind_of(plan.procedure).check_design(plan.procedure, plan.run_list)
    except FitError as error:
        raise ConfigurationError(f"{procedure}: {error}") from error
    plan = replace(plan, unsettled=lacking_beside(bench), laboratory=laboratory_of(bench))
    plan = replace(plan, path=procedure, bench_path=bench)
    misfit, sensors = plan.procedure.conduct.misfit, config.sensors
    columns = {name: f"{name}_{sensor.unit}" for name, sensor in sensors.items()}
    if misfit is not None and (defect := misfit(columns, config.read_only)):
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


def _conformity(path: Path) -> dict[str, str]:
    """Tolerances and decision rule as they are before the run, as a document; none if nothing is to be judged.

    Raises:
        ConfigurationError: the file cannot be read, or is no TOML; its values are checked with the certificate.
    """
    if not path.exists():
        return {}
    values = parse_toml(read_text(path, "certificate"), str(path))
    if "tolerance" not in values:
        return {}
    return {CONFORMITY: toml_text({key: values[key] for key in ("decision", "tolerance") if key in values})}


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
    if "world.toml" not in documents and config.live is not None and config.live.world is not None:
        documents = {**documents, "world.toml": config.live.world}  # so that a run over `rig sim` has its world
        where = {**where, "world.toml": f"{where['bench.toml']}: live.world"}
    checked = check_options(config, where["bench.toml"], strict=strict)
    if not strict:
        config = _as_checked(config, checked)
    procedure = parse_procedure(documents["procedure.toml"], where["procedure.toml"], strict=strict)
    run_list = procedure.expand()
    check_match(config, procedure, run_list, where["bench.toml"])
    if strict:
        check_names(config, procedure.conduct, where["procedure.toml"])
    truth = parse_toml(documents["world.toml"], where["world.toml"]) if "world.toml" in documents else {}
    return Plan(documents, config, procedure, run_list, dry, truth, where.get("world.toml", "world.toml"))


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
        raise ConfigurationError(
            f"{path}: its run list is not the one it began with; `rig verify {shell_word(path)}` says more"
        )
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
    if plan.needs_approval:
        raise ConfigurationError(
            f"{bench}: the run was approved with its own bench file, and no other; resume it without --bench, or "
            f"propose a new run with this one"
        )
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
        "approval",
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
    return replace(plan, bench=other)
