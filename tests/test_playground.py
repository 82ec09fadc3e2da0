import time
from dataclasses import replace

import numpy as np
import pytest

from display import DRIVERS, choose_display, hand_on
from drawings import hanging_rope
from pbd_gym.playground.files import at_rest, load_scene
from pbd_gym.playground.scenes import SCENES

pytest.importorskip("pygame_gui")


@pytest.fixture(params=DRIVERS)
def play(request, monkeypatch, tmp_path):
    """A function that opens the program on a scene and returns it with a mouse."""
    import pygame

    from pbd_gym.playground.app import App

    choose_display(request.param, monkeypatch)
    opened = []

    def open_app(scene):
        app = App(scene, folder=tmp_path)
        opened.append(app)
        deadline = time.monotonic() + 300.0  # kernels may have to be compiled
        while app.stage is None:
            app.frame()
            assert app.running, app.message
            assert not app.message
            assert time.monotonic() < deadline
            time.sleep(0.01)
        for _ in range(5):
            app.frame()
        return app, hand_on(request.param, pygame, app.frame)

    yield open_app
    for app in opened:
        app.close()


def seen(app, particle):
    """Where a particle is seen in the window."""
    middle = app.stage.view.place.center
    x, y = app.stage.place_of(particle, middle)
    return round(x), round(y)


def position(app, particle):
    return next(iter(app.stage.simulation.worlds.values())).x[0, particle].copy()


def middle_of(element):
    return element.get_abs_rect().center


def press_button(app, hand, name):
    hand.click(middle_of(app.panel.buttons[name]))


def test_dragging_moves_the_particle_and_letting_go_frees_it(play):
    app, hand = play(hanging_rope())
    start = seen(app, 5)
    place = (start[0] + 120, start[1] - 60)
    hand.press(start)
    hand.move(place)
    for _ in range(60):
        app.frame()
    assert abs(seen(app, 5)[0] - start[0]) > 50
    assert app.stage.simulation.grip is not None
    hand.release(place)
    assert app.stage.simulation.grip is None
    for _ in range(30):
        app.frame()
    assert position(app, 5)[1] < 0.0  # it falls back


def test_dragging_by_hand_puts_the_particle_where_the_mouse_is(play):
    app, hand = play(hanging_rope())
    press_button(app, hand, "Spring")
    start = seen(app, 5)
    place = (start[0] + 60, start[1] - 20)
    hand.press(start)
    hand.move(place)
    app.frame()
    assert np.abs(np.subtract(seen(app, 5), place)).max() <= 1  # whole pixels
    hand.release(place)


def test_a_stroke_cuts_the_link_that_it_crosses(play):
    app, hand = play(hanging_rope())
    press_button(app, hand, "Cut")
    (x, upper), (_, lower) = seen(app, 2), seen(app, 3)
    middle = (upper + lower) // 2
    hand.drag((x - 40, middle), (x - 10, middle), (x + 40, middle))
    assert [thread.particles for thread in app.stage.drawing.threads] == [(0, 1, 2), (3, 4, 5)]
    for _ in range(60):
        app.frame()
    assert position(app, 2)[1] > 0.05
    assert position(app, 3)[1] < -0.5  # it fell


def test_the_tool_and_the_right_button_pin_and_unpin(play):
    app, hand = play(hanging_rope())
    press_button(app, hand, "Pin")
    hand.click(seen(app, 5))
    assert app.stage.drawing.particles[5].pinned
    hand.click(seen(app, 0), button=3)
    assert not app.stage.drawing.particles[0].pinned
    for _ in range(60):
        app.frame()
    assert position(app, 0)[1] < -0.2  # it fell, and hangs from the other end
    hand.click(seen(app, 5))
    assert not app.stage.drawing.particles[5].pinned


