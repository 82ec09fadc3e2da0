"""Pictures, windows and videos of models; needs neither a display nor a task.

Importing it is cheap: pygame and imageio-ffmpeg are imported by the first picture and video.
"""

from pbd_gym.rendering.renderer import Renderer
from pbd_gym.rendering.video import VideoWriter, grid
from pbd_gym.rendering.window import Window

__all__ = ["Renderer", "VideoWriter", "Window", "grid"]
