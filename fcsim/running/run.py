"""Running a case into a folder: the consumers of a simulation's steps.

DIR/run.json       case, title, parameters, versions, status, and which columns the plots take
DIR/steps.csv      one row a step: contacts, solver, checks, energies, seconds, the case's sensors
DIR/steps.h5       the same with units, written when the run ends
DIR/vtk/           run.pvd, the ParaView series of blocks, contacts, rigid bodies, links
DIR/fclib/global/  FCLIB files (and local/ where asked for)
DIR/checkpoint.h5  state and the last reactions: what `--resume` goes on from
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from fcsim.errors import InputError, NotConverged, Unphysical
from fcsim.files import alone_in, files_read, remove_partial_files
from fcsim.interrupts import ended_by, is_interrupt
from fcsim.problem.rolling import GlobalRollingProblem
from fcsim.ranks import alone, of_rank_0, section, told, world, writes
from fcsim.running.case import Case, CaseScript
from fcsim.running.case_description import describe
from fcsim.running.checkpoint import read_checkpoint
from fcsim.running.description import Description, SeenOverlap, write_description, write_end
from fcsim.running.outputs import Outputs, RunOptions, Unwritten, witnessed
from fcsim.running.parameters import parse_parameters
from fcsim.running.refusals.fclib_files import refuse_fclib_files
from fcsim.running.refusals.own_files import check_folder, empty, make_folder
from fcsim.running.refusals.same_case import same_case, shared_work
from fcsim.running.refusals.size import size_of
from fcsim.running.resume import accepted, changes, check_moments, resumed_assignments, resumed_options
from fcsim.running.step_table import refuse_taken
from fcsim.runtime import limited_threads
from fcsim.timestep.step import Moment, Step

__all__ = ["RunOptions", "Summary", "run_case"]


@dataclass(frozen=True)
class Totals:
    """Sums over the steps that a run has computed: seconds by phase; steps that needed the fallback chain, that another solver led since it
    had to answer before (see `Lead`), that were cut; energy_residual the largest of a step [J]; energy_created by contacts in all, see
    `Ledger` [J]; overlap the largest that was seen, by the run's earlier parts too."""

    overlap: SeenOverlap
    seconds: Mapping[str, float] = field(default_factory=dict)
    computed: int = 0
    iterations: int = 0
    largest_error: float = 0.0
    fallbacks: int = 0
    led: int = 0
    cut: int = 0
    energy_residual: float = 0.0
    energy_created: float = 0.0

    def after(self, step: Step, seconds: Mapping[str, float]) -> Totals:
        """With one more step, and the seconds that its phases took."""
        seen = step.overlap
        return Totals(
            overlap=self.overlap if seen is None or seen.depth <= self.overlap.depth else SeenOverlap(seen.depth, seen.share, seen.between),
            seconds={**self.seconds, **{phase: self.seconds.get(phase, 0.0) + value for phase, value in seconds.items()}},
            computed=self.computed + 1,
            iterations=self.iterations + step.iterations,
            largest_error=max(self.largest_error, step.result.error),
            fallbacks=self.fallbacks + step.fell_back,
            led=self.led + (bool(step.attempts) and step.attempts[0].leads),
            cut=self.cut + (step.substeps > 1),
            energy_residual=max(self.energy_residual, abs(step.energy.residual)),
            energy_created=step.ledger.created,
        )


@dataclass(frozen=True, kw_only=True)
class Summary(Totals):
    """How a run ended: status "finished", "not converged", "failed" (penetration seen, energy created) or "interrupted"; steps that the
    run has in all; wall_time [s]; notes: what is to be known of the results."""

    status: str
    message: str
    steps: int
    wall_time: float
    notes: tuple[str, ...] = ()

    @property
    def converged(self) -> bool:
        return self.status == "finished"


