import gymnasium
import numpy as np
import pytest

from drawn import CLOTH, PLANE, SPACE, as_ints, changed, cloth, every_scene, no_goal, pendulum, rope
from pbd_gym.physics import ModelBuilder, shapes
from pbd_gym.rendering import Renderer, Viewpoint
from pbd_gym.rendering.scene import loose_links, payload_radius, tips
from pbd_gym.rendering.strain import Strains, scale

SIZE = (256, 256)


@every_scene
@pytest.mark.parametrize("color", ["material", "strain"])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_every_look_shows_what_is_there(model, view, color, theme):
    renderer = Renderer(model, view, size=SIZE, color=color, theme=theme)
    empty = renderer.draw(no_goal(model))
    frame = renderer.draw(model.positions)
    assert changed(frame, empty) > 100
    assert (np.median(frame) > 200) == (theme == "light")
    np.testing.assert_array_equal(renderer.draw(model.positions), frame)


def stretched(model, strain):
    x = model.positions.copy()
    return x.mean(axis=0) + (x - x.mean(axis=0)) * (1.0 + strain)


@pytest.mark.parametrize(("model", "view"), [(rope(), PLANE), (cloth(), SPACE)])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_what_is_too_long_is_red_and_what_is_too_short_is_blue(model, view, theme):
    renderer = Renderer(model, view, size=SIZE, color="strain", theme=theme)
    empty = renderer.draw(no_goal(model))

    def redness(strain):
        frame = renderer.draw(stretched(model, strain))
        drawn = as_ints(frame)[(frame != empty).any(axis=2)]
        return (drawn[:, 0] - drawn[:, 2]).mean()

    reds = [redness(strain) for strain in (-0.1, -0.01, 0.0, 0.01, 0.1)]
    assert max(reds[:2]) < -30 < -15 < reds[2] < 15 < 30 < min(reds[3:])


def test_a_link_has_the_colour_of_its_own_strain():
    model = rope()
    strains = Strains(model, "light")
    x = model.positions.copy()
    rest = np.linalg.norm(x[1] - x[0])
    x[1:] += [0.0, -0.05 * rest]  # the first link alone is longer
    along = strains.of_pairs(np.stack([np.arange(11), np.arange(1, 12)], axis=1), x)
    np.testing.assert_allclose(along, [0.05] + [0.0] * 10, atol=1e-12)  # rounding alone
    of_particles = strains.of_particles(x)
    np.testing.assert_allclose(of_particles, [0.05, 0.05] + [0.0] * 10, atol=1e-12)


def test_a_soft_body_shows_the_strain_of_its_area():
    builder = ModelBuilder(2)
    corners = 0.3 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    body = shapes.soft_body_2d(builder, corners, mass=0.1)
    model = builder.build()
    x = model.positions.copy()
    strains = Strains(model, "light")
    assert strains.of_content(np.array(body), x) == pytest.approx(0.0, abs=1e-12)  # rounding alone
    assert strains.of_content(np.array(body), 1.1 * x) == pytest.approx(0.21, abs=1e-12)
    assert strains.of_content(np.array(body[:3]), x) is None
    renderer = Renderer(model, PLANE, size=SIZE, color="strain")
    small, large = (as_ints(renderer.draw(share * x)) for share in (0.95, 1.05))
    row, column = np.round(renderer.project(np.zeros((1, 2)))[0][0][::-1]).astype(int)
    assert small[row, column, 2] - small[row, column, 0] > 20  # blue
    assert large[row, column, 0] - large[row, column, 2] > 20  # red


def test_a_cloth_shows_the_strain_of_its_threads():
    model = cloth()
    x = model.positions.copy()
    x[:, 0] *= 1.02  # along the rows; the other threads keep their length
    grid = np.arange(CLOTH**2).reshape(CLOTH, CLOTH)
    strain = Strains(model, "light").of_grid(grid, x)
    np.testing.assert_allclose(strain, 0.02, atol=1e-12)  # rounding alone


