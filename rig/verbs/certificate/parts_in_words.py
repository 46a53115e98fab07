"""Parts of a certificate that are words: laboratory, customer, items, people, equipment; and missing fields."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Any

from rig.bench.config import InstrumentConfig, parse_toml, read_text
from rig.procedures.column_names import spelled, stem_of, unit_of
from rig.procedures.plan.hand_steps import Made
from rig.procedures.present.durations import duration
from rig.procedures.tables.table import CORRECTED
from rig.register import DOCUMENT, Register, SensorItem, item_of
from rig.register.check import Entry, entries
from rig.run_file.state.state import RunState
from rig.runs.certificate_fields import lacking
from rig.units.of_instruments import TEMPERATURE_UNIT
from rig.verbs.budget.evaluation import OfRun
from rig.verbs.certificate.changes import changes
from rig.verbs.certificate.document import Equipment, Evidence, Item, Laboratory, Logo, Method, Party, Person
from rig.verbs.certificate.measured import Stage
from rig.verbs.certificate.settings import CertificateSettings
from rig.verbs.certificate.standing_sentences import count
from rig.version import VERSION

_LARGEST_LOGO, _MOST_OF_REGISTER, _MOST_OF_STEPS = 2 << 20, 5, 12


@dataclass
class Missing:
    """Fields that a certificate needs and nobody gave, with where to give them."""

    reasons: list[str] = field(default_factory=list)

    def given(self, value: str, what: str, where: str) -> str:
        """The value; if it is empty, that is noted."""
        if not value.strip():
            self.reasons.append(f"{what} is missing: add {where}")
        return value.strip()


@dataclass(frozen=True)
class Origin:
    """Files that the words come from, for messages.

    Attributes:
        register: name of the register.
        settings: name of certificate.toml.
        folder: of certificate.toml, for the files that it names.
    """

    register: str
    settings: str
    folder: Path


def settled(settings: CertificateSettings, origin: Origin, missing: Missing, approved: str) -> None:
    """Note what only the settings can say, whatever the run is."""
    values = {"country": settings.country, "item": settings.item, "method.name": settings.method.name}
    missing.reasons += lacking({**values, "approved_by": approved or settings.approved_by}, origin.settings)


def laboratory(register: Register, settings: CertificateSettings, origin: Origin, missing: Missing) -> Laboratory:
    """Who issues the certificate."""
    own = register.laboratory
    party = Party(
        own.name.strip(),
        _lines(own.address),
        settings.country.strip(),
        settings.email,
        settings.phone,
    )
    return Laboratory(party, own.accreditation, _logo(settings, origin, missing))


def _lines(address: str) -> tuple[str, ...]:
    return tuple(line.strip() for line in address.splitlines() if line.strip())


_BEGINS: Mapping[bytes, str] = {b"\x89PNG": "png", b"\xff\xd8\xff": "jpg"}


def _logo(settings: CertificateSettings, origin: Origin, missing: Missing) -> Logo | None:
    if not settings.logo:
        return None
    path = origin.folder / settings.logo
    try:
        data = path.read_bytes()[: _LARGEST_LOGO + 1]
    except OSError as error:
        missing.reasons.append(f"logo {path} cannot be read: {error.strerror}: correct logo in {origin.settings}")
        return None
    kind: Any = next((kind for begin, kind in _BEGINS.items() if data.startswith(begin)), None)
    if kind is None and b"<svg" in data[:4096]:
        kind = "svg"
    if kind is None or len(data) > _LARGEST_LOGO:
        missing.reasons.append(
            f"logo {path} is no SVG, PNG or JPEG of at most 2 MiB: correct logo in {origin.settings}"
        )
        return None
    return Logo(data, kind)


def items(runs: Sequence[OfRun], settings: CertificateSettings) -> tuple[tuple[Item, ...], tuple[SensorItem, ...]]:
    """The calibrated sensors, and what the register says of each."""
    of, found, known = runs[-1], [], []
    described = settings.item.strip()
    for name in of.table.outputs.values():
        sensor = of.config.sensors.get(name)
        _, one = item_of(of.register, name, sensor)
        if one is None:
            continue
        words = (one.maker.strip(), one.model.strip(), one.serial.strip(), one.condition.strip())
        asset = sensor.asset if sensor else ""
        found.append(Item(name, described, *words, asset, from_customer=one.from_customer))
        known.append(one)
    return tuple(found), tuple(known)


def customer(known: Sequence[SensorItem], settings: CertificateSettings, origin: Origin, missing: Missing) -> Party:
    """Whom the certificate is for: one customer for all items."""
    names = list(dict.fromkeys(one.customer.strip() for one in known if one.customer.strip()))
    addresses = list(dict.fromkeys(one.customer_address.strip() for one in known if one.customer_address.strip()))
    if len(names) > 1 or len(addresses) > 1:
        missing.reasons.append(
            f"the items belong to several customers ({'; '.join(names)}): a certificate is for one; correct "
            f"sensors.*.customer and customer_address in {origin.register}"
        )
    address = addresses[0] if addresses else ""
    return Party(names[0] if names else "", _lines(address), settings.customer_country)


def people(
    of: OfRun, settings: CertificateSettings, origin: Origin, missing: Missing, calibrated: str, approved: str
) -> tuple[tuple[Person, ...], Person]:
    """Who calibrated and who approves. Where the register lists who may, they must be in its lists."""
    own = of.register.laboratory
    operators = str(of.table.provenance.get("operator", ""))
    names = calibrated or settings.calibrated_by or operators
    who = [one.strip() for one in names.split(",") if one.strip()]
    if not who:
        missing.reasons.append(f"who calibrated is missing: add calibrated_by in {origin.settings}, or --calibrated-by")
    approver = (approved or settings.approved_by).strip()
    for name, allowed, may in (
        *((one, own.calibrates, "calibrates") for one in who),
        *([(approver, own.approves, "approves")] if approver else []),
    ):
        if allowed and name not in allowed:
            listed = ", ".join(allowed)
            missing.reasons.append(f"{name} is not in laboratory.{may} of {origin.register}, which has {listed}")
    roles = settings.calibrated_by_role, settings.approved_by_role
    return tuple(Person(one, roles[0]) for one in who), Person(approver, roles[1])


def method(of: OfRun, settings: CertificateSettings) -> Method:
    """The method, and what the procedure of the run was."""
    own = settings.method
    p = of.table.provenance
    ran = (
        f"Procedure of the run: {p['procedure']}; {p['points_observed']} of {p['points_planned']} planned observations."
        if "procedure" in p
        else f"Evaluated from the table {p['file']}: {count(p['points_observed'], 'observation')}."
    )
    return Method(own.name.strip(), (*own.sentences, ran), own.references)


def equipment(runs: Sequence[OfRun]) -> tuple[Equipment, ...]:
    """Instruments and standards of the benches, and constants of the place, each once."""
    found: dict[tuple[str, str], Equipment] = {}
    for of in runs:
        for key, entry in entries(of.config):
            known = of.register.equipment.get(entry.asset)
            if known is None:
                if not _is_person(entry) and not _is_stated(of, key):
                    found.setdefault((key, ""), Equipment(_what(key), "", "", "", entry.asset, "", "", None, None))
                continue
            certificate = known.certificate if _states(of, entry.asset) else None
            found.setdefault(
                (entry.asset, certificate.number if certificate else ""),
                Equipment(
                    known.description or _what(key),
                    known.maker,
                    known.model,
                    known.serial,
                    entry.asset,
                    certificate.number if certificate else "",
                    certificate.laboratory if certificate else "",
                    certificate.date if certificate else None,
                    certificate.due if certificate else None,
                    certificate.accreditation if certificate else "",
                ),
            )
        for name, constant in of.register.place.items():
            if constant.source:
                words = name.replace("_", " ")
                found.setdefault((words, ""), Equipment(words, "", "", "", "", "", constant.source, None, None))
    return tuple(found.values())


_KINDS = {"references": "reference standard of {}", "temperatures": "thermometer {}"}


def _what(key: str) -> str:
    """Name of an entry of a bench file, for people."""
    table, _, name = key.partition(".")
    words = (stem_of(name) if table in _KINDS else name).replace("_", " ")
    if table == "temperatures" and unit_of(name) != TEMPERATURE_UNIT:  # a hygrometer or barometer
        return f"instrument for {words}"
    return _KINDS.get(table, "{}").format(words)


def _is_person(entry: Entry) -> bool:
    return isinstance(entry, InstrumentConfig) and entry.by_hand


def _is_stated(of: OfRun, key: str) -> bool:
    """Whether the register states an error of the column of an entry, by the instrument that reads it."""
    return any(key.partition(".")[2] in one.columns for one in of.stated.errors)


def _states(of: OfRun, asset: str) -> bool:
    """Whether the register states an error of what an asset gives here; otherwise no result is traced to it."""
    return any(one.key.startswith(f"equipment.{asset}.says.") for one in of.stated.errors)


def deviations(of: OfRun, state: RunState, stage: Stage, registers: tuple[str | None, Path | None]) -> Iterator[str]:
    """Departures from the procedure, one sentence each.

    Args:
        of: the run.
        state: of its points.
        stage: of it.
        registers: text of the one kept with the run, if any, and the other one that was used, if any.
    """
    p = of.table.provenance
    at = f" ({stage})" if stage else ""
    yield from _register_used(*registers, at)
    for one in p.get("skipped", ()):
        yield f"Point {one['point']} ({one['where']}) was skipped{at}: {one['reason']}."
    for why in state.lost.values():
        yield f"A whole plot was measured again{at}: {why}."
    if state.sessions > 1:
        yield f"The run was interrupted and continued {_times(state.sessions - 1)}{at}."
    if rejected := p.get("observations_rejected"):
        yield f"{_observations(rejected)} rejected during the run and measured again{at}."
    if doubted := p.get("left_out_in_doubt"):
        yield f"{_observations(doubted)} left out, because temperatures had left their band{at}."
    for flag, number in p.get("flags", {}).items():
        yield f"{_observations(number)} marked {flag!r}, and used{at}."
    yield from steps_by_hand(of.table.by_hand, at)
    corrections = p.get(CORRECTED, ())
    if corrections:
        yield f"Entries that a person had typed were corrected after their acceptance{at}, {_times(len(corrections))}."
        yield from (f"Correction of a typed entry{at}: {one}." for one in corrections)
    if of.corrected:
        columns = ", ".join(f"{name} by {' and '.join(_correcting(of, name))}" for name in of.corrected)
        yield f"Recorded values were corrected by the certificates of the equipment{at}: {columns}."


def _correcting(of: OfRun, column: str) -> Iterator[str]:
    """Certificates that correct a column, with who issued them; without one, the constants of the place."""
    values = of.table.columns[column]
    by = [e for e in of.stated.errors if column in e.columns and e.correction(e.quantity(column, values)).any()]
    if not by:
        yield "constants of the place"
    for asset in dict.fromkeys(one.key.split(".")[1] for one in by):
        certificate = of.register.equipment[asset].certificate
        if certificate is not None:
            of_whom = ", ".join(filter(None, (certificate.laboratory, certificate.accreditation)))
            yield f"certificate {certificate.number} of {asset} ({of_whom})"


def _register_used(kept: str | None, given: Path | None, at: str) -> Iterator[str]:
    """That another register was used than the one kept with the run, and what differs, a sentence."""
    text = "" if given is None else read_text(given, "equipment")
    if given is None or text == kept:
        return
    named = f"{given.name}, SHA-256 {hashlib.sha256(text.encode()).hexdigest()}"
    if kept is None:
        yield f"The run has no register of equipment{at}: that of {named} was used."
        return
    differs = changes(parse_toml(kept, DOCUMENT), parse_toml(text, str(given)), _MOST_OF_REGISTER)
    told = "; ".join(differs) or "only comments differ"
    yield f"The register of equipment kept with the run was replaced after it{at} by {named}: {told}."


def steps_by_hand(steps: Sequence[Made], at: str) -> Iterator[str]:
    """Steps that a person did, as the procedure says them: a sentence for each different one."""
    alike: dict[tuple[str, str], list[Made]] = {}
    for one in steps:
        alike.setdefault((one.say.rstrip(". "), one.who), []).append(one)
    for (say, who), made in alike.items():
        times = f", {len(made)} times" if len(made) > 1 else ""
        when = ", ".join(duration(one.elapsed_s) for one in made[:_MOST_OF_STEPS])
        more = ", ..." if len(made) > _MOST_OF_STEPS else ""
        stated = [f"{one.number:g}" for one in made if one.number is not None]
        name = stem_of(made[0].value).replace("_", " ")
        values = f"; stated for {name}: {', '.join(stated)} {spelled(unit_of(made[0].value))}" if stated else ""
        person = f" ({who})" if who else ""
        yield f"A person{person} did a step by hand{times}{at}, {when}{more} after the begin of the run: {say}{values}."


def _times(number: int) -> str:
    return "once" if number == 1 else f"{number} times"


def _observations(number: int) -> str:
    return f"{count(number, 'observation')} {'was' if number == 1 else 'were'}"


def evidence(of: OfRun, records: int, stage: Stage) -> Evidence:
    """The run file, or the table in its place."""
    p = of.table.provenance
    return Evidence(
        str(p["file"]),
        str(p.get("run_id", "")),
        str(p["head"]),
        records,
        int(p["points_observed"]),
        date.fromisoformat(p["began_utc"][:10]),
        date.fromisoformat(p["last_observation_utc"][:10]),
        VERSION,
        stage,
    )
