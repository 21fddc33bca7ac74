"""Performance profiles against hand-computed values, their properties, and the pictures."""

import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

from fcsim.bench.reporting.comparison import Selection, compare
from fcsim.bench.reporting.curves import COLOURS, MARKERS, curve_styles, spread
from fcsim.bench.reporting.profile_plots import write_profiles
from fcsim.bench.reporting.profiles import performance_profile
from fcsim.bench.reporting.time_table import time_table, tolerance_name, tolerances
from fcsim.bench.results import Measurement, append
from fcsim.command_line.main import main
from fcsim.errors import InputError

INF = np.inf

#         A    B    C (solves nothing)
HAND = [
    [1.0, 2.0, INF],  # ratios 1, 2
    [4.0, 1.0, INF],  # 4, 1
    [3.0, 3.0, INF],  # a tie: 1, 1
    [5.0, INF, INF],  # 1, never
    [INF, INF, INF],  # solved by none
]


def measurement(problem="P-1", solver="A", tol=1e-4, seconds=1.0, **changes):
    solved = changes.get("status", "SOLVED") == "SOLVED"
    values = {
        "form": "global", "dimension": 3, "nc": 10, "n": 60, "program": "fcsim", "time_limit": 10.0, "memory_limit": None,
        "status": "SOLVED", "solved": solved, "seconds": seconds, "cpu_seconds": seconds, "iterations": 5, "error": tol / 2, "flops": None,
        "machine": "a machine", "threads": 1, "version": "1", "started": "2024-01-01T00:00:00+00:00",
    }  # fmt: skip
    return Measurement(problem=problem, solver=solver, tol=tol, **(values | changes))


def results(times, tol=1e-4, names="ABCDEFGHIJ", **changes):
    """Measurements with the times of a table; infinity ends at the time limit."""
    return [
        measurement(f"P-{p}", names[s], tol, None if t == INF else t, **({"status": "KILLED_TIME"} if t == INF else {}), **changes)
        for p, row in enumerate(times)
        for s, t in enumerate(row)
    ]


def test_hand_made_table():
    profile = performance_profile(HAND)
    assert profile.problems == 5 and profile.unsolved_by_all == 1 and profile.largest == 4.0
    # counts of problems with a ratio <= tau, over 5
    for tau, counts in ((1.0, (3, 2, 0)), (1.999, (3, 2, 0)), (2.0, (3, 3, 0)), (3.9, (3, 3, 0)), (4.0, (4, 3, 0)), (INF, (4, 3, 0))):
        assert profile.rho(tau) == pytest.approx(np.array(counts) / 5, abs=1e-15)
    assert (profile.ratios == 1).sum(axis=0).tolist() == [3, 2, 0]
    assert profile.solved == pytest.approx([0.8, 0.6, 0.0])
    assert profile.rho([0.99, 1.0]).shape == (2, 3) and not profile.rho(0.99).any()


def test_problems_that_none_solves_may_be_left_out():
    profile = performance_profile(HAND, leave_out_unsolved=True)
    assert profile.problems == 4 and profile.unsolved_by_all == 1
    assert profile.solved == pytest.approx([1.0, 0.75, 0.0])


def test_zero_times_and_the_resolution_of_the_clock():
    # with d = 0.01: max(t, d) = 0.01, 0.01, 0.05 and 0.02, 0.04, 0.02
    profile = performance_profile([[0.0, 0.004, 0.05], [0.02, 0.04, 0.02]], resolution=0.01)
    assert profile.ratios == pytest.approx(np.array([[1, 1, 5], [1, 2, 1]]))
    assert (profile.ratios == 1).sum(axis=0).tolist() == [2, 1, 1]


def test_corners_and_area():
    profile = performance_profile([[1.0, 2.0], [1.0, 8.0]])
    tau, rho = profile.steps(1, 16.0)
    assert tau.tolist() == [1, 2, 8, 16] and rho.tolist() == [0, 0.5, 1, 1]
    # mean over log2 tau from 0 to 4: 0 on one, 1/2 on two, 1 on one
    assert profile.area(16.0) == pytest.approx([1.0, (0 * 1 + 0.5 * 2 + 1 * 1) / 4])
    assert profile.order(16.0) == [0, 1]
    tau, rho = profile.steps(1, 4.0)  # the curve goes on beyond the axis
    assert tau.tolist() == [1, 2, 4] and rho.tolist() == [0, 0.5, 0.5]
    assert profile.solved.tolist() == [1, 1]


def test_the_order_is_that_of_the_right_edge():
    profile = performance_profile([[1.0, 9.0, INF], [INF, 9.0, INF], [1.0, 9.0, 1.0]])
    assert profile.order(profile.largest) == [1, 0, 2]


times = arrays(float, st.tuples(st.integers(1, 12), st.integers(1, 5)), elements=st.floats(0, 1e3) | st.just(INF))