@limited_threads()  # also for what is written, beside the steps and between them
def run_case(
    script: CaseScript,
    assignments: Mapping[str, str],
    directory: str | Path,
    options: RunOptions | Mapping[str, object] | None = None,
    *,
    resume: bool = False,
    overwrite: bool = False,
    accept_changes: bool = False,
    announce: Callable[[str], None] | None = None,
    watch: Callable[[Case, Step], None] | None = None,
) -> Summary:
    """Run a case script with the given parameter texts into a folder; `announce` is told its size before the first step, `watch` is
    called after each step.

    options: all of them, or those that are given by their names: the others are those of the run that goes on, or by default.
    resume goes on from the folder's checkpoint with the parameters stored there (steps may be raised); where script, meshes, tables or
    versions are not as they were, only with accept_changes, and run.json says so. overwrite removes an earlier run's files first.
    A run that does not fit into the free memory is refused (see `fcsim.memory`). Nothing is touched before the case is built, and no
    two runs write into one folder. Under `fcsim.ranks.sharing` all ranks call this; rank 0 reads and writes the folder, and what it finds
    there is told to the others. Returns the summary also when a step does not converge or the run is interrupted by Ctrl-C.
    """
    if resume and overwrite:
        raise InputError("--resume, --overwrite: expected one of them, got both")
    directory = Path(directory).absolute()  # a script may change the working directory
    stored: Description | None = None
    if resume:
        given = assignments
        assignments, stored = of_rank_0("the run to go on with", lambda: resumed_assignments(directory, script, given))
    else:
        of_rank_0("the folder of the results", lambda: check_folder(directory, overwrite))
    if not isinstance(options, RunOptions):
        options = resumed_options(stored, options or {})
    with section("the case"):
        parameters = parse_parameters(script, assignments)
        with files_read() as read:
            case = script.build(parameters)
        refuse_taken(case.name, case.sensors)
        refuse_fclib_files(case.simulation.scheme.law, options.export_every, options.export_forms)
        case = replace(case, simulation=witnessed(case.simulation, options))
        size = size_of(case.simulation)
        size.refuse()
        description = describe(case, script, parameters, assignments, asdict(options), read)
    same_case(case, description)

    asked = _Asked(case, parameters, directory, options)

    with ExitStack() as held:
        moments, outputs = None, None
        with section("the folder of the results"):
            if writes():
                make_folder(directory)
                held.enter_context(alone_in(directory, "fcsim run"))
                moments, outputs, description = _opened(asked, description, stored, accept_changes, overwrite or resume)
        moments, description = told("the beginning", (moments, description))
        if announce is not None:
            announce(str(size))
        return _run(asked, moments, outputs or Unwritten(), description, watch if writes() else None)


@dataclass(frozen=True)
class _Asked:
    """The run that is asked for: the case, the parameters that it was built with, its folder, what is written there."""

    case: Case
    parameters: object
    directory: Path
    options: RunOptions


def _opened(
    asked: _Asked, description: Description, stored: Description | None, accept_changes: bool, may_hold: bool
) -> tuple[tuple[Moment, Moment] | None, Outputs, Description]:
    """The moments from which the run goes on, None: from its beginning, what writes it, and what run.json says of it now; the folder is
    this run's alone. may_hold: whether it may hold a run."""
    moments, directory = None, asked.directory
    if stored is not None:
        moments = read_checkpoint(directory / "checkpoint.h5", stored.origin)
        description = _resumed(description, stored, asked.case, moments, directory, accept_changes)
    check_folder(directory, may_hold)
    if moments is None:  # a new run, or one that stopped before its first checkpoint
        if stored is not None:
            description = _anew(description, stored, directory / "checkpoint.h5")
        empty(directory)
        description = description.begun()
    remove_partial_files(directory)
    start = moments[0].number if moments else 0
    try:
        write_description(directory, replace(description, status="running"))
        outputs = Outputs(directory, asked.case, asked.parameters, asked.options, start, description.origin)
    except OSError as error:  # a disk that is full from the beginning
        write_end(directory, replace(description, status="failed", message=f"{type(error).__name__}: {error}", steps_done=start))
        raise
    return moments, outputs, description


