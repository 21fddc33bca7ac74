"""The process of one run of a sweep: `python -m fcsim.campaign.worker PARENT`, with its task as JSON on stdin.

What the run says goes to stderr, its log; the end of stdout is one line of JSON, how the run ended. The process dies with its parent,
so that nothing runs on when a sweep is killed.
"""

from __future__ import annotations

import json
import os
import sys
import traceback
from pathlib import Path
from time import strftime
from typing import TYPE_CHECKING

from fcsim.bench.workers.killable import die_with_parent
from fcsim.campaign.record import CRASHED, INTERRUPTED, REFUSED, Limits
from fcsim.errors import FcsimError, MissingDependency
from fcsim.interrupts import ended_by, ended_politely, is_interrupt
from fcsim.running.outputs import RunOptions

if TYPE_CHECKING:
    from fcsim.campaign.process import Task
    from fcsim.running.case import Case
    from fcsim.running.run import Summary
    from fcsim.timestep.step import Step


def run_task(task: Task) -> tuple[str, str]:
    """Make a run, or go on with it; how it ended, and what is to be said of that."""
    try:
        with ended_politely():
            summary = _made(task)
    except (KeyboardInterrupt, SystemError) as error:
        if not is_interrupt(error):
            raise
        return INTERRUPTED, f"interrupted by {ended_by(error)} before its first step"
    except MissingDependency as error:
        return CRASHED, str(error)
    except FcsimError as error:
        return REFUSED, str(error)
    except Exception as error:  # a fault of the case's script, a full disk: a result like any other
        traceback.print_exc()
        return (REFUSED if _comes_again(error, task) else CRASHED), f"{type(error).__name__}: {error}"
    _say(f"{summary.status}: {summary.computed} steps computed, {summary.wall_time:.1f} s {summary.message}")
    return summary.status, summary.message


def _comes_again(error: Exception, task: Task) -> bool:
    """Whether it is the script's own and not the machine's, whose disk has room another time; a file that is not there is the script's."""
    from fcsim.running.case import passed_through

    machine = isinstance(error, (OSError, MemoryError)) and not isinstance(
        error, (FileNotFoundError, IsADirectoryError, NotADirectoryError)
    )
    return not machine and passed_through(error, Path(task.script))


def _made(task: Task) -> Summary:
    from fcsim.campaign.named_case import named_case
    from fcsim.running.description import FILE
    from fcsim.running.run import run_case
    from fcsim.runtime import limited_threads
    from fcsim.solvers.plugins import load_plugins

    load_plugins([Path(path) for path in task.plugins])
    directory = task.place.run
    there = (directory / FILE).is_file()
    _say(f"{task.name}, {strftime('%Y-%m-%d %H:%M:%S')}" + (", goes on" if there and not task.anew else ""))
    directory.parent.mkdir(parents=True, exist_ok=True)
    with limited_threads():
        return run_case(
            named_case(task.script),
            task.assignments,
            directory,
            task.options,
            resume=there and not task.anew,
            overwrite=task.anew,
            accept_changes=task.accept_changes,
            announce=_say,
            watch=_show,
        )


def _show(case: Case, step: Step) -> None:
    for remark in step.remarks:
        _say(remark)
    if step.substeps > 1:
        _say(f"step {step.number}: cut into {step.substeps} parts")
    elif step.fell_back:
        _say(f"step {step.number}: fallback chain used ({'; '.join(f'{a.way}: {a.status}' for a in step.attempts)})")


def _say(text: str) -> None:
    """A line of the log; on a full disk it is the log that lacks it."""
    try:
        print(text, file=sys.stderr, flush=True)
    except OSError:
        return


def main() -> int:
    """Read the task, make the run, say how it ended."""
    from fcsim.campaign.process import Task

    die_with_parent()
    if os.getppid() != int(sys.argv[1]):  # it ended just before
        return 1
    told = json.loads(sys.stdin.read())
    reply = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what libraries print does not mix with the reply
    options = {**told.pop("options")}
    options["export_forms"] = tuple(options["export_forms"])
    task = Task(**{**told, "limits": Limits(**told["limits"])}, options=RunOptions(**options))
    status, message = run_task(task)
    print(json.dumps({"status": status, "message": message}), file=reply, flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
