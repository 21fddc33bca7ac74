"""A collection that is asked for: built here, or by a job of a cluster, within limits, while the one who asked waits for it."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fcsim.bench.workers.killable import FINISHED, Task, run_killable
from fcsim.cluster import Cluster, run_jobs
from fcsim.collection.build import Built, Progress, build_collection
from fcsim.collection.folder import refuse_folder
from fcsim.errors import InputError
from fcsim.linear.storage import SUM_UP_TO
from fcsim.running.case import Case
from fcsim.timestep.step import Step


@dataclass(frozen=True)
class Build:
    """What `build_collection` is asked for, and the limits of the job that does it: wall time [s], resident memory [MiB], None: none."""

    source: str
    out: str
    time_limit: float | None = None
    memory_limit: float | None = None
    every: int = 1
    assignments: Mapping[str, str] = field(default_factory=dict)
    iterations: bool = False
    authors: str = ""
    spectrum_up_to: int = SUM_UP_TO
    overwrite: bool = False

    def here(self, progress: Progress | None = None, watch: Callable[[Case, Step], None] | None = None) -> Built:
        """Build in this process; progress and watch are those of `build_collection`."""
        return build_collection(
            self.source,
            self.out,
            every=self.every,
            assignments=self.assignments,
            iterations=self.iterations,
            authors=self.authors,
            spectrum_up_to=self.spectrum_up_to,
            overwrite=self.overwrite,
            progress=progress,
            watch=watch,
        )


def build_limited(build: Build) -> tuple[str, Built | None]:
    """Build in a child with limits: how it ended, FINISHED or in words, and what it built."""

    def items() -> Iterator[Built]:
        yield build.here()

    seconds = np.inf if build.time_limit is None else build.time_limit
    ended = next(run_killable([Task(None, items, seconds, build.memory_limit)]))
    return ended.how, ended.items[-1] if ended.how == FINISHED and ended.items else None


def build_by_job(build: Build, cluster: Cluster) -> Built:
    """Have a collection built by a job, whose files stand beside it until then. InputError where that did not end well, with the reason,
    and before it begins where the collection may not be written."""
    out = Path(build.out)
    refuse_folder(out, build.overwrite, Path(build.source))
    folder = out.resolve().with_name(f".{out.name}.job")
    with closing(run_jobs(build_limited, [build], folder, cluster, "fcsim-collection")) as jobs:
        for news in jobs:
            if news.ended is None:
                continue
            if news.error or not isinstance(news.result, tuple):
                raise InputError(f"{out}: {news.error or 'its job ended without a word'} (see {folder})")
            how, built = news.result
            if not isinstance(built, Built):
                raise InputError(f"{out}: expected a collection within the limits of its job, got: {how} (see {folder})")
            shutil.rmtree(folder, ignore_errors=True)
            return built
    raise InputError(f"{out}: its job was never made")
