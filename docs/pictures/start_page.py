"""Draw the pictures of the start page from a dry run of `examples/flow-lab`: live page, report, certificate.

`python docs/pictures/start_page.py`, with a Chromium on the machine and the extra `certificate`.
"""

from __future__ import annotations

import base64
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from rig.examples import example

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[1] / "tests" / "page"))
from chromium import Page, chromium  # noqa: E402

RIG = [sys.executable, "-m", "rig"]
WIDTH = 900


def rig(*words: str, cwd: Path) -> str:
    """What a command prints."""
    return subprocess.run([*RIG, *words], cwd=cwd, check=True, capture_output=True, text=True).stdout


def shot(page: Page, address: str, name: str, height: int, ready: str = "true", top: str = "") -> None:
    """A part of a page, from its top or from the heading that has the words `top`, once it is ready."""
    page.size(WIDTH, height)
    page.open(address)
    page.until(ready)
    page.ask("new Promise(done => setTimeout(done, 1500))")  # bars grow in a second
    heading = f"[...document.querySelectorAll('h1,h2,h3')].find(h => h.innerText.includes('{top}'))"
    y = page.ask(f"{heading}.getBoundingClientRect().top + scrollY - 12") if top else 0
    clip = {"x": 0, "y": y, "width": WIDTH, "height": height, "scale": 1}
    picture = page.call("Page.captureScreenshot", format="png", captureBeyondViewport=True, clip=clip)
    (HERE / f"{name}.png").write_bytes(base64.b64decode(picture["data"]))


def main() -> None:
    """Run, trace and certify in a copy of the example; picture what comes of it."""
    with tempfile.TemporaryDirectory() as scratch, chromium(Path(scratch)) as page:
        lab = Path(scratch) / "lab"
        shutil.copytree(example("flow-lab"), lab)
        told = rig("run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml", cwd=lab)
        run = told.splitlines()[0]
        rig("trace", run, "--report", "trace.html", cwd=lab)
        rig("certificate", run, "--traced", "--out", "certificates", cwd=lab)
        watch = subprocess.Popen([*RIG, "watch", run, "--port", "0"], cwd=lab, stdout=subprocess.PIPE, text=True)
        try:
            assert watch.stdout is not None
            shot(
                page,
                watch.stdout.readline().strip(),
                "live_page",
                630,
                "document.body.innerText.includes('run created')",
            )
        finally:
            watch.terminate()
            watch.wait(15)
        shot(page, (lab / "trace.html").as_uri(), "report", 700)
        (certificate,) = (lab / "certificates").glob("*.html")
        shot(page, certificate.as_uri(), "certificate", 850)


if __name__ == "__main__":
    main()
