import os
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from pbd_gym.rendering import VideoWriter, grid

imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")

SIZE = (64, 48)  # width and height


def moving_block(count):
    """A grey block that wanders over a coloured ground, one frame for each place."""
    frames = np.empty((count, SIZE[1], SIZE[0], 3), dtype=np.uint8)
    frames[:] = (0, 114, 178)
    for k, frame in enumerate(frames):
        frame[16:32, 2 * k : 2 * k + 16] = 200
    return frames


def read(path):
    """Return what a video says of itself and its frames."""
    with warnings.catch_warnings():
        # The reader leaves its pipes to the garbage collector.
        warnings.simplefilter("ignore", ResourceWarning)
        reader = imageio_ffmpeg.read_frames(str(path))
        about = next(reader)
        frames = list(reader)
        del reader
    width, height = about["size"]
    return about, [np.frombuffer(frame, np.uint8).reshape(height, width, 3) for frame in frames]


@pytest.mark.parametrize(
    # Chroma at half resolution blurs the block's rim; a GIF keeps every pixel of so few colours.
    ("name", "fps", "tolerance"),
    [("film.mp4", 50, 12.0), ("film.MP4", 30, 12.0), ("new/folder/film.gif", 25, 1.0)],
)
def test_a_video_plays_back_as_it_was_written(tmp_path, name, fps, tolerance):
    frames = moving_block(20)
    with VideoWriter(tmp_path / name, fps) as video:
        for frame in frames:
            video.write(frame)
        assert not (tmp_path / name).exists()  # a half-written film cannot be taken for a whole one
    about, played = read(tmp_path / name)
    assert about["fps"] == fps
    assert about["size"] == SIZE
    assert len(played) == len(frames)
    for frame, copy in zip(frames, played, strict=True):
        assert np.abs(frame.astype(int) - copy).mean() < tolerance
    assert [p.name for p in (tmp_path / name).parent.iterdir()] == [(tmp_path / name).name]


def test_an_mp4_is_of_the_kind_that_browsers_play(tmp_path):
    path = tmp_path / "film.mp4"
    with VideoWriter(path, 30) as video:
        for frame in moving_block(10):
            video.write(frame)
    about, played = read(path)
    assert about["codec"] == "h264"
    assert about["pix_fmt"].startswith("yuv420p(tv, bt709")
    head = path.read_bytes()
    assert head.index(b"moov") < head.index(b"mdat")  # the index stands in front
    # The ground keeps its colour: players that follow the tags show what was drawn.
    np.testing.assert_allclose(played[0][40:, 40:].mean(axis=(0, 1)), (0, 114, 178), atol=4)


def test_a_webp_holds_every_frame(tmp_path):
    path = tmp_path / "film.webp"
    write_all(VideoWriter(path, 20), moving_block(7))
    data = path.read_bytes()
    assert data[:4] == b"RIFF"
    assert data[8:12] == b"WEBP"
    assert data.count(b"ANMF") == 7


def test_views_of_a_larger_picture_can_be_written(tmp_path):
    path = tmp_path / "film.gif"
    picture = np.random.default_rng(0).integers(0, 256, (96, 128, 3), dtype=np.uint8)
    with VideoWriter(path, 10) as video:
        video.write(picture[::2, ::2] // 64 * 64)  # few enough colours for a palette
        video.write(np.full((48, 64, 3), 64, dtype=np.uint8))
    _, played = read(path)
    assert np.abs(played[0].astype(int) - picture[::2, ::2] // 64 * 64).mean() < 1.0


@pytest.mark.parametrize("written", [0, 1, 30])
def test_an_aborted_video_leaves_nothing_behind(tmp_path, written):
    def film_and_stumble():
        with VideoWriter(tmp_path / "film.mp4", 30) as video:
            for frame in moving_block(30)[:written]:
                video.write(frame)
            raise KeyError("stumble")

    with pytest.raises(KeyError, match="stumble"):
        film_and_stumble()
    assert list(tmp_path.iterdir()) == []


def test_an_aborted_video_keeps_the_older_one(tmp_path):
    path = tmp_path / "film.mp4"
    path.write_bytes(b"older")
    with pytest.raises(ValueError, match="no frame was written"), VideoWriter(path, 30):
        pass
    assert path.read_bytes() == b"older"
    with VideoWriter(path, 30) as video:
        video.write(moving_block(1)[0])
    assert len(read(path)[1]) == 1


def write_all(video, frames):
    with video:
        for frame in frames:
            video.write(frame)


def test_a_path_that_cannot_be_replaced_is_reported(tmp_path):
    (tmp_path / "film.mp4").mkdir()
    with pytest.raises(OSError, match=r"film\.mp4"):
        write_all(VideoWriter(tmp_path / "film.mp4", 30), moving_block(2))
    assert [p.name for p in tmp_path.iterdir()] == ["film.mp4"]


@pytest.mark.parametrize("side", [32, 512])  # fits the pipe, and does not
def test_ffmpeg_that_gives_up_is_reported(tmp_path, side):
    video = VideoWriter(tmp_path / "film.mp4", 30)
    video._ffmpeg = shutil.which("false")  # a program that fails at once, without reading
    frames = np.zeros((2, side, side, 3), dtype=np.uint8)
    with pytest.raises(RuntimeError, match=r"could not write .*film\.mp4"):
        write_all(video, frames)
    assert list(tmp_path.iterdir()) == []


def test_a_finished_video_takes_no_more_frames(tmp_path):
    frame = moving_block(1)[0]
    video = VideoWriter(tmp_path / "film.gif", 10)
    video.write(frame)
    video.close()
    video.close()
    with pytest.raises(ValueError, match="finished"):
        video.write(frame)


@pytest.mark.parametrize(
    ("name", "fps", "message"),
    [
        ("film.avi", 30, "ends with '.avi'; allowed are .mp4, .gif, .webp"),
        ("film", 30, "ends with ''"),
        ("film.mp4", 0, "fps is 0"),
        ("film.mp4", float("nan"), "fps is nan"),
        ("film.gif", 60, "at most 50"),
    ],
)
def test_videos_that_cannot_be_are_refused_before_anything_is_written(tmp_path, name, fps, message):
    with pytest.raises(ValueError, match=message):
        VideoWriter(tmp_path / name, fps)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (np.zeros((48, 63, 3), np.uint8), "63 x 48 pixels; a video needs even sides"),
        (np.zeros((47, 64, 3), np.uint8), "64 x 47 pixels"),
        (np.zeros((48, 64, 3)), "float64 of shape"),
        (np.zeros((48, 64, 4), np.uint8), r"shape \(48, 64, 4\)"),
        (np.zeros((48, 64), np.uint8), r"shape \(48, 64\)"),
        (np.zeros((0, 64, 3), np.uint8), r"shape \(0, 64, 3\)"),
    ],
)
def test_frames_that_no_video_takes_are_refused(tmp_path, frame, message):
    with pytest.raises(ValueError, match=message), VideoWriter(tmp_path / "a.mp4", 30) as video:
        video.write(frame)
    assert list(tmp_path.iterdir()) == []


