r"""What each line of the solver table iterates, as formulas: by its function, and where one function has variants by their option.

Symbols are those of docs/theory/formulation.md: u = W r + q, g the De Saxcé term, K the cone, K(mu, W, ...) its parts.
"""

NEWTON = r"(A W + B)\,\Delta r = -F(u, r),\quad A = \partial F/\partial u,\ B = \partial F/\partial r,\ r \leftarrow r + t\,\Delta r"
FUNCTIONS = {
    "AC": r"F_N = r_N - [r_N - \rho_N u_N]_+,\quad F_T = r_T - P_{D(\mu [r_N - \rho_N u_N]_+)}(r_T - \rho_T u_T)",
    "JM": r"F_N = r_N - [r_N - \rho_N u_N]_+,\quad F_T = r_T - P_{D(\mu [r_N]_+)}(r_T - \rho_T u_T)",
    "NM": r"F = r - P_K\left(r - \rho\,(u + g(u))\right)",
    "FB": r"F = x + y - (x \circ x + y \circ y)^{1/2},\quad x,\ y\ \text{the scaled}\ r,\ u + g(u)",
}
ONE_CONTACT = {
    "AC": "Newton's method on AC",
    "JM": "Newton's method on JM",
    "AC-GP": "Newton's method on AC, line search of Goldstein and Price",
    "JM-GP": "Newton's method on JM, line search of Goldstein and Price",
    "FP-DS-ONE": "one projection of De Saxcé and Feng",
    "FP-DS": "projections of De Saxcé and Feng until they settle",
    "FP-VI-UPK": "projections with Khobotov's self-adaptive step",
    "PC-DIAG": "one projection in the metric of the diagonal of its block",
    "CYL": "one projection on the cylinder of radius mu r_N",
    "EXACT": "exact: take-off, stick, slide in turn, sliding by a quartic (in 2D by cases)",
    "NCP-FB": "Glocker's complementarity problem by Newton on Fischer-Burmeister equations",
}
SWEEP = r"r_a \leftarrow S_a\Big(q_a + \sum_{b \ne a} W_{ab}\,r_b\Big)\quad a = 1 \dots n_c,\ \text{the newest}\ r_b"
PROJECTION = r"r \leftarrow P_K\left(r - \rho\,(u(r) + g(u(r)))\right)"
EXTRAGRADIENT = r"\bar r = P_K(r - \rho F(r)),\quad r \leftarrow P_K(r - \rho F(\bar r)),\quad F(r) = u(r) + g(u(r))"
SPLITTING = (
    r"x = (W + \rho I)^{-1}(\rho (z - \zeta) - q - g),\quad z = P_K(x + \zeta),"
    r"\quad \zeta \leftarrow \zeta + x - z,\quad g = g(u)"
)
METHODS = {
    "automatic": "",
    "newton": NEWTON,
    "nsgs": SWEEP,
    "nncg": r"p \leftarrow \beta p - (s - S(s)),\quad s \leftarrow S(s) + \beta p,\quad \beta = \|s - S(s)\|^2/\|s_- - S(s_-)\|^2,\quad S\ \text{a sweep}",
    "anderson": r"r \leftarrow S(r) - \sum_j \gamma_j\,\Delta S(r_j),\quad \gamma = \arg\min \|f - \textstyle\sum_j \gamma_j\,\Delta f_j\|,\quad f = S(r) - r,\quad S\ \text{a sweep}",
    "nsgsv": r"r = W^{-1}(u - q)\quad\text{swept over the contacts' velocities}\ u_a",
    "proximal_point": r"r_{k+1}\ \text{solves}\quad u = (W + \alpha D)\,r + q - \alpha D\,r_k,\quad K^* \ni u + g(u) \perp r \in K",
    "proximal_path": r"P\left(c - \rho\,(W r + q + (1 - t)\,w)\right) = r,\quad t\ \text{from}\ 0\ \text{to}\ 1,\quad c \leftarrow r,\ \alpha = 1/(\rho D)\ \text{falls}",
    "levenberg_marquardt": r"\Delta r = -D^{1/2}(J^T J + \lambda^2 I)^{-1} J^T F,\quad J = \frac{dF}{dr} D^{1/2}",
    "hybrid": "",
    "fixed_point": PROJECTION,
    "extragradient": EXTRAGRADIENT,
    "hyperplane": r"r \leftarrow P_K\Big(r - \frac{F(\bar r)\cdot(r - \bar r)}{\|F(\bar r)\|^2}\,F(\bar r)\Big),\quad \bar r\ \text{between}\ r\ \text{and}\ P_K(r - \rho F(r))",
    "admm": SPLITTING,
    "tresca": r"r \leftarrow \arg\min \tfrac12 r\cdot W r + q\cdot r\quad\text{over}\ r_N \ge 0,\ \|r_T\| \le \mu\,r_N^{\text{last}}",
    "panagiotopoulos": r"r_N\ \text{by its LCP with}\ r_T\ \text{fixed, then}\ r_T \leftarrow \arg\min\ \text{over}\ \|r_T\| \le \mu r_N,\ \text{in turn}",
    "aclm": r"r \leftarrow \arg\min_{r \in K} \tfrac12 r\cdot W r + (q + g(s))\cdot r,\quad s \leftarrow \text{the sliding of that answer}",
    "interior_point": r"r_N u_N = \tau,\quad (\mu r_N, r_T) \circ (s, u_T) = \tau e,\quad u = W r + q,\quad \tau \to 0",
    "soclcp": r"K^* \ni W r + q \perp r \in K\quad(\text{without}\ g)",
    "faceted_cone": r"0 \le \begin{pmatrix} u_N \\ u_D + \lambda e \\ \mu r_N - e\cdot r_D \end{pmatrix} \perp \begin{pmatrix} r_N \\ r_D \\ \lambda \end{pmatrix} \ge 0\quad\text{on facets}\ D\ \text{that are adapted}",
    "planar_nsgs": SWEEP,
    "conjugated_projected_gradient": r"r \leftarrow P\left(r + \alpha p\right),\quad p\ \text{conjugate in}\ W\ \text{among the contacts that stay on their face of}\ C(r)",
    "planar_lemke": r"0 \le M z + q' \perp z \ge 0\quad\text{by complementary pivots}",
    "planar_enumeration": r"0 \le M z + q' \perp z \ge 0\quad\text{by trying complementary bases}",
    "rolling_sweeps": SWEEP,
    "rolling_automatic": SWEEP,
    "rolling_newton": NEWTON,
    "rolling_proximal": r"W r + q + \alpha D (r - r_k) = u,\quad \alpha \to 0\ \text{as far as Newton inside converges}",
    "rolling_fixed_point": PROJECTION,
    "rolling_extragradient": EXTRAGRADIENT,
    "rolling_admm": SPLITTING,
}  # fmt: skip


