"""Memory is limited by the system, and returned to it."""

import gc
import os
import subprocess
import sys
import weakref

import pytest
from conftest import created

from gym_server import memory
from gym_server.manager import watchdog

needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits memory")


class Circle:
    def __init__(self):
        self.itself = self


def test_what_refers_to_itself_is_collected():
    gc.disable()
    try:
        circle = weakref.ref(Circle())
        assert circle() is not None
        memory.give_back()
        assert circle() is None
    finally:
        gc.enable()


# In separate processes, where nothing was freed before.
RESIDENT = """
import os, threading
from gym_server import memory

def resident():
    with open("/proc/self/statm") as statm:
        return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
"""

SMALL_PIECES = """
kept = []

def use():
    pieces = [bytes(2**14) for _ in range(2**12)]
    # It lies behind all that is freed.
    kept.append(pieces[-1])

before = resident()
thread = threading.Thread(target=use)
thread.start()
thread.join()
memory.give_back()
print((resident() - before) // 2**20)
"""

LARGE_BODIES = """
def receive():
    body = bytearray()
    for _ in range(2**8):
        body += bytes(2**16)

memory.prepare()
before = resident()
for _ in range(3):
    threads = [threading.Thread(target=receive) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
memory.give_back()
print((resident() - before) // 2**20)
"""


@pytest.mark.skipif(memory._malloc_trim is None, reason="glibc keeps what is free, others do not")
@pytest.mark.parametrize("script", [SMALL_PIECES, LARGE_BODIES], ids=["small", "large"])
def test_what_threads_have_freed_does_not_stay(script):
    measured = subprocess.run(
        [sys.executable, "-c", RESIDENT + script], stdout=subprocess.PIPE, text=True, check=True
    )
    assert int(measured.stdout) < 8


LIMITED = """
import resource, sys
from gym_server import memory

memory.limit(100)
try:
    bytearray(101 * 2**20)
except MemoryError:
    print("too large")
bytearray(50 * 2**20)
# A limit that the process was given is kept.
_, before = resource.getrlimit(resource.RLIMIT_DATA)
memory.limit(200)
assert resource.getrlimit(resource.RLIMIT_DATA) == (before, before)
"""


@needs_linux
def test_the_system_limits_what_a_process_takes_from_then_on():
    command = [sys.executable, "-c", LIMITED]
    assert subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout == b"too large\n"


def test_where_the_system_limits_nothing_the_log_says_so(monkeypatch, caplog):
    monkeypatch.setattr(sys, "platform", "win32")
    memory.limit(None)
    assert not caplog.records
    memory.limit(100)
    assert "--max-memory-mb has no effect" in caplog.text


@needs_linux
def test_a_machine_has_what_its_cgroups_leave(tmp_path, monkeypatch):
    whole = memory.machine_mb(tmp_path)
    assert whole == os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2**20
    (tmp_path / "memory.max").write_text("max\n")
    assert memory.machine_mb(tmp_path) == whole
    (tmp_path / "memory.max").write_text(f"{20 * 2**20}\n")
    assert memory.machine_mb(tmp_path) == 20


def test_the_watchdog_sees_to_it(monkeypatch, quick, eventually):
    given_back = []
    monkeypatch.setattr(watchdog, "_LONGEST_TICK", 0.05)
    monkeypatch.setattr(watchdog, "_GIVE_BACK_SECONDS", 0.0)
    monkeypatch.setattr(memory, "give_back", given_back.append)
    client = quick().test_client()
    eventually(lambda: len(given_back) > 1)
    assert not any(given_back)
    client.post(f"{created(client)}/close/")
    eventually(lambda: any(given_back))
    eventually(lambda: not given_back[-1])
