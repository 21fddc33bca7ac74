"""`auto` on few contacts in one compiled call: conjugate sweeps and proximal Newton take turns, by counted costs.

Prices are those of `automatic.costs`: the rates of its reference machine, so that runs repeat bit by bit. Sweeps go on as long as at their
rate they arrive for less than Newton would take; Newton as long as it brings the error down as it does where it arrives; then each spends
what the other has spent. Errors are those of `problem._judge_kernels`, those of penetrations too.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear._block_rows_kernels import own_blocks, row_patterns
from fcsim.linear.storage import REAL, REFERENCE
from fcsim.problem._cone_kernels import cone_projection
from fcsim.problem._judge_kernels import squared_natural_residual
from fcsim.solvers.automatic.closed import UNLIKE
from fcsim.solvers.automatic.costs import LP_STEPS, NEWTON_STEPS, PASSES
from fcsim.solvers.automatic.costs import ONE_CONTACT as OPERATIONS
from fcsim.solvers.gauss_seidel._sweep_kernels import change_to_await_next
from fcsim.solvers.gauss_seidel.one_contact import ONE_CONTACT
from fcsim.solvers.newton._formulation_kernels import split_compliances
from fcsim.solvers.small._gauss_seidel_kernels import (
    MAX_ITERATIONS,
    NOT_HERE,
    SOLVED,
    STAGNATED,
    embedded,
    error_of,
    judged,
    own_compliances,
)
from fcsim.solvers.small._newton_kernels import proximal_newton

sweep_conjugate = ONE_CONTACT["AC"].sweep_conjugate

FAR = 1e-3
"""Error above which Newton takes long."""
NEWTON_FROM_FAR, NEWTON_FROM_NEAR = 30, 15
"""Iterations that Newton needs from errors above and below `FAR`, about: what sweeps may still cost."""
MANY, FEWER = 220, 1.5
"""Contact unknowns that bear from which Newton in so many times fewer velocities of the bodies, which the race has, is the quicker one."""
ALREADY, OVERFULL = 150, 3.0
"""The same where so many times as many unknowns bear as the bodies have velocities: Newton here mostly fails then."""
FIRST_ELSEWHERE, ELSEWHERE_FROM_FAR, ELSEWHERE_FROM_NEAR = 2, 8, 4
"""Its iterations whose cost sweeps then spend before their rate is believed, and those that it needs: of the race, in faces."""
MANY_AGAIN = 100
"""The same once Newton has failed here: in velocities it does not mind a W of far more unknowns than those (contacts and their twins)."""
LOOSE, LOOSE_2D = 3.75, 1.5
"""Contacts a pair of bodies, told by the patterns of W's rows, below which grains lie in a bed: 1 of spheres and discs, 1.8 to 3.5 of
rocks, 4 and more of boxes, in the plane 2."""
FIRST_IN_BEDS, ALONE_IN_BEDS = 30, 20
"""Newton's iterations whose cost sweeps spend there before their rate is believed, and those of the first Newton, the only one, before it
must have got on: an interior point comes next, in the race."""
FEWEST = 60
"""Contacts of a bed up to which Newton here costs less than the small steps of a race, so that both its starts are tried as elsewhere."""
STILL = 0.999
"""Factor by which sweeps between two errors bring an error above `FAR` down at least, or they are at an end."""
NO_ANSWER_YET = 5
"""How it ends where a proof that there is no solution is to be tried before Newton from zero."""
DECADE = 10
"""Newton's iterations that are its own for each tenfold."""
RATES = REFERENCE.flops, REFERENCE.bytes, REFERENCE.step
"""Operations and bytes a second, and the seconds of a small step."""
PROOF = LP_STEPS * REFERENCE.step
"""Seconds on the reference machine of a proof that there is no solution: on few contacts those of its small steps."""


@njit(cache=True, nogil=True)
def projected(r, mu, d):
    """P_K(r) (m,): Newton's reactions leave the cone by what is left of its equations, where those of sweeps never do."""
    inside = np.empty_like(r)
    for a in range(len(mu)):
        i = a * d
        r0, r1, r2 = cone_projection(r[i], r[i + 1], r[i + 2] if d == 3 else 0.0, mu[a])
        inside[i], inside[i + 1] = r0, r1
        if d == 3:
            inside[i + 2] = r2
    return inside


@njit(cache=True, nogil=True)
def bearing(r, d):
    """Contact unknowns of the contacts that bear, of one at least."""
    closed = 0
    for i in range(0, len(r), d):
        closed += d * (r[i] > 0.0)
    return max(closed, d)


