"""Tests of links: what they describe, what they refuse."""

from __future__ import annotations

import pytest
from link_cases import LINKS

from pendulum_env import SCENES, rollout
from pendulum_env.engine.rollout import run
from pendulum_env.physics.units import SceneError
from pendulum_env.web import link_of, read_link

LINK = ("file:///lab.html#v=1&scene=lab&methods=rk4:0.01,symplectic_euler:0.02&angle=0.7&velocity=-0.5&time=2"
        "&body.length=0.5&effects.2.gamma=0.03")


@pytest.mark.parametrize(("pendulum", "method", "dt"), [(1, "rk4", 0.01), (2, "symplectic_euler", 0.02)])
def test_a_link_is_a_run(pendulum: int, method: str, dt: float) -> None:
    found = run(read_link(LINK, pendulum))
    drag = SCENES["lab"].coefficients["quadratic_drag_rate"]
    wanted = rollout("lab", integrator=method, dt=dt, duration=2.0, angle=0.7, velocity=-0.5, length=0.5, gamma=0.03,
                     c=drag, backend="python")
    assert found.angle.tobytes() == wanted.angle.tobytes()
    assert found.energy.tobytes() == wanted.energy.tobytes()


def test_what_a_link_leaves_out_is_usual() -> None:
    spec = read_link("v=1&scene=exercise&methods=heun:0.01")
    assert spec.start is not None
    assert (float(spec.start[0]), float(spec.start[1])) == (SCENES["exercise"].run.angle, 0.0)


def test_a_link_made_in_python() -> None:
    text = link_of("lab", ["verlet", "rk4"], angle=0.5, dt=0.02, length=0.4, gamma=0.03)
    spec = read_link(text, 1)
    assert (spec.method.name, spec.h, spec.scene.body.reach) == ("velocity_verlet", 0.02, 0.4)
    assert dict(spec.scene.coefficients)["linear_drag_rate"] == 0.03
    with pytest.raises(SceneError, match="did you mean length"):
        link_of("lab", ["rk4"], lenght=0.4)
    for names in ([], ["rk4"] * 5):
        with pytest.raises(ValueError, match="1 to 4 methods"):
            link_of("lab", names)


def test_a_link_whose_time_has_not_begun_takes_one_step() -> None:
    assert run(read_link("v=1&scene=vacuum&methods=rk4:0.3&time=-1e308")).time[-1] == 0.3


def test_only_whole_steps_are_taken() -> None:
    ends = [run(read_link("v=1&scene=vacuum&methods=rk4:0.3,rk4:0.01,rk4:2&time=0.7", i)).time[-1] for i in (1, 2, 3)]
    assert ends == pytest.approx([0.6, 0.7, 2.0])


BAD = {
    "": "does not begin with v=1", "v=2&scene=lab&methods=rk4:0.01": "of another version",
    "v=1&scene=labb&methods=rk4:0.01": "did you mean lab", "v=1&scene=lab": "needs methods=",
    "v=1&scene=lab&methods=rk5:0.01": "did you mean", "v=1&scene=lab&methods=rk4:x": "the step of rk4 must be a finite",
    "v=1&scene=lab&methods=rk4:0.01&angle=nan": "angle must be a finite number, not 'nan'",
    "v=1&scene=lab&methods=rk4:0.01&body.lenght=1": "did you mean body.length",
    "v=1&scene=lab&methods=rk4:0.01&body.length=-1": "length", "v=1&scene=lab&methods=rk4:-1": "from 1e-06 to 10 s",
    "v=1&scene=lab&methods=rk4:0.01&angle=1&angle=2": "twice",
    "v=1&scene=lab&methods=rk4:0.01&time=1e308": "takes inf steps, more than the 1e\\+10 allowed",
    "v=1&scene=lab&methods=rk4:1&time=1e308": "shorter run",
    "v=1&scene=lab&methods=rk4:5e-324&time=1": "the step of rk4 must be from 1e-06 to 10 s, not '5e-324'",
    "v=1&scene=lab&methods=rk4:0.01&angle=%": "'%' is no part of an address: a percent sign is written %25",
    "v=1&scene=exercise&methods=rk4:0.01&control=1": "in a scene with a motor",
    "v=1&scene=lab&methods=" + ",".join(["rk4:0.01"] * 5): "1 to 4 methods",
}


@pytest.mark.parametrize("link", BAD)
def test_bad_links_end_in_a_sentence(link: str) -> None:
    with pytest.raises(ValueError, match=BAD[link]):
        read_link(link)
    with pytest.raises(SceneError, match="from 1 to 2"):
        read_link(LINK, 3)
    with pytest.raises(SceneError, match="must be text"):
        read_link(1)  # type: ignore[arg-type]


@pytest.mark.parametrize("link", LINKS)
def test_the_grammar_of_links(link: str) -> None:
    """The page reads the same table: see test_page.py."""
    if LINKS[link]:
        assert read_link(link, 1).scene.name in ("lab", "exercise")
    else:
        with pytest.raises(ValueError, match=r"\.$|did you mean"):
            read_link(link, 1)
