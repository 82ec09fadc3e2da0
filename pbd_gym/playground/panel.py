"""The controls: a bar of buttons above the view, and a column of menus and sliders beside it."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import pygame
import pygame_gui
from pygame_gui.elements import UIButton, UIDropDownMenu, UIHorizontalSlider, UILabel

from pbd_gym.playground.drawing import RANGES, RIGID, Settings
from pbd_gym.playground.layout import BAR, MARGIN, Layout

_BUTTON = 32  # height [pixels]
_GAP, _GROUP_GAP = 5, 14  # between buttons and between groups of them [pixels]

INTEGRATORS = {
    "pbd": "First order (the seed's)",
    "rattle": "Second order (RATTLE)",
    "both": "Both side by side",
}
BAR_BUTTONS = (
    "Drag",
    "Pin",
    "Cut",
    "Draw",
    "",
    "Pause",
    "Step",
    "Slow",
    "Reset",
    "",
    "Strain",
    "Help",
)
_COLUMN_BUTTONS = ("Spring", "Save", "Load", "Picture", "Film")
_NAMES = {
    "gravity": "Gravity",
    "damping": "Damping",
    "stiffness": "Stiffness of links",
    "substeps": "Substeps",
    "restitution": "Restitution",
    "friction": "Friction",
}


class Slider(NamedTuple):
    """A slider and the label that tells its value."""

    control: UIHorizontalSlider
    value: UILabel


class Panel:
    """All controls of the window.

    Args:
        manager: Of the controls.
        layout: Where they go.
        scenes: Names to choose from.
        scene: The one that is shown.
        settings: That the sliders show.

    Attributes:
        buttons: By name.
        sliders: By setting.
        scene: Menu of scenes.
        integrator: Menu of integrators.
    """

    def __init__(
        self,
        manager: pygame_gui.UIManager,
        layout: Layout,
        scenes: list[str],
        scene: str,
        settings: Settings,
    ) -> None:
        self._manager = manager
        self.settings = settings
        self.buttons: dict[str, UIButton] = {}
        self._bar_width = layout.view.width
        self._make_bar()
        self._next = layout.column.copy()  # the part of the column that is still free
        self._heading("Scene")
        options = scenes if scene in scenes else [scene, *scenes]
        self.scene = self._menu(options, scene)
        self._heading("Integrator")
        self.integrator = self._menu(list(INTEGRATORS.values()), INTEGRATORS[settings.integrator])
        self._row(0, 6)
        self.sliders = {name: self._slider(name, settings) for name in RANGES}
        self._row(0, 4)
        self._make_column_buttons()
        self.status = UILabel(layout.status, "", manager)

    def read(self) -> Settings:
        """Return the settings that the sliders and the menu show."""
        values: dict[str, float | int] = {}
        for name, slider in self.sliders.items():
            value = slider.control.get_current_value()
            values[name] = int(value) if name == "substeps" else round(float(value), 3)
        chosen = self.integrator.selected_option
        words = chosen[0] if isinstance(chosen, tuple) else chosen
        integrator = next(name for name, text in INTEGRATORS.items() if text == words)
        self.settings = replace(self.settings, integrator=integrator, **values)  # pyright: ignore[reportArgumentType]
        for name, slider in self.sliders.items():
            slider.value.set_text(worded(name, getattr(self.settings, name)))
        return self.settings

    def mark(self, name: str, on: bool, words: str | None = None) -> None:
        """Show a button as switched on or off, with other words on request."""
        button = self.buttons[name]
        if words is not None and button.text != words:
            button.set_text(words)
        if on and not button.is_selected:
            button.select()
        elif not on and button.is_selected:
            button.unselect()

    def next_integrator(self) -> None:
        """Show the next integrator in the menu, after the last one the first."""
        names = list(INTEGRATORS)
        name = names[(names.index(self.read().integrator) + 1) % len(names)]
        place = self.integrator.relative_rect
        self.integrator.kill()
        words = INTEGRATORS[name]
        self.integrator = UIDropDownMenu([*INTEGRATORS.values()], words, place, self._manager)

    def named(self, element: object) -> str | None:
        """Return the name of a button, or None for what is none."""
        return next((name for name, button in self.buttons.items() if button is element), None)

    def _make_bar(self) -> None:
        left, space = MARGIN - 6, self._bar_width - MARGIN
        named = [name for name in BAR_BUTTONS if name]
        space -= _GAP * len(named) + _GROUP_GAP * (len(BAR_BUTTONS) - len(named))
        width = min(space // len(named), 66)
        for name in BAR_BUTTONS:
            if not name:
                left += _GROUP_GAP
                continue
            place = pygame.Rect(left, (BAR - _BUTTON) // 2, width, _BUTTON)
            self.buttons[name] = UIButton(place, name, self._manager)
            left += width + _GAP

    def _make_column_buttons(self) -> None:
        half = (self._next.width - 6) // 2
        self.buttons["Spring"] = UIButton(self._row(_BUTTON, 6), "Drag by a spring", self._manager)
        for index, name in enumerate(_COLUMN_BUTTONS[1:]):
            if index % 2 == 0:
                row = self._row(_BUTTON, 6)
            place = pygame.Rect(row.left + (index % 2) * (half + 6), row.top, half, _BUTTON)
            self.buttons[name] = UIButton(place, name, self._manager)

    def _row(self, height: int, gap: int) -> pygame.Rect:
        """Return the next row of the column."""
        row = pygame.Rect(self._next.topleft, (self._next.width, height))
        self._next.top += height + gap
        return row

    def _heading(self, words: str) -> None:
        UILabel(self._row(22, 2), words, self._manager)

    def _menu(self, options: list[str], chosen: str) -> UIDropDownMenu:
        return UIDropDownMenu([*options], chosen, self._row(30, 8), self._manager)

    def _slider(self, name: str, settings: Settings) -> Slider:
        low, high, _ = RANGES[name]
        row = self._row(20, 2)
        value = getattr(settings, name)
        UILabel(row, _NAMES[name], self._manager)
        place = pygame.Rect(row.centerx, row.top, row.width // 2, row.height)
        label = UILabel(place, worded(name, value), self._manager, object_id="#value")
        control = UIHorizontalSlider(self._row(18, 9), value, (low, high), self._manager)
        return Slider(control, label)


def worded(name: str, value: float) -> str:
    """Return the value of a setting in words."""
    if name == "stiffness":
        return "rigid" if value >= RIGID else f"{10.0**value:.3g} N"
    if name == "substeps":
        return f"{value:d}" if isinstance(value, int) else f"{value:.0f}"
    return f"{value:.2f} {RANGES[name][2]}".rstrip()
