import numpy as np
import pytest

from drawn import SPACE, every_scene
from pbd_gym.rendering import Renderer
from pbd_gym.rendering.camera import OrthographicCamera, PerspectiveCamera
from pbd_gym.rendering.curves import smooth_line, smooth_sheet
from pbd_gym.rendering.scene import round_length


def test_the_plane_is_seen_upright():
    camera = OrthographicCamera.framing(
        np.array([-1.0, 0.0]), np.array([1.0, 1.0]), (400, 400), 0.0
    )
    pixels, depth = camera.project(np.array([[0.0, 0.5], [1.0, 0.5], [0.0, 1.0]]))
    np.testing.assert_allclose(pixels, [[200, 200], [400, 200], [200, 100]])
    np.testing.assert_array_equal(depth, 0.0)
    np.testing.assert_allclose(camera.unproject(pixels), [[0.0, 0.5], [1.0, 0.5], [0.0, 1.0]])


def test_space_is_framed_upright_and_in_perspective():
    lower, upper = (np.array(corner) for corner in SPACE)
    camera = PerspectiveCamera.framing(lower, upper, (600, 400), 0.1, -1.0, 0.5)
    corners = np.array(np.meshgrid(*zip(lower, upper, strict=True))).reshape(3, -1).T
    pixels, _ = camera.project(corners)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    np.testing.assert_allclose((low + high) / 2.0, [300, 200])
    assert (low >= [59.999, 39.999]).all()
    assert (high <= [540.001, 360.001]).all()
    # One direction fills the frame: the picture is as large as it can be.
    assert np.isclose(low, [60, 40]).any()
    up, depth = camera.project(np.array([[0, 0, 0.0], [0, 0, 0.5]]))
    assert up[1, 1] < up[0, 1]
    near, far = depth.min(), depth.max()
    assert camera.scale(near) > camera.scale(far)
    behind, _ = camera.project(camera.eye[None] - camera.axes[2])
    assert np.isnan(behind).all()


@every_scene
def test_what_is_seen_at_a_pixel_and_its_depth_is_the_point_that_was_projected(model, view):
    renderer = Renderer(model, view, size=(160, 128))
    pixels, depths = renderer.project(model.positions)
    inside = (pixels > 0).all(axis=1) & (pixels < (160, 128)).all(axis=1)
    assert inside.any()
    points = renderer.unproject(pixels, depths)
    np.testing.assert_allclose(points, model.positions, atol=1e-12)  # rounding alone


def test_smooth_curves_pass_through_every_particle():
    points = np.random.default_rng(0).normal(size=(7, 3))
    curve = smooth_line(points, 4)
    # Weights of the spline are exact at the knots up to rounding.
    np.testing.assert_allclose(curve[::4], points, atol=1e-14)
    straight = np.linspace([0.0, 0.0, 1.0], [6.0, 3.0, 1.0], 7)
    np.testing.assert_allclose(np.diff(smooth_line(straight, 4), n=2, axis=0), 0.0, atol=1e-14)
    sheet = np.random.default_rng(1).normal(size=(4, 5, 3))
    np.testing.assert_allclose(smooth_sheet(sheet, 3)[::3, ::3], sheet, atol=1e-14)


@pytest.mark.parametrize(
    ("length", "expected"), [(0.9, 0.5), (1.0, 1.0), (0.21, 0.2), (0.19, 0.1), (73.0, 50.0)]
)
def test_scales_have_round_lengths(length, expected):
    assert round_length(length) == pytest.approx(expected)
