"""Bodies that follow a timeline, springs, and motions as shape keys."""
import exmat
import numpy as np
import pytest
from exmat_blender.columns import keys_of
from exmat_blender.fault import Fault
from exmat_blender.player import Player

STEPS = 20


def scene(bundle, **members):
    return {"bundle": str(bundle), "time_step": 0.002, "gravity": [0, 0, -9.81], "damping": {"mass": 1, "stiffness": 0.002}, **members}


@pytest.mark.parametrize("kind", ["clamped", "free"])
def test_frames_are_those_of_the_body_in_any_order(bundles, bar, kind):
    player = Player(exmat, scene(bundles[kind]), bar[0], STEPS, first=10)
    body = exmat.Body(player.model)
    points = exmat.Points.at(player.model, bar[0])
    expected = {10: body.positions(points)}
    for frame in range(11, 31):
        body.step(STEPS)
        expected[frame] = body.positions(points)
    for frame in (3, 10, 11, 12, 20, 11, 30, 21, 30):
        player.go_to(frame)
        assert np.array_equal(player.positions(), expected[max(frame, 10)])
    assert player.last == 30
    player.restart()
    assert player.last == 10 and np.array_equal(player.positions(), expected[10])


@pytest.mark.parametrize("kind", ["clamped", "free"])
def test_keys_add_up_to_the_motion(bundles, bar, kind):
    rest = bar[0]
    player = Player(exmat, scene(bundles[kind]), rest, STEPS)
    if kind == "free":
        player.body.motion = exmat.Motion(linear_velocity=(1, 0, 0), angular_velocity=(3, 2, 1))
        player._states[1] = player.body.state
    columns = player.columns()
    with exmat.Bundle(bundles[kind]) as data:  # of the bundle in double precision; at the vertices points are those of the mesh
        assert np.abs(columns - np.moveaxis(data["modal/basis"][:], 2, 0)).max() < 1e-5 * np.abs(columns).max()
    q, shown, motions = [], [], []
    for frame in range(1, 30):
        player.go_to(frame)
        q.append(player.body.q.copy())
        shown.append(player.positions().astype(float))
        motions.append(player.rigid_motion(columns) if kind == "free" else (np.eye(3), np.zeros(3)))
    keys = keys_of(columns, q, 2.0)
    assert all(np.abs(values).max() == 1 for _, values in keys)
    for place, (rotation, translation) in enumerate(motions):
        keyed = rest + sum(values[place] * displacement for displacement, values in keys)
        assert np.abs(keyed @ rotation.T + translation - shown[place]).max() < 2e-6  # single precision
    assert np.abs(shown[-1] - rest).max() > 0.05


@pytest.mark.parametrize("kind", ["clamped", "free"])
@pytest.mark.parametrize("stiffness", [1e3, 1e5, 1e9])
def test_a_spring_draws_its_point_and_does_not_grow(bundles, bar, kind, stiffness):
    tip = np.array([[2, 0.25, 0.25]])
    target = tip[0] + [-0.1, 0.2, 0.4]
    player = Player(exmat, scene(bundles[kind], gravity=[0, 0, 0], damping={"mass": 2, "stiffness": 0.005}), bar[0], STEPS, [(tip, stiffness, 1.0)])
    spring = player.springs[0]
    assert spring.limited == (stiffness > spring.stiffness) and (stiffness < 1e9 or spring.limited)
    for frame in range(2, 400):
        player.go_to(frame, [target])
    missed = np.linalg.norm(spring.middle(player.body) - target)
    if kind == "free":  # it swings about its tip
        assert missed < 0.01
    else:  # it comes to rest, nearer to the target the stiffer the spring is
        before = player.positions()
        player.go_to(400, [target])
        assert np.abs(player.positions() - before).max() < 1e-4
        assert missed < {1e3: 0.9, 1e5: 0.3, 1e9: 0.02}[stiffness] * np.linalg.norm(target - tip)


def test_a_spring_is_as_stiff_as_it_says(bundles, bar):
    """At rest its force is what holds the body there: the same force without the spring does the same."""
    tip, target = np.array([[2, 0.25, 0.25]]), np.array([2, 0.25, 0.5])
    still = scene(bundles["clamped"], gravity=[0, 0, 0], damping={"mass": 5, "stiffness": 0.01})
    player = Player(exmat, still, bar[0], STEPS, [(tip, 2000, 1.0)])
    for frame in range(2, 300):
        player.go_to(frame, [target])
    force = 2000 * (target - player.springs[0].middle(player.body))
    body = exmat.Body(player.model)
    body.apply_forces(exmat.Points.at(player.model, tip), [force])
    body.step(STEPS * 300)
    assert np.abs(body.q - player.body.q).max() < 1e-3 * np.abs(body.q).max()


def test_the_same_drag_gives_the_same_motion(bundles, bar):
    tips = bar[0][bar[0][:, 0] == 2]

    def dragged():
        player = Player(exmat, scene(bundles["clamped"]), bar[0], STEPS, [(tips, 3000, 1.0)])
        for frame in range(2, 40):
            player.go_to(frame, [[2, 0.25, 0.25 + 0.01 * frame]])
        return player

    first = dragged()
    assert np.array_equal(first.positions(), dragged().positions())
    last = first.positions()
    first.go_to(5)
    first.go_to(39)
    assert np.array_equal(first.positions(), last)


def test_faults_are_in_words(bundles, bar, tmp_path):
    with pytest.raises(Fault, match="nowhere.h5"):
        Player(exmat, scene(tmp_path / "nowhere.h5"), bar[0], STEPS)
    player = Player(exmat, scene(bundles["clamped"]), bar[0], STEPS)
    player.body = exmat.Body(exmat.Model(bundles["clamped"], time_step=0.002, stiffness_damping=1e300))
    player.body.set_reduced(np.full(10, 1e30), np.full(10, 1e30))
    with pytest.raises(Fault, match="simulation stopped at .* s: .*Try more steps a frame"):
        player.go_to(2)
