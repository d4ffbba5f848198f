import json
import tracemalloc

import numpy as np
import pytest
import safetensors.numpy

from gym_server.errors import GymServerError
from gym_server.protocol.safetensors import TENSORS, Tensor, read, write

DTYPES = ["f2", "f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "?"]


def file(header, data=b"", length=None):
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return (len(text) if length is None else length).to_bytes(8, "little") + text + data


def entry(dtype="U8", shape=(2,), offsets=(0, 2), **others):
    return {"dtype": dtype, "shape": list(shape), "data_offsets": list(offsets), **others}


def refusal(raw):
    with pytest.raises(GymServerError) as refused:
        read(raw)
    assert (refused.value.code, refused.value.status) == ("malformed_tensors", 400)
    return refused.value.message


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("shape", [(), (1,), (2, 3), (0,), (2, 0)])
def test_what_safetensors_writes_is_read(dtype, shape):
    array = np.arange(np.prod(shape)).reshape(shape).astype(dtype)
    raw = safetensors.numpy.save({"a": array, "b/c": array[::-1].copy() if shape else array})
    tensors = read(raw).tensors
    assert tensors["a"].shape == shape
    assert tensors["a"].array().dtype == array.dtype
    assert np.array_equal(tensors["a"].array(), array)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("shape", [(), (1,), (2, 3), (0,), (2, 0)])
def test_what_is_written_safetensors_reads(dtype, shape):
    array = np.arange(np.prod(shape)).reshape(shape).astype(dtype)
    raw = write({"a": Tensor.of(array)}, {"info": '{"ä":1}'})
    back = safetensors.numpy.load(raw)["a"]
    assert (back.dtype, back.shape) == (array.dtype, array.shape)
    assert np.array_equal(back, array)
    assert read(raw).metadata == {"info": '{"ä":1}'}


def test_an_array_may_be_a_view_and_big_endian():
    array = np.arange(12, dtype=">i4").reshape(3, 4)[:, ::2].T
    assert np.array_equal(Tensor.of(array).array(), array)


def test_what_was_read_may_be_changed():
    array = read(write({"a": Tensor.of(np.zeros(2))}, {})).tensors["a"].array()
    array += 1


def test_the_header_begins_alike_whatever_the_metadata_is():
    arrays = {"terminated": Tensor.of(np.array(True)), "observation": Tensor.of(np.zeros(4))}
    one, other = (write(arrays, {"info": info}) for info in ("{}", '{"lives":3}'))
    begin = one.index(b'"__metadata__"')
    assert one[8:begin] == other[8:begin]


def test_tensors_lie_where_their_dtypes_may():
    arrays = {str(i): Tensor.of(np.zeros(3, dtype)) for i, dtype in enumerate(DTYPES)}
    raw = write(arrays, {"x": "y"})
    data = 8 + int.from_bytes(raw[:8], "little")
    assert data % 8 == 0
    header = json.loads(raw[8:data])
    for i, dtype in enumerate(DTYPES):
        assert header[str(i)]["data_offsets"][0] % np.dtype(dtype).itemsize == 0


WHOLE = write({"a": Tensor.of(np.arange(4.0)), "b": Tensor.of(np.array(True))}, {"k": "v"})


@pytest.mark.parametrize("length", range(len(WHOLE)))
def test_a_file_cut_short_is_refused_wherever_it_was_cut(length):
    refusal(WHOLE[:length])


@pytest.mark.parametrize(
    ("raw", "words"),
    [
        (file({}, length=100 * 2**20), "a header of 104857600 bytes"),
        (file({}, length=2**64 - 1), "a header of"),
        (file({}, length=3), "a header of 3 bytes"),
        (file(b" " * (2**20 + 1)), "1048576 is the most"),
        (file(b"not json"), "Expecting value"),
        (file(b"\xff\xfe"), "decode"),
        (file(b"[" * 10**5), "recursion"),
        (file([]), "not a JSON object"),
        (file({"a": 1}), "needs a dtype"),
        (file({"a": {"dtype": "U8", "shape": [0]}}), "needs a dtype"),
        (file({"a": entry(more=1)}, b"xx"), "needs a dtype"),
        (file({"a": entry("BF16", (1,))}, b"xx"), "needs a dtype"),
        (file({"a": entry(["U8"])}, b"xx"), "needs a dtype"),
        (file({"a": entry(shape=(-2,))}, b"xx"), "needs a dtype"),
        (file({"a": entry(shape=(2.0,))}, b"xx"), "needs a dtype"),
        (file({"a": entry(shape=(True, 2))}, b"xx"), "needs a dtype"),
        (file({"a": entry(shape=(2**62, 2**62))}, b"xx"), "needs a dtype"),
        (file({"a": entry(shape=(3,))}, b"xx"), "needs a dtype"),
        (file({"a": entry("U16")}, b"xx"), "needs a dtype"),
        (file({"a": entry(offsets=(0, 2, 4))}, b"xx"), "needs a dtype"),
        (file({"a": entry(offsets=(2, 0))}, b"xx"), "needs a dtype"),
        (file({"a": entry(offsets=(-2, 0))}, b"xx"), "needs a dtype"),
        (file({"a": entry(offsets=(1, 3))}, b"xxx"), "a gap or an overlap"),
        (file({"a": entry()}, b"xxx"), "a gap or an overlap"),
        (file({"a": entry()}, b"x"), "a gap or an overlap"),
        (file({"a": entry(), "b": entry(offsets=(1, 3))}, b"xxx"), "a gap or an overlap"),
        (file({"a": entry(), "b": entry(offsets=(3, 5))}, b"xxxxx"), "a gap or an overlap"),
        (file({"a": entry(), "b": entry()}, b"xx"), "a gap or an overlap"),
        (file(b'{"a":{},"a":{}}'), "a name twice"),
        (
            file(b'{"a":{"dtype":"U8","dtype":"I8","shape":[0],"data_offsets":[0,0]}}'),
            "a name twice",
        ),
        (file({"__metadata__": {"a": 1}}), "must be texts"),
        (file({"__metadata__": []}), "must be texts"),
        (file({"a": entry("BOOL")}, b"\x01\x02"), "neither 0 nor 1"),
        (file(b'{"a":' + b"9" * 5000 + b"}"), "digits"),
    ],
)
def test_a_file_that_lies_is_refused(raw, words):
    assert words in refusal(raw)


@pytest.mark.parametrize(
    "raw",
    [
        file({}, length=100 * 2**20),
        file({"a": entry("F64", (10**9,), (0, 8 * 10**9))}, b"xx"),
        file({"a": entry("F64", (10**9, 0), (0, 0))}, b"xx"),
        file(b" " * (2**20 - 2) + b"{}", b"x"),
    ],
)
def test_nothing_is_allocated_on_the_word_of_a_header(raw):
    tracemalloc.start()
    refusal(raw)
    assert tracemalloc.get_traced_memory()[1] < 4 * len(raw) + 2**16
    tracemalloc.stop()


# Over the wire ------------------------------------------------------------------------------


ACCEPT = {"Accept": TENSORS}


def step(client, url, arrays, metadata=None, **headers):
    raw = safetensors.numpy.save(arrays, metadata)
    headers = {"Content-Type": TENSORS, **headers}
    return client.post(f"{url}/step/", data=raw, headers=headers)


def test_an_episode_in_tensors_is_that_in_json(client, create):
    json_url, url = create(), create()
    observation = client.post(f"{json_url}/reset/", json={"seed": 1}).json["observation"]
    answer = client.post(f"{url}/reset/", json={"seed": 1}, headers=ACCEPT)
    assert answer.content_type == TENSORS
    file = read(answer.data)
    assert file.tensors["observation"].array().tolist() == observation
    assert file.tensors.keys() == {"observation"}
    assert file.metadata == {"info": "{}"}
    for action in (0, 1, 1):
        expected = client.post(f"{json_url}/step/", json={"action": action}).json
        file = read(step(client, url, {"action": np.array(action)}, **ACCEPT).data)
        arrays = {name: tensor.array() for name, tensor in file.tensors.items()}
        assert arrays["observation"].dtype == np.float32
        assert arrays["observation"].tolist() == expected["observation"]
        assert (arrays["reward"].dtype, arrays["reward"].shape) == (np.float64, ())
        assert arrays["reward"] == expected["reward"]
        for flag in ("terminated", "truncated"):
            assert (arrays[flag].dtype, arrays[flag].shape) == (np.bool_, ())
            assert arrays[flag] == expected[flag]


def test_what_is_not_a_number_travels_bit_by_bit(client, faulty):
    url = faulty("NotANumber")
    client.post(f"{url}/reset/")
    file = read(client.post(f"{url}/step/", json={"action": 0}, headers=ACCEPT).data)
    expected = np.array([np.nan, np.inf, -np.inf, 0.1], dtype=np.float32)
    assert file.tensors["observation"].array().tobytes() == expected.tobytes()
    assert file.tensors["reward"].array() == np.inf
    assert json.loads(file.metadata["info"])["nan"] == "NaN"


def test_a_nested_space_travels_in_parts(client, faulty):
    url = faulty("Nested")
    client.post(f"{url}/reset/")
    parts = {
        "action/pixels": np.array([[1, 2], [3, 4]], np.uint8),
        "action/a~1b~0/0": np.array(-1),
        "action/a~1b~0/1": np.array([0.5]),
    }
    texts = {"texts": json.dumps({"action/word": "ä"})}
    file = read(step(client, url, parts, texts, **ACCEPT).data)
    assert file.tensors["observation/pixels"].array().tolist() == [[1, 2], [3, 4]]
    assert file.tensors["observation/a~1b~0/0"].array() == -1
    assert file.tensors["observation/a~1b~0/1"].array() == 0.5
    assert json.loads(file.metadata["texts"]) == {"observation/word": "ä"}
    assert file.metadata["texts"].isascii()
    answer = step(client, url, parts, texts).json["observation"]
    assert answer == {"pixels": [[1, 2], [3, 4]], "a/b~": [-1, [0.5]], "word": "ä"}


@pytest.mark.parametrize(
    ("parts", "texts", "words"),
    [
        ({"action/pixels": None}, {}, "null at $pixels is not in Box(0, 255, (2, 2), uint8)"),
        ({"action/pixels": np.zeros((2, 2))}, {}, '"F64 [2, 2]" at $pixels is not in Box'),
        ({"action/pixels": np.zeros(4, np.uint8)}, {}, '"U8 [4]" at $pixels is not in Box'),
        ({"action/a~1b~0/0": np.array(7)}, {}, "7 at $`a/b~`[0] is not in Discrete(3, start=-1)"),
        ({"action/a~1b~0/1": np.array([np.nan])}, {}, '"NaN" at $`a/b~`[1][0] is not in Box'),
        ({"action/more": np.array(1)}, {}, '"action/more" is not in Dict('),
        ({}, {"action/word": "zzz"}, '"zzz" at $word is not in Text'),
        ({}, {"action/word": None}, "null at $word is not in Text"),
        ({}, {"action/pixels": "x"}, '"action/pixels" is not in Dict('),
    ],
)
def test_parts_that_are_no_action_are_refused_with_their_path(client, faulty, parts, texts, words):
    url = faulty("Nested")
    client.post(f"{url}/reset/")
    whole = {
        "action/pixels": np.zeros((2, 2), np.uint8),
        "action/a~1b~0/0": np.array(0),
        "action/a~1b~0/1": np.array([0.5]),
        **parts,
    }
    words_of = {"action/word": "a", **texts}
    arrays = {name: array for name, array in whole.items() if array is not None}
    sent = {name: text for name, text in words_of.items() if text is not None}
    answer = step(client, url, arrays, {"texts": json.dumps(sent)})
    assert (answer.status_code, answer.json["code"]) == (400, "action_not_in_space")
    assert answer.json["message"].startswith(f"The action {words}")
    assert client.get(url).json["steps"] == 0


@pytest.mark.parametrize("dtype", [np.int16, np.uint64, np.float64, np.bool_])
def test_a_discrete_action_is_i64_or_i32(client, create, dtype):
    url = create()
    client.post(f"{url}/reset/")
    answer = step(client, url, {"action": np.array(1, dtype)})
    assert answer.json["code"] == "action_not_in_space"
    assert answer.json["message"].endswith("I64 [] is needed")


def test_a_space_of_no_fixed_parts_is_answered_in_json(client, faulty):
    url = faulty("Letters")
    assert client.post(f"{url}/reset/", headers=ACCEPT).json["observation"] == [1, 2]
    answer = step(client, url, {"action": np.array(1)})
    assert answer.json["code"] == "action_not_in_space"
    assert answer.json["message"].endswith("its members travel as JSON")


def test_errors_are_json(client, create):
    answer = client.post(f"{create()}/step/", json={"action": 0}, headers=ACCEPT)
    assert (answer.content_type, answer.json["code"]) == ("application/json", "reset_needed")


@pytest.mark.parametrize(
    ("raw", "code"),
    [
        (b"", "malformed_tensors"),
        (b'{"action":1}', "malformed_tensors"),
        (WHOLE[:-1], "malformed_tensors"),
        (write({}, {}), "missing_parameter"),
        (write({"observation": Tensor.of(np.array(1))}, {}), "missing_parameter"),
        (write({"action": Tensor.of(np.array(1))}, {"request": "{"}), "malformed_tensors"),
        (write({"action": Tensor.of(np.array(1))}, {"request": "1"}), "invalid_parameter"),
        (write({"action": Tensor.of(np.array(1))}, {"render": '"x"'}), "invalid_parameter"),
        (write({"action": Tensor.of(np.array(1))}, {"texts": "[]"}), "malformed_tensors"),
        (write({"action": Tensor.of(np.array(1))}, {"texts": '{"a":1}'}), "malformed_tensors"),
    ],
)
def test_a_body_that_is_no_step_is_refused(client, create, raw, code):
    url = create()
    client.post(f"{url}/reset/")
    answer = client.post(f"{url}/step/", data=raw, content_type=TENSORS)
    assert (answer.status_code, answer.json["code"]) == (400, code)
    assert client.get(url).json["steps"] == 0


def test_other_metadata_is_ignored(client, create):
    url = create()
    client.post(f"{url}/reset/")
    metadata = {"format": "pt", "render": "true"}
    assert step(client, url, {"action": np.array(1)}, metadata).status_code == 200


@pytest.mark.parametrize(
    ("accept", "content_type"),
    [
        (TENSORS, TENSORS),
        (f"{TENSORS}, application/json", TENSORS),
        (f"application/json;q=0.5, {TENSORS}", TENSORS),
        (f"{TENSORS};q=0.5, application/json", "application/json"),
        (f"{TENSORS};q=0", "application/json"),
        ("*/*", "application/json"),
        ("application/json", "application/json"),
        ("nonsense", "application/json"),
    ],
)
def test_the_client_says_what_it_accepts(client, create, accept, content_type):
    answer = client.post(f"{create()}/reset/", headers={"Accept": accept})
    assert answer.content_type == content_type


def test_a_frame_as_tensors_is_the_picture(client, faulty):
    url = faulty("Drawing")
    client.post(f"{url}/reset/")
    client.post(f"{url}/step/", json={"action": 0})
    answer = client.get(f"{url}/render/", headers=ACCEPT)
    assert answer.content_type == TENSORS
    frame = read(answer.data).tensors["frame"]
    assert (frame.dtype, frame.shape) == ("U8", (16, 32, 3))
    assert np.all(frame.array() == 1)
    pictures = {"Accept": f"image/png, {TENSORS};q=0.9"}
    assert client.get(f"{url}/render/", headers=pictures).content_type == "image/png"


def numbered(number):
    return {"request": json.dumps({"key": "k", "number": number})}


def test_a_numbered_step_in_tensors_is_taken_once(client, faulty):
    url = faulty("Counting")
    client.post(f"{url}/reset/")
    arrays = {"action": np.array(1)}
    first, second = (step(client, url, arrays, numbered(1), **ACCEPT) for _ in range(2))
    assert first.data == second.data
    assert first.content_type == second.content_type == TENSORS
    assert json.loads(read(first.data).metadata["request"]) == {"key": "k", "number": 1}
    assert client.get(url).json["steps"] == 1


def test_the_same_number_for_another_kind_of_answer_is_a_conflict(client, faulty):
    url = faulty("Counting")
    client.post(f"{url}/reset/")
    arrays = {"action": np.array(1)}
    step(client, url, arrays, numbered(1), **ACCEPT)
    answer = step(client, url, arrays, numbered(1))
    assert (answer.status_code, answer.json["code"]) == (409, "request_conflict")
    assert client.get(url).json["steps"] == 1
