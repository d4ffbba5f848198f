import numpy as np
import pytest
from pictures import decode

from gym_server.rendering.png import picture, png


@pytest.mark.parametrize("shape", [(4, 6, 3), (4, 6, 4), (4, 6, 1), (4, 6)])
def test_a_png_holds_every_pixel(shape):
    frame = np.arange(np.prod(shape), dtype=np.uint8).reshape(shape)
    assert np.array_equal(decode(png(picture(frame))), frame.reshape(4, 6, -1))


def test_a_frame_may_be_a_transposed_view():
    frame = np.arange(72, dtype=np.uint8).reshape(4, 6, 3).transpose(1, 0, 2)
    assert np.array_equal(decode(png(frame)), frame)


@pytest.mark.parametrize(
    "frame",
    [np.zeros((4, 6, 3)), np.zeros((4,), np.uint8), np.zeros((4, 6, 2), np.uint8), None, "ansi"],
)
def test_what_is_no_picture_is_refused(frame):
    with pytest.raises(ValueError, match="no picture"):
        picture(frame)
