"""A sweep's folder through all that may become of its runs; their processes are played, see conftest."""

import csv
import fcntl
import json
import os
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from fcsim.campaign.plan import Plan, make_plan
from fcsim.campaign.process import Task, make_run
from fcsim.campaign.record import Limits, Place, Record, runs_in, stands
from fcsim.campaign.results import Row, write_results
from fcsim.campaign.sweep import Progress, SweepOptions, sweep
from fcsim.command_line.main import main
from fcsim.errors import InputError
from fcsim.files import alone_in
from fcsim.running.case import load_case

Planned = Callable[..., Plan]


def statuses(rows: list[Row]) -> dict[str, str]:
    return {",".join(row.run.values.values()): row.record.status for row in rows}


def starts(directory: Path) -> int:
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in directory.glob("runs/*/starts"))


def test_what_became_of_each_run_is_named_and_only_what_may_end_otherwise_is_made_again(planned: Planned, tmp_path: Path) -> None:
    plan, out = planned("how=well,diverges,dies,babbles,full"), tmp_path / "out"
    rows = sweep(plan, out, SweepOptions(jobs=2))
    assert statuses(rows) == {"well": "finished", "diverges": "not converged", "dies": "crashed", "babbles": "crashed", "full": "crashed"}
    said = {row.run.values["how"]: row.record.message for row in rows}
    assert said["diverges"] == "step 3 did not"
    assert "SIGKILL" in said["dies"] and "exit code 3" in said["babbles"] and "No space left" in said["full"]
    with (out / "results.csv").open(encoding="utf-8") as file:
        table = {row["how"]: row for row in csv.DictReader(file)}
    assert {how: row["status"] for how, row in table.items()} == statuses(rows)
    assert table["well"]["push"] == "-7.5" and table["well"]["push_max"] == "5.0" and table["well"]["steps_done"] == "2"
    assert float(table["well"]["largest_error"]) == 3e-9
    content = json.loads((out / "results.json").read_text(encoding="utf-8"))
    assert [run["status"] for run in content["runs"]] == list(statuses(rows).values())
    assert all((out / run["folder"]).is_dir() for run in content["runs"])
    assert starts(out) == 5

    assert statuses(sweep(plan, out))["dies"] == "finished"  # it goes on, and so do the others that crashed
    assert starts(out) == 8
    assert "diverges" in statuses(sweep(plan, out, SweepOptions(retry=True)))
    assert starts(out) == 11  # two that crash, and the one that does not converge


def test_limits_end_a_run_and_looser_ones_let_it_go_on(planned: Planned, tmp_path: Path) -> None:
    plan, out = planned("how=hangs,grows"), tmp_path / "out"
    hangs, grows = (replace(plan, runs=(run,)) for run in plan.runs)
    late, large = SweepOptions(limits=Limits(time=0.5)), SweepOptions(limits=Limits(memory=150.0))
    (first,), (second,) = sweep(hangs, out, late), sweep(grows, out, large)
    assert (first.record.status, second.record.status) == ("time limit", "memory limit")
    made = starts(out)
    assert sweep(hangs, out, late)[0].record == first.record and sweep(grows, out, large)[0].record == second.record
    assert starts(out) == made
    known = first.record
    assert known.time_limit == 0.5 and known.seconds is not None and known.seconds >= 0.5
    assert not stands(known, Limits(time=2.0)) and not stands(known, Limits()) and stands(known, Limits(time=0.5, memory=1e6))
    assert stands(second.record, Limits(memory=150.0)) and not stands(second.record, Limits(memory=151.0))


@pytest.mark.parametrize(("status", "again"), [("finished", False), ("crashed", True), ("interrupted", True), ("waiting", True)])
def test_what_stands(status: str, again: bool) -> None:
    assert stands(Record(status), Limits()) is not again
    assert stands(Record(status), Limits(), retry=True) is not again


def test_an_end_of_the_run_that_nobody_noted_counts(planned: Planned, tmp_path: Path) -> None:
    """The sweep was killed after the run had ended and before it could note that."""
    plan, out = planned("how=well"), tmp_path / "out"
    sweep(plan, out)
    place = Place(out, plan.runs[0].name)
    place.record.unlink()
    assert place.known().status == "finished"
    place.write(Record("time limit", time_limit=1.0))
    assert place.known().status == "finished"
    (place.run / "run.json").write_text('{"status": "runn', encoding="utf-8")
    place.record.unlink()
    assert place.known().status == "interrupted"
    place.record.write_text('{"status": "splendid"}', encoding="utf-8")
    with pytest.raises(InputError, match="splendid"):
        place.known()


