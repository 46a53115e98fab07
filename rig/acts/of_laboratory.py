"""Acts of a laboratory: proposals and approvals, reports, certificates."""

from __future__ import annotations

import subprocess
import sys
from datetime import UTC, datetime

from pydantic import Field

from rig.acts.act import Act, Told
from rig.acts.of_queue import BENCH, PROCEDURE
from rig.acts.of_runs import RUN
from rig.acts.places import Places
from rig.drivers.clock import RealClock
from rig.errors import RigError, UsageError
from rig.lab.proposals import decide, known
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import is_simulated
from rig.who import Operator

PROPOSAL = Field(ge=1, description="number of the proposal")
WHY = Field("", max_length=500, description="reason")
_MOST_S = 1800.0


class Propose(Act, act="propose", slow=True, proposes=True):
    """Run a procedure dry, and propose it with what the dry run shows."""

    procedure: str = PROCEDURE
    bench: str = BENCH
    why: str = WHY

    def will(self, places: Places) -> str:
        """Which files. Raises `UsageError` if there are no such ones."""
        return f"{places.bench(self.bench).name} runs {places.procedure(self.procedure).name} dry."

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Take the dry run, and write the proposal."""
        from rig.verbs.propose import proposed  # noqa: PLC0415 - loads the simulation

        procedure, bench = places.procedure(self.procedure), places.bench(self.bench)
        made = proposed(procedure, bench, by, why=self.why, on_progress=lambda _: None)
        outcome = made.asked.dry["outcome"]
        words = f"proposal {made.number}: its dry run is {outcome}"
        return Told(words, {"proposal": made.number, "outcome": outcome}, f"proposal/{made.number}")


class Approve(Act, act="approve", role="approver", again=True):
    """Approve exactly the files of a proposal that somebody else made, for one run."""

    proposal: int = PROPOSAL
    why: str = WHY

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Write it into the log."""
        decide(places.laboratory, self.proposal, "approved", self.why, by)
        return Told(f"proposal {self.proposal} is approved", page=f"proposal/{self.proposal}")


class Decline(Act, act="decline", role="approver", again=True):
    """Decline a proposal."""

    proposal: int = PROPOSAL
    why: str = WHY

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Write it into the log."""
        known(places.laboratory.log(), self.proposal)
        decide(places.laboratory, self.proposal, "declined", self.why, by)
        return Told(f"proposal {self.proposal} is declined", page=f"proposal/{self.proposal}")


class Report(Act, act="report", slow=True):
    """Trace a run, and write the report."""

    run: str = RUN

    def will(self, places: Places) -> str:
        """Which run. Raises `UsageError` if there is no such one."""
        return f"{places.run(self.run).name} is traced."

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Call `rig trace`, so that the report is the one of the command line."""
        return _written(places, self.run, "trace", "--report", f"reports/{_stem(places, self.run)}.html")


class Calibrate(Act, act="calibrate", slow=True):
    """Fit the declared model to a run, and write the calibration."""

    run: str = RUN

    def will(self, places: Places) -> str:
        """Which run. Raises `UsageError` if there is no such one."""
        return f"{places.run(self.run).name} is fitted."

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Call `rig fit`, so that the calibration is the one of the command line."""
        return _written(places, self.run, "fit", "--out", f"calibrations/{_stem(places, self.run)}.json")


def _stem(places: Places, run: str) -> str:
    return places.run(run).name.removesuffix(".sqlite")


def _written(places: Places, run: str, verb: str, option: str, name: str) -> Told:
    """Call a verb on a run that writes a file of the laboratory. Raises `RigError`."""
    path = places.folder / name
    path.parent.mkdir(exist_ok=True)
    command = [sys.executable, "-m", "rig", verb, str(places.run(run)), option, str(path)]
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=_MOST_S, check=False
        )
    except subprocess.TimeoutExpired:
        raise RigError(f"rig {verb} of {run} took more than {_MOST_S / 60:.0f} min") from None
    if not path.exists() or done.returncode not in (0, 3):
        raise UsageError(done.stderr.strip().removeprefix("rig: ")[-2000:] or f"rig {verb} wrote nothing")
    return Told(f"{name} is written", {"file": name}, f"file/{name}")


class Sign(Act, act="sign", role="approver", again=True, slow=True):
    """Issue the certificate of a run, approved by you."""

    run: str = RUN
    because: str = Field("", max_length=500, description="why there is a second certificate of this run")

    def will(self, places: Places) -> str:
        """Which run. Raises `UsageError` if there is no such one."""
        return f"{places.run(self.run).name} gets a certificate."

    def carry_out(self, places: Places, by: Operator) -> Told:
        """Issue it with the settings of the laboratory."""
        from rig.verbs.certificate.issue import Issue, check_extras  # noqa: PLC0415 - few acts need it
        from rig.verbs.certificate.request import CertificateRequest  # noqa: PLC0415
        from rig.verbs.certificate.signing import issue_signed  # noqa: PLC0415

        run, out = places.run(self.run), places.folder / "certificates"
        with RunReader.open(run) as reader:
            simulated = is_simulated(reader)
        day = datetime.fromtimestamp(RealClock().utc(), UTC).date()
        settings = places.certificate_settings(run)
        asked = CertificateRequest((run,), day, settings=settings, today=None if simulated else day)
        how = Issue(out, because=self.because)
        check_extras(how)
        made = issue_signed(places.laboratory, by, asked, how)
        number = made.document.number
        return Told(f"certificate {number} is issued", {"certificate": number}, "certificates")
