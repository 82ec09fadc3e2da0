"""Displays to test windows on, and a mouse and keyboard that work on them.

On SDL's dummy display the buttons and keys are events that are posted. Under Xvfb, where it is
installed, they are pressed on the X server itself, as by a user.
"""

import atexit
import ctypes
import functools
import os
import shutil
import subprocess

DRIVERS = ["dummy", *(["x11"] if shutil.which("Xvfb") else [])]


class Hand:
    """A mouse and a keyboard."""

    def __init__(self, pygame, frame):
        self._pygame, self._frame = pygame, frame

    def move(self, place):
        self._pygame.mouse.set_pos(place)
        self._settle()

    def press(self, place, button=1):
        self.move(place)
        self._button(place, button, down=True)

    def release(self, place, button=1):
        self.move(place)
        self._button(place, button, down=False)

    def drag(self, start, *places):
        self.press(start)
        for place in places:
            self.move(place)
        self.release(places[-1])

    def click(self, place, button=1):
        self.press(place, button)
        self.release(place, button)

    def key(self, name, mod=0):
        code = self._pygame.key.key_code(name)
        for kind in (self._pygame.KEYDOWN, self._pygame.KEYUP):
            event = self._pygame.event.Event(kind, key=code, mod=mod, unicode="", scancode=0)
            self._pygame.event.post(event)
        self._settle()

    def _button(self, place, button, down):
        kind = self._pygame.MOUSEBUTTONDOWN if down else self._pygame.MOUSEBUTTONUP
        self._pygame.event.post(self._pygame.event.Event(kind, pos=place, button=button))
        self._settle()

    def _settle(self):
        for _ in range(3):  # what is pressed posts an event of its own
            self._frame()


class XHand(Hand):
    """The same on an X server, by its XTEST extension."""

    def __init__(self, pygame, frame):
        super().__init__(pygame, frame)
        self._x11 = ctypes.CDLL("libX11.so.6")
        self._xtst = ctypes.CDLL("libXtst.so.6")
        self._x11.XOpenDisplay.restype = ctypes.c_void_p
        self._display = ctypes.c_void_p(self._x11.XOpenDisplay(os.environ["DISPLAY"].encode()))

    def move(self, place):
        self._xtst.XTestFakeMotionEvent(self._display, -1, *place, 0)
        self._settle()

    def _button(self, place, button, down):
        self._xtst.XTestFakeButtonEvent(self._display, button, int(down), 0)
        self._settle()

    def _settle(self):
        self._x11.XSync(self._display, 0)
        super()._settle()


def choose_display(driver, monkeypatch):
    """Let the next window open on a display of DRIVERS."""
    monkeypatch.setenv("SDL_VIDEODRIVER", driver)
    monkeypatch.setenv("SDL_VIDEO_WINDOW_POS", "0,0")
    if driver == "x11":
        monkeypatch.setenv("DISPLAY", _xvfb())


def hand_on(driver, pygame, frame):
    """Return a mouse and keyboard for a window whose pictures `frame` draws."""
    return (XHand if driver == "x11" else Hand)(pygame, frame)


@functools.cache
def _xvfb():
    """Start a server that ends with the tests; return the name of its display."""
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1400x1000x24", "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    atexit.register(server.terminate)
    with os.fdopen(read) as pipe:
        return f":{pipe.readline().strip()}"