def test_values_written_otherwise_are_the_same_run_and_any_text_makes_a_folder(planned: Planned, tmp_path: Path) -> None:
    plan = planned("mu=0.5,0.50,5e-1,0.6", "size=1,2;3,4")
    assert len(plan.runs) == 4
    assert len(planned("mu=0,-0,0.0,-0.0").runs) == 1
    odd = planned("how=a b,../../etc,é;x,$(rm),-f," + "y" * 300)
    assert len(odd.runs) == 2  # ; comes before , as a separator
    odd = planned("how=a b,a/b,../../etc,$(rm),-f,é,\x1b[0m," + "y" * 300)
    assert len({run.name for run in odd.runs}) == 8
    out = tmp_path / "out"
    assert set(statuses(sweep(odd, out, SweepOptions(jobs=2))).values()) == {"finished"}
    assert sorted(path.name for path in (out / "runs").iterdir()) == sorted(run.name for run in odd.runs)


def test_values_that_are_none_are_refused_before_anything_begins(planned: Planned) -> None:
    with pytest.raises(InputError, match="combination 2 of 2: --set mu=x"):
        planned("mu=0.5,x")
    with pytest.raises(InputError, match="has the parameters mu, how"):
        planned("nu=0.5")
    with pytest.raises(InputError, match="mu in both"):
        planned("mu=0.5", mu="0.5")


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [("--solver", "NOPE", "solver 'NOPE': expected one of auto"), ("--steps", "-3", "--steps: expected a whole number >= 0, got -3")],
)
def test_what_no_run_could_take_is_refused_before_anything_begins(
    option: str, value: str, said: str, script_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["sweep", str(script_folder), "--over", "mu=0.1,0.2", "--out", str(tmp_path / "out"), f"{option}={value}"]
    assert main(arguments) == 2
    assert capsys.readouterr().err.startswith(f"fcsim: {said}") and not (tmp_path / "out").exists()


def test_only_the_same_sweep_goes_on_in_a_folder(planned: Planned, script_folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    sweep(planned("mu=0.1,0.2"), out)
    more = sweep(planned("mu=0.2,0.3"), out)
    assert statuses(more) == {"0.2": "finished", "0.3": "finished"} and starts(out) == 3
    with (out / "results.csv").open(encoding="utf-8") as file:
        assert [row["mu"] for row in csv.DictReader(file)] == ["0.1", "0.2", "0.3"]
    with pytest.raises(InputError, match="same varied parameters, mu, got how, mu"):
        sweep(planned("mu=0.1", "how=well"), out)
    with pytest.raises(InputError, match="same --set, none, got how=well"):
        sweep(planned("mu=0.1", how="well"), out)
    with alone_in(out, "fcsim sweep"), pytest.raises(InputError, match="another fcsim sweep"):
        sweep(planned("mu=0.1"), out)
    script = script_folder / "tiny.py"
    script.write_text(script.read_text(encoding="utf-8") + "# changed\n", encoding="utf-8")
    with pytest.raises(InputError, match="--accept-changes"):
        sweep(planned("mu=0.1"), out)
    assert statuses(sweep(planned("mu=0.1"), out, SweepOptions(accept_changes=True))) == {"0.1": "finished"}
    assert starts(out) == 3


def test_a_folder_of_others_is_not_written_into(planned: Planned, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").touch()
    with pytest.raises(InputError, match=r"thesis\.tex"):
        sweep(planned("mu=0.1"), tmp_path / "out")
    with pytest.raises(InputError, match="found a file"):
        sweep(planned("mu=0.1"), tmp_path / "out" / "thesis.tex")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "sweep.json").write_text('{"case": "tiny", "script": "x"}', encoding="utf-8")
    with pytest.raises(InputError, match="expected what fcsim sweep wrote"):
        sweep(planned("mu=0.1"), tmp_path / "other")


def test_an_interrupt_ends_the_runs_and_the_same_call_goes_on(planned: Planned, tmp_path: Path) -> None:
    plan, out = planned("how=hangs,well"), tmp_path / "out"

    def interrupt(progress: Progress, row: Row | None) -> None:
        if starts(out) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(plan, out, SweepOptions(jobs=2), watch=interrupt)
    for line in next(out.glob("runs/how=hangs*/starts")).read_text(encoding="utf-8").splitlines():
        with pytest.raises(ProcessLookupError):
            os.kill(int(line.split()[0]), 0)
    with (out / "results.csv").open(encoding="utf-8") as file:
        assert {row["how"]: row["status"] for row in csv.DictReader(file)}["hangs"] == "interrupted"


def test_a_retry_that_was_killed_is_made_again(planned: Planned, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was noted of the process before is no longer true once another one has begun."""
    plan, out = planned("how=diverges,well"), tmp_path / "out"
    sweep(plan, out)

    def killed(task: Task, log: object, stop: object) -> Record:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("fcsim.campaign.process._made", killed)
        with pytest.raises(KeyboardInterrupt):
            sweep(plan, out, SweepOptions(retry=True))
    assert statuses(sweep(plan, out))["diverges"] == "not converged"
    assert starts(out) == 3


def test_what_was_refused_for_a_change_goes_on_where_changes_are_accepted(planned: Planned, tmp_path: Path) -> None:
    plan, out = planned("how=well"), tmp_path / "out"
    sweep(replace(plan, runs=()), out)
    Place(out, plan.runs[0].name).write(Record("refused", "numpy was 2.4, is 2.5"))
    assert statuses(sweep(plan, out)) == {"well": "refused"}
    assert statuses(sweep(plan, out, SweepOptions(accept_changes=True))) == {"well": "finished"}


def test_a_run_that_another_process_makes_is_waited_for(planned: Planned, tmp_path: Path) -> None:
    plan, out = planned("how=well"), tmp_path / "out"
    task = Task(str(out), plan.runs[0].name, plan.script, {})
    place = task.place
    place.log.parent.mkdir(parents=True)
    with place.log.open("a") as log:
        fcntl.flock(log, fcntl.LOCK_EX)
        stop = threading.Event()
        stop.set()
        assert make_run(task, stop).status == "waiting"  # whoever stops does not wait
        thread = threading.Thread(target=lambda: make_run(task))
        thread.start()
        time.sleep(0.2)
        assert thread.is_alive() and not place.run.exists()
        place.write(Record("not converged", "by the other process"))
    thread.join()
    assert place.known().message == "by the other process" and not place.run.exists()


def test_what_another_process_has_finished_meanwhile_is_not_made_again(planned: Planned, tmp_path: Path) -> None:
    """A job that outlived its sweep, and ended after the next one had looked and before that one's job began."""
    plan, out = planned("how=well"), tmp_path / "out"
    sweep(plan, out)
    assert make_run(Task(str(out), plan.runs[0].name, plan.script, {})).status == "finished" and starts(out) == 1


def test_a_full_disk_ends_the_sweep_with_an_error_and_no_process_left(
    planned: Planned, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, out = planned("how=well,hangs"), tmp_path / "out"

    def full(self: Place, record: Record) -> None:
        raise OSError(28, "No space left on device", str(self.record))

    with monkeypatch.context() as patched:
        patched.setattr(Place, "write", full)
        with pytest.raises(OSError, match="No space left"):
            sweep(plan, out, SweepOptions(jobs=2))
    for path in out.glob("runs/*/starts"):
        with pytest.raises(ProcessLookupError):
            os.kill(int(path.read_text(encoding="utf-8").split()[0]), 0)
    assert statuses(sweep(planned("how=well"), out)) == {"well": "finished"}


def test_columns_of_one_name_are_told_apart(script_folder: Path, tmp_path: Path) -> None:
    plan = make_plan(load_case(script_folder), {}, [{"steps": "2", "mu": "0.1"}])
    plan = replace(plan, varied=("status", "mu", "push"))
    run = replace(plan.runs[0], values={"status": "S", "mu": "M\udce9", "push": "P"})
    write_results(tmp_path, replace(plan, runs=(run,)), [Row(run, Record("crashed", "two\nlines, and a comma"), {"push": 3.0})])
    with (tmp_path / "results.csv").open(encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert (row["status"], row["status (set)"], row["mu"], row["push"], row["push (set)"]) == ("crashed", "S", "M\\udce9", "3.0", "P")
    assert row["message"] == "two lines, and a comma"


def test_the_process_of_a_run_is_told_its_parent(planned: Planned, tmp_path: Path) -> None:
    out = tmp_path / "out"
    sweep(planned("how=well"), out)
    assert next(out.glob("runs/*/starts")).read_text(encoding="utf-8").split()[1] == str(os.getpid())


def test_options_that_are_none_are_refused() -> None:
    with pytest.raises(InputError, match="jobs"):
        SweepOptions(jobs=0)
    with pytest.raises(InputError, match="time limit"):
        SweepOptions(limits=Limits(time=float("nan")))


def test_the_folder_of_a_sweep_stands_for_its_runs_and_all_that_is_in_it_for_each_once(planned: Planned, tmp_path: Path) -> None:
    """`fcsim compare SWEEP/*/` is given logs/ and records/ too."""
    out = tmp_path / "out"
    sweep(planned("mu=0.3,0.5"), out, SweepOptions())
    runs = sorted((out / "runs").iterdir())
    assert len(runs) == 2 and {path.name for path in out.iterdir() if path.is_dir()} >= {"logs", "records", "runs"}
    assert runs_in(out) == runs == [run for path in out.iterdir() if path.is_dir() for run in runs_in(path)]
    assert runs_in(runs[0]) == [runs[0]] and runs_in(tmp_path / "logs") == [tmp_path / "logs"]
