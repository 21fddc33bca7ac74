"""The solver table: one visible place with the published names; a variant is a line of data.

Names: Acary, Brémond, Huber, "On solving contact problems with Coulomb friction: formulations and numerical comparisons", 2018.
"""

from __future__ import annotations

from dataclasses import replace
from difflib import get_close_matches

from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.solvers.automatic.followed import automatic_followed
from fcsim.solvers.automatic.stages import AutomaticOptions, automatic
from fcsim.solvers.base import Method, Options
from fcsim.solvers.gauss_seidel.anderson import AndersonOptions, anderson
from fcsim.solvers.gauss_seidel.conjugate import nncg
from fcsim.solvers.gauss_seidel.one_contact import ONE_CONTACT
from fcsim.solvers.gauss_seidel.sweeps import GaussSeidelOptions, SweepOptions, nsgs
from fcsim.solvers.gauss_seidel.velocity import VelocityOptions, nsgsv
from fcsim.solvers.hybrid import HybridOptions, Stage, hybrid
from fcsim.solvers.interior_point.coulomb import InteriorPointOptions, interior_point
from fcsim.solvers.lcp.faceted import FacetedOptions, faceted_cone
from fcsim.solvers.lcp.planar import (
    ConjugateGradientOptions,
    EnumerationOptions,
    LemkeOptions,
    conjugated_projected_gradient,
    planar_enumeration,
    planar_lemke,
    planar_nsgs,
)
from fcsim.solvers.newton.iterations import newton, newton_followed
from fcsim.solvers.newton.kkt import newton_global, newton_mixed
from fcsim.solvers.newton.levenberg_marquardt import levenberg_marquardt
from fcsim.solvers.newton.options import NewtonOptions
from fcsim.solvers.proximal.options import PROXIMAL_NEWTON, ProximalOptions
from fcsim.solvers.proximal.path_steps import PathOptions, proximal_path
from fcsim.solvers.proximal.steps import proximal_point
from fcsim.solvers.rolling.automatic import rolling_automatic
from fcsim.solvers.rolling.newton import rolling_newton, rolling_proximal
from fcsim.solvers.rolling.projections import rolling_admm, rolling_extragradient, rolling_fixed_point
from fcsim.solvers.rolling.sweeps import RollingSweepOptions, rolling_sweeps
from fcsim.solvers.variational.admm import AdmmOptions, admm, admm_global
from fcsim.solvers.variational.fixed_points import (
    AlternationOptions,
    ConeProgramOptions,
    FixedPointOptions,
    aclm,
    aclm_global,
    panagiotopoulos,
    soclcp,
    tresca,
)
from fcsim.solvers.variational.projection import HyperplaneOptions, ProjectionOptions, extragradient, fixed_point, hyperplane

_BOOK = "Acary, Brémond, Huber 2018"
_NEWTON_OVER_RANKS = 1e7
"""Entries of W below which Newton's method on each rank, with what it keeps from step to step, is quicker."""
_ROLLING = "Acary, Bourrier 2021"


def _newton(formulation: str, source: str, siconos: str, rho: str = "split spectral norm", line_search: str = "none") -> Method:
    options = NewtonOptions(formulation=formulation, rho=rho, line_search=line_search)
    return Method(
        *(newton, options, "Newton", source, siconos),
        run_global=newton_global,
        run_mixed=newton_mixed,
        run_followed=newton_followed,
        over_ranks=formulation in ("AC", "JM"),
        over_ranks_from=_NEWTON_OVER_RANKS,
        over_ranks_elastic=True,
    )


def _nsgs(one_contact: str, source: str, siconos: str = "", options: GaussSeidelOptions = GaussSeidelOptions()) -> Method:  # noqa: B008 - frozen
    siconos = siconos or ONE_CONTACT[one_contact].siconos
    return Method(nsgs, replace(options, one_contact=one_contact), "Gauss-Seidel", source, f"NSGS + {siconos}" if siconos else "")


def _hybrid(stages: tuple[Stage, ...], siconos: str, cycles: int = 1, first: tuple[Stage, ...] = ()) -> Method:
    return Method(hybrid, HybridOptions(stages=stages, cycles=cycles, first=first), "hybrid", _BOOK, siconos)