def test_the_legend_is_even_and_ends_at_ten_percent():
    places = scale(np.array([-1.0, -0.1, -0.01, 0.0, 0.01, 0.1, 1.0]))
    np.testing.assert_allclose(places[:3], -places[:-4:-1])
    assert places[0] == places[1] == -1.0
    assert -1.0 < places[2] < places[3] == 0.0


def test_the_legend_stands_inside_the_picture_and_alone():
    for size in ((256, 256), (512, 512), (1024, 768)):
        model = rope()
        x = no_goal(model)
        plain, legend = (Renderer(model, PLANE, size=size, color=c) for c in ("material", "strain"))
        rows, columns = np.nonzero((plain.draw(x) != legend.draw(x)).any(axis=2))
        assert rows.min() >= 2
        assert rows.max() < size[1] - 2
        assert size[0] * 0.4 < columns.min()
        assert columns.max() < size[0] - 2


def test_a_dark_picture_is_dark_and_keeps_its_shapes():
    light, dark = (Renderer(rope(), PLANE, size=SIZE, theme=t) for t in ("light", "dark"))
    x = rope().positions
    assert dark.draw(x).mean() < 60 < 200 < light.draw(x).mean()


@pytest.mark.parametrize("camera", ["front", "side", "top", Viewpoint(45.0, 20.0, zoom=0.7)])
def test_a_camera_looks_from_its_side_and_frames_everything(camera):
    model = cloth()
    renderer = Renderer(model, SPACE, size=SIZE, camera=camera)
    default = Renderer(model, SPACE, size=SIZE)
    assert changed(renderer.draw(model.positions), default.draw(model.positions)) > 5000
    corners = np.array(np.meshgrid(*zip(*SPACE, strict=True))).reshape(3, -1).T
    pixels, _ = renderer.project(corners)
    assert (pixels > 0).all()
    assert (pixels < SIZE).all()


def test_zoom_enlarges():
    for model, view in ((rope(), PLANE), (cloth(), SPACE)):
        plain = Renderer(model, view, size=SIZE)
        near = Renderer(model, view, size=SIZE, camera=Viewpoint(zoom=2.0))
        spans = [np.ptp(r.project(model.positions)[0], axis=0).max() for r in (plain, near)]
        assert spans[1] == pytest.approx(2.0 * spans[0])


def test_the_clock_shows_the_time_on_request():
    model = rope()
    x = no_goal(model)
    plain, clock = (Renderer(model, PLANE, size=SIZE, show=s) for s in ((), ("clock",)))
    np.testing.assert_array_equal(plain.draw(x, time=1.0), clock.draw(x))
    first, second = clock.draw(x, time=1.0), clock.draw(x, time=2.5)
    rows, columns = np.nonzero((first != second).any(axis=2))
    assert rows.max() < 40
    assert columns.min() > 180


@pytest.mark.parametrize(("model", "view"), [(rope(), PLANE), (cloth(), SPACE)])
def test_a_trail_leads_where_the_tip_was(model, view):
    shown, hidden = (Renderer(model, view, size=SIZE, show=s) for s in (("trail",), ()))
    trail = np.linspace(view[0], view[1], 20)[:, None]
    empty = hidden.draw(no_goal(model), trail=trail)
    frame = shown.draw(no_goal(model), trail=trail)
    pixels, _ = shown.project(trail[:, 0])
    inside = pixels[5:-1].astype(int)
    assert (frame != empty).any(axis=2)[inside[:, 1], inside[:, 0]].all()
    broken = trail.copy()
    broken[10] = np.nan
    assert 0 < changed(shown.draw(no_goal(model), trail=broken), empty) < changed(frame, empty)
    with pytest.raises(ValueError, match="trail has shape"):
        shown.draw(model.positions, trail=trail[0])


def test_the_tips_are_free_ends():
    assert tips(rope()).tolist() == [11]
    assert tips(pendulum([1.0, 1.0])).tolist() == [2]
    assert tips(cloth()).tolist() == [CLOTH * (CLOTH - 1), CLOTH**2 - 1]


