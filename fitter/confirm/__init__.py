"""A further run beside one that was traced: which explanation holds, and what a run could tell before it is made."""

from fitter.confirm.judge import Confirmation, Member, SensorError, confirm
from fitter.confirm.predict import NOTHING, Separation, separation
from fitter.confirm.question import Hypothesis, Question, noise_of, questions_of
from fitter.confirm.together import Together, join

__all__ = [
    "NOTHING",
    "Confirmation",
    "Hypothesis",
    "Member",
    "Question",
    "SensorError",
    "Separation",
    "Together",
    "confirm",
    "join",
    "noise_of",
    "questions_of",
    "separation",
]
