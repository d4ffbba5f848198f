"""Prepare MuJoCo for a server: OpenGL without a display, several environments, its warnings."""

from __future__ import annotations

import ctypes
import ctypes.util
import functools
import os
import sys
from typing import Any

from gym_server import logs

# https://registry.khronos.org/EGL/extensions/EXT/EGL_EXT_platform_device.txt
_EGL_PLATFORM_DEVICE_EXT = 0x313F


def choose_gl() -> None:
    """Set MUJOCO_GL to a kind of OpenGL that works here, unless it is already set.

    MuJoCo reads the variable when it is first imported. Without it MuJoCo opens a window. That
    fails on Linux without a display, and ends the process on macOS, where only the main thread may
    open windows.
    """
    if "MUJOCO_GL" in os.environ:
        return
    if sys.platform == "darwin":
        _choose_cgl()
    elif sys.platform.startswith("linux") and not _has_display():
        if _has_egl():
            os.environ["MUJOCO_GL"] = "egl"
        elif ctypes.util.find_library("OSMesa"):
            os.environ["MUJOCO_GL"] = "osmesa"


def log_warnings() -> None:
    """Send MuJoCo's warnings to the server's log instead of a file in the working directory."""
    import mujoco

    # It gives the same one for each environment.
    mujoco.set_mju_user_warning(functools.partial(logs.warn_once, "MuJoCo"))


def draw_in_own_context() -> None:
    """Make every environment draw, and free its resources, in its own OpenGL context.

    Gymnasium leaves the last used context current, so one environment draws in another's. The
    resources of a closed environment are freed when Python collects it, in whatever context is
    current then. The environment that owns that context draws black pictures from then on.
    """
    from gymnasium.envs.mujoco import mujoco_rendering

    rendering: Any = mujoco_rendering
    original: Any = rendering.OffScreenViewer
    if getattr(original, "draws_in_own_context", False):
        return

    # The base class is known only if MuJoCo is installed.
    class OwnContextViewer(original):  # type: ignore[misc]
        con: Any
        draws_in_own_context = True

        def render(self, *args: Any, **kwargs: Any) -> Any:
            self.make_context_current()
            return super().render(*args, **kwargs)

        def close(self) -> None:
            if self.con is not None:
                self.make_context_current()
                self.con.free()
                self.con = None
            super().close()

    rendering.OffScreenViewer = OwnContextViewer


def _has_display() -> bool:
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _choose_cgl() -> None:
    # Gymnasium's list of renderers lacks the one that needs no window on macOS.
    os.environ["MUJOCO_GL"] = "cgl"
    from gymnasium.envs.mujoco import mujoco_rendering
    from mujoco.cgl import GLContext

    mujoco_rendering._ALL_RENDERERS.setdefault("cgl", GLContext)


def _has_egl() -> bool:
    """Return whether EGL has a device that MuJoCo can open."""
    try:
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError:
        return False
    pointer = ctypes.c_void_p
    egl.eglGetProcAddress.restype = pointer
    query_at = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
    display_at = egl.eglGetProcAddress(b"eglGetPlatformDisplayEXT")
    if not query_at or not display_at:
        return False
    query = ctypes.CFUNCTYPE(
        ctypes.c_uint, ctypes.c_int, ctypes.POINTER(pointer), ctypes.POINTER(ctypes.c_int)
    )(query_at)
    display_of = ctypes.CFUNCTYPE(pointer, ctypes.c_uint, pointer, pointer)(display_at)
    devices, found = (pointer * 16)(), ctypes.c_int()
    if not query(16, devices, ctypes.byref(found)):
        return False
    egl.eglInitialize.argtypes = (pointer, pointer, pointer)
    displays = (
        display_of(_EGL_PLATFORM_DEVICE_EXT, device, None) for device in devices[: found.value]
    )
    return any(display and egl.eglInitialize(display, None, None) for display in displays)
