"""Ground that shakes, beside closed forms: pulses shorter than a step, long steps, records that begin before the run."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from fcsim.assembly.time_functions import AccelerationRecord
from fcsim.command_line.main import main
from fcsim.errors import EXIT_BAD_INPUT, InputError
from fcsim.masonry import MasonryProblem, read_masonry
from fcsim.masonry.histories.shake import shake, shaken

G, MU = 9.81, 0.2


def flat(tmp_path: Path, **more: object) -> Path:
    """A flat block, whose usual step is 4.5 ms, on a wide floor."""

    def box(x: float, low: float, high: float) -> list[list[float]]:
        return [[sx * x, sy * x, z] for z in (low, high) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]

    data = {
        "schema": "masonry-problem/1",
        "name": "flat",
        "dimension": 3,
        "contact": {"mu": MU},
        "loads": [{"kind": "acceleration", "value": [0, 0, -G]}],
        "blocks": [
            {"id": "floor", "vertices": box(5.0, -1.0, 0.0), "support": True},
            {"id": "block", "vertices": box(0.5, 0.0, 0.4), "density": 2000.0},
        ],
        **more,
    }
    path = tmp_path / "flat.json"
    path.write_text(json.dumps(data))
    return path


def slid(a: float, duration: float) -> float:
    """[m] The way of Newmark's sliding block under a pulse a sin(pi t / duration) that ends before the block does: begins at
    a sin = mu g, is slowed by mu g."""
    omega, drag = np.pi / duration, MU * G
    begin = np.arcsin(drag / a) / omega
    left = duration - begin
    speed = a / omega * (1 + np.cos(omega * begin)) - drag * left
    way = a / omega * (left * np.cos(omega * begin) + np.sin(omega * begin) / omega) - 0.5 * drag * left**2
    return float(way + speed**2 / (2 * drag))


@pytest.mark.parametrize(("a", "duration"), [(100.0, 5e-3), (400.0, 2e-3), pytest.param(20.0, 0.05, marks=pytest.mark.slow)])
def test_pulses_shorter_than_a_step(tmp_path: Path, a: float, duration: float) -> None:
    """At the steps themselves the record of 2 ms is zero, of 5 ms it is seen once or twice."""
    pulse = {"base_acceleration": {"kind": "half_sine", "value": [a, 0, 0], "duration": duration}}
    seen = shake(read_masonry(flat(tmp_path, **pulse)), duration=0.5)
    assert seen.displacement[-1] == pytest.approx(slid(a, duration), rel=0.02)
    assert not seen.remarks


def box_pulse(problem: MasonryProblem) -> MasonryProblem:
    """0.8 g for 0.2 s, from the beginning on."""
    record = AccelerationRecord(np.array([0.0, 0.2, 0.2001, 0.4]), 0.8 * G * np.array([1.0, 1.0, 0.0, 0.0]))
    return shaken(problem, (0.0, 1.0, 0.0), record)


@pytest.mark.parametrize(("h", "within"), [(0.1, 0.05), (0.03, 0.01)])
def test_long_steps(tmp_path: Path, h: float, within: float) -> None:
    """v = (0.8 - mu) g 0.2 s, then slowed: 0.4709 m."""
    speed = (0.8 - MU) * G * 0.2
    seen = shake(box_pulse(read_masonry(flat(tmp_path))), duration=1.5, h=h)
    assert seen.displacement[-1] == pytest.approx(0.1 * speed + speed**2 / (2 * MU * G), rel=within)


def test_records_that_begin_before_the_run_are_refused(tmp_path: Path) -> None:
    record = AccelerationRecord(np.array([-1.0, 0.5]), np.array([3.0, 3.0]))
    with pytest.raises(InputError, match="times >= 0, since simulations begin at t = 0, got -1 s"):
        shaken(read_masonry(flat(tmp_path)), (1.0, 0.0, 0.0), record)


def test_functions_without_an_end_ask_for_a_duration(tmp_path: Path) -> None:
    problem = shaken(read_masonry(flat(tmp_path)), (1.0, 0.0, 0.0), lambda t: 1.0)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="expected a duration"):
        shake(problem)
    assert shake(problem, duration=0.1, h=0.01).displacement[-1] < 1e-6  # mu g is more


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--duration=2", "--h=0"], "h: expected a step > 0 in s, at most the duration of 2 s, got 0"),
        (["--duration=2", "--h=-1"], "h: expected a step > 0 in s, at most the duration of 2 s, got -1"),
        (["--duration=2", "--h=nan"], "h: expected a step > 0 in s, at most the duration of 2 s, got nan"),
        (["--duration=2", "--h=3"], "h: expected a step > 0 in s, at most the duration of 2 s, got 3"),
        (["--duration=-2"], "duration: expected a time > 0 in s, got -2"),
        (
            ["--duration=1e-3"],
            "duration: expected at least one step, which is 0.004515 s unless h says another, got 0.001",
        ),  # sqrt(2 x 1 m / g) / 100
    ],
)
def test_steps_and_durations_that_cannot_be_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], said: str
) -> None:
    assert main(["shake", str(flat(tmp_path)), *options]) == EXIT_BAD_INPUT
    assert said in capsys.readouterr().err


def test_what_a_run_says_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = tmp_path / "push.csv"
    record.write_text("t [s],a [m/s^2]\n0,1\n1,1\n")
    command = ["shake", str(flat(tmp_path)), "--record", str(record), "--duration", "2", "--h", "0.5"]
    assert main(command) == 0
    assert "note: in one step of h = 0.5 s a body falls by" in capsys.readouterr().out
