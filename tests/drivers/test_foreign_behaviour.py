"""What twelve foreign instruments did that a file took without a word: `proving/notes/foreign_instruments.md`."""

from __future__ import annotations

import pytest
from declared_bench import DeclaredBench

from rig.contracts.declared.forms import step_of
from rig.contracts.declared.instrument import parse
from rig.drivers.errors import BadReply

SOURCE = r"""
maker = "ACME"
model = "T1"
[identity]
ask = "ID?"
answer = "{maker} {model}"
[source]
unit = "degC"
low = -40
high = 250
set = { tell = "SP {value:.2}", answer = "SP {value:.2}" }
read = "PV?"
safe_value = 20
tolerance = 0.1
dwell_s = 0
"""


@pytest.fixture
def bench():
    made: list[DeclaredBench] = []

    def make(text: str, **how) -> DeclaredBench:
        made.append(DeclaredBench(text, **how))
        return made[-1]

    yield make
    for one in made:
        one.close()


def answers(it: DeclaredBench, **said: str) -> None:
    """The twin says this to lines that begin so."""
    before = it.twin._carried_out

    def carried_out(line: str):
        found = next((text for begin, text in said.items() if line.startswith(begin)), None)
        return (found, 0.0) if found is not None else before(line)

    it.twin._carried_out = carried_out


class TestSetpoints:
    def test_an_acknowledgement_with_another_value_is_no_acknowledgement(self, bench):
        """A bath beyond its limit answers with the setpoint that stays in force."""
        it = bench(SOURCE)
        it.it.prepare()
        it.it.set(25.0)
        answers(it, SP="SP 20.00")
        with pytest.raises(BadReply, match=r"'SP 20.00' to 'SP 240.00'.* it took 20 and not 240"):
            it.it.set(240.0)

    @pytest.mark.parametrize(("printed", "step"), [("100", 1.0), ("0FA0", 1.0), ("1.25", 0.01), ("+1.250E+02", 0.1)])
    def test_fewer_digits_than_were_sent_are_the_same_value(self, printed, step):
        assert step_of(printed) == pytest.approx(step)

    def test_a_source_that_says_settled_somewhere_else_has_not_arrived(self, bench):
        """A pressure controller drops a setpoint beyond its range, and reports that it has settled at the old one."""
        it = bench(SOURCE + 'settled = "ARRIVED?"\n')
        it.it.prepare()
        it.it.set(200.0)
        answers(it, ARRIVED="1", PV="149.99")
        assert not it.it.read().settled
        answers(it, PV="199.99")
        assert it.it.read().settled

    def test_a_setpoint_that_nothing_compares_is_refused(self):
        text = SOURCE.replace(', answer = "SP {value:.2}"', "").replace("tolerance = 0.1", 'settled = "ARRIVED?"')
        with pytest.raises(ValueError, match=r"setpoint is missing: .* or read with tolerance"):
            parse(text)
