"""Sentences that stand on every certificate. A laboratory's own go into `remarks` of certificate.toml."""

from __future__ import annotations

from collections.abc import Mapping

from rig.certificate.document import Document
from rig.certificate.measured import Verdict

COVER = (
    "The results relate only to the items that are named here, in the condition in which they were calibrated.",
    "Without the written approval of the laboratory this certificate is reproduced only in full.",
)
TRACEABILITY = (
    "The results are traceable to the International System of Units (SI) through the certificates in this table.",
)
UNTRACED = (
    "Instruments without a certificate keep or watch conditions, or the register states no error of them: no result is "
    "traceable through them, and conditions that they alone record are indications.",
)
LACKS = "of the declared model, which lacks effects"
"""How a sentence of `Document.models` says that effects were found and not accepted."""
_LIES = "The value of the quantity lies within it with the stated coverage probability."
_BY_MODEL = (
    "It counts the size of the effects that the model lacks: of a result that they move, the value by the model with "
    "them is inside, and the coverage is at least the stated one as far as that model holds."
)
_NAMELESS = (
    "The trace left an error without a name: of the results of that item, the coverage probability is stated under the "
    "condition that the model holds at their points."
)
_UNCERTAINTY = (
    "The expanded uncertainty is the combined standard uncertainty times the coverage factor k. {} It was evaluated "
    "after JCGM 100:2008 (GUM) from the scatter of the run and the certificates of the equipment; it does not include "
    "the behaviour of the item after the calibration."
)
UNCERTAINTY = (_UNCERTAINTY.format(_LIES),)
CORRELATED = "Coefficients of one item are correlated: the uncertainty of an output does not follow from theirs alone."
INFERRED = (
    "A result that is called inferred is the quantity for one reading in use at the point: its value is the point, and "
    "its uncertainty that of the quantity that the reading gives."
)
CONDITIONS = ("Of all accepted observations of the run.",)
CONFORMITY = ("The statements hold for the results above, at the time of the calibration.",)
EFFECTS = "The declared model does not have these effects; they were found in the data of the run."
UNCONFIRMED = "The cause of an effect that is not confirmed is known by these data alone."
EVIDENCE = (
    "Every number above comes from this run file. Its head hash is the fingerprint of all of its records: "
    "`rig verify FILE --head HASH` shows whether a copy of the file is the one that this certificate was made from.",
)
EVIDENCE_OF_TABLE = (
    "The numbers above come from this table; there is no run file. Its SHA-256 shows whether a copy of the table is "
    "the one that this certificate was made from, not that its numbers are those of the instruments.",
)
ANNEX = (
    "Shares are of the squared combined standard uncertainty. Type A: evaluated from the scatter of the run; "
    "type B: from certificates and other knowledge.",
)
PAGE = {
    "title": "Calibration certificate",
    "simulated": "SIMULATED",
    "warning": "Simulated run: no real instrument was involved. This is not a certificate.",
    "end": "end of the certificate",
}
VERDICTS: Mapping[Verdict, str] = {
    "pass": "pass",
    "fail": "fail",
    "conditionalPass": "conditional pass",
    "conditionalFail": "conditional fail",
    "noPass": "not passed",
    "noFail": "not failed",
}


def uncertainty(document: Document) -> tuple[str, ...]:
    """Sentences on the uncertainties, of such results as the certificate has."""
    labels = [one.label for table in document.tables for one in table.results]
    told = {"coefficient ": CORRELATED, "inferred ": INFERRED}
    found = (words for begin, words in told.items() if any(label.startswith(begin) for label in labels))
    coverage = [_LIES]
    if any(LACKS in one for one in document.models):
        coverage = [_BY_MODEL]
    if any(one.name == "no name" for one in document.effects):
        coverage = [*(one for one in coverage if one != _LIES), _NAMELESS]
    first = (_UNCERTAINTY.format(" ".join(coverage)),)
    return (*first, " ".join(found)) if any(label.startswith(tuple(told)) for label in labels) else first


def count(number: int, noun: str) -> str:
    """A number with its noun: `1 point`, `2 points`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
