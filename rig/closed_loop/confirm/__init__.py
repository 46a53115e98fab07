"""Confirmation of a trace by a further run: proposals, expected separation, and results."""

from rig.closed_loop.confirm.answers import Confirmed, chance, evidence, following, judge, sentences, sizes
from rig.closed_loop.confirm.calibration import fit_confirmed
from rig.closed_loop.confirm.first import First, open_traced
from rig.closed_loop.confirm.plans import plan_for, procedure_text
from rig.closed_loop.confirm.proposal import SURE, Proposal
from rig.closed_loop.confirm.proposals import (
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
    "sizes",
    "unlikely",
]