@njit(cache=True, nogil=True)
def newton_price(r, d, velocities, many):
    """Seconds of an iteration of Newton on the reference machine, and whether it is one of the race's, in the bodies' velocities.

    An LU of the unknowns of the contacts that bear, or of the velocities with the race's small steps, and W read. many: `MANY`, or
    `MANY_AGAIN`.
    """
    closed = bearing(r, d)
    elsewhere = closed > max(many, FEWER * velocities) or closed > max(ALREADY, OVERFULL * velocities)
    steps = RATES[2] * NEWTON_STEPS if elsewhere else 0.0
    size = velocities if elsewhere else closed
    return 2.0 / 3.0 * size**3 / RATES[0] + PASSES * REAL * len(r) ** 2 / RATES[1] + steps, elsewhere


@njit(cache=True, nogil=True)
def sweeps_left(course, looks, tol):
    """Sweeps until the error is tol at the rate of the second half of the course (looks, 2) of sweeps and best errors."""
    last, best = course[looks - 1, 0], course[looks - 1, 1]
    half = looks - 1
    while half > 0 and course[half, 0] > 0.5 * last:
        half -= 1
    before = course[half, 1]
    if not 0.0 < best < before:
        return np.inf
    return np.log(best / tol) / np.log(before / best) * (last - course[half, 0])


