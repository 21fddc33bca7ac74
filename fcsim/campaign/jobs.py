"""The runs of a sweep as jobs of a cluster: each job watches over the process of its run, so that the limits hold there too."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from pathlib import Path

from fcsim.campaign.process import Task, make_run
from fcsim.campaign.record import CRASHED, INTERRUPTED, WAITING, Record
from fcsim.campaign.sweep import Launch, News
from fcsim.cluster import Cluster, run_jobs


def on_cluster(directory: Path, cluster: Cluster) -> Launch:
    """Runs as jobs, whose files submitit keeps in directory/jobs."""

    def launch(tasks: Sequence[Task]) -> Generator[News]:
        for jobs in run_jobs(make_run, tasks, directory.resolve() / "jobs", cluster, "fcsim-sweep"):
            left = tuple(tasks[number] for number in jobs.left)
            if jobs.ended is None:
                yield News(None, left)
                continue
            task = tasks[jobs.ended]
            if task.place.known().status in (WAITING, INTERRUPTED):  # nobody was left there to note how it ended
                task.place.write(Record(CRASHED, jobs.error or "its job ended without a word"))
            yield News(task, left)

    return launch
