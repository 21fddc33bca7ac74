"""Nonsmooth Newton methods: formulations, line searches, iterations and the linear systems of their steps.

To follow NSN-AC on a step of a wall, eleven files, in this order:

1. solvers/solve.py                        the problem, the answer and its check
2. solvers/run_method.py                   the method between them, and what it hands back where it stops unsolved
3. solvers/newton/iterations.py            Newton's method: F, A, B, the step, the line search, why it stops
4. solvers/newton/formulations.py          Alart and Curnier's F with A = dF/du and B = dF/dr
5. solvers/newton/spaces.py                u = W r + q beside r
6. solvers/newton/systems/choice.py        which linear algebra serves
7. solvers/newton/systems/condensed.py     (A W + B) dr = -F by what is held from iteration to iteration and from step to step
8. solvers/newton/systems/held.py          the factor of W on the held contacts
9. linear/fronts.py                        ... by fronts of the joints' contacts (linear/multifrontal: LU)
10. solvers/newton/systems/border.py        the contacts whose status has changed since
11. solvers/newton/systems/remainder.py    what is left to be solved on them

Beside these, `kkt` works on the global and the mixed form, `levenberg_marquardt` near what other methods reached, and
systems/direct.py and systems/multifrontal.py solve where nothing is held, systems/preconditioned.py where the border would be too large,
and systems/two_level where W is large and its bodies are known, by systems/over_ranks.py where ranks of MPI have W together.
"""
