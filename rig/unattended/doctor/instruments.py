"""The instruments of a bench: checks that they are free, answer, are the right ones, and are within their
calibration interval. It asks for identities and changes nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

from rig.bench.bench_file import NO_QUESTION, cannot_be_asked, check_options, unasked
from rig.bench.config import BenchConfig, InstrumentConfig, due_dates
from rig.bench.plugins import driver_class
from rig.drivers.clock import Clock, RealClock, ScaledClock
from rig.drivers.errors import DriverError
from rig.drivers.roles import Identity, Instrument, Remarking
from rig.drivers.wires import Wires
from rig.errors import BusyError
from rig.instruments.locks import locked_addresses
from rig.procedures.present.shell import shell_word
from rig.register import Register, stated_of
from rig.register.likeness import unlike
from rig.unattended.doctor.addresses import check_addresses
from rig.unattended.doctor.findings import Finding, ok, problem, warning

Known = Mapping[str, Mapping[str, Any]]
"""Identities in a run file, by instrument."""


def check_instruments(
    config: BenchConfig, known: Known, run_file: Path | None, register: Register | None = None
) -> Iterator[Finding]:
    """Findings about a real bench: addresses, locks, identities.

    Args:
        config: the bench file.
        known: identities in the run's last session; {} for a new run.
        run_file: the run to be resumed, for messages.
        register: with which identities are compared, if there is one.

    """
    addresses = dict(check_addresses(config.instruments))
    yield from addresses.values()
    wanting = {name for name, finding in addresses.items() if finding.level == "problem"}
    try:
        with locked_addresses(config.instruments):
            yield ok("locks", "no other controller of this machine uses these addresses")
            live = config.live
            clock: Clock = ScaledClock(live.speed, live.epoch_utc, live.started_utc) if live else RealClock()
            yield from ask(config, clock, Wires(clock), known, run_file, register, leave_out=wanting)
    except BusyError as error:
        yield problem("locks", str(error), "stop that controller, or wait for it; nothing was sent to any instrument")


def check_twins(config: BenchConfig, truth: Mapping[str, Any], world: str, known: Known) -> Iterator[Finding]:
    """Ask the instruments of the simulated bench of a dry run, which has neither addresses nor locks."""
    from rig.simulated.dry_run import DryBench  # noqa: PLC0415 - a real run never loads the simulation

    dry = DryBench(config, truth, where=world)
    try:
        yield from ask(dry.config, dry.world, dry.wires, known, None, twins=True)
    finally:
        dry.close()
    told = "whether the real ones are there, and accept the commands, numbers and units of the bench file"
    yield warning(
        "twins", f"simulated instruments have answered, which does not show {told}", "ask: rig doctor without --dry"
    )


def check_guards(config: BenchConfig) -> Iterator[Finding]:
    """Findings about instruments that nothing asks whether they were changed."""
    names = unasked(config)
    if names:
        words = "no question shows whether somebody has changed its unit, channel or range at the panel"
        yield warning(", ".join(names), words, "name one in check (docs/how_to/own_instrument.md)")
    if names := cannot_be_asked(config):
        yield ok(", ".join(names), NO_QUESTION)


def ask(
    config: BenchConfig,
    clock: Clock,
    wires: Wires,
    known: Known,
    run_file: Path | None,
    register: Register | None = None,
    *,
    leave_out: Collection[str] = (),
    twins: bool = False,
) -> Iterator[Finding]:
    """Ask every reachable instrument for its identity, also after one does not answer."""
    options = check_options(config, "bench")
    opened: list[Instrument] = []
    try:
        for name, declared in config.instruments.items():
            if name in leave_out:
                continue
            try:
                instrument = driver_class(declared.driver)(name, declared.address, options[name], wires, clock)
                opened.append(instrument)
                identity = instrument.identify()
            except (DriverError, OSError) as error:
                yield problem(name, str(error), "switch it on, check cable and address; then ask again")
            else:
                found = _identity(name, declared, identity, known.get(name), run_file)
                simulated = twins or config.simulated
                yield replace(found, found=f"{found.found}; simulated") if simulated else found
                if register is not None and not simulated:
                    yield from _of_register(name, declared, identity, register)
                for said in instrument.remarks() if isinstance(instrument, Remarking) else ():
                    yield warning(name, said, "check whether this is enough (docs/reference/instruments.md)")
    finally:
        for instrument in opened:
            instrument.close()
        wires.close()


def _identity(
    name: str, declared: InstrumentConfig, found: Identity, before: Mapping[str, Any] | None, run_file: Path | None
) -> Finding:
    serial = f"serial number {found.serial}" if found.confirmed else "does not report its serial number"
    text = f"{found.maker} {found.model}, {serial}"
    if declared.serial and found.confirmed and declared.serial != found.serial:
        advice = "connect the declared instrument, or correct the bench file"
        return problem(name, f"{text}; the bench file says {declared.serial}", advice)
    now = {"maker": found.maker, "model": found.model, "serial": found.serial, "asset": declared.asset}
    if before is not None and any(before[key] != now[key] for key in now):
        was = f"{before['maker']} {before['model']}, serial number {before['serial'] or 'unknown'}"
        was += f", asset {before['asset']}" if before["asset"] else ""
        advice = f"connect the first one, or: rig resume {shell_word(run_file or 'RUN')} --accept {shell_word(name)}"
        return problem(name, f"{text}; the run began with another one ({was})", advice)
    if not found.confirmed and not declared.asset:
        advice = "give it an asset number in the bench file: nothing else distinguishes it from another one"
        return warning(name, text, advice)
    return ok(name, text if found.confirmed else f"{text}; known by asset number {declared.asset}")


def _of_register(name: str, declared: InstrumentConfig, found: Identity, register: Register) -> Iterator[Finding]:
    known = register.equipment.get(declared.asset)
    key = "" if known is None else unlike(known, found.model, found.serial, confirmed=found.confirmed)
    if key:
        told, stated = getattr(found, key), getattr(known, key)
        advice = "correct the register, or connect that instrument: certificates of the run would be refused"
        yield problem(name, f"its {key} is {told}; the register says {stated} of {declared.asset}", advice)


def check_due(
    config: BenchConfig, now_s: float, end_s: float | None, register: Register | None = None
) -> Iterator[Finding]:
    """Findings about calibrations of instruments and reference standards: overdue, or due before the run ends.

    Dates that the bench file does not state are those of the register's certificates.
    """
    today = datetime.fromtimestamp(now_s, UTC).astimezone().date()
    last = today if end_s is None else datetime.fromtimestamp(end_s, UTC).astimezone().date()
    equipment = {} if register is None else register.equipment
    known = {asset: one.certificate.due for asset, one in equipment.items() if one.certificate is not None}
    nowhere = f"no due date in the bench file{'' if register is None else ' or its register of equipment'}"
    for kind, names, due in due_dates(config, known):
        of = "the reference standard of " if kind == "reference" else ""
        check = f"calibration of {of}{names}"
        yield ok(check, nowhere) if due is None else _due(check, due, today, last)


def check_stated(config: BenchConfig, register: Register, now_s: float) -> Iterator[Finding]:
    """Findings about a register: outputs and reference standards without stated errors, statements of nothing here."""
    name = "register of equipment"
    stated = stated_of(register, config, datetime.fromtimestamp(now_s, UTC).date())
    known = {column for one in stated.errors for column in one.columns if column not in one.computed}
    needed = [*(f"{sensor}_{one.unit}" for sensor, one in config.sensors.items()), *config.references]
    lacking = [column for column in needed if column not in known]
    advice = "correct it first: uncertainties would be too small, or a certificate refused"
    if lacking:
        yield warning(name, f"it states no errors of {', '.join(lacking)}", advice)
    yield from (warning(name, one, advice) for one in stated.lacking)
    if not lacking and not stated.lacking:
        yield ok(name, "it states errors of every output and reference standard")


def _due(check: str, due: date, today: date, last: date) -> Finding:
    advice = "have it calibrated first: its measurements are not traceable"
    if due < today:
        return problem(check, f"was due on {due}, {(today - due).days} days ago", advice)
    if due <= last:
        return problem(check, f"is due on {due}, before the run ends (about {last})", advice)
    days = (due - today).days
    if days < 30:
        return warning(check, f"is due on {due}, in {days} days", "plan its calibration")
    return ok(check, f"is due on {due}")
