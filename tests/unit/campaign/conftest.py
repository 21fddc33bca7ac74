"""A case of two parameters, and processes that take the place of its runs: they write what a run does, in milliseconds."""

from collections.abc import Callable
from pathlib import Path

import pytest

from fcsim.campaign import process
from fcsim.campaign.combinations import combinations, read_over
from fcsim.campaign.plan import Plan, make_plan
from fcsim.running.case import load_case

SCRIPT = """
from dataclasses import dataclass

@dataclass(frozen=True)
class Parameters:
    mu: float = 0.5
    how: str = "well"
    size: tuple[int, int] = (1, 2)
    steps: int = 3

def build(p):
    raise AssertionError("the fast tests have no case")
"""
ACTOR = """
import json, os, pathlib, signal, sys, time
task = json.loads(sys.stdin.read())
run = pathlib.Path(task["sweep"], "runs", task["name"])
again = run.is_dir()
run.mkdir(parents=True, exist_ok=True)
how = task["assignments"].get("how", "well")

def note(status):
    (run / "run.json").write_text(json.dumps({"format": "fcsim run", "case": "tiny", "status": status}))

def end(status, message=""):
    note(status)
    print(json.dumps({"status": status, "message": message}), flush=True)
    raise SystemExit(0)

signal.signal(signal.SIGTERM, lambda *_: end("interrupted", "by SIGTERM"))
note("running")
with (run / "starts").open("a") as file:
    file.write(f"{os.getpid()} {sys.argv[1]}\\n")
(run / "steps.csv").write_text("step,t,error,push\\n1,0.1,1e-9,5.0\\n2,0.2,3e-9,-7.5\\n")
print("a line of the log", file=sys.stderr)
if how == "dies" and not again:
    os.kill(os.getpid(), signal.SIGKILL)
if how == "babbles":
    print("what nobody understands")
    raise SystemExit(3)
if how == "grows":
    held = bytearray(300 * 2**20)
    for k in range(0, len(held), 4096):
        held[k] = 1
if how in ("grows", "hangs"):
    time.sleep(60)
if how == "diverges":
    end("not converged", "step 3 did not")
if how == "full":
    end("crashed", "OSError: [Errno 28] No space left on device")
end("finished")
"""


@pytest.fixture
def script_folder(tmp_path: Path) -> Path:
    """The folder tiny with its script."""
    folder = tmp_path / "tiny"
    folder.mkdir()
    (folder / "tiny.py").write_text(SCRIPT, encoding="utf-8")
    return folder


@pytest.fixture
def planned(script_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Plan]:
    """Plans of the case over what is given, whose runs are played."""
    monkeypatch.setattr(process, "WORKER", ("-c", ACTOR))

    def plan(*over: str, **assignments: str) -> Plan:
        return make_plan(load_case(script_folder), assignments, combinations([read_over(text) for text in over]))

    return plan
