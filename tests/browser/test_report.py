"""A bench's page in a real browser: it asks for nothing, sorts, filters, and says of each problem what the table of results says."""

import csv

import numpy as np
import pytest

from fcsim.bench.reporting.comparison import compare
from fcsim.bench.reporting.report import write_report
from fcsim.bench.results import Measurement, append

pytestmark = pytest.mark.browser
SOLVERS = ("NSN-AC", "NSGS-AC", "<b>&odd")


def measured(p, solver, k, tol, seconds, ended):
    return Measurement(
        f"Wall-{p:02d}", "local", 3, 10 + 7 * (p * 5 % 12), 60, "fcsim", solver, tol,
        5.0, None, ended, ended == "SOLVED",
        seconds if ended == "SOLVED" else None, seconds, 3 + k, tol / 2, None, "Processor X", 1, "0.1.0",
        f"2024-01-0{1 + p % 9}T00:00:00+00:00",
    )  # fmt: skip


def bench(folder, factor):
    """Twelve problems: NSGS-AC solves only the first seven, NSN-AC was not measured on the last."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(4)
    for p in range(12):
        for tol in (1e-4, 1e-8):
            for k, solver in enumerate(SOLVERS):
                if p == 11 and solver == "NSN-AC":
                    continue
                ended = "MAX_ITERATIONS: 500 sweeps" if solver == "NSGS-AC" and p > 6 else "SOLVED"
                append(folder, measured(p, solver, k, tol, float(factor * (k + 1) * 1e-3 * rng.lognormal()), ended))
    return folder


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    root = tmp_path_factory.mktemp("bench")
    here, there = bench(root / "here", 1.0), bench(root / "there", 2.0)
    lines = "\n".join(f"{solver},{k},{1e-4 * (k + 1)},{10.0**-k}" for solver in SOLVERS for k in range(9))
    (here / "convergence-Wall-03.csv").write_text(f"solver,iteration,seconds,error\n{lines}\n")
    return here, write_report(compare(here), here / "report.html", results=here, against=there)


@pytest.fixture
def opened(visited, pages, request):
    with visited(pages[1], *getattr(request, "param", ())) as page:
        yield page


def names(page):
    return page.eval_on_selector_all("#problems tbody tr td:first-child", "cells => cells.map(cell => cell.textContent)")


def test_it_asks_for_nothing_and_says_no_error(opened, pages):
    assert opened.asked == [pages[1].resolve().as_uri()] and opened.said == []


def test_which_problems_a_solver_loses_and_why_one_is_left_out(opened):
    opened.select_option("#mine", "NSGS-AC")
    opened.select_option("#show", "lost")
    assert sorted(names(opened)) == [f"Wall-{p:02d}" for p in range(7, 12)]
    opened.select_option("#show", "out")
    assert names(opened) == ["Wall-11"]
    opened.click("#problems tbody tr")
    assert opened.inner_text("#why") == "Left out of the comparison: not measured with NSN-AC."
    assert "max iterations: 500 sweeps" in opened.inner_text("#numbers")
    opened.fill("#filter", "no such problem")
    assert names(opened) == [] and opened.inner_text("#said").startswith("0 of 12 problems shown")


def test_headings_sort_both_ways(opened, pages):
    with (pages[0] / "results.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["solver"] == "NSN-AC" and float(row["tol"]) == 1e-8]
    by_time = [row["problem"] for row in sorted(rows, key=lambda row: float(row["seconds"]))]
    opened.click("#problems thead button:text-is('NSN-AC')")
    assert names(opened) == [*by_time, "Wall-11"]  # what was not measured comes last
    opened.click("#problems thead button:text-is('NSN-AC')")
    assert names(opened) == ["Wall-11", *reversed(by_time)]
    assert opened.get_attribute("#problems thead th:has(button:text-is('NSN-AC'))", "aria-sort") == "descending"


def test_a_click_shows_the_numbers_of_the_table_the_curve_and_the_other_bench(opened):
    opened.click("#problems tbody tr:has-text('Wall-03')")
    assert opened.inner_text("#which").startswith("Wall-03, local form, 31 contacts")
    assert opened.evaluate("document.getElementById('curve').data.map(curve => curve.name)") == ["NSN-AC", "NSGS-AC", "&lt;b>&amp;odd"]
    assert opened.evaluate("document.getElementById('curve').data[0].y.at(-1)") == pytest.approx(1e-8)
    assert "in there" in opened.inner_text("#numbers thead")
    rows = [row.split("\t") for row in opened.inner_text("#both tbody").splitlines()]
    assert [row[0] for row in rows] == list(SOLVERS)
    assert [row[4].split()[0] for row in rows] == ["0.500"] * 3  # the same times twice as long there


def test_profiles_are_those_of_the_comparison(opened, pages):
    profile = compare(pages[0]).parts[1].profile
    for k, name in enumerate(SOLVERS):
        shown = opened.evaluate(f"document.getElementById('profile').data[{k}].y.at(-1)")
        assert shown == pytest.approx(profile.solved[k]), name


@pytest.mark.parametrize("opened", [(1280, 900, "light"), (390, 844, "light"), (390, 844, "dark"), (1280, 900, "dark")], indirect=True)
def test_nothing_is_clipped_and_all_can_read_it(opened):
    opened.click("#problems tbody tr:has-text('Wall-03')")
    opened.wait_for_function("document.documentElement.scrollWidth <= innerWidth", timeout=10_000)  # plots find their width when drawn
    axe = pytest.importorskip("axe_core_python.sync_playwright", reason="axe-core-python is not installed: pip install 'fcsim[browser]'")
    broken = axe.Axe().run(opened)["violations"]
    assert not [(rule["id"], [node["html"][:120] for node in rule["nodes"]][:3]) for rule in broken]
