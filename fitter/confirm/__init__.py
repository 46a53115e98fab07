"""A further run compared with a traced one: the remaining explanation, and the expected result of a planned run."""

from rig.fitter.confirm.compare import CARRIED_ON, NOTHING, Pair, lasting
from rig.fitter.confirm.judgement import BY_BOTH, Confirmation, Confirmed, Member, confirm, confirm_all
from rig.fitter.confirm.points import Choice, Points
from rig.fitter.confirm.predict import Separation, separation
from rig.fitter.confirm.prediction import SensorError
from rig.fitter.confirm.question import Hypothesis, Question, questions_of
from rig.fitter.confirm.runs import Later
from rig.fitter.confirm.still_open import still_open
from rig.fitter.confirm.together import Together

__all__ = [
    "BY_BOTH",
    "CARRIED_ON",
    "NOTHING",
    "Choice",
    "Confirmation",
    "Confirmed",
    "Hypothesis",
    "Later",
    "Member",
    "Pair",
    "Points",
    "Question",
    "SensorError",
    "Separation",
    "Together",
    "confirm",
    "confirm_all",
    "lasting",
    "questions_of",
    "separation",
    "still_open",
]