def _made_together(step: Step, options: RunOptions) -> None:
    """What files and tables need of all ranks, before one of them writes."""
    step.energy  # noqa: B018 - kept by the step
    if options.export_every and step.number % options.export_every == 0:
        step.guess  # noqa: B018 - kept by the step
        if "local" in options.export_forms and not isinstance(step.problem, GlobalRollingProblem):  # which has none: writing says so
            step.reduction.local.whole  # noqa: B018 - kept by its W


def _resumed(
    now: Description, stored: Description, case: Case, moments: tuple[Moment, Moment] | None, directory: Path, accept: bool
) -> Description:
    """The description of the run that goes on, with notes on what has changed."""
    if moments is None:
        return now
    notes = accepted(changes(stored, now), accept)
    check_moments(moments, case.simulation.model, case.simulation.steps, directory / "checkpoint.h5")
    return replace(now, origin=stored.origin, overlap=stored.overlap, notes=tuple(dict.fromkeys((*stored.notes, *now.notes, *notes))))


def _anew(now: Description, stored: Description, checkpoint: Path) -> Description:
    """The description of a run that begins again for want of a checkpoint, with a note. InputError where a checkpoint was written as the
    run ended: what is there is whole, and would be emptied."""
    if stored.steps_done == 0:
        return now
    if stored.status in ("finished", "interrupted"):
        raise InputError(
            f"{checkpoint}: expected the checkpoint of the {stored.steps_done} steps that the run has, found none; --overwrite begins anew"
        )
    return replace(now, notes=(*now.notes, "no checkpoint was there to go on from: the run has begun anew"))


def _none_computed(start: int, parameters: object) -> str:
    """What is said of a run whose steps are all there when it begins, `start` of them."""
    if start == 0:
        return "no step was asked for (steps = 0), and none was computed"
    said = f"the run had its {start} steps already, and none was computed"
    if not hasattr(parameters, "steps"):
        return said
    unless = "" if hasattr(parameters, "h") else ", unless the case divides its time by them"
    return f"{said}: --resume --steps {2 * start} goes on with it{unless}"


def _run(
    asked: _Asked,
    moments: tuple[Moment, Moment] | None,
    outputs: Outputs | Unwritten,
    description: Description,
    watch: Callable[[Case, Step], None] | None,
) -> Summary:
    """Take the steps one after the other, and leave the folder whole however that ends."""
    status, message, simulation = "finished", "", asked.case.simulation
    totals, begin = Totals(description.overlap), time.perf_counter()
    start = moments[0].number if moments else 0
    if start >= simulation.steps:
        message = _none_computed(start, asked.parameters)

    def reached() -> int:
        return outputs.last.number if outputs.last is not None else start

    def describe_end() -> None:
        write_end(asked.directory, replace(description, status=status, message=message, steps_done=reached(), overlap=totals.overlap))

    try:
        for step in simulation.run(*moments) if moments else simulation:
            if world() is not None:
                _made_together(step, asked.options)
            with alone():
                seconds = outputs.take(step)
            totals = totals.after(step, seconds)
            description = replace(description, notes=tuple(dict.fromkeys((*description.notes, *step.remarks))))
            if watch is not None:
                watch(asked.case, step)
            del step  # its W is not kept while the next one is made
        outputs.finish()
        description = replace(description, ranks=shared_work())
    except NotConverged as error:
        status, message = "not converged", str(error)
    except Unphysical as error:
        status, message = "failed", str(error)
    except BaseException as error:  # an interrupt, too: run.json says how the run ended
        if not writes():
            raise
        if not is_interrupt(error):
            status, message = "failed", f"{type(error).__name__}: {error}"
            try:
                outputs.end(describe_end)
            except OSError as another:
                error.add_note(f"and then: {another}")
            raise
        status, message = "interrupted", f"interrupted by {ended_by(error)}; go on with --resume"
    outputs.end(describe_end, failed=status in ("not converged", "failed"))
    return Summary(
        status=status,
        message=message,
        steps=reached(),
        wall_time=time.perf_counter() - begin,
        notes=description.notes,
        **vars(totals),
    )
