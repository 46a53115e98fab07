"""Sentences that stand on every certificate. A laboratory's own go into `remarks` of certificate.toml."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rig.fitter.budget.coverage import coverage_factor
from rig.verbs.budget.coverage import ROUNDED
from rig.verbs.certificate.blocks import percent
from rig.verbs.certificate.document import Document
from rig.verbs.certificate.measured import Statement, Verdict

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
LACKS = "which lacks effects"
"""How a sentence of `Document.models` says that effects were found and not accepted."""
_LIES = "The value of the quantity lies within it with the stated coverage probability."
STATES = "Results hold in the states and conditions that stand in brackets."
_IN_STATES = "Where states of effects stand in brackets, this is so in these states."
_BY_MODEL = (
    "It counts how far the effects that the model lacks move a result, in the states and conditions that stand in "
    "brackets: over these the coverage is at least the stated one, as far as the model with the effects holds."
)
_NAMELESS = (
    "The trace left an error without a name: of the results of that item, the coverage probability is stated under the "
    "condition that the model holds at their points."
)
FACTOR = (
    "k is the factor of Student's t distribution for the coverage probability and the effective degrees of freedom of "
    "the result, which combine those of all its contributions (Welch-Satterthwaite): it is larger where they are few, "
    "so it is not 2 throughout{}."
)
OTHER_FACTOR = "; a note names the results with the factor of another distribution"
_UNCERTAINTY = (
    "The expanded uncertainty is the combined standard uncertainty times the coverage factor k. {} {} It was evaluated "
    "after JCGM 100:2008 (GUM) from the scatter of the run and the certificates of the equipment; it does not include "
    "the behaviour of the item after the calibration."
)
UNCERTAINTY = (_UNCERTAINTY.format(FACTOR.format(""), _LIES),)
CORRELATED = "Coefficients of one item are correlated: the uncertainty of an output does not follow from theirs alone."
INFERRED = (
    "A result that is called inferred is the quantity for one reading in use at the point. Its value is the point, and "
    "its uncertainty that of the quantity that the reading gives. A note says of how many readings it is the mean."
)
CONDITIONS = ("Of all accepted observations of the run.",)
BY_RECORD = "The laboratory states {} by its own record; the run did not record it."
HOLDINGS = (
    "Conditions that the certificates of the equipment name, where the equipment stands: those of another place, such "
    "as a chamber in which the items stood, do not count.",
)
EXTERNAL = (
    "These results are not of this laboratory. They stand here as the certificate of their provider states them; "
    "statements of conformity are not about them.",
)
SUPPLIED = "These data were supplied by the customer. This laboratory did not verify them and does not answer for them."
AFFECTED = (
    "Results for which the table says so depend on data of the customer: they are valid only as far as these data are "
    "right."
)
JUDGED = "Statements of conformity are against tolerances that the customer supplied, where the table says so."
IDENTITY: Mapping[str, str] = {"maker": "manufacturer", "model": "model", "serial": "serial number"}
"""Parts of an item's identity that the customer may state, for people."""
AFFECTS: Mapping[str, str] = {"": "nothing", "results": "results", "conformity": "statement of conformity"}
"""What data of the customer can affect, for people."""
SEE_SUPPLIED = (
    "Results can be affected by data that the customer supplied and this laboratory did not verify: they are listed "
    "under Data supplied by the customer."
)
CONFORMITY = ("The statements hold for the results above, at the time of the calibration.",)
EFFECTS = "The declared model does not have these effects; they were found in the data of the run."
UNCONFIRMED = "The cause of an effect that no further run has confirmed is known from these data alone."
EVIDENCE = (
    "Every measured number above comes from this run file, and that of a confirmed effect from the further run that "
    "stands with it, too. The head hash is the fingerprint of all records of the file: "
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
    "warning": "Simulated run: no real instrument was involved. This is not a certificate, and its number is none of "
    "the laboratory's.",
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
    states = any(STATES in one for one in document.models)
    coverage = [_LIES, _IN_STATES] if states else [_LIES]
    if any(LACKS in one for one in document.models):
        coverage = [_BY_MODEL]
    if any(one.name == "no name" for one in document.effects):
        coverage = [*(one for one in coverage if one not in (_LIES, _IN_STATES)), _NAMELESS]
    every = [one for table in document.tables for one in table.results]
    own = any(abs(one.factor - coverage_factor(float(one.probability), one.df)) > ROUNDED for one in every)
    first = (_UNCERTAINTY.format(FACTOR.format(OTHER_FACTOR if own else ""), " ".join(coverage)),)
    return (*first, " ".join(found)) if any(label.startswith(tuple(told)) for label in labels) else first


_OF_VERDICTS: Mapping[Verdict, tuple[str, str]] = {
    "pass": ("conforms with its tolerance", "conform with their tolerances"),
    "fail": ("does not conform with its tolerance", "do not conform with their tolerances"),
    "conditionalPass": (
        "is within its tolerance, but nearer to a limit than the guard band",
        "are within their tolerances, but nearer to a limit than the guard band",
    ),
    "conditionalFail": (
        "is outside its tolerance, but nearer to a limit than the guard band",
        "are outside their tolerances, but nearer to a limit than the guard band",
    ),
    "noPass": (
        "has no statement of conformity, and is rather within its tolerance",
        "have no statement of conformity, and are rather within their tolerances",
    ),
    "noFail": (
        "has no statement of conformity, and is rather outside its tolerance",
        "have no statement of conformity, and are rather outside their tolerances",
    ),
}


def conformity(statements: Sequence[Statement]) -> Iterator[str]:
    """The statements on one item together: parts of a sentence, one for each verdict.

    Results that conform are counted, with the lowest probability of conformity; others are named.
    """
    for verdict, (one, several) in _OF_VERDICTS.items():
        mine = [s for s in statements if s.verdict == verdict]
        if len(mine) == 1:
            yield f"{mine[0].what} {one}"
        elif mine and verdict == "pass":
            lowest = min(mine, key=lambda s: float(s.probability.strip("<> ")))
            more, least = lowest.probability.startswith("> "), percent(lowest.probability.removeprefix("> "))
            of = f"all {len(mine)}" if len(mine) == len(statements) else f"{len(mine)} of {len(statements)}"
            yield f"{of} results {several}, each with a probability of {'more than' if more else 'at least'} {least}"
        elif mine:
            yield f"{', '.join(s.what for s in mine)} {several}"


def count(number: int, noun: str) -> str:
    """A number with its noun: `1 point`, `2 points`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def disclaimer(*affected: str) -> tuple[str, ...]:
    """Sentences on data that the customer supplied, by what they can affect."""
    more = {"results": AFFECTED, "conformity": JUDGED}
    return (SUPPLIED, *(sentence for what, sentence in more.items() if what in affected))
