"""From a trace to the run that confirms it: what could be done, what it would tell, what it told."""

from rig.closed_loop.confirm.answers import Confirmed, chance, evidence, judge, sentences, sizes
from rig.closed_loop.confirm.calibration import confirmed_by, fit_attitude_confirmed, fit_whole_plots_confirmed
from rig.closed_loop.confirm.first import First, open_traced
from rig.closed_loop.confirm.plans import plan_for, planned, procedure_text
from rig.closed_loop.confirm.proposals import ENOUGH, Proposal, otherwise, propose

__all__ = [
    "ENOUGH",
    "Confirmed",
    "First",
    "Proposal",
    "chance",
    "confirmed_by",
    "evidence",
    "fit_attitude_confirmed",
    "fit_whole_plots_confirmed",
    "judge",
    "open_traced",
    "otherwise",
    "plan_for",
    "planned",
    "procedure_text",
    "propose",
    "sentences",
    "sizes",
]
