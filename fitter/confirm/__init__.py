"""A further run compared with a traced one: the remaining explanation, and the expected result of a planned run."""

from fitter.confirm.compare import CARRIED_ON, NOTHING, Pair
from fitter.confirm.judge import Confirmation, Confirmed, Member, confirm, confirm_all
from fitter.confirm.points import Choice, Points
from fitter.confirm.predict import Separation, separation
from fitter.confirm.prediction import SensorError
from fitter.confirm.question import Hypothesis, Question, questions_of
from fitter.confirm.runs import Later
from fitter.confirm.still_open import still_open
from fitter.confirm.together import Together

__all__ = [
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
    "questions_of",
    "separation",
    "still_open",
]
