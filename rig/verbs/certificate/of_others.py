"""Parts of a certificate that are not of the laboratory: results of external providers, and the customer's data."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rig.register import SensorItem
from rig.register.check import entries
from rig.verbs.budget.evaluation import OfRun
from rig.verbs.certificate.document import External, Item, Supplied
from rig.verbs.certificate.settings import CertificateSettings
from rig.verbs.certificate.standing_sentences import IDENTITY


def external(items: Sequence[Item], known: Sequence[SensorItem]) -> Iterator[External]:
    """Results of external providers about the items.

    Args:
        items: under calibration.
        known: what the register says of each.
    """
    for item, one in zip(items, known, strict=True):
        for given in one.external:
            yield External(
                item.name,
                given.what,
                given.value,
                given.unit,
                given.expanded,
                given.k,
                given.probability,
                given.laboratory,
                given.accreditation,
                given.certificate,
                given.date,
                given.used_for,
            )


def supplied(
    items: Sequence[Item], known: Sequence[SensorItem], runs: Sequence[OfRun], settings: CertificateSettings
) -> Iterator[Supplied]:
    """Data that the customer supplied: about the items, the equipment, and tolerances.

    Args:
        items: under calibration.
        known: what the register says of each.
        runs: whose equipment counts.
        settings: have the tolerances.
    """
    for item, one in zip(items, known, strict=True):
        for key, words in IDENTITY.items():
            if key in one.from_customer:
                yield Supplied(item.name, words, getattr(item, key), "")
        for datum in one.customer_data:
            yield Supplied(item.name, datum.what, datum.value, "results" if datum.affects_results else "")
    equipment = ((e.asset, of.register.equipment.get(e.asset)) for of in runs for _, e in entries(of.config))
    theirs = dict.fromkeys((asset, one.from_customer) for asset, one in equipment if one and one.from_customer)
    yield from (Supplied(asset, words, "", "results") for asset, words in theirs)
    for tolerance in settings.tolerance:
        if tolerance.from_customer:
            yield Supplied(tolerance.sensor, f"tolerance of {tolerance.result}", "", "conformity")
