"""Videos from pictures, and many pictures in one."""

from __future__ import annotations

import contextlib
import os
import subprocess
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

_GAP = 2  # between the pictures of a grid [pixels]; even, so that the grid stays even
_GAP_COLOUR = 168

# H.264 that every browser plays: 4:2:0, colours as for HD video, index in front for streaming.
_MP4 = (
    *("-c:v", "libx264", "-preset", "medium", "-crf", "18", "-pix_fmt", "yuv420p", "-vf"),
    "scale=out_color_matrix=bt709:out_range=tv,"
    "setparams=colorspace=bt709:color_primaries=bt709:color_trc=bt709",
    *("-movflags", "+faststart"),
)
# One palette made for all frames, which are mostly plain areas.
_GIF = (
    "-filter_complex",
    "[0:v]split[a][b];[a]palettegen[p];"
    "[b][p]paletteuse=dither=bayer:bayer_scale=5:diff_mode=rectangle",
    *("-loop", "0"),
)
_WEBP = ("-c:v", "libwebp_anim", "-q:v", "80", "-loop", "0")
_FORMATS = {".mp4": _MP4, ".gif": _GIF, ".webp": _WEBP}
_MAX_GIF_FPS = 50  # viewers play frames of less than 2/100 s slowly, at 10 frames per second


class VideoWriter:
    """Writes frames to a video, MP4 (H.264), GIF or WebP by the suffix of the path.

    The file appears when the with-block ends without an exception; otherwise nothing is left.

        with VideoWriter("rope.mp4", fps=30) as video:
            video.write(frame)

    Args:
        path: Of the video; missing folders are made.
        fps: Frames per second.

    Raises:
        ImportError: If imageio-ffmpeg is not installed.
        ValueError: If the suffix is unknown or the format cannot play so many frames per second.
    """

    def __init__(self, path: str | os.PathLike[str], fps: float) -> None:
        self.path = Path(path)
        suffix = self.path.suffix.lower()
        if suffix not in _FORMATS:
            raise ValueError(f"{self.path} ends with {suffix!r}; allowed are {', '.join(_FORMATS)}")
        if not (np.isfinite(fps) and fps > 0.0):
            raise ValueError(f"fps is {fps!r}; it must be finite and above 0")
        if suffix == ".gif" and fps > _MAX_GIF_FPS:
            raise ValueError(f"fps is {fps!r}; a GIF plays at most {_MAX_GIF_FPS} per second")
        try:
            from imageio_ffmpeg import get_ffmpeg_exe
        except ImportError as error:
            raise ImportError('videos need imageio-ffmpeg: pip install "pbd-gym[video]"') from error
        self._ffmpeg = get_ffmpeg_exe()
        self._rate = str(Fraction(fps).limit_denominator(1001))
        self._output = _FORMATS[suffix]
        self._partial = self.path.with_name(f".{self.path.stem}.{os.getpid()}.partial{suffix}")
        self._shape: tuple[int, ...] = ()
        self._process: subprocess.Popen[bytes] | None = None
        self._finished = False

    def __enter__(self) -> VideoWriter:
        return self

    def __exit__(self, exception: type[BaseException] | None, *_: object) -> None:
        if exception is None:
            self.close()
        else:
            self._abandon()

    def write(self, frame: np.ndarray) -> None:
        """Append a frame (height, width, 3) of uint8, even and of the same size as the others.

        Raises:
            ValueError: If it is no such frame, or the video is finished.
            RuntimeError: If ffmpeg gave up.
        """
        check_frame(frame)
        if self._finished:
            raise ValueError(f"{self.path} is finished; nothing more can be written to it")
        process = self._process or self._start(frame.shape)
        if frame.shape != self._shape:
            raise ValueError(f"frame has shape {frame.shape}; the first one had {self._shape}")
        assert process.stdin is not None
        try:
            process.stdin.write(np.ascontiguousarray(frame).data)
        except OSError as error:
            _, words = process.communicate()
            self._abandon()
            raise RuntimeError(self._complaint(words)) from error

    def close(self) -> None:
        """Finish the video: now the file appears. Doing so twice does no harm.

        Raises:
            ValueError: If no frame was written.
            RuntimeError: If ffmpeg gave up.
        """
        if self._finished:
            return
        if self._process is None:
            raise ValueError(f"no frame was written to {self.path}")
        self._finished = True
        try:
            _, words = self._process.communicate()
            if self._process.returncode:
                raise RuntimeError(self._complaint(words))
            os.replace(self._partial, self.path)
        finally:
            self._abandon()

    def _start(self, shape: tuple[int, ...]) -> subprocess.Popen[bytes]:
        height, width = shape[:2]
        if height % 2 or width % 2:
            raise ValueError(f"frame is {width} x {height} pixels; a video needs even sides")
        self.path.parent.mkdir(parents=True, exist_ok=True)
        source = f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -r {self._rate} -i -".split()
        target = f"file:{self._partial}"  # or ffmpeg would take "a:b.mp4" for a protocol
        self._process = subprocess.Popen(
            [self._ffmpeg, "-y", "-loglevel", "error", *source, *self._output, target],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        self._shape = shape
        return self._process

    def _complaint(self, words: bytes) -> str:
        return f"ffmpeg could not write {self.path}: {words.decode(errors='replace').strip()}"

    def _abandon(self) -> None:
        """Stop ffmpeg and remove what is not finished."""
        self._finished = True
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for stream in (self._process.stdin, self._process.stderr):
                with contextlib.suppress(OSError):  # what was still to be written is not wanted
                    if stream is not None:
                        stream.close()
        self._partial.unlink(missing_ok=True)


def check_frame(frame: Any) -> None:
    """Refuse what is not a picture (height, width, 3) of uint8.

    Raises:
        ValueError: Naming the shape and the type.
    """
    array = np.asarray(frame)
    if array.dtype != np.uint8 or array.ndim != 3 or array.shape[2] != 3 or not array.size:
        raise ValueError(
            f"frame is {array.dtype} of shape {array.shape}; expected uint8 (height, width, 3)"
        )


def grid(frames: Sequence[np.ndarray], columns: int | None = None) -> np.ndarray:
    """Tile pictures into one, row by row; what stays empty is white.

    Args:
        frames: Pictures (height, width, 3) of uint8, all of one size.
        columns: Pictures in a row; about as many as rows where None.

    Returns:
        One picture, even in size if the pictures are.

    Raises:
        ValueError: If there is no picture, they differ in size or columns is not positive.
    """
    pictures = list(frames)
    if not pictures:
        raise ValueError("frames is empty; a grid needs at least one picture")
    for picture in pictures:
        check_frame(picture)
        if picture.shape != pictures[0].shape:
            raise ValueError(f"frame has shape {picture.shape}; the first has {pictures[0].shape}")
    if columns is None:
        columns = int(np.ceil(np.sqrt(len(pictures))))
    if columns < 1:
        raise ValueError(f"columns is {columns}; it must be at least 1")
    height, width = pictures[0].shape[:2]
    rows = -(-len(pictures) // columns)
    size = (rows * (height + _GAP) - _GAP, columns * (width + _GAP) - _GAP, 3)
    whole = np.full(size, _GAP_COLOUR, dtype=np.uint8)
    for place in range(rows * columns):
        top, left = (place // columns) * (height + _GAP), (place % columns) * (width + _GAP)
        content = pictures[place] if place < len(pictures) else 255
        whole[top : top + height, left : left + width] = content
    return whole