_SWEEPS = Stage(nsgs, GaussSeidelOptions(max_iterations=100))
_PLI = Stage(nsgs, GaussSeidelOptions(one_contact="FP-DS", local_iterations=100, max_iterations=100))
_NEWTON_GP = Stage(newton, NewtonOptions(line_search="Goldstein-Price", max_iterations=50))

SOLVERS: dict[str, Method] = {
    "auto": Method(
        *(automatic, AutomaticOptions(), "automatic", "this package (see automatic)"),
        run_followed=automatic_followed,
        over_ranks=True,
        over_ranks_from=_NEWTON_OVER_RANKS,
        over_ranks_elastic=True,
    ),
    # adaptive: on walls from r = 0 an eighth fewer iterations than with the fixed rho of NSN-AC-NLS, and single contacts on which that
    # one cycles are solved
    "NSN-AC": _newton("AC", "Alart, Curnier 1991", "NSN_AC", rho="adaptive"),
    "NSN-JM": _newton("JM", "Jean, Moreau 1987", "NSN_AC (JEANMOREAU, LINESEARCH_NO)"),
    "NSN-NM": _newton("NM", _BOOK, "NSN_NM (LINESEARCH_NO)", rho="spectral norm"),
    "NSN-FB": _newton("FB", "Fukushima, Luo, Tseng 2002", "NSN_FB", "spectral norm", "Goldstein-Price"),
    "NSN-AC-NLS": _newton("AC", _BOOK, "NSN_AC (LINESEARCH_NO)"),
    "NSN-FB-NLS": _newton("FB", _BOOK, "NSN_FB (LINESEARCH_NO)", "spectral norm"),
    "NSN-AC-GP": _newton("AC", _BOOK, "NSN_AC", line_search="Goldstein-Price"),
    "NSN-JM-GP": _newton("JM", _BOOK, "NSN_AC (JEANMOREAU)", line_search="Goldstein-Price"),
    "NSN-NM-GP": _newton("NM", _BOOK, "NSN_NM", "spectral norm", "Goldstein-Price"),
    "NSN-AC-TEST": Method(
        newton,
        NewtonOptions(line_search="Goldstein", safeguard=True, max_iterations=1000),
        "Newton",
        "De Luca, Facchinei, Kanzow 1996",
        "NSN_AC_TEST",
    ),
    "NSGS-AC": _nsgs("AC", "Jourdan, Alart, Jean 1998"),
    "NSGS-JM": _nsgs("JM", "Jean, Moreau 1987"),
    "NSGS-AC-GP": _nsgs("AC-GP", _BOOK),
    "NSGS-JM-GP": _nsgs("JM-GP", _BOOK),
    "NSGS-FP-DS-ONE": _nsgs("FP-DS-ONE", "De Saxcé, Feng 1998"),
    "NSGS-FP-DS": _nsgs("FP-DS", "De Saxcé, Feng 1998", options=GaussSeidelOptions(local_iterations=1000)),
    "NSGS-FP-VI-UPK": _nsgs("FP-VI-UPK", _BOOK, options=GaussSeidelOptions(local_iterations=1000)),
    "NSGS-PC-REG": _nsgs("FP-DS-ONE", _BOOK, "ONECONTACT_ProjectionOnConeWithRegularization", GaussSeidelOptions(regularisation=0.1)),
    "NSGS-PC-DIAG": _nsgs("PC-DIAG", _BOOK),
    "NSGS-CYL": _nsgs("CYL", _BOOK),
    "NSGS-EXACT": _nsgs("EXACT", "Bonnefon, Daviet 2011"),
    "NSGS-NCP": _nsgs("NCP-FB", "Glocker 1999", options=GaussSeidelOptions(local_iterations=100)),
    "NNCG": Method(nncg, SweepOptions(), "Gauss-Seidel", "Silcowitz-Hansen, Niebe, Erleben 2010"),
    "NSGS-AA": Method(anderson, AndersonOptions(), "Gauss-Seidel", "Anderson 1965; Walker, Ni 2011"),
    "NSGSV": Method(nsgsv, VelocityOptions(), "Gauss-Seidel", _BOOK, "NSGSV"),
    "PPA-NSN-AC": Method(
        proximal_point, ProximalOptions(internal="NSN-AC", internal_options={"max_iterations": 30}), "proximal point", _BOOK, "PROX"
    ),
    "PROX-NEWTON": Method(
        proximal_point,
        PROXIMAL_NEWTON,
        "proximal point",
        "Rockafellar 1976; Acary, Brémond, Huber 2018; metric of the contacts' compliances: fcsim",
    ),
    "PROX-PATH": Method(
        proximal_path,
        PathOptions(),
        "proximal point",
        "Rockafellar 1976; Katzenelson 1965; Kojima, Saigal 1981 (paths by pieces); for friction: fcsim",
    ),
    "LM": Method(
        levenberg_marquardt,
        Options(max_iterations=200),
        "Newton",
        "Marquardt 1963; Fan, Yuan 2005",
        limits="local: a least-squares step on the error itself, for the neighbourhood of what other methods reached, small problems",
    ),
    "PPA-NSGS-AC": Method(
        proximal_point,
        ProximalOptions(internal="NSGS-AC", internal_options={"max_iterations": 1000}, alpha=1e-2, easy=200),
        "proximal point",
        _BOOK,
        "PROX + NSGS",
    ),
    "NSN-AC-HYBRID": _hybrid((_SWEEPS, Stage(newton, NewtonOptions())), "NSN_AC with an NSGS start"),
    "NSN-AC-GP-HYBRID": _hybrid((_SWEEPS, _NEWTON_GP), "NSN_AC with an NSGS start"),
    "NSN-FB-HYBRID": _hybrid((_SWEEPS, Stage(newton, NewtonOptions(formulation="FB", rho="spectral norm"))), "NSN_FB with an NSGS start"),
    "NSN-AC-EG-HYBRID": _hybrid(
        (Stage(extragradient, ProjectionOptions(step_rule="Khobotov", max_iterations=100)), Stage(newton, NewtonOptions())),
        "NSN_AC (VI_EG_NSN)",
    ),
    "NSN-AC-PLI-LOOP": _hybrid((_PLI, _NEWTON_GP), "NSN_AC (PLI_NSN_LOOP)", cycles=10),
    "NSN-AC-NSN-PLI-LOOP": _hybrid((_PLI, _NEWTON_GP), "NSN_AC (NSN_AND_PLI_NSN_LOOP)", cycles=10, first=(_NEWTON_GP,)),
    "FP-DS": Method(fixed_point, ProjectionOptions(), "projection", "De Saxcé, Feng 1998", "DSFP, FPP", over_ranks=True),
    "EG": Method(extragradient, ProjectionOptions(), "projection", "Korpelevich 1976", "EG", over_ranks=True),
    "HP": Method(hyperplane, HyperplaneOptions(), "projection", "Konnov 1993; Solodov, Svaiter 1999", "HP", over_ranks=True),
    "FP-VI-UPK": Method(fixed_point, ProjectionOptions(step_rule="Khobotov"), "projection", _BOOK, "VI_FPP", over_ranks=True),
    "FP-VI-UTK": Method(
        fixed_point, ProjectionOptions(step_rule="Solodov-Tseng"), "projection", _BOOK, "VI_FPP (SOLODOV)", over_ranks=True
    ),
    "EG-VI-UPK": Method(extragradient, ProjectionOptions(step_rule="Khobotov"), "projection", _BOOK, "VI_EG", over_ranks=True),
    "EG-VI-UTK": Method(
        extragradient, ProjectionOptions(step_rule="Solodov-Tseng"), "projection", _BOOK, "VI_EG (SOLODOV)", over_ranks=True
    ),
    "ADMM": Method(admm, AdmmOptions(), "ADMM", "Boyd et al. 2011; Goldstein et al. 2014", "ADMM", run_global=admm_global, over_ranks=True),
    "ADMM-SPECTRAL": Method(
        admm,
        AdmmOptions(rho_update="spectral", balancing_ratio=10.0, acceleration="none"),
        "ADMM",
        "Carpentier, Le Lidec, Montaut 2024",
    ),
    "TRESCA": Method(tresca, FixedPointOptions(), "convex programs", "Haslinger 1983", "TFP"),
    "CYLINDER-QP": Method(tresca, FixedPointOptions(internal="projected gradient"), "convex programs", _BOOK, "CONVEXQP_CYLINDER"),
    "FP-VI-CYL": Method(tresca, FixedPointOptions(internal="FP-VI-UPK"), "convex programs", _BOOK, "VI_FPP_Cylinder"),
    "PANA": Method(panagiotopoulos, AlternationOptions(), "convex programs", "Panagiotopoulos 1975", "PFP"),
    "ACLM": Method(aclm, ConeProgramOptions(), "convex programs", "Acary et al. 2011", "ACLMFP", run_global=aclm_global),
    "IPM": Method(
        aclm,
        ConeProgramOptions(internal="primal-dual"),
        "convex programs",
        "Acary, Armand, Nguyen, Shpakovych 2023",
        "GFC3D IPM",
        run_global=aclm_global,
    ),
    "IPM-COULOMB": Method(interior_point, InteriorPointOptions(), "interior point", "Chen, Ly, Wojtan 2024; Howell et al. 2022"),
    "SOCLCP": Method(
        soclcp,
        FixedPointOptions(internal="FP-VI-UPK", max_iterations=20_000),
        "convex programs",
        _BOOK,
        "SOCLCP",
        limits="the convex relaxation, without g(u): solves the friction problem only where no contact slides",
    ),
    "PATH": Method(faceted_cone, FacetedOptions(), "LCP", "Klarbring 1986; Dirkse, Ferris 1995", "GAMS_LCP_PATH"),
    "2D-NSGS": Method(planar_nsgs, GaussSeidelOptions(one_contact="EXACT"), "2D", "Jean, Moreau 1992", "FRICTION_2D_NSGS", (2,)),
    "2D-CPG": Method(conjugated_projected_gradient, ConjugateGradientOptions(), "2D", "Renouf, Alart 2005", "FRICTION_2D_CPG", (2,)),
    "2D-LEMKE": Method(planar_lemke, LemkeOptions(), "2D", "Lemke 1965", "FRICTION_2D_LEMKE", (2,)),
    "2D-ENUM": Method(planar_enumeration, EnumerationOptions(), "2D", "Murty 1988", "FRICTION_2D_ENUM", (2,)),
    "ROLLING-NSGS": Method(rolling_sweeps, RollingSweepOptions(), "rolling", _ROLLING, "ROLLING_FRICTION_3D_NSGS", (5, 6)),
    "ROLLING-FP": Method(rolling_fixed_point, ProjectionOptions(step_rule="Khobotov"), "rolling", _ROLLING, "", (5, 6)),
    "ROLLING-EG": Method(rolling_extragradient, ProjectionOptions(step_rule="Khobotov"), "rolling", _ROLLING, "", (5, 6)),
    "ROLLING-ADMM": Method(rolling_admm, AdmmOptions(), "rolling", "Boyd et al. 2011; as ADMM", "", (5, 6)),
    "ROLLING-NSN": Method(rolling_newton, NewtonOptions(rho="adaptive"), "rolling", "Alart, Curnier 1991, a disk a part", "", (5, 6)),
    "ROLLING-AUTO": Method(rolling_automatic, Options(max_iterations=50_000), "rolling", "this package (what auto is there)", "", (5, 6)),
    "ROLLING-PROX": Method(rolling_proximal, PROXIMAL_NEWTON, "rolling", "Rockafellar 1976; as PROX-NEWTON", "", (5, 6)),
}

ALIASES: dict[str, str] = {"NSN-JM-NLS": "NSN-JM", "NSN-NM-NLS": "NSN-NM", "NSN-AC-NLS-HYBRID": "NSN-AC-HYBRID", "FP": "FP-DS"}
"""Second published names of a method: taken wherever a name is asked for, left out where the table is gone through."""


def method(name: str) -> Method:
    """Return the method of that name or alias; an unknown one is an InputError that lists the table."""
    if not isinstance(name, str):
        raise InputError(f"solver: expected a name, as 'auto', got {shown(name)}")
    known = SOLVERS.get(name) or SOLVERS.get(ALIASES.get(name, ""))
    if known is None:
        near = get_close_matches(name.upper(), (*SOLVERS, *ALIASES), 3, 0.7)
        mean = f" (did you mean {' or '.join(near)}?)" if near else ""
        raise InputError(f"solver {name!r}{mean}: expected one of {', '.join((*SOLVERS, *ALIASES))}")
    return known