def formulas(method):
    """(LaTeX, ...) of a line of the table; KeyError for a function that none was written for."""
    found = tuple(filter(None, (METHODS[method.run.__name__],)))
    if method.run.__name__ == "newton":
        found += (FUNCTIONS[method.options.formulation],)
    return found


def in_words(method):
    """What the formulas leave open, as text; empty where nothing is."""
    options = method.options
    if method.run.__name__ == "newton":
        return f"rho: {options.rho}; line search: {options.line_search}."
    if method.run.__name__ == "automatic":
        return "Sweeps, ADMM, Newton, proximal Newton, paths and a proof race; who works next is decided by counted costs."
    if method.run.__name__ == "proximal_path":
        return (
            "Newton's method takes each proximal problem; where it fails, the solution is followed from one contact's status to the next."
        )
    if method.run.__name__ == "interior_point":
        return "Nesterov-Todd scaling, predictor and corrector; where a central path turns back another one, at its end proximal Newton."
    if method.run.__name__ == "hybrid":
        stages = " then ".join(
            f"{stage.options.max_iterations} iterations of {stage.run.__name__}" for stage in options.first + options.stages
        )
        return f"One method after the other: {stages}" + (f", up to {options.cycles} times over." if options.cycles > 1 else ".")
    if hasattr(options, "one_contact"):
        return f"One contact alone, S_a: {ONE_CONTACT[options.one_contact]}."
    if hasattr(options, "step_rule"):
        return f"Step rho: {options.step_rule}."
    if hasattr(options, "internal"):
        return f"The problems within are solved by {options.internal}."
    return ""
