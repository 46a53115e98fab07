"""Every command's help has three examples or more, and they are commands that exist with options that exist."""

from __future__ import annotations

import re
import shlex

import pytest

from rig.cli.commands import COMMANDS, loaded

LINE = re.compile(r"- `(.*)`")


def examples(name: str) -> list[str]:
    return LINE.findall((loaded(name).help or "").partition("Examples:")[2])


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_a_command_has_three_examples_that_can_be_typed(name: str):
    found = examples(name)
    assert len(found) >= 3
    for example in found:
        rig, own, *words = shlex.split(example.partition(" && ")[0])
        assert (rig, own) == ("rig", name)
        command = loaded(own)
        while hasattr(command, "commands") and words:
            command, words = command.commands[words[0]], words[1:]
        command.make_context(own, words)  # raises for options, arguments and values that there are not