def test_all_frames_have_one_size(tmp_path):
    wide, tall = np.zeros((48, 64, 3), np.uint8), np.zeros((64, 48, 3), np.uint8)
    with pytest.raises(ValueError, match="the first one had"):
        write_all(VideoWriter(tmp_path / "a.mp4", 30), [wide, tall])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("count", "columns", "shape"),
    [(1, None, (1, 1)), (4, None, (2, 2)), (5, None, (2, 3)), (5, 2, (3, 2)), (2, 4, (1, 4))],
)
def test_a_grid_shows_every_picture_in_order(count, columns, shape):
    pictures = [np.full((48, 64, 3), 10 * k, dtype=np.uint8) for k in range(count)]
    whole = grid(pictures, columns)
    gap = 2
    assert whole.shape == (shape[0] * (48 + gap) - gap, shape[1] * (64 + gap) - gap, 3)
    assert not any(np.shares_memory(whole, picture) for picture in pictures)
    for place in range(shape[0] * shape[1]):
        top, left = place // shape[1] * (48 + gap), place % shape[1] * (64 + gap)
        expected = 10 * place if place < count else 255
        assert (whole[top : top + 48, left : left + 64] == expected).all()


def test_grids_that_cannot_be_are_refused():
    picture = np.zeros((48, 64, 3), np.uint8)
    with pytest.raises(ValueError, match="frames is empty"):
        grid([])
    with pytest.raises(ValueError, match="the first has"):
        grid([picture, picture[:-2]])
    with pytest.raises(ValueError, match="columns is 0"):
        grid([picture], 0)
    with pytest.raises(ValueError, match="float64"):
        grid([picture.astype(float)])


def test_the_example_films_a_policy(tmp_path):
    root = Path(__file__).parents[1]
    command = [sys.executable, str(root / "examples/record_video.py"), "--policy", "random"]
    options = ["--grid", "1x2", "--episodes", "3", "--out", str(tmp_path / "film.mp4")]
    run = subprocess.run(
        [*command, *options],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(root)},
    )
    assert run.returncode == 0, run.stderr
    assert "of 4 episodes succeeded" in run.stdout  # three, rounded up to whole grids of two
    assert "200/200" in run.stderr  # the bar counts two rounds of 100 steps
    about, played = read(tmp_path / "film.mp4")
    assert about["size"] == (2 * 512 + 2, 512)
    assert len(played) == 2 * (100 + 1)  # with the first frame of each round


def test_stable_baselines3_films_a_batch(tmp_path):
    pytest.importorskip("moviepy")
    recorders = pytest.importorskip("stable_baselines3.common.vec_env")
    from pbd_gym.sb3 import make_sb3_vec_env

    look = {"render_mode": "rgb_array", "render_size": (64, 64)}
    batch = make_sb3_vec_env("pbd_gym:PBDRope-v0", 4, seed=0, **look)
    recorder = recorders.VecVideoRecorder(batch, str(tmp_path), lambda step: step == 0, 5)
    recorder.reset()
    for _ in range(7):
        recorder.step(np.zeros((4, 2), np.float32))
    recorder.close()
    (film,) = tmp_path.glob("*.mp4")
    about, _ = read(film)
    assert about["size"] == (128, 128)  # four worlds side by side
