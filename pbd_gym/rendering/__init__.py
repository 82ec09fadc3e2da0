"""Pictures, windows and videos of models; needs neither a display nor a task.

Importing it is cheap: pygame is imported by the first writing or window, imageio-ffmpeg by the
first video.
"""

from pbd_gym.rendering.look import Look, Viewpoint
from pbd_gym.rendering.renderer import Renderer
from pbd_gym.rendering.video import VideoWriter, grid
from pbd_gym.rendering.window import Window

__all__ = ["Look", "Renderer", "VideoWriter", "Viewpoint", "Window", "grid"]
