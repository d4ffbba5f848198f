"""Readers of untrusted bytes: the tensor reader and the JSON decoder, with all kinds of bytes.

``GYM_TEST_FUZZ_SECONDS=600``, which ``make soak`` sets, tests each for that long.
"""

import itertools
import json
import math
import os
import tempfile
import time
from pathlib import Path

import pytest

# Generated files must not be below inst/server.
os.environ.setdefault(
    "HYPOTHESIS_STORAGE_DIRECTORY", str(Path(tempfile.gettempdir()) / "gym-hypothesis")
)
hypothesis = pytest.importorskip("hypothesis", reason="the extra `dev` brings hypothesis")

# This concerns only how a failure is shown.
pytestmark = pytest.mark.filterwarnings("ignore:Generating overly large repr")

from hypothesis import strategies as st  # noqa: E402

from gym_server.errors import GymServerError  # noqa: E402
from gym_server.protocol import answers, bodies, safetensors  # noqa: E402

SECONDS = float(os.environ.get("GYM_TEST_FUZZ_SECONDS", "0"))

# The longest time for one case. Memory is limited, too.
_LONGEST_SECONDS = 5.0
_MOST_BYTES = 2**30


def explore(check, strategy):
    """Check examples of a strategy: some hundred, or as many as there is time for."""
    counted = 0

    def timed(example):
        nonlocal counted
        counted += 1
        # Processor time, because other processes may take longer.
        began = time.thread_time()
        check(example)
        assert time.thread_time() - began < _LONGEST_SECONDS

    settings = hypothesis.settings(
        max_examples=2000 if SECONDS else 150,
        deadline=None,
        database=None,
        suppress_health_check=list(hypothesis.HealthCheck),
    )
    end = time.monotonic() + SECONDS
    with _memory_ceiling():
        for seed in itertools.count():
            hypothesis.seed(seed)(settings(hypothesis.given(strategy)(timed)))()
            if time.monotonic() >= end:
                return counted


class _memory_ceiling:  # noqa: N801
    """Limit additional memory to a gigabyte; exceeding it is a MemoryError."""

    def __enter__(self):
        try:
            import resource
        except ImportError:  # Windows
            self._before = None
            return
        self._resource, self._before = resource, resource.getrlimit(resource.RLIMIT_DATA)
        with open("/proc/self/status") as status:
            lines = dict(line.split(":", 1) for line in status)
        used = int(lines["VmData"].split()[0]) * 1024
        resource.setrlimit(resource.RLIMIT_DATA, (used + _MOST_BYTES, self._before[1]))

    def __exit__(self, *_):
        if self._before is not None:
            self._resource.setrlimit(self._resource.RLIMIT_DATA, self._before)


def report(capsys, name, cases):
    if SECONDS:
        with capsys.disabled():
            print(f"\n{name}: {cases} cases in {SECONDS:.0f} s, crashes, hangs, over-allocation 0")


# Bytes -----------------------------------------------------------------------------------------

NUMBERS = st.one_of(
    st.integers(-2, 40), st.sampled_from([2**31, 2**32, 2**53 + 1, 2**63, 2**64, 10**30, 1e3, 0.5])
)
LEAVES = st.none() | st.booleans() | NUMBERS | st.text(max_size=8)
VALUES = st.recursive(
    LEAVES, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner)
)
NAMES = st.sampled_from(["action", "action/0", "action/a~1b", "", "é", "x"])


BYTES = {"F64": 8, "I64": 8, "U64": 8, "F32": 4, "I32": 4, "F16": 2, "U8": 1, "BOOL": 1}
SHAPES = st.lists(st.integers(0, 5), max_size=3)
FAULTS = ["entry", "entry", "length", "data", "bytes"]
METADATA = st.dictionaries(
    st.sampled_from(["request", "render", "texts", "step_mask", "format"]),
    st.sampled_from(["{}", "true", '{"key":"k","number":1}', "[", "NaN", '{"a":1}', '{"a":"b"}']),
    max_size=3,
)