def test_strokes_draw_ropes_soft_bodies_and_balls(play):
    app, hand = play(hanging_rope())
    press_button(app, hand, "Draw")
    x, y = seen(app, 5)
    hand.drag((x, y), (x + 40, y), (x + 90, y), (x + 140, y))
    drawn = app.stage.drawing.threads[-1]
    assert drawn.particles[:2] == (5, 6)  # it joins the rope where it began
    hand.drag((700, 200), (800, 200), (800, 300), (700, 300), (700, 204))
    assert len(app.stage.drawing.outlines) == 1
    hand.click((200, 150))
    assert len(app.stage.drawing.balls) == 1
    for _ in range(30):
        app.frame()
    assert np.isfinite(position(app, slice(None))).all()


def test_a_slider_changes_gravity(play):
    app, hand = play(hanging_rope())
    slider = app.panel.sliders["gravity"].control
    knob, bar = slider.sliding_button.get_abs_rect(), slider.get_abs_rect()
    hand.drag(knob.center, (knob.centerx - 30, knob.centery), (bar.left + 2, knob.centery))
    app.frame()
    assert app.stage.drawing.settings.gravity == 0.0
    world = app.stage.simulation.worlds["pbd"]
    assert (world.model.gravity == 0.0).all()


def test_pause_step_slow_and_reset(play):
    app, hand = play(hanging_rope())
    press_button(app, hand, "Pause")
    before = app.stage.simulation.time
    app.frame()
    assert app.stage.simulation.time == before
    press_button(app, hand, "Step")
    assert app.stage.simulation.time == pytest.approx(before + 1.0 / 60.0)
    hand.key("s")
    hand.key(".")
    assert app.stage.simulation.time == pytest.approx(before + 1.25 / 60.0)
    hand.click(seen(app, 5), button=3)
    hand.key("r")
    assert not app.stage.drawing.particles[5].pinned
    assert app.stage.simulation.time == 0.0


def test_the_integrators_are_compared_side_by_side(play):
    swing = SCENES["Pendulum"]()
    app, hand = play(at_rest(replace(swing, settings=replace(swing.settings, integrator="pbd"))))
    for name, shown in (("rattle", ["rattle"]), ("both", ["pbd", "rattle"])):
        hand.key("i")
        deadline = time.monotonic() + 300.0
        while app.stage.drawing.settings.integrator != name:
            app.frame()
            assert time.monotonic() < deadline
        assert list(app.stage.simulation.worlds) == shown
    for _ in range(120):
        app.frame()
    first, second = (np.array(app.stage.simulation.energies[name]) for name in ("pbd", "rattle"))
    assert first[-1] < first[0] - 0.1  # the seed's scheme takes energy out
    assert np.ptp(second) < 0.01