@settings(deadline=None)
@given(times, st.lists(st.floats(1, 1e12), min_size=2, max_size=8), st.booleans())
def test_profiles_are_monotone_fractions(table, tau, leave_out):
    profile = performance_profile(table, leave_out_unsolved=leave_out)
    rho = profile.rho(sorted(tau))
    assert np.all((rho >= 0) & (rho <= 1)) and np.all(np.diff(rho, axis=0) >= 0)
    assert np.all(rho <= profile.solved)
    assert profile.rho(profile.largest) == pytest.approx(profile.solved)
    if np.isfinite(table).any():
        assert (profile.ratios == 1).sum() >= np.isfinite(table).any(axis=1).sum()  # each solved problem has a winner


@settings(deadline=None)
@given(times, st.floats(1, 1e6))
def test_rho_counts_by_its_definition(table, tau):
    profile = performance_profile(table)
    for s in range(table.shape[1]):
        count = 0
        for row in np.maximum(table, 1e-6):
            count += bool(np.isfinite(row[s]) and row[s] / row.min() <= tau)
        assert profile.rho(tau)[s] == count / len(table)


@pytest.mark.parametrize("bad", [[1.0, 2.0], np.zeros((3, 0)), [[np.nan]], [[-1.0]]])
def test_bad_times_are_refused(bad):
    with pytest.raises(InputError, match="times: expected"):
        performance_profile(bad)


def test_bad_resolution_is_refused():
    with pytest.raises(InputError, match="resolution"):
        performance_profile(HAND, resolution=0.0)


def test_table_of_times_takes_solved_from_the_judge():
    rows = [
        measurement("P", "A", status="WRONG", solved=False, seconds=0.1),
        measurement("P", "B", status="MAX_ITERATIONS", solved=True, seconds=0.2, cpu_seconds=0.15),
    ]
    assert time_table(rows, 1e-4).times.tolist() == [[INF, 0.2]]
    assert time_table(rows, 1e-4, clock="cpu").times.tolist() == [[INF, 0.15]]
    assert time_table(rows, 1e-4, ["B"]).times.tolist() == [[0.2]]


def test_what_was_not_measured_is_not_unsolved():
    rows = [measurement("P", "A"), measurement("P", "B"), measurement("Q", "A")]
    table = time_table(rows, 1e-4)
    assert table.problems == ("P",) and table.left_out == ("Q",)
    with pytest.raises(InputError, match=r"no problem was measured with every solver.*A 1, B 1"):
        time_table([measurement("P", "A"), measurement("Q", "B")], 1e-4)


def test_methods_of_another_dimension_are_left_out_with_a_remark():
    """As of a folder with files in 2D and 3D, measured by methods for both and by such for one: nothing in common with all of them."""
    both = [measurement(problem, solver) for problem in "PQR" for solver in "AB"]
    rows = [*both, measurement("P", "3D"), measurement("Q", "3D"), measurement("R", "2D")]
    compared = compare(rows)
    assert compared.solvers == ("A", "B", "3D") and compared.parts[0].table.problems == ("P", "Q")
    assert compared.remarks[0].startswith("2D is left out: ")
    assert compare(rows, Selection(reference="2D")).parts[0].table.problems == ("R",)
    with pytest.raises(InputError, match="no problem was measured with every solver"):
        compare(rows, Selection(solvers=("A", "3D", "2D")))
    with pytest.raises(InputError, match="no problem was measured with every solver"):
        compare([measurement("P", "A"), measurement("Q", "B")])


def test_forms_of_one_problem_are_two():
    rows = [measurement("P", "A"), measurement("P", "A", form="local")]
    assert time_table(rows, 1e-4).problems == ("P (global)", "P (local)")


def test_solved_without_a_time_is_an_error():
    with pytest.raises(InputError, match="column cpu_seconds"):
        time_table([measurement(cpu_seconds=None)], 1e-4, clock="cpu")


def test_tolerances_and_their_names():
    rows = [measurement(tol=tol) for tol in (1e-8, 1e-2, 2.5e-3)]
    assert tolerances(rows) == [1e-2, 2.5e-3, 1e-8]
    assert [tolerance_name(tol) for tol in (1e-2, 2.5e-3, 1e-10, 1.0)] == ["1e-2", "2.5e-3", "1e-10", "1e0"]
    with pytest.raises(InputError, match=r"expected tolerances among 1e-2, 2\.5e-3, 1e-8"):
        tolerances(rows, [1e-3])


def test_a_tolerance_begun_only_is_left_out_with_a_remark():
    rows = [*results(HAND), measurement("P-0", "A", tol=1e-6)]
    comparison = compare(rows)
    assert [part.table.tol for part in comparison.parts] == [1e-4] and "1e-6" in comparison.remarks[0]
    with pytest.raises(InputError, match="1e-6"):
        compare(rows, Selection(tols=[1e-6]))


def test_different_machines_are_remarked():
    rows = [measurement("P", "A"), measurement("P", "B", machine="another")]
    assert any("machines (a machine, another)" in remark for remark in compare(rows).remarks)


