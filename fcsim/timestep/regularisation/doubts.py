"""What may be why a step did not converge, said with the error."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.floating import floating, nodal_stiffness, proposed_eta, stretching_quotient
from fcsim.assembly.model import Model
from fcsim.assembly.shares.group_factor import FAINT
from fcsim.linkage import Linkage
from fcsim.mesh.material.by_region import AnyMaterial, ByRegion
from fcsim.mesh.material.law import PointLaw
from fcsim.solvers import Status
from fcsim.timestep.chain import Attempt, StepTimes
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State

HIDDEN = 1e-3
"""Of the proposed eta: below it round-off hides the mass of a body that only contact holds, whatever was tried. Where solvers stagnate near
an answer it may hide it up to the proposed one: a steel block between two plates ends at errors of 5e-8 at 1e-3 of it, 1e-9 at a tenth,
a rigid ball of 1 kg between two plates of 1 GPa at 4e-8 at 1e-2 of it in the plane, at 2e-8 at 1e-3 in space."""
NEAR = 1e-6  # an error that stagnates below it is round-off's
TENFOLD = 10.0  # of the eta of linear bodies: problems within Newton's method on nonlinear ones are solved to 1e-9 for 1e-8
PRESSED = (2e-3, 6e-3, 2e-2, 6e-2, 0.2, 0.6)
"""Of a body's `stretching_quotient`, in turn: eta / h^2 that bears what loads of about a percent of its shear modulus do to a body that
turns, and more. A billet at its yield stress, 1e-3 E, needs 1e-3; ten times as much bears a tenth of the forces while plates move on."""
OF_STRAIN = 1.5
"""Times the strain that supports give a body: the share of its `stretching_quotient` that bears it. Blocks of rubber in plane strain
between plates that come together by 0.5 to 30 % of their height need 0.7 to 2, in the mean."""
_LOOKS = 16  # at what supports do until the end of a run
ROUNDED = 1.6  # an eta is named by one digit
_NO_STEP = StepTimes(0.0, 0.0, 0.0)


def doubts(
    model: Model,
    scheme: Scheme,
    linkage: Linkage | None,
    times: StepTimes = _NO_STEP,
    attempts: Sequence[Attempt] = (),
    state: State | None = None,
    until: float | None = None,
) -> Iterator[str]:
    """Of statics: plastic bodies under loads that may be beyond their limit load; with eta > 0 bodies whose mass is too faint to keep them
    where they are until contact does.

    linkage: links, which may hold it; attempts: what was tried, none = nothing is said of plastic bodies; state: the last that was reached,
    which says what yields; until [s]: the end of the run, None = that of the step.
    """
    if isinstance(scheme, QuasiStatic) and attempts and attempts[-1].solver == "Newton":
        yield from _limit_load(model, times, state)
    if not isinstance(scheme, QuasiStatic) or not scheme.eta or linkage is not None:
        return
    loose = [(eta, number) for number in floating(model) if (eta := _proposed(model, number, scheme.h)) is not None]
    near = any(attempt.status == Status.STAGNATED.value and attempt.error < NEAR for attempt in attempts)
    if loose and scheme.eta < (1.0 if near else HIDDEN) * max(loose)[0]:
        eta, number = max(loose)
        own = proposed_eta(model, number, scheme.h) or eta
        yield (
            f"eta / h^2 M is {FAINT * scheme.eta / own:.0e} of the stiffness of body {model.bodies[number].name!r}, which only contact "
            f"holds, and round-off {'hides' if scheme.eta < HIDDEN * eta else 'may hide'} it: try eta = {eta:.0e}"
        )
    yield from _faint_beside(model, scheme, near)
    soft = {number for group in model.groups if group.finite for number in group.members.tolist()}
    yield from _unstable(model, scheme, [number for _, number in loose if number in soft], times.end if until is None else until)


def _unstable(model: Model, scheme: QuasiStatic, numbers: Sequence[int], until: float) -> Iterator[str]:
    """Of bodies of finite strain that only contact holds: the mass that may bear what makes them unstable until the end of the run; who has
    that already is told the next larger one."""
    least, number = max(((stretching_quotient(model, number) or 0.0, number) for number in numbers), default=(0.0, -1))
    larger = [eta for share in PRESSED if (eta := share * scheme.h**2 * least) > ROUNDED * scheme.eta]
    if larger and not _is_plastic(model.deformable[number].part.material):  # which its yield stress presses at most
        strain = _driven_strain(model, number, until)
        enough = [eta for eta in larger if eta >= OF_STRAIN * strain * scheme.h**2 * least]
        larger = enough or larger[-1:]
    if larger:
        yield (
            f"where body {model.bodies[number].name!r}, which only contact holds, has lost its stiffness: loads that press it make it "
            f"unstable, and its mass has to bear that until contact does: try eta = {larger[0]:.0e} and steps in which loads stand; "
            "what is too large is said with the share of the forces that it carries"
        )


def _driven_strain(model: Model, number: int, until: float) -> float:
    """The most by which supports bring the model's bodies together or apart from t = 0 to `until` [s], over the body's length there."""
    d, largest, moved, h = model.dimension, 0.0, np.zeros(len(model.driven_dofs)), until / _LOOKS
    length = np.ptp(model.bodies[number].points, axis=0)
    known = _along_axes(model, model.of_driven(np.ones(len(model.driven_dofs))))
    for k in range(_LOOKS):
        moved = moved + model.held.increment(k * h, h)
        now = _along_axes(model, model.of_driven(moved))
        largest = max([largest, *(float(np.ptp(now[known[:, i] != 0, i]) / length[i]) for i in range(d) if known[:, i].any())])
    return largest


def _along_axes(model: Model, x: FloatArray) -> FloatArray:
    """What x (n_dofs,) has of nodes and of centres of rigid bodies (n, d)."""
    return np.concatenate([x[: model.n_elastic].reshape(-1, model.dimension), model.rigid_part(x)[:, : model.dimension]])


def _faint_beside(model: Model, scheme: QuasiStatic, near: bool) -> Iterator[str]:
    """Of rigid bodies, whose mass is to be seen beside the stiffness at a node of the deformable bodies that may press them."""
    count = len(model.deformable)
    rigid = [(model.rigid[number - count].mass, number) for number in floating(model) if number >= count]
    stiff = [(nodal_stiffness(model, number) or 0.0, number) for number in range(count)]
    if not rigid or not stiff or not max(stiff)[0]:
        return
    (mass, number), (stiffness, by) = min(rigid), max(stiff)
    eta = TENFOLD * FAINT * scheme.h**2 * stiffness / mass
    if scheme.eta < (1.0 if near else HIDDEN) * eta:
        yield (
            f"eta / h^2 m of rigid body {model.bodies[number].name!r}, which only contact holds, is "
            f"{scheme.eta / scheme.h**2 * mass / stiffness:.0e} of the stiffness at a node of {model.bodies[by].name!r}, and round-off "
            f"{'hides' if scheme.eta < HIDDEN * eta else 'may hide'} it: try eta = {eta:.0e}"
        )


def _proposed(model: Model, number: int, h: float) -> float | None:
    eta, laws = proposed_eta(model, number, h), any(number in group.members and group.laws is not None for group in model.groups)
    return TENFOLD * eta if laws and eta is not None else eta


def _limit_load(model: Model, times: StepTimes, state: State | None) -> Iterator[str]:
    plastic = {body.name for body in model.deformable if _is_plastic(body.part.material)}
    forces = [np.linalg.norm(model.load(t) - model.driven_share(model.load(t))) for t in (times.end, times.part)]
    if state is not None and plastic and forces[1] > 0:
        plastic &= {model.bodies[k].name for k in yielding(model, state, float(forces[0] / forces[1]), times)}
    name = next((body.name for body in model.deformable if body.name in plastic), None)
    if name is not None and forces[0] > 0:
        yield (
            f"the loads may be more than plastic body {name!r} can bear (its limit load): the last that it bore are those of "
            f"t = {times.part:.6g} s, {forces[1] / forces[0]:.3g} of those at the end of this step; to go on, drive it by supports with a "
            "displacement in place of the load, or give it hardening"
        )


def yielding(model: Model, state: State, ratio: float, times: StepTimes) -> Iterator[int]:
    """Numbers of the bodies that have flowed plastically somewhere at `state`, or would where its displacements, in proportion to the
    loads, were those of the end of the step: by `ratio`, > 1 where loads grow. One that is elastic up to its limit load has not before."""
    bodies, x = model.nonlinear, max(ratio, 1.0) * state.x
    with np.errstate(all="ignore"):  # so far from the state that was reached a law may have no answer: nan, which differs too
        after = bodies.inner(x, state.internal, times.end, times.end - times.part).variables
    for (group, part, first), (_, _, last) in zip(bodies.shares(None), bodies.shares(after), strict=True):
        flowed = np.zeros(len(group.members), dtype=bool)
        for (region, begun), (_, now) in zip(part.region_variables(first), part.region_variables(last), strict=True):
            named = [np.full(variable.components, "plastic" in variable.name) for variable in region.law.variables]
            column = np.concatenate([*named, np.empty(0, dtype=bool)])
            flowed |= (now[..., column] != begun[..., column]).any(axis=(1, 2, 3))
        yield from group.members[flowed].tolist()


def _is_plastic(material: AnyMaterial | ByRegion) -> bool:
    """Whether a law of the material keeps a plastic strain."""
    if isinstance(material, ByRegion):
        return any(map(_is_plastic, material.materials.values()))
    return isinstance(material, PointLaw) and any("plastic" in variable.name for variable in material.variables)
