"""The process that has PyTorch.

It is a process of its own, as it is for users: PyTorch may crash where other tests have loaded
libraries that draw. There is one for all tests of a file, because PyTorch takes seconds to import.
"""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import pytest


@pytest.fixture(scope="module")
def child():
    """Return a function that calls another one in the process with PyTorch."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        yield lambda *call, **kwargs: pool.submit(*call, **kwargs).result()
