"""The windows within the window: help, and the choice of a file."""

from __future__ import annotations

from pathlib import Path

import pygame
import pygame_gui
from pygame_gui.elements import UITextBox, UIWindow
from pygame_gui.windows import UIFileDialog

from pbd_gym.playground.layout import Layout

KEYS = {
    pygame.K_1: "Drag",
    pygame.K_2: "Pin",
    pygame.K_3: "Cut",
    pygame.K_4: "Draw",
    pygame.K_SPACE: "Pause",
    pygame.K_PERIOD: "Step",
    pygame.K_s: "Slow",
    pygame.K_r: "Reset",
    pygame.K_i: "Integrator",
    pygame.K_g: "Spring",
    pygame.K_c: "Strain",
    pygame.K_d: "Dark",
    pygame.K_p: "Picture",
    pygame.K_v: "Film",
    pygame.K_F5: "Save",
    pygame.K_F9: "Load",
    pygame.K_h: "Help",
}
_HELP = """<b>Mouse</b>
Left button: the tool chosen above. Right button: pin a particle, or free it.

<b>Keys</b>
<b>1 2 3 4</b> drag, pin, cut, draw
<b>space</b> pause, <b>.</b> single step, <b>s</b> slow motion, <b>r</b> reset
<b>g</b> drag by a spring or by hand, <b>i</b> next integrator
<b>c</b> colours of strain, <b>d</b> dark or light
<b>p</b> picture, <b>v</b> film, <b>F5</b> save, <b>F9</b> load
<b>ctrl z</b> undo the last cut, stroke or pin, <b>h</b> this help, <b>Esc</b> leave

<b>Good to know</b>
A closed line drawn makes a soft body, a click a ball. Reset undoes all edits, too. \
Pictures, films and scenes go to the folder in which the program was started."""


def open_help(manager: pygame_gui.UIManager, layout: Layout) -> UIWindow:
    """Open the help over the view."""
    place = pygame.Rect(0, 0, 580, 400)
    place.center = layout.view.center
    window = UIWindow(place, manager, window_display_title="Help")
    inner = window.get_container().get_rect()
    text = _HELP.replace("\n", "<br>")
    UITextBox(text, pygame.Rect(0, 0, inner.width, inner.height), manager, container=window)
    return window


def open_file_dialog(manager: pygame_gui.UIManager, layout: Layout, folder: Path) -> UIFileDialog:
    """Ask for a scene over the view."""
    place = pygame.Rect(0, 0, 580, 460)
    place.center = layout.view.center
    return UIFileDialog(
        place,
        manager,
        window_title="Load a scene",
        initial_file_path=str(folder),
        allow_existing_files_only=True,
        allowed_suffixes={"json"},
    )
