"""Rocking blocks: periods and overturning by the exact equation of motion about the toe, blocks that begin turned, ground that shakes."""

import json

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from fcsim.assembly.time_functions import AccelerationRecord
from fcsim.command_line.main import main
from fcsim.errors import InputError
from fcsim.masonry import Stone, limit_problem, read_masonry
from fcsim.masonry.histories.shake import shake, shaken

G = 9.81


def stone(tmp_path, b, h, mu=1.5, **more):
    """The half sizes b, h of Housner's block on a wide floor, in the plane."""

    def box(x0, x1, z0, z1):
        return [[x, y, z] for z in (z0, z1) for x, y in ((x0, 0.0), (x1, 0.0), (x1, 0.3 * b), (x0, 0.3 * b))]

    data = {
        "schema": "masonry-problem/1",
        "name": "stone",
        "dimension": 2,
        "contact": {"mu": mu},
        "loads": [{"kind": "acceleration", "value": [0, 0, -G]}],
        "blocks": [
            {"id": "floor", "vertices": box(-9 * h, 9 * h, -h, 0.0), "support": True},
            {"id": "stone", "vertices": box(0.0, 2 * b, 0.0, 2 * h), "density": 2000.0},
        ],
        **more,
    }
    path = tmp_path / "stone.json"
    path.write_text(json.dumps(data))
    return path


def turned(angle, b):
    """About the right lower edge, to the right: a positive turn about y."""
    return {"initial_pose": [{"block": "stone", "rotation": [0, angle, 0], "about": [2 * b, 0, 0]}]}


@pytest.mark.parametrize(("b", "h", "share"), [(0.2, 0.6, 0.4), pytest.param(0.2, 0.6, 0.8, marks=pytest.mark.slow), (2.0, 5.0, 0.5)])
def test_quarter_period_of_free_rocking(tmp_path, b, h, share):
    """From rest at theta_0 the block is upright after int d theta / theta', (4/3) m R^2 theta'' = m g R sin(alpha - theta)."""
    alpha, R = np.arctan2(b, h), np.hypot(b, h)
    begin = share * alpha
    rate = 1.5 * G / R  # theta'^2 = 2 (3 g / 4 R) (cos(alpha - theta) - cos(alpha - begin)), theta below begin falls back

    def speed(theta):
        return np.sqrt(rate * (np.cos(alpha - begin) - np.cos(alpha - theta)))

    quarter = quad(lambda s: 2 * s / speed(begin - s * s), 0.0, np.sqrt(begin))[0]
    problem = read_masonry(stone(tmp_path, b, h, **turned(begin, b)))
    step = quarter / 150
    seen = shake(problem, duration=1.1 * quarter, h=step)
    upright = seen.t[np.argmax(seen.turn >= begin * (1 - 1e-3))]
    assert upright == pytest.approx(quarter, rel=0.01)
    assert not seen.fallen


def test_an_elastic_block_rocks_as_a_rigid_one(tmp_path):
    """10 GPa: nine tenths of the way back to upright in the rigid block's time; then over to the other side with Housner's loss,
    1 - 3/2 sin^2 alpha of the speed, or a little more of it: its stone's damping takes what the impact makes of the motion."""
    b, h = 0.2, 0.6
    alpha, R = np.arctan2(b, h), np.hypot(b, h)
    begin = 0.4 * alpha
    rate = 1.5 * G / R
    most = np.sqrt(0.9 * begin)
    way = quad(lambda s: 2 * s / np.sqrt(rate * (np.cos(alpha - begin) - np.cos(alpha - begin + s * s))), 0.0, most)[0]
    kept = (np.cos(alpha - begin) - np.cos(alpha)) * (1 - 1.5 * np.sin(alpha) ** 2) ** 2
    housner = alpha - np.arccos(np.cos(alpha) + kept)
    problem = read_masonry(stone(tmp_path, b, h, **turned(begin, b)))
    seen = shake(problem, duration=2.2 * way, h=way / 60, blocks="deformable", stone=Stone(cells=1.0))
    back = int(np.argmax(seen.turn >= 0.9 * begin))
    assert np.interp(0.9 * begin, seen.turn[back - 1 : back + 1], seen.t[back - 1 : back + 1]) == pytest.approx(way, rel=5e-3)
    assert seen.turn.max() - begin == pytest.approx(housner, rel=0.12)


