"""fcsim doctor: what works here, what is missing and how to get it."""

from __future__ import annotations

import argparse

from fcsim.command_line.answers import answer, current
from fcsim.command_line.terminal import Bar, print_table, say
from fcsim.errors import EXIT_NOT_CONVERGED, EXIT_OK


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `doctor`."""
    doctor = commands.add_parser(
        "doctor",
        help="say what works here, what is missing and how to get it",
        description="Try what fcsim needs: Python and packages, C compiler, system libraries of gmsh and VTK, MPI, threads, memory, "
        "disks, caches, optional programs. Exit code 1 where simulations do not work; with --quiet only what is amiss is said.",
    )
    doctor.set_defaults(act=_doctor)


def _doctor(options: argparse.Namespace) -> int:
    from fcsim.command_line.start.findings import CHECKS

    findings = []
    with Bar("looked at", lines=0) as bar:
        for k, check in enumerate(CHECKS):
            bar.update(k, len(CHECKS), check.__name__.replace("_", " "))
            findings += check()
    missing = [finding for finding in findings if finding.state == "MISSING"]
    code = EXIT_NOT_CONVERGED if missing else EXIT_OK
    if current().quiet:
        for finding in findings:
            if finding.state in ("MISSING", "warning"):
                mend = f". {finding.mend}" if finding.mend else ""
                say(f"fcsim: {'warning: ' if finding.state == 'warning' else ''}{finding.what}: {finding.said}{mend}", to_stderr=True)
    if answer({"works": not missing, "findings": findings}):
        return code
    print_table(("looked at", "", "found"), [(finding.what, finding.state, finding.said) for finding in findings], texts=3)
    if mends := [finding for finding in findings if finding.mend]:
        print_table(("what", "mend"), [(finding.what, finding.mend) for finding in mends], title="How to get it", texts=2)
    say("\nsimulations do not work here" if missing else "\nsimulations work here")
    return code
