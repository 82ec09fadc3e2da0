"""Ctrl-C as a wish: the training ends at its next update instead of in the middle of one."""

from __future__ import annotations

import signal
from types import FrameType, TracebackType


class InterruptRequest:
    """Within its `with` block, Ctrl-C and SIGTERM set `requested`; a second one ends at once."""

    def __init__(self) -> None:
        self.requested = False

    def __enter__(self) -> InterruptRequest:
        self._previous = {
            number: signal.signal(number, self._request)
            for number in (signal.SIGINT, signal.SIGTERM)
        }
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._restore()

    def _request(self, number: int, frame: FrameType | None) -> None:
        self.requested = True
        self._restore()

    def _restore(self) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)