def test_styles_differ_for_print_in_grey():
    styles = curve_styles(110)
    assert len({(s.colour, str(s.dashes), s.marker, s.hollow) for s in styles}) == 110
    assert len({s.marker for s in styles[:10]}) == 10 and len({s.colour for s in styles[:10]}) == 10
    assert len(set(COLOURS)) == len(COLOURS) and len(set(MARKERS)) == len(MARKERS)


@settings(deadline=None)
@given(st.lists(st.floats(0, 1), min_size=1, max_size=12), st.floats(0.001, 0.2))
def test_labels_do_not_overlap(heights, gap):
    wanted = sorted(heights, reverse=True)
    places = spread(wanted, gap, 0.0, 1.0)
    least = min(gap, 1 / max(len(wanted) - 1, 1))
    assert np.all(-np.diff(places) >= least - 1e-9) and places.max() <= 1 + 1e-9 and places.min() >= -1e-9
    if np.all(-np.diff(wanted) >= gap):
        assert places == pytest.approx(wanted)  # nothing to move


def made_up(solvers=10, problems=12):
    """Results with a spread like that of real solvers."""
    rng = np.random.default_rng(7)
    speeds = np.logspace(-2, 0.7, solvers)
    rows = []
    for tol, hardness in ((1e-2, 1.0), (1e-4, 3.0)):
        t = speeds * hardness * rng.lognormal(0, 0.6, (problems, 1)) * rng.lognormal(0, 0.3, (problems, solvers))
        t[t > 5] = INF
        t[3] = INF
        rows += results(t, tol, time_limit=5.0)
    return rows


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("results")
    for row in made_up():
        append(path, row)
    return path


def test_command_draws_and_tabulates(folder, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["profile", str(folder), "--out", str(out), "--reference", "J"]) == 0
    names = {"profile-1e-2", "profile-1e-4", "profiles"}
    assert {path.name for path in out.iterdir()} == {f"{n}.{f}" for n in names for f in ("png", "svg")} | {"summary.md", "summary.csv"}
    printed = capsys.readouterr().out
    assert "Tolerance 1e-4" in printed and "faster than J" in printed and str(out / "profiles.svg") in printed
    for name in names:
        pixels = np.asarray(Image.open(out / f"{name}.png").convert("RGB"))
        assert pixels.shape[1] >= 1600 and pixels.std() > 12
        text = " ".join(ElementTree.parse(out / f"{name}.svg").getroot().itertext())
        for solver in "ABCDEFGHIJ":
            assert f"%  {solver}" in text
        assert "12 problems" in text and "1 solved by none counted" in text and "time limit 5 s" in text
    assert "| A |" in (out / "summary.md").read_text()


def test_curves_are_drawn_as_counted(tmp_path):
    from fcsim.bench.reporting.profile_plots import profile_figure

    part = compare(results(HAND)).parts[0]
    axes, labels = profile_figure(part).axes
    curves = [line for line in axes.lines if line.get_drawstyle() == "steps-post"]
    drawn = [(line.get_xdata().tolist(), line.get_ydata().tolist()) for line in curves]
    end = axes.get_xlim()[1]
    a, b, c = ([1, 4, end], [0.6, 0.8, 0.8]), ([1, 2, end], [0.4, 0.6, 0.6]), ([1, end], [0, 0])
    assert end > 4 and sorted(drawn) == sorted([a, b, c])
    texts = [text.get_text().replace("\u2007", "") for text in labels.texts]
    assert texts[:3] == ["80 %  A", "60 %  B", "0 %  C"]
    assert axes.get_xlim()[0] == 1


def test_the_axis_may_end_early(tmp_path):
    written = write_profiles(compare(results(HAND)), tmp_path, tau_max=3.0)
    text = " ".join(ElementTree.parse(tmp_path / "profile-1e-4.svg").getroot().itertext())
    assert [path.name for path in written] == ["profile-1e-4.png", "profile-1e-4.svg"] and "largest ratio 4" in text
    with pytest.raises(InputError, match="tau-max"):
        write_profiles(compare(results(HAND)), tmp_path, tau_max=1.0)


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["--tols", "1e-3"], "expected tolerances among 1e-2, 1e-4"),
        (["--solvers", "A,Z"], "--solvers Z: expected solvers among A, B"),
        (["--reference", "Z"], "--reference Z"),
    ],
)
def test_bad_arguments(folder, arguments, said, capsys):
    assert main(["profile", str(folder), *arguments]) == 2
    assert said in capsys.readouterr().err


def test_nothing_to_draw(capsys, tmp_path):
    assert main(["profile"]) == 2
    assert "expected RESULTS" in capsys.readouterr().err
    assert main(["profile", str(tmp_path)]) == 2


def test_the_command_line_stays_light():
    code = (
        "import sys; from fcsim.command_line.main import _parser; _parser(); sys.exit('matplotlib' in sys.modules or 'rich' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parents[4]).returncode == 0
