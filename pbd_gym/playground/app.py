"""The window: its loop, and what its buttons, keys and mouse do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pygame
import pygame_gui
from pygame_gui.elements import UIWindow

from pbd_gym.playground import theme
from pbd_gym.playground.capture import Recorder
from pbd_gym.playground.dialogs import KEYS, open_file_dialog, open_help
from pbd_gym.playground.display import count_up, draw_stage, draw_waiting
from pbd_gym.playground.files import Scene, at_rest, load_scene
from pbd_gym.playground.layout import LEAST, SIZE, lay_out
from pbd_gym.playground.panel import Panel
from pbd_gym.playground.preparing import Preparation
from pbd_gym.playground.scenes import SCENES
from pbd_gym.playground.simulation import Simulation
from pbd_gym.playground.stage import Stage
from pbd_gym.playground.tools import TOOLS, Pin, Tool
from pbd_gym.playground.view import View

FPS = 60
_PACES = (1.0, 0.25, 0.0625)
_PREPARING = "Preparing the physics for that, once ..."


class App:
    """The program.

    Args:
        scene: With which it begins.
        size: Of the window [pixels].
        folder: Where pictures, films and scenes are written; the working folder where None.

    Attributes:
        running: Until the user leaves.
        paused: Whether time stands still.
        pace: Share of real time.
        stage: What is played with; None while its physics are prepared.
        tool: What the left button of the mouse does.
        panel: The controls.
    """

    def __init__(
        self, scene: Scene, *, size: tuple[int, int] = SIZE, folder: Path | None = None
    ) -> None:
        pygame.display.init()
        pygame.font.init()
        pygame.display.set_caption("pbd_gym playground")
        self._screen = pygame.display.set_mode(size, pygame.RESIZABLE)
        self._clock = pygame.time.Clock()
        self._preparation = Preparation()
        self._recorder = Recorder(folder or Path.cwd(), FPS)
        self._help: UIWindow | None = None
        self._pointer, self._is_pressed, self._pictures = (0, 0), False, 0
        self.running, self.paused, self.pace = True, False, _PACES[0]
        self.tool: Tool = TOOLS["Drag"]()
        self._theme = "light"
        self._manager = self._make_manager()
        self.open(scene)

    def open(self, scene: Scene) -> None:
        """Begin with another scene, as soon as its physics are there."""
        self._scene = scene
        self._is_waiting = True
        self.message = ""
        self.stage: Stage | None = None
        self._place_controls()

    def run(self) -> None:
        """Go on until the user leaves."""
        try:
            while self.running:
                self.frame()
                self._clock.tick(FPS)
        finally:
            self.close()

    def close(self) -> None:
        """Finish the film and close the window."""
        self._recorder.finish_film()
        pygame.display.quit()

    def frame(self) -> None:
        """Take in what the user did, step, and draw one picture."""
        for event in pygame.event.get():
            self._take(event)
        if not self.running:
            return
        self._manager.update(1.0 / FPS)
        self._prepare()
        if self.stage is not None:
            if self._has_slid:
                self._apply_settings(self.stage)
            if not self.paused:
                self.stage.simulation.step(self.pace)
        self._draw()
        self._pictures += 1

    def do(self, name: str) -> None:
        """Do what a button says."""
        stage = self.stage
        if name in TOOLS:
            self.tool = TOOLS[name]()
            self.say("")  # the tool has a hint of its own
        elif name == "Pause":
            self.paused = not self.paused
        elif name == "Slow":
            self.pace = _PACES[(_PACES.index(self.pace) + 1) % len(_PACES)]
        elif name == "Help":
            self._toggle_help()
        elif name == "Dark":
            self._toggle_dark()
        elif name == "Load":
            open_file_dialog(self._manager, self._layout, self._recorder.folder)
        elif stage is not None:
            self._do_on(stage, name)
        self._mark_buttons()

    def _do_on(self, stage: Stage, name: str) -> None:
        if name == "Step":
            self.paused = True
            stage.simulation.step(self.pace)
        elif name == "Reset":
            stage.reset()
            self._place_controls()
        elif name == "Undo":
            stage.undo()
        elif name == "Spring":
            stage.springs = not stage.springs
        elif name == "Strain":
            stage.view.strains = not stage.view.strains
        elif name == "Integrator":
            self.panel.next_integrator()
            self._has_slid = True
        else:
            self._record(stage, name)

    def _record(self, stage: Stage, name: str) -> None:
        recorder = self._recorder
        if name == "Save":
            stage.message = recorder.save(stage.simulation.scene())
        elif name == "Picture":
            stage.message = recorder.picture(self._screen)
        elif name == "Film":
            stage.message = recorder.finish_film() or recorder.start_film(self._screen)

    def _draw(self) -> None:
        shades = theme.SHADES[self._theme]
        self._screen.fill(shades.side)
        if self.stage is None:
            draw_waiting(self._screen, self._layout, self._pictures, self.message, shades)
        else:
            draw_stage(self._screen, self._layout, self.stage, self.tool, self._pointer)
        self.panel.status.set_text(self._status())
        self._manager.draw_ui(self._screen)
        trouble = self._recorder.keep(self._screen)
        if trouble is not None:
            self.say(trouble)
        pygame.display.flip()

    def _status(self) -> str:
        """Return the line of text; its numbers change twice a second."""
        if self.stage is None:
            return self.message
        if self._pictures % (FPS // 2) == 0:
            pace = 0.0 if self.paused else self.pace
            self._numbers = count_up(self.stage.drawing, self._clock.get_fps(), pace / FPS)
        return self._numbers + (self.stage.message or self.tool.hint)

    def _place_controls(self) -> None:
        """Lay out the window as large as it is now."""
        window = self._screen.get_size()
        self._layout = lay_out(window)
        self._manager.set_window_resolution(self._layout.window)
        self._manager.clear_and_reset()
        self._help = None
        drawing = self._scene.drawing if self.stage is None else self.stage.drawing
        self.panel = Panel(
            self._manager, self._layout, list(SCENES), drawing.name, drawing.settings
        )
        if self.stage is not None:
            self.stage.view = self._make_view(strains=self.stage.view.strains)
        self._has_slid, self._numbers = False, ""
        self._mark_buttons()

    def _mark_buttons(self) -> None:
        for name, tool in TOOLS.items():
            self.panel.mark(name, isinstance(self.tool, tool))
        self.panel.mark("Pause", self.paused)
        slow = "Slow" if self.pace == 1.0 else f"1/{1.0 / self.pace:.0f}"
        self.panel.mark("Slow", self.pace != 1.0, slow)
        self.panel.mark("Film", self._recorder.is_filming)
        self.panel.mark("Strain", self.stage is not None and self.stage.view.strains)
        springs = self.stage is None or self.stage.springs
        self.panel.mark("Spring", springs, "Drag by a spring" if springs else "Drag by hand")

    def _prepare(self) -> None:
        """Begin with the scene that waits, when its physics are there."""
        if not self._is_waiting:
            return
        try:
            if not self._preparation.is_ready(self._scene.drawing):
                return
            self.stage = Stage(Simulation(self._scene), self._make_view())
            self._mark_buttons()
        except (ValueError, RuntimeError) as error:
            self.message = f"This scene cannot be shown: {error}"
        self._is_waiting = False

    def _apply_settings(self, stage: Stage) -> None:
        """Take over what sliders and menus say, when the physics for it are there."""
        drawing = replace(stage.drawing, settings=self.panel.read())
        if self._preparation.is_ready(drawing):
            self._has_slid = False
            stage.edit(drawing)
        else:
            stage.message = _PREPARING

    def _take(self, event: pygame.event.Event) -> None:
        if event.type == pygame.QUIT:
            self.running = False
        elif event.type == pygame.VIDEORESIZE:
            self._resize()
        elif not self._manager.process_events(event):
            self._take_control(event)
            self._take_mouse(event)
            if event.type == pygame.KEYDOWN:
                self._take_key(event)

    def _take_control(self, event: pygame.event.Event) -> None:
        """Do what a control was used for."""
        if event.type == pygame_gui.UI_BUTTON_PRESSED:
            name = self.panel.named(event.ui_element)
            if name is not None:
                self.do(name)
        elif event.type == pygame_gui.UI_HORIZONTAL_SLIDER_MOVED:
            self._has_slid = True
        elif event.type == pygame_gui.UI_DROP_DOWN_MENU_CHANGED:
            if event.ui_element is self.panel.scene and event.text in SCENES:
                self.open(at_rest(SCENES[event.text]()))
            else:
                self._has_slid = True
        elif event.type == pygame_gui.UI_FILE_DIALOG_PATH_PICKED:
            self._load(event.text)

    def _take_mouse(self, event: pygame.event.Event) -> None:
        """Let the tool work on the view."""
        stage = self.stage
        if event.type == pygame.MOUSEMOTION:
            self._pointer = event.pos
            if self._is_pressed and stage is not None:
                self.tool.move(stage, event.pos)
        elif event.type == pygame.MOUSEBUTTONDOWN and stage is not None:
            if stage.view.place.collidepoint(event.pos):
                self._press(stage, event)
        elif event.type == pygame.MOUSEBUTTONUP and event.button == pygame.BUTTON_LEFT:
            if self._is_pressed and stage is not None:
                self.tool.release(stage, event.pos)
            self._is_pressed = False

    def _press(self, stage: Stage, event: pygame.event.Event) -> None:
        if event.button == pygame.BUTTON_LEFT:
            self._is_pressed = True
            self.tool.press(stage, event.pos)
        elif event.button == pygame.BUTTON_RIGHT:
            Pin().press(stage, event.pos)

    def _take_key(self, event: pygame.event.Event) -> None:
        if event.key == pygame.K_ESCAPE:
            self.running = False
        elif event.key in KEYS:
            self.do(KEYS[event.key])
        elif event.key == pygame.K_z and event.mod & (pygame.KMOD_CTRL | pygame.KMOD_META):
            self.do("Undo")

    def _resize(self) -> None:
        """Fit everything into the window; a film has one size and ends."""
        words = self._recorder.finish_film()
        width, height = self._screen.get_size()
        if width < LEAST[0] or height < LEAST[1]:
            window = (max(width, LEAST[0]), max(height, LEAST[1]))
            self._screen = pygame.display.set_mode(window, pygame.RESIZABLE)
        self._place_controls()
        if words is not None:
            self.say(words)

    def _make_manager(self) -> pygame_gui.UIManager:
        """Return who draws the controls."""
        colours = theme.controls_theme(theme.SHADES[self._theme])
        manager = pygame_gui.UIManager(self._screen.get_size(), colours)
        manager.preload_fonts([{"name": "noto_sans", "point_size": 14, "style": "bold"}])
        return manager

    def _make_view(self, *, strains: bool = False) -> View:
        return View(self._layout.view, strains=strains, theme=self._theme)

    def _toggle_dark(self) -> None:
        self._theme = "light" if self._theme == "dark" else "dark"
        self._manager = self._make_manager()
        self._place_controls()

    def _toggle_help(self) -> None:
        if self._help is not None and self._help.alive():
            self._help.kill()
        else:
            self._help = open_help(self._manager, self._layout)

    def _load(self, path: str) -> None:
        try:
            self.open(load_scene(path))
        except (OSError, ValueError) as error:
            self.say(str(error))

    def say(self, words: str) -> None:
        """Show a message in the line at the bottom."""
        if self.stage is None:
            self.message = words
        else:
            self.stage.message = words
