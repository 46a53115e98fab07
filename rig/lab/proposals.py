"""Two keys: a run is proposed, and somebody else approves exactly these bytes, for one run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rig.errors import UsageError
from rig.lab.laboratory import Laboratory, Log, Proposal
from rig.procedures.present.shell import shell_word
from rig.run_file.approval import Approval, digests_of
from rig.run_file.events.laboratory import ApprovalUsed, Decided, Proposed
from rig.run_file.read.reader import RunReader
from rig.who import PROVEN, Operator, login_of


def propose(laboratory: Laboratory, asked: Proposed) -> Proposal:
    """Write a proposal into the log, with the next number."""
    numbers: list[int] = []

    def numbered(log: Log) -> list[Proposed]:
        numbers.append(len(log.proposals) + 1)
        return [Proposed(**{**vars(asked), "number": numbers[-1]})]

    return laboratory.append(numbered).proposals[numbers[-1]]


def decide(laboratory: Laboratory, number: int, decision: str, why: str, by: Operator) -> Proposal:
    """Approve or decline a proposal.

    Args:
        laboratory: has the log.
        number: of the proposal.
        decision: "approved" or "declined".
        why: reason.
        by: the person, whose password was right.

    Raises:
        UsageError: there is none that waits, this person proposed it, or the dry run was not complete.
    """

    def decided(log: Log) -> list[Decided]:
        proposal = known(log, number)
        if proposal.state != "waiting":
            raise UsageError(f"proposal {number} is {proposal.state}: propose it again")
        asked = proposal.asked
        if decision == "approved" and asked.who_by not in (*PROVEN, "token"):
            raise UsageError(f"nothing proves who proposed it ({asked.who}): propose it again with --login")
        if decision == "approved" and login_of(asked.who) == login_of(by.name):
            raise UsageError(f"{by.name} proposed it: somebody else approves it")
        if decision == "approved" and asked.dry.get("outcome") != "complete":
            raise UsageError(f"its dry run was not complete, it ended: {asked.dry.get('outcome')}; propose it again")
        digests, run_list = digests_of(asked.documents), asked.run_list
        return [
            Decided(
                decision=decision,
                number=number,
                digests=digests,
                run_list=run_list,
                why=why,
                who=by.name,
                who_by=by.by,
            )
        ]

    if by.by != "password":
        raise UsageError("a decision needs a person with a password")
    return laboratory.append(decided).proposals[number]


def known(log: Log, number: int) -> Proposal:
    """A proposal by its number. Raises `UsageError`."""
    if number not in log.proposals:
        raise UsageError(f"there is no proposal {number} (there are {len(log.proposals)})")
    return log.proposals[number]


@dataclass(frozen=True)
class Permission:
    """An approval of exactly these files that no run has used.

    Attributes:
        laboratory: has the log.
        number: of the proposal.
        digests: SHA-256 of the documents, by name.
        run_list: hash of the run list.
    """

    laboratory: Laboratory
    number: int
    digests: Mapping[str, str]
    run_list: str

    def use(self, run: str, who: str) -> str:
        """Use it for a run; returns the document that the run keeps.

        Raises:
            UsageError: another run has used it meanwhile.
        """

        def used(log: Log) -> list[ApprovalUsed]:
            if not self._holds(log.proposals.get(self.number)):
                raise UsageError(f"the approval of proposal {self.number} was used by another run a moment ago")
            return [ApprovalUsed(number=self.number, run=run, who=who)]

        proposal = self.laboratory.append(used).proposals[self.number]
        with RunReader.open(self.laboratory.log_file) as reader:
            records, head = reader.head()
        assert proposal.decided is not None
        people = (proposal.asked.who, proposal.decided.who)
        return Approval(self.number, run, *people, self.run_list, records, head.hex(), self.digests).text()

    def _holds(self, proposal: Proposal | None) -> bool:
        return (
            proposal is not None
            and proposal.state == "approved"
            and proposal.decided is not None
            and proposal.decided.digests == self.digests
            and proposal.decided.run_list == self.run_list
        )


def permission(
    laboratory: Laboratory | None, documents: Mapping[str, str], run_list: str, procedure: Path | str
) -> Permission:
    """The permission for a real run on a bench with `approval = true`.

    Raises:
        UsageError: nobody approved exactly these files; the message says what to do.
    """
    how = f"rig propose {shell_word(procedure)} --bench BENCH, then somebody else: rig approve NUMBER --login LOGIN"
    if laboratory is None:
        raise UsageError(
            f"this bench says approval = true, and a run on it is proposed and approved by itself in a laboratory with "
            f"people (rig person): {how}. Further runs of a loop or of rig confirm are proposed as files of their own"
        )
    digests = digests_of(documents)
    proposals = laboratory.verified_log().proposals.values()
    for proposal in proposals:
        found = Permission(laboratory, proposal.number, digests, run_list)
        if found._holds(proposal):
            return found
    raise UsageError(f"this bench says approval = true, and {_nearest(list(proposals), digests, run_list)}: {how}")


def _nearest(proposals: list[Proposal], digests: Mapping[str, str], run_list: str) -> str:
    """Why no proposal permits a run, of the one that comes nearest."""
    same = [one for one in proposals if digests_of(one.asked.documents) == digests and one.asked.run_list == run_list]
    if same:
        last = same[-1]
        return f"proposal {last.number} of exactly these files is {last.state}"
    approved = [one for one in proposals if one.state == "approved"]
    if approved:
        last, own = approved[-1], digests_of(approved[-1].asked.documents)
        others = sorted(name for name in {*own, *digests} if own.get(name) != digests.get(name)) or ["the run list"]
        return f"proposal {last.number}, which is approved, is of another {', '.join(others)}"
    return "nobody has approved these files"


def findings_of_approval(laboratory: Laboratory, approval: Approval) -> list[str]:
    """Contradictions between the approval of a run and the laboratory's log, as sentences."""
    if not laboratory.log_file.exists():
        return [f"{laboratory.log_file} is not there, which the approval is from"]
    with RunReader.open(laboratory.log_file) as reader:
        if not reader.holds(approval.log_records, bytes.fromhex(approval.log_head)):
            return [f"{laboratory.log_file} has no record {approval.log_records} of the hash that the approval names"]
        log = Log()
        for record in reader.records():
            log.add(record)
            if record.seq == approval.log_records:
                break
    proposal = log.proposals.get(approval.proposal)
    if proposal is None or proposal.decided is None or proposal.decided.decision != "approved":
        return [f"{laboratory.log_file} has no approval of proposal {approval.proposal}"]
    found = []
    told = proposal.decided
    if (told.digests, told.run_list) != (approval.digests, approval.run_list):
        found.append(f"proposal {approval.proposal} in {laboratory.log_file} is of other files")
    if (proposal.asked.who, told.who) != (approval.proposed_by, approval.approved_by):
        found.append(f"proposal {approval.proposal} in {laboratory.log_file} is of other people")
    if proposal.used != approval.run:
        found.append(f"the approval of proposal {approval.proposal} was used by {proposal.used or 'no run'}")
    return found
