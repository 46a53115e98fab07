"""A further run beside one that was traced: which explanation holds, and what a run could tell before it is made."""

from fitter.confirm.compare import CARRIED_ON
from fitter.confirm.judge import Confirmation, Confirmed, Member, SensorError, confirm, confirm_all
from fitter.confirm.predict import NOTHING, Pair, Separation, separation
from fitter.confirm.question import Hypothesis, Question, questions_of
from fitter.confirm.together import Together

__all__ = [
    "CARRIED_ON",
    "NOTHING",
    "Confirmation",
    "Confirmed",
    "Hypothesis",
    "Member",
    "Pair",
    "Question",
    "SensorError",
    "Separation",
    "Together",
    "confirm",
    "confirm_all",
    "questions_of",
    "separation",
]
