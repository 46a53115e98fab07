"""Confirmation of a trace by a further run: proposals, expected separation, and results."""

from rig.verbs.confirm.answers import Confirmed, chance, ends, evidence, following, judge, sentences, sizes, unfit
from rig.verbs.confirm.calibration import fit_confirmed, settled_as, with_confirmed
from rig.verbs.confirm.first import First, open_traced, traces_kept
from rig.verbs.confirm.further_plan import plan_for, procedure_text
from rig.verbs.confirm.proposal import SURE, Proposal
from rig.verbs.confirm.proposals import (
    Inseparable,
    consider,
    inseparable,
    ordered,
    otherwise,
    propose,
    unlikely,
)

__all__ = [
    "SURE",
    "Confirmed",
    "First",
    "Inseparable",
    "Proposal",
    "chance",
    "consider",
    "ends",
    "evidence",
    "fit_confirmed",
    "following",
    "inseparable",
    "judge",
    "open_traced",
    "ordered",
    "otherwise",
    "plan_for",
    "procedure_text",
    "propose",
    "sentences",
    "settled_as",
    "sizes",
    "traces_kept",
    "unfit",
    "unlikely",
    "with_confirmed",
]
