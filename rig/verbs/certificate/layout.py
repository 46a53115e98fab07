"""The parts of a certificate, in order, as blocks that paper and page render alike.

Nothing is computed here: a block arranges texts of the document. A template of a laboratory gets the same blocks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from datetime import date
from typing import Any

from rig.fitter.rounding import rounded_df
from rig.procedures.present.visible import visible
from rig.verbs.certificate import standing_sentences as words
from rig.verbs.certificate.blocks import (
    Block,
    Cell,
    Facts,
    Grid,
    Head,
    Section,
    Sentences,
    Signatures,
    day,
    grid,
    percent,
    text_grid,
)
from rig.verbs.certificate.document import Document, Item, Party, by_source
from rig.verbs.certificate.measured import Budget, ResultTable, Stage
from rig.verbs.certificate.standing_sentences import count
from rig.verbs.certificate.typeset import raised, typeset


def sections(document: Document) -> tuple[Section, ...]:
    """All parts of a certificate, in the order of its pages; parts without contents are absent."""
    parts = (
        Section("", tuple(_cover(document))),
        Section("Method", tuple(_method(document))),
        Section("Data supplied by the customer", tuple(_supplied(document))),
        Section("Conditions during the calibration", tuple(_conditions(document))),
        Section("Equipment and traceability", tuple(_equipment(document))),
        Section("Results", tuple(_results(document))),
        Section("Results of external providers", tuple(_external(document))),
        Section("Statement of conformity", tuple(_conformity(document))),
        Section("Effects beside the declared model", tuple(_effects(document))),
        Section("Deviations from the procedure", tuple(_deviations(document))),
        Section("Remarks", tuple(_paragraphs(document.remarks))),
        Section("Opinions and interpretations", tuple(_paragraphs(document.opinions))),
        Section("Evidence", tuple(_evidence(document))),
        Section("Annex: uncertainty budgets", tuple(_annex(document)), annex=True),
    )
    return tuple(part for part in parts if part.blocks)


def _cover(document: Document) -> Iterator[Block]:
    dates = document.dates
    if document.amends is not None:
        yield Sentences((f"Amended certificate. {document.amends.sentence}", *document.amends.changes))
    rows = [("Customer", _party(document.customer)), *_items(document), ("Place of calibration", (document.place,))]
    if dates.received is not None:
        rows.append(("Date of receipt", (day(dates.received),)))
    rows += [("Date of calibration", (_span(dates.began, dates.ended),)), ("Date of issue", (day(dates.issued),))]
    if document.next_due is not None:
        rows.append(("Next calibration", (f"{day(document.next_due)}, at the customer's wish",)))
    yield Facts(tuple(rows))
    yield Sentences(words.COVER, small=True)
    signed = [("Calibrated by", one.name, one.role) for one in document.calibrated_by]
    approved = document.approved_by
    yield Signatures((*signed, ("Approved by", approved.name, approved.role)))


def _party(party: Party) -> tuple[str, ...]:
    return (party.name, *filter(None, (*party.address, party.email, party.phone)))


def _items(document: Document) -> Iterator[tuple[str, tuple[str, ...]]]:
    """One item as facts; several are a table of the next page, and one line here."""
    if len(document.items) > 1:
        listed = ", ".join(f"{one.name} (serial {_named(one, 'serial')})" for one in document.items)
        yield f"{len(document.items)} items", (_same(one.description for one in document.items), listed)
        return
    (item,) = document.items
    yield "Item", (f"{item.description} ({item.name} in this certificate)",)
    yield "Manufacturer, model", (f"{_named(item, 'maker')}, {_named(item, 'model')}",)
    numbers = [f"serial number {_named(item, 'serial')}"]
    numbers += [f"laboratory's number {item.asset}"] if item.asset else []
    numbers += [f"customer's number {item.customer_id}"] if item.customer_id else []
    yield "Identification", (", ".join(numbers),)
    yield "Condition as received", (item.condition,)


def _named(item: Item, what: str) -> str:
    """Maker, model or serial number of an item, with who states it if that is the customer."""
    return f"{getattr(item, what)} (stated by the customer)" if what in item.from_customer else str(getattr(item, what))


def _same(texts: Iterable[str]) -> str:
    """Each different text once."""
    return "; ".join(dict.fromkeys(texts))


def _method(document: Document) -> Iterator[Block]:
    method = document.method
    yield Sentences((method.name, *method.sentences))
    if method.references:
        yield Sentences(tuple(method.references), small=True)
    if len(document.items) > 1:
        heads = ("Item", "Manufacturer, model", "Serial number", "Other numbers", "Condition as received")
        rows = [
            (
                one.name,
                f"{_named(one, 'maker')}, {_named(one, 'model')}",
                _named(one, "serial"),
                ", ".join(filter(None, (one.asset, one.customer_id))),
                one.condition,
            )
            for one in document.items
        ]
        yield text_grid("Items under calibration", heads, rows)


def _supplied(document: Document) -> Iterator[Block]:
    if not document.supplied:
        return
    heads = ("Of", "Data", "As the customer states", "Can affect")
    rows = [(one.subject or "-", one.what, one.value or "-", words.AFFECTS[one.affects]) for one in document.supplied]
    yield text_grid("", heads, rows, notes=words.disclaimer(*(one.affects for one in document.supplied)))


def _external(document: Document) -> Iterator[Block]:
    """A table for each certificate of a provider."""
    heads = [Head("Item"), Head("Quantity"), Head("Unit"), Head("Value", align="right")]
    heads += [Head("Expanded\nuncertainty", align="right"), Head("k", align="right")]
    heads += [Head("Coverage\nprobability", align="right"), Head("Used here for")]
    for source, ones in by_source(document.external).items():
        told = [
            [
                *(one.sensor, one.label, one.unit or "1", one.value),
                *(one.expanded or "-", one.k or "-", percent(one.probability) or "-"),
                one.used_for or "-",
            ]
            for one in ones
        ]
        yield grid(source, heads, told, notes=words.EXTERNAL)


def _conditions(document: Document) -> Iterator[Block]:
    yield from _recorded(document)
    yield from _paragraphs(document.unrecorded)
    if not document.holdings:
        return
    staged = any(one.stage for one in document.holdings)
    heads = ["Equipment", "Certificate", *(["Run"] if staged else []), "Quantity", "Holds at", "It was", "By"]
    rows = [
        (
            one.asset,
            one.certificate,
            *([one.stage] if staged else []),
            one.label,
            f"{one.limits} {one.unit}",
            f"{one.found} {one.unit}" if one.found else "not recorded",
            one.by or "-",
        )
        for one in document.holdings
    ]
    yield text_grid("Conditions under which certificates of the equipment hold", heads, rows, notes=words.HOLDINGS)


def _recorded(document: Document) -> Iterator[Block]:
    if not document.conditions:
        return
    staged = any(one.stage for one in document.conditions)
    heads = [Head("Quantity"), *([Head("Run")] if staged else []), Head("Unit")]
    heads += [Head(name, align="right") for name in ("Minimum", "Mean", "Maximum")]
    told = [
        [one.label, *([one.stage] if staged else []), one.unit, one.minimum, one.mean or "-", one.maximum]
        for one in document.conditions
    ]
    stated = ", ".join(dict.fromkeys(one.label for one in document.conditions if not one.name))
    notes = words.CONDITIONS if any(one.name for one in document.conditions) else ()
    yield grid("", heads, told, notes=(*notes, *([words.BY_RECORD.format(stated)] if stated else [])))


def _equipment(document: Document) -> Iterator[Block]:
    heads = ("Instrument", "Manufacturer, model", "Serial, asset", "Certificate", "Laboratory", "Date", "Due")
    rows = [
        (
            one.name,
            ", ".join(filter(None, (one.maker, one.model))),
            ", ".join(filter(None, (one.serial, one.asset))),
            one.certificate or "-",
            ", ".join(filter(None, (one.laboratory, one.accreditation))) or "-",
            "-" if one.date is None else day(one.date),
            "-" if one.due is None else day(one.due),
        )
        for one in document.equipment
    ]
    traced = all(one.laboratory for one in document.equipment)
    yield text_grid("", heads, rows, notes=words.TRACEABILITY if traced else (*words.TRACEABILITY, *words.UNTRACED))
    yield from _paragraphs(document.unstated)


def _results(document: Document) -> Iterator[Block]:
    if any(one.affects == "results" for one in document.supplied):
        yield Sentences((words.SEE_SUPPLIED,))
    if document.models:
        yield Sentences(document.models)
    yield Sentences(words.uncertainty(document))
    if document.notes:
        yield Sentences(document.notes, small=True)
    stages = list(dict.fromkeys(one.stage for one in document.tables))
    for stage in stages:
        for table in document.tables:
            if table.stage == stage:
                yield _table(table)
        if stage == "as found" and document.adjustment:
            yield Sentences((f"Adjustment between as found and as left: {document.adjustment}",))


def _table(table: ResultTable) -> Grid:
    numbered = any(one.unit != table.results[0].unit for one in table.results)
    unit = "" if numbered else table.results[0].unit
    heads = [Head(one.label, one.unit, "right") for one in table.at]
    if not table.at or len({one.label for one in table.results}) > 1:
        heads.insert(0, Head("Quantity"))
    named = heads[:1] == [Head("Quantity")]
    heads += [Head("Unit")] if numbered else []
    heads += [Head("Value", unit, "right"), Head("Expanded\nuncertainty", unit, "right")]
    heads += [Head("Coverage\nprobability", align="right"), Head("k", align="right")]
    heads += [Head("Degrees of\nfreedom", align="right")]
    rows = [
        [
            *([one.label] if named else []),
            *one.at,
            *([one.unit or "1"] if numbered else []),
            one.value,
            one.expanded,
            percent(one.probability),
            one.k,
            rounded_df(one.df),
        ]
        for one in table.results
    ]
    return grid(
        _titled(table.sensor, table.title, table.stage), heads, rows, notes=[raised(one) for one in table.notes]
    )


def _conformity(document: Document) -> Iterator[Block]:
    if not document.statements:
        return
    staged = any(one.stage for one in document.statements)
    heads = ["Item", *(["Run"] if staged else []), "Quantity", "Tolerance", "Result", "Probability\nof conformity"]
    rows = [
        (
            one.sensor,
            *([one.stage] if staged else []),
            one.what,
            one.tolerance,
            words.VERDICTS[one.verdict],
            percent(one.probability),
        )
        for one in document.statements
    ]
    rules = tuple(dict.fromkeys(one.rule for one in document.statements))
    by = dict.fromkeys(f"Tolerance of {one.basis}." for one in document.statements if one.basis)
    yield text_grid("", heads, rows, notes=(*by, *(f"Decision rule: {rule}" for rule in rules), *words.CONFORMITY))
    yield Sentences(tuple(_stated(document)))


def _stated(document: Document) -> Iterator[str]:
    """A sentence for each item: how many of its results conform, the lowest probability, and those that do not."""
    sentences: dict[tuple[Stage, str], list[str]] = {}
    for stage, sensor in dict.fromkeys((one.stage, one.sensor) for one in document.statements):
        mine = [one for one in document.statements if (one.stage, one.sensor) == (stage, sensor)]
        told = "; ".join(words.conformity(mine))
        sentences.setdefault((stage, told), []).append(sensor or "all items together")
    for (stage, told), items in sentences.items():
        yield f"{', '.join(items)}{f', {stage}' if stage else ''}: {told}."


def _effects(document: Document) -> Iterator[Block]:
    if not document.effects:
        return
    staged = any(one.stage for one in document.effects)
    heads = ["Item", *(["Run"] if staged else []), "Effect", "Size (95 % interval)", "State"]
    by_name = {one.name: n for n, one in reversed(list(enumerate(document.effects)))}
    every = sorted(document.effects, key=lambda one: by_name[one.name])
    rows, before = [], None
    for one in every:
        state = "confirmed" if one.confirmed else "not confirmed"
        stage = [one.stage] if staged else []
        same = before is not None and (before.name, before.cause) == (one.name, one.cause)
        rows.append((one.sensor, *stage, "the same" if same else f"{one.name}: {one.cause}", one.size, state))
        before = one
    sure = all(one.confirmed for one in every)
    how = _joined((one.name, f"{'Confirmed' if one.confirmed else 'Not confirmed'}: {one.how}.") for one in every)
    shared = _joined((one.name, one.shared.removeprefix(one.name)) for one in every if one.shared)
    notes = [
        words.EFFECTS if sure else f"{words.EFFECTS} {words.UNCONFIRMED}",
        *(told if len(how) == 1 else f"{', '.join(names)}: {told}" for told, names in how.items()),
        *(f"{'Each of ' if len(names) > 1 else ''}{' and '.join(names)}{told}." for told, names in shared.items()),
    ]
    yield text_grid("", heads, rows, notes=notes)


def _joined(told: Iterable[tuple[str, str]]) -> Mapping[str, Sequence[str]]:
    """Names of effects by the sentence about them."""
    found: dict[str, dict[str, None]] = {}
    for name, sentence in told:
        found.setdefault(sentence, {})[name] = None
    return {sentence: list(names) for sentence, names in found.items()}


def _deviations(document: Document) -> Iterator[Block]:
    yield Sentences(document.deviations or ("None.",))


def _paragraphs(texts: Sequence[str]) -> Iterator[Block]:
    if texts:
        yield Sentences(tuple(texts))


def _evidence(document: Document) -> Iterator[Block]:
    for one in document.evidence:
        stage = f" ({one.stage})" if one.stage else ""
        run = f"{one.file}: run {one.run_id}, {count(one.observations, 'observation')}, {one.records} records"
        what, hashed = "Run file", "Head hash"
        if not one.run_id:
            run, what, hashed = f"{one.file}: {count(one.observations, 'observation')}", "Table", "SHA-256"
        rows = [(f"{what}{stage}", (run,)), (hashed, (one.head[:32], one.head[32:]))]
        yield Facts((*rows, ("Written by", (f"calibration-rig {one.version}",))), mono=True)
    if any(one.run_id for one in document.evidence):
        yield Sentences(words.EVIDENCE, small=True)
    if not all(one.run_id for one in document.evidence):
        yield Sentences(words.EVIDENCE_OF_TABLE, small=True)


def _annex(document: Document) -> Iterator[Block]:
    if document.budgets:
        yield Sentences(words.ANNEX, small=True)
    for budget in document.budgets:
        yield _budget(budget)


def _budget(budget: Budget) -> Grid:
    heads = [Head("Influence"), Head("Traced to"), Head("Type"), Head("Standard\nuncertainty", budget.unit, "right")]
    heads += [Head("Degrees of\nfreedom", align="right"), Head("Share", align="bar")]
    told = [[one.label, one.source, one.kind, one.standard, one.df, _share(one.share)] for one in budget.contributions]
    made = grid("", heads, told)
    rows = tuple(
        (*row[:-1], Cell(row[-1].text, bar=min(max(one.share, 0.0), 1.0)))
        for row, one in zip(made.rows, budget.contributions, strict=True)
    )
    unit = f" {raised(budget.unit)}" if budget.unit else ""
    foot = (
        ("Combined standard uncertainty", f"{typeset(budget.combined)}{unit}"),
        ("Effective degrees of freedom", typeset(budget.df)),
        ("Coverage factor k", typeset(budget.k)),
        ("Expanded uncertainty", f"{typeset(budget.expanded)}{unit}"),
    )
    left = (_left(budget.left),) if budget.left else ()
    return Grid(_titled(budget.sensor, budget.label, budget.stage), made.heads, rows, left, foot)


def _left(number: int) -> str:
    if number == 1:
        return "1 smaller contribution, below 0.1 %, is not listed."
    return f"{number} smaller contributions, each below 0.1 %, are not listed."


def _titled(sensor: str, what: str, stage: str) -> str:
    return "".join((f"{sensor}: " if sensor else "", raised(what), f", {stage}" if stage else ""))


def _share(share: float) -> str:
    """A share of the variance in percent."""
    per_cent = 100 * share
    return "< 0.1 %" if 0 < per_cent < 0.1 else f"{per_cent:.1f} %".replace("-", "−")


def _span(began: date, ended: date) -> str:
    return day(began) if began == ended else f"{day(began)} to {day(ended)}"


def contents(document: Document) -> dict[str, Any]:
    """The input of a template: the document and its sections, as JSON values; control characters are shown."""
    told = {
        "document": document.to_json(),
        "sections": [asdict(one) for one in sections(document)],
        "words": words.PAGE,
    }
    shown: dict[str, Any] = _visible(told)
    return shown


def _visible(value: Any) -> Any:
    """A value with control characters of its texts as escape sequences: they have no glyph on paper."""
    if isinstance(value, str):
        return visible(value)
    if isinstance(value, dict):
        return {name: _visible(one) for name, one in value.items()}
    return [_visible(one) for one in value] if isinstance(value, list | tuple) else value