def test_a_load_is_drawn_by_its_mass_and_links_of_no_body_as_rods():
    builder = ModelBuilder(2)
    shapes.rope(builder, (0, 0.5), (0, -0.5), 12, mass=0.2, payload=1.0)
    loose = builder.add_particles([(0.5, 0.0), (0.9, 0.0)], 0.1)
    builder.add_distance(*loose.tolist())
    model = builder.build()
    # a ball of 500 kg/m3
    radius = np.cbrt(3.0 * (1.0 + 0.2 / 12) / (4.0 * np.pi * 500.0))
    assert payload_radius(model, model.bodies[0]) == pytest.approx(radius, rel=0.01)
    assert payload_radius(rope(), rope().bodies[0]) == 0.0
    assert loose_links(model).tolist() == [loose.tolist()]
    renderer = Renderer(model, PLANE, size=SIZE)
    x = no_goal(model)
    x[loose] = model.positions[loose]
    middle = renderer.project(np.array([[0.7, 0.0]]))[0][0].astype(int)
    difference = renderer.draw(x) != renderer.draw(no_goal(model))
    assert difference[middle[1], middle[0]].any()


@pytest.mark.parametrize(
    ("keyword", "value", "allowed"),
    [
        ("camera", "behind", "default, front, side, top"),
        ("camera", 3, "default, front"),
        ("color", "stress", "material, strain"),
        ("theme", "grey", "light, dark"),
        ("show", "clock", "sequence"),
        ("show", ("time",), "scale, clock, trail"),
    ],
)
def test_unknown_looks_are_refused_at_the_door(keyword, value, allowed):
    with pytest.raises(ValueError, match=f"{keyword} is .*{allowed}"):
        Renderer(rope(), PLANE, **{keyword: value})
    for make in (gymnasium.make, lambda id, **k: gymnasium.make_vec(id, num_envs=2, **k)):
        with pytest.raises(ValueError, match=f"{keyword} is .*{allowed}"):
            make("pbd_gym:PBDRope-v0", render_mode="rgb_array", **{keyword: value})


@pytest.mark.parametrize("wrong", [{"zoom": 0.0}, {"elevation": 91.0}, {"azimuth": np.nan}])
def test_viewpoints_that_cannot_be_are_refused(wrong):
    with pytest.raises(ValueError, match=f"{next(iter(wrong))} is"):
        Viewpoint(**wrong)


def test_environments_draw_clock_and_trail_of_the_episode_alone():
    look = {"render_mode": "rgb_array", "render_size": SIZE, "show": ("clock", "trail")}
    env = gymnasium.make("pbd_gym:PBDRope-v0", **look)
    plain = gymnasium.make("pbd_gym:PBDRope-v0", **{**look, "show": ()})
    first = None
    for _ in range(2):
        env.reset(seed=1)
        plain.reset(seed=1)
        start = env.render()
        assert first is None or (start == first).all()  # nothing is left of the last episode
        first = start
        for _ in range(10):
            env.step(np.array([1.0, 0.0], dtype=np.float32))
            plain.step(np.array([1.0, 0.0], dtype=np.float32))
        assert changed(env.render(), plain.render()) > 100


def test_a_batch_shows_each_world_its_own_look_and_trail():
    look = {"render_mode": "rgb_array", "render_size": (128, 128), "show": ("trail",)}
    look |= {"color": "strain", "theme": "dark", "camera": "default"}
    vector = gymnasium.make_vec(
        "pbd_gym:PBDRope-v0", num_envs=2, vectorization_mode="vector_entry_point", **look
    )
    single = gymnasium.make("pbd_gym:PBDRope-v0", **look)
    vector.reset(seed=4)
    single.reset(seed=5)
    for _ in range(5):
        vector.step(np.ones((2, 2), dtype=np.float32))
        single.step(np.ones(2, dtype=np.float32))
    frames = vector.render()
    assert len(frames) == 2
    np.testing.assert_array_equal(frames[1], single.render())
    assert changed(frames[0], frames[1]) > 50