@st.composite
def files(draw):
    """Draw a valid file, or one with a few errors."""
    header, begin = {}, 0
    for name in draw(st.lists(NAMES, max_size=4)):
        dtype, shape = draw(st.sampled_from(list(BYTES))), draw(SHAPES)
        end = begin + math.prod(shape) * BYTES[dtype]
        if name not in header:
            header[name] = {"dtype": dtype, "shape": shape, "data_offsets": [begin, end]}
            begin = end
    if draw(st.booleans()):
        header["__metadata__"] = draw(METADATA)
    faults = draw(st.sampled_from([0, 1, 1, 2]))
    kinds = draw(st.lists(st.sampled_from(FAULTS), min_size=faults, max_size=faults))
    if "entry" in kinds and header:
        entry = header[draw(st.sampled_from(list(header)))]
        field = draw(st.sampled_from(["dtype", "shape", "data_offsets", "more"]))
        # Nearly valid files are most likely to reveal bugs.
        nearly = {
            "dtype": st.sampled_from(list(BYTES)),
            "shape": SHAPES,
            "data_offsets": st.lists(st.integers(0, begin + 8), min_size=2, max_size=2),
        }
        entry[field] = draw(nearly.get(field, VALUES) | nearly.get(field, VALUES) | VALUES)
    text = json.dumps(header).encode()
    length = len(text)
    if "length" in kinds:
        length = draw(st.integers(0, length + 8) | st.integers(0, 2**64 - 1))
    data = draw(st.binary(min_size=begin, max_size=begin))
    if draw(st.integers(0, 3)):
        # Bytes that are valid for all dtypes, including booleans.
        data = bytes(byte & 1 for byte in data)
    if "data" in kinds:
        data = draw(st.sampled_from([data[:-1], data + b"\0", data + data, b""]))
    raw = length.to_bytes(8, "little") + text + data
    return mutated(draw, raw) if "bytes" in kinds else raw


def mutated(draw, raw):
    """Return the bytes with a few changed, removed or doubled."""
    raw = bytearray(raw)
    for _ in range(draw(st.sampled_from([1, 1, 2, 5]))):
        place = draw(st.integers(0, len(raw)))
        match draw(st.integers(0, 3)):
            case 0:
                raw[place : place + 1] = draw(st.binary(max_size=2))
            case 1:
                del raw[place:]
            case 2:
                raw[place:place] = raw[place : place + draw(st.integers(1, 40))]
            case 3 if place < len(raw):
                raw[place] ^= 1 << draw(st.integers(0, 7))
    return bytes(raw)


@st.composite
def texts(draw):
    """Draw JSON in one of its encodings, and nearly valid JSON."""
    deep = draw(st.sampled_from([0, 0, 0, 10, 1000, 20_000]))
    opening, closing = draw(st.sampled_from([('{"a":', "}"), ("[", "]")]))
    text = opening * deep + json.dumps(draw(VALUES)) + closing * draw(st.sampled_from([deep, 0]))
    words = st.sampled_from(["NaN", "-Infinity", "1" * 5000, "1e999", '"\\ud800"', "\ufeff", "nul"])
    if draw(st.booleans()):
        text = text.replace("null", draw(words)) if "null" in text else f'{{"a":{draw(words)}}}'
    encoding = draw(st.sampled_from(["utf-8", "utf-16", "utf-32-le", "utf-16-be", "latin-1"]))
    raw = text.encode(encoding, "replace")
    return mutated(draw, raw) if draw(st.booleans()) else raw


# What must hold --------------------------------------------------------------------------------


def check_tensors(raw):
    file = body = None
    try:
        file = safetensors.read(raw)
        body = bodies.loads_tensors(raw, {"info", "request"})
    except GymServerError as refusal:
        assert refusal.code == "malformed_tensors"
    if body is not None:
        assert isinstance(body, dict)
    if file is None:
        return
    # Every byte belongs to a tensor.
    arrays = {name: tensor.array() for name, tensor in file.tensors.items()}
    head = 8 + int.from_bytes(raw[:8], "little")
    assert sum(array.nbytes for array in arrays.values()) == len(raw) - head
    again = safetensors.read(safetensors.write(file.tensors, file.metadata))
    assert again.metadata == file.metadata
    for name, array in arrays.items():
        assert again.tensors[name].array().tobytes() == array.tobytes()


def check_json(raw):
    try:
        body = bodies.loads(raw)
    except GymServerError as refusal:
        assert refusal.code in ("malformed_json", "not_an_object")
    else:
        assert isinstance(body, dict)
        written = answers.dumps(body)
        # Deeper or non-finite values are written differently.
        if max(raw.count(b"{"), raw.count(b"[")) < 100 and "inf" not in repr(body):
            assert bodies.loads(written) == body


@pytest.mark.slow
def test_the_tensor_reader_takes_or_refuses_any_bytes(capsys):
    cases = explore(check_tensors, files() | st.binary(max_size=200))
    report(capsys, "fuzz-tensors", cases)


@pytest.mark.slow
def test_the_json_decoder_takes_or_refuses_any_bytes(capsys):
    cases = explore(check_json, texts() | st.binary(max_size=200))
    report(capsys, "fuzz-json", cases)


@pytest.mark.slow
def test_files_of_all_kinds_are_tried():
    """The strategy is useless if nearly all of its files are refused, or none."""
    outcomes = {True: 0, False: 0}

    def count(raw):
        try:
            safetensors.read(raw)
            outcomes[True] += 1
        except GymServerError:
            outcomes[False] += 1

    explore_once = hypothesis.settings(max_examples=100, deadline=None, database=None)
    hypothesis.seed(1)(explore_once(hypothesis.given(files())(count)))()
    assert min(outcomes.values()) > 10, outcomes