def equation(b, h, record, end):
    """theta of the block under a ground record, about the toe that it stands on, with Housner's loss at impacts."""
    alpha, R = np.arctan2(b, h), np.hypot(b, h)
    p2, loss = 3 * G / (4 * R), 1 - 1.5 * np.sin(alpha) ** 2

    def right(t, y):
        sign = 1.0 if y[0] > 0 or (y[0] == 0 and y[1] >= 0) else -1.0
        return [y[1], -p2 * (np.sin(sign * alpha - y[0]) + record(t) / G * np.cos(sign * alpha - y[0]))]

    def zero(t, y):
        return y[0]

    def over(t, y):
        return abs(y[0]) - 0.5 * np.pi

    zero.terminal = over.terminal = True
    start = next((k for k in np.linspace(0, record.times[-1], 20001) if abs(record(k)) > G * b / h), None)
    if start is None:
        return 0.0, False
    y, t, most = [-np.sign(record(start)) * 1e-12, 0.0], start, 0.0
    while t < end:
        piece = solve_ivp(right, (t, end), y, events=(zero, over), rtol=1e-9, atol=1e-12, max_step=1e-2, first_step=1e-4)
        most = max(most, np.abs(piece.y[0]).max())
        if len(piece.t_events[1]):
            return most, True
        t, y = piece.t[-1], [0.0, loss * piece.y[1, -1]]
        if abs(y[1]) < 1e-4:
            return most, False
        y[0] = np.sign(y[1]) * 1e-12
    return most, False


def half_sine(amplitude, duration):
    times = np.linspace(0.0, duration, 401)
    return AccelerationRecord(times, amplitude * np.sin(np.pi * times / duration))


@pytest.mark.slow
@pytest.mark.parametrize("duration", [0.3, 0.6])
def test_overturning_by_a_half_sine(tmp_path, duration):
    """The least amplitude that overturns, by bisection of the equation of motion; the simulation stands 1 % below and falls 1 % above."""
    b, h = 0.2, 0.6
    low, high = G * b / h, 30.0
    while high - low > 1e-3 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if equation(b, h, half_sine(middle, duration), 6.0)[1] else (middle, high)
    problem = read_masonry(stone(tmp_path, b, h))
    for factor, falls in ((0.99, False), (1.01, True)):
        seen = shake(shaken(problem, (1.0, 0.0, 0.0), half_sine(factor * high, duration)), duration=2.5, h=4e-3)
        assert bool(seen.fallen) is falls, (factor, high)


def test_a_block_that_slides_under_a_pulse(tmp_path):
    """Half sine of 0.8 g, 0.5 s, mu 0.3: 0.5107 m (Newmark's sliding block, by quadrature)."""
    pulse = {"base_acceleration": {"kind": "half_sine", "value": [0.8 * G, 0, 0], "duration": 0.5}}
    seen = shake(read_masonry(stone(tmp_path, 0.3, 0.1, mu=0.3, **pulse)), duration=1.2, h=4e-3)
    assert seen.displacement[-1] == pytest.approx(0.5107, rel=2e-3)
    assert not seen.moving


def test_limit_analysis_refuses_ground_that_shakes(tmp_path):
    pulse = {"base_acceleration": {"direction": [1, 0, 0], "times": [0, 1], "values": [1.0, 0.0]}}
    with pytest.raises(InputError, match="base_acceleration"):
        limit_problem(read_masonry(stone(tmp_path, 0.2, 0.6, **pulse)))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"initial_pose": [{"block": "none", "rotation": [0, 0, 0]}]}, "initial_pose.*'none'"),
        ({"initial_pose": [{"block": "stone", "rotation": [0.1]}]}, "three numbers"),
        ({"base_acceleration": {"kind": "square", "value": [1, 0, 0], "duration": 1}}, "half_sine"),
        ({"base_acceleration": {"kind": "half_sine", "value": [1, 0, 0], "duration": 0}}, "duration"),
        ({"base_acceleration": {"direction": [0, 1, 0], "times": [0, 1], "values": [1, 1]}}, "direction"),
        ({"base_acceleration": {"direction": [1, 0, 0], "times": [1, 0], "values": [1, 1]}}, "increasing times"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, more, words):
    with pytest.raises(InputError, match=words):
        read_masonry(stone(tmp_path, 0.2, 0.6, **more))


def test_command(tmp_path, capsys):
    """A record file, by direction and factor: table, history, verdict."""
    path, record = stone(tmp_path, 0.2, 0.6), tmp_path / "pulse.csv"
    times = np.linspace(0.0, 0.5, 51)
    record.write_text("t [s],a [m/s^2]\n" + "\n".join(f"{t},{np.sin(2 * np.pi * t)}" for t in times))
    command = ["shake", str(path), "--record", str(record), "--factor", "20", "--out", str(tmp_path / "o")]
    assert main([*command, "--duration", "1.2"]) == 0
    assert "fallen: stone" in capsys.readouterr().out
    rows = np.loadtxt(tmp_path / "o" / "shake.csv", delimiter=",", skiprows=1)
    assert rows[-1, 0] == pytest.approx(1.2, abs=0.02)
    assert (tmp_path / "o" / "shake.png").stat().st_size > 5000