def test_the_last_edit_is_undone_and_the_one_before(play):
    pygame = pytest.importorskip("pygame")
    app, hand = play(hanging_rope())
    hand.key("z", pygame.KMOD_LCTRL)
    assert "nothing to undo" in app.stage.message
    drawn, sliders = app.stage.drawing, app.stage.drawing.settings
    hand.click(seen(app, 5), button=3)
    app.do("Pause")
    before = position(app, slice(None))
    hand.key("3")
    (x, upper), (_, lower) = seen(app, 2), seen(app, 3)
    hand.drag((x - 40, (upper + lower) // 2), (x + 40, (upper + lower) // 2))
    assert len(app.stage.drawing.threads) == 2
    app.stage.edit(replace(app.stage.drawing, settings=replace(sliders, gravity=1.0)))
    app.stage.simulation.step()
    hand.key("z", pygame.KMOD_LCTRL)
    assert app.stage.drawing.threads == drawn.threads
    assert app.stage.drawing.particles[5].pinned
    assert app.stage.drawing.settings.gravity == 1.0
    np.testing.assert_array_equal(position(app, slice(None)), before)
    hand.key("z", pygame.KMOD_LCTRL)
    assert app.stage.drawing.particles == drawn.particles


def test_what_is_saved_is_loaded(play, tmp_path):
    app, hand = play(hanging_rope())
    hand.click(seen(app, 5), button=3)
    press_button(app, hand, "Save")
    saved = app.stage.simulation.scene()
    loaded = load_scene(tmp_path / "playground-1.json")
    assert loaded.drawing == app.stage.drawing
    np.testing.assert_array_equal(loaded.x.shape, saved.x.shape)
    app.open(loaded)
    app.frame()
    assert app.stage.drawing.particles[5].pinned


def test_pictures_and_films_are_written(play, tmp_path):
    app, hand = play(hanging_rope())
    press_button(app, hand, "Picture")
    assert (tmp_path / "playground-1.png").stat().st_size > 10_000
    hand.key("v")
    for _ in range(5):
        app.frame()
    hand.key("v")
    assert (tmp_path / "playground-1.mp4").stat().st_size > 1_000


def test_h_opens_and_closes_the_help(play):
    _, hand = play(hanging_rope())
    pygame = pytest.importorskip("pygame")
    plain = pygame.surfarray.array3d(pygame.display.get_surface())
    hand.key("h")
    helped = pygame.surfarray.array3d(pygame.display.get_surface())
    assert (plain != helped).any(axis=2).mean() > 0.1
    hand.key("h")
    closed = pygame.surfarray.array3d(pygame.display.get_surface())
    assert (plain != closed).any(axis=2).mean() < 0.1


def test_strain_is_shown_in_colours(play):
    app, hand = play(hanging_rope())
    pygame = pytest.importorskip("pygame")
    hand.key("space")
    plain = pygame.surfarray.array3d(pygame.display.get_surface())
    press_button(app, hand, "Strain")
    coloured = pygame.surfarray.array3d(pygame.display.get_surface())
    place = app.stage.view.place
    differ = (plain != coloured).any(axis=2)[: place.right, place.top : place.bottom]
    assert differ.sum() > 500  # the rope and the legend


def test_d_makes_the_window_dark_and_light_again(play):
    pygame = pytest.importorskip("pygame")
    app, hand = play(hanging_rope())

    def brightness():
        return float(pygame.surfarray.array3d(pygame.display.get_surface()).mean())

    hand.key("3")
    light = brightness()
    hand.key("d")
    assert brightness() < 80 < 200 < light
    assert app.panel.buttons["Cut"].is_selected
    press_button(app, hand, "Pause")
    assert app.paused
    hand.key("d")
    assert brightness() == pytest.approx(light, abs=2)  # the rope has moved on, Pause is marked


def test_a_window_of_any_size_has_room_for_all_controls(play):
    pygame = pytest.importorskip("pygame")
    app, _ = play(hanging_rope())
    for size in ((1400, 900), (901, 641), (300, 200)):
        pygame.display.set_mode(size, pygame.RESIZABLE)
        pygame.event.post(pygame.event.Event(pygame.VIDEORESIZE, size=size, w=size[0], h=size[1]))
        for _ in range(3):
            app.frame()
        window = pygame.display.get_surface().get_rect()
        controls = [*app.panel.buttons.values(), app.panel.scene, app.panel.status]
        controls += [slider.control for slider in app.panel.sliders.values()]
        places = [control.get_abs_rect() for control in controls]
        assert all(window.contains(place) for place in places)
        for index, place in enumerate(places):
            assert place.collidelist(places[:index]) == -1


def test_closing_the_window_ends_the_program(play):
    pygame = pytest.importorskip("pygame")
    app, _ = play(hanging_rope())
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    app.run()
    assert not app.running
    assert not pygame.display.get_init()


def test_a_cloth_in_space_is_dragged_and_cut_and_not_drawn_upon(play):
    app, hand = play(at_rest(SCENES["Cloth in space"]()))
    last = len(app.stage.drawing.particles) - 1
    start = seen(app, last)
    hand.press(start)
    before = position(app, last)
    hand.move((start[0] + 80, start[1] - 80))
    for _ in range(20):
        app.frame()
    assert np.linalg.norm(position(app, last) - before) > 0.05
    hand.release((start[0] + 80, start[1] - 80))
    threads = len(app.stage.drawing.threads)
    hand.key("3")
    middle = seen(app, last // 2)
    hand.drag((middle[0] - 40, middle[1]), (middle[0] + 41, middle[1] + 3))
    assert len(app.stage.drawing.threads) > threads
    assert app.stage.simulation.worlds["pbd"].model.bodies[0].holes
    hand.key("4")
    hand.click((200, 200))
    assert "flat scene" in app.stage.message
