"""The approval of a run, kept among its documents: who proposed and who approved exactly these files.

It is part of the run's first record, so that whatever seals the run seals the approval.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass

from rig.bench.config import parse_toml
from rig.errors import ConfigurationError
from rig.files.toml_text import toml_text
from rig.who import login_of

DOCUMENT = "approval.toml"


def digests_of(documents: Mapping[str, str]) -> dict[str, str]:
    """SHA-256 of the documents that are approved, by name: all but the approval itself."""
    kept = {name: text for name, text in documents.items() if name != DOCUMENT}
    return {name: hashlib.sha256(text.encode()).hexdigest() for name, text in sorted(kept.items())}


def digest_of(documents: Mapping[str, str], run_list: str) -> str:
    """One SHA-256 of the documents that are approved, and of the run list."""
    told = "".join(f"{digest}  {name}\n" for name, digest in digests_of(documents).items())
    return hashlib.sha256(f"{told}{run_list}  run list\n".encode()).hexdigest()


@dataclass(frozen=True)
class Approval:
    """An approval, as a run has it.

    Attributes:
        proposal: number of the proposal.
        run: id of the run that it is for.
        proposed_by: who proposed it.
        approved_by: who approved it.
        run_list: hash of the run list.
        log_records: number of records of the laboratory's log when the run began; `log_head` is the hash of the last.
        digests: SHA-256 of the approved documents, by name.
    """

    proposal: int
    run: str
    proposed_by: str
    approved_by: str
    run_list: str
    log_records: int
    log_head: str
    digests: Mapping[str, str]

    def text(self) -> str:
        """The document."""
        return toml_text(asdict(self))

    @classmethod
    def of(cls, text: str) -> Approval:
        """An approval from a document. Raises `ConfigurationError`."""
        values = parse_toml(text, DOCUMENT)
        fields = cls.__dataclass_fields__
        numbers = all(type(values.get(name)) is int for name in ("proposal", "log_records"))
        digests = values.get("digests")
        texts = [value for name, value in values.items() if name not in ("proposal", "log_records", "digests")]
        if (
            values.keys() != fields.keys()
            or not (numbers and isinstance(digests, dict))
            or not all(isinstance(one, str) for one in (*texts, *digests.values()))
        ):
            raise ConfigurationError(f"{DOCUMENT} is no approval: it has {', '.join(values) or 'nothing'}")
        return cls(**values)


def defect(text: str | None, digests: Mapping[str, str], run_list: str, run: str) -> str:
    """Why a run that needs an approval has none, the end of a sentence that begins with "it"; "" if it has one.

    Args:
        text: the document; None if there is none.
        digests: SHA-256 of the run's documents, by name.
        run_list: hash of its run list.
        run: its id.
    """
    if text is None:
        return "has no approval, and its bench says approval = true"
    try:
        found = Approval.of(text)
    except ConfigurationError as error:
        return f"has no approval: {error}"
    given = {name: digest for name, digest in digests.items() if name != DOCUMENT}
    others = sorted(name for name in {*given, *found.digests} if given.get(name) != found.digests.get(name))
    if others:
        return f"has an approval of other files than its own: {', '.join(others)}"
    if found.run_list != run_list:
        return "has an approval of another run list"
    if found.run != run:
        return f"has the approval of another run, {found.run}"
    if login_of(found.proposed_by) == login_of(found.approved_by):
        return f"has an approval by the person who proposed it, {found.approved_by}"
    return ""
