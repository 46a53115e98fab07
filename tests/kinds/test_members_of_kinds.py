"""Members of a kind that are imported by name have the arguments of the methods of `Kind` whose place they take."""

from __future__ import annotations

import inspect

import pytest

from rig.procedures.kind import Kind
from rig.procedures.kinds import kinds

BY_NAME = type(vars(type(kinds()["pitch-roll"]))["unused"])
MEMBERS = [
    (kind, name)
    for kind, one in kinds().items()
    for name, own in vars(type(one)).items()
    if isinstance(own, BY_NAME) and not isinstance(inspect.getattr_static(Kind, name), property)
]


@pytest.mark.parametrize(("kind", "name"), MEMBERS, ids=str)
def test_a_member_imported_by_name_takes_the_arguments_of_its_method(kind, name):
    """Mypy does not compare them. Names of positional arguments may differ; further arguments have defaults."""
    method, given = inspect.getattr_static(Kind, name), getattr(kinds()[kind], name)
    wanted = list(inspect.signature(method).parameters.values())[1:]
    own = list(inspect.signature(given).parameters.values())
    named = [one.name for one in wanted if one.kind is one.KEYWORD_ONLY]
    assert [one.kind for one in own[: len(wanted)]] == [one.kind for one in wanted]
    assert [one.name for one in own[: len(wanted)] if one.kind is one.KEYWORD_ONLY] == named
    assert all(one.default is not one.empty for one in own[len(wanted) :])