@njit(cache=True, nogil=True)
def solve_automatically(
    W, q, mu, start, d, published, floor, tol, local_tolerance, local_iterations, look, first, alone, within, budget, velocities, done,
    history,
):  # fmt: skip
    """Conjugate sweeps from `start` (m,) and proximal Newton from their best iterate, then from zero, by turns until the error is tol.

    In beds of more than `FEWEST` contacts the first Newton is the only one, and a shorter one, after more sweeps. Where the first one
    leaves the error above `FAR`, there may be no solution: sweeps are over then, and where Newton from zero costs more than a proof, that
    is to come before (`NO_ANSWER_YET`; a call with the iterations `done` so far and their best iterate as start goes on).
    look: sweeps between two errors; first: Newton's iterations whose cost the sweeps spend before their rate is believed; alone: those of
    Newton from the sweeps' iterate, from zero, and from zero from afar before it must have got on; within: those from each at the most;
    budget: seconds on the reference machine after which sweeps, and after half of which Newton is left; velocities: those of the bodies
    behind W, where known.
    What is returned is as in `solve_by_sweeps`; iterations are sweeps and Newton's together. Newton's answer is brought back to the cone
    where that leaves it one. Long because it is one call from Python, as `solve_by_sweeps`.
    """
    nc = len(mu)
    zero, none = np.zeros_like(q), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    compliance = own_compliances(W, nc, d)
    if not np.all(compliance > 0.0):
        return NOT_HERE, 0, 0, zero, q, 0.0, 0.0, 0.0, none
    weights = np.ones(nc) if published else compliance
    scale = max(np.sqrt(np.sum(q * q)), floor)
    resting = np.sqrt(squared_natural_residual(zero, q, mu, weights, d))
    if resting == 0.0 or (scale > 0.0 and resting / scale <= tol):
        u, scaled, plain, found = judged(W, q, mu, compliance, zero, d)
        return SOLVED, 0, 0, zero, u, scale, scaled, plain, found
    starts, columns, blocks, q3, r3 = embedded(W, q, start, d)
    diagonal, shift = own_blocks(starts, columns, blocks), np.zeros(nc)
    largest = split_compliances(diagonal[:, :d, :d].copy())
    if not np.all(largest > 0.0):
        return NOT_HERE, 0, 0, zero, q, 0.0, 0.0, 0.0, none
    turns, own, last_sweeps = 2, alone, np.any(start) or np.max(compliance) > UNLIKE * np.min(compliance)
    if nc > FEWEST and nc < (LOOSE if d == 3 else LOOSE_2D) * row_patterns(starts, columns):
        turns, first, own = 1, max(first, FIRST_IN_BEDS), (min(alone[0], ALONE_IN_BEDS), alone[1], alone[2])
    rho, order, frozen = np.ascontiguousarray(1.0 / largest[:, :2]), np.arange(nc), np.zeros(nc, dtype=np.int64)
    from_here, direction, last, awaited = r3.copy(), np.zeros_like(r3), 0.0, tol
    r, u = zero.copy(), q.copy()
    least = error_of(starts, columns, blocks, q3, r3, mu, weights, scale, r, u, d)
    best = r.copy()
    sweep_price = OPERATIONS * nc / RATES[0] + 1.1 * REAL * d * d * len(columns) / RATES[1]
    history[0, 0], history[0, 1], rows = 0, least, 1
    course, looks = np.empty((len(history), 2)), 1
    course[0, 1] = least
    sweeps, sweeping, inside, of_newton, turn, far = 0, True, done, 0.0, int(done > 0), done > 0
    course[0, 0], history[0, 0] = 0.0, done
    while True:
        many = MANY if turn == 0 else MANY_AGAIN
        price, elsewhere = newton_price(best, d, velocities, many)
        allowed = of_newton if turn else (FIRST_ELSEWHERE if elsewhere else first) * price
        while sweeping and not far and not least <= tol:
            change, size, swept, _ = sweep_conjugate(
                starts, columns, blocks, diagonal, shift, q3, mu, rho, order, r3, frozen, from_here, direction, last, local_tolerance,
                local_iterations, 1.0, look, awaited,
            )  # fmt: skip
            last = change
            sweeps += swept
            error = error_of(starts, columns, blocks, q3, r3, mu, weights, scale, r, u, d)
            if swept < look and error > tol and size > 0.0:  # where some reactions are far larger than others it may stay so
                awaited = change_to_await_next(awaited, np.sqrt(change / size), tol / error)
            if not np.isfinite(error) or (change == 0.0 and error > tol):
                sweeping = False
            if error < least:
                least, best = error, r.copy()
            before = course[looks - 1, 1]
            if looks < len(course):
                course[looks, 0], course[looks, 1] = sweeps, least
                looks += 1
            else:
                sweeping = False
            if rows < len(history):
                history[rows, 0], history[rows, 1] = sweeps + inside, error
                rows += 1
            if least > FAR and looks > 2 and least > STILL * before:
                break
            spent = sweep_price * sweeps
            price, elsewhere = newton_price(best, d, velocities, many)
            if elsewhere and not turn:
                allowed = FIRST_ELSEWHERE * price
                patience = (ELSEWHERE_FROM_FAR if least > FAR else ELSEWHERE_FROM_NEAR) * price
            else:
                patience = (NEWTON_FROM_FAR if least > FAR else NEWTON_FROM_NEAR) * price
            if spent > budget or (spent > allowed and sweep_price * sweeps_left(course, looks, tol) > patience):
                break
        if least <= tol or turn >= turns or elsewhere:
            break
        begin = best if turn == 0 else zero
        turn += 1
        most = min(within, int(0.5 * budget / price))
        found_r, found_error, iterations = proximal_newton(
            W, q, mu, compliance, weights, scale, tol, begin, d, most, own[2 if far else turn - 1], np.int64(DECADE)
        )
        inside += iterations
        of_newton += price * iterations
        if rows < len(history):
            history[rows, 0], history[rows, 1] = sweeps + inside, found_error
            rows += 1
        if found_error <= tol:
            admissible = projected(found_r, mu, d)
            u, scaled, plain, found = judged(W, q, mu, compliance, admissible, d)
            if (plain if published else scaled) <= tol * scale:
                return SOLVED, sweeps + inside, rows, admissible, u, scale, scaled, plain, found
            u, scaled, plain, found = judged(W, q, mu, compliance, found_r, d)
            return SOLVED, sweeps + inside, rows, found_r, u, scale, scaled, plain, found
        if turns == 1 and not last_sweeps:  # an interior point comes next: of 24 beds that it had left sweeps solved none
            if found_error < least:
                least, best = found_error, found_r
            break
        far = min(found_error, least) > FAR
        if far and turn == 1 and turns == 2 and done == 0 and alone[2] * price > PROOF:
            if found_error < least:
                least, best = found_error, found_r
            u, scaled, plain, found = judged(W, q, mu, compliance, best, d)
            return NO_ANSWER_YET, sweeps + inside, rows, best, u, scale, scaled, plain, found
        if found_error < 0.1 * least and sweeping:  # its iterate is well ahead: sweeps go on from there
            least, best = found_error, found_r
            admissible = projected(found_r, mu, d)
            for a in range(nc):
                for i in range(d):
                    r3[a, i] = admissible[a * d + i]
            from_here[:] = r3
            last = 0.0
            course[0, 0], course[0, 1], looks = sweeps, least, 1
    if elsewhere and turn == 0 and not least <= tol:
        return NOT_HERE, sweeps, rows, best, q, scale, 0.0, 0.0, none
    ended = SOLVED if least <= tol else (MAX_ITERATIONS if sweeping else STAGNATED)
    u, scaled, plain, found = judged(W, q, mu, compliance, best, d)
    return ended, sweeps + inside, rows, best, u, scale, scaled, plain, found
