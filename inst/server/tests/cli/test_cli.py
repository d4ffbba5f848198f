import http.client
import signal
import sys
import threading
import time

import pytest
from conftest import SHORT_GRACE
from running import descendants, is_running

from gym_server.cli import main

pytestmark = pytest.mark.slow

needs_signals = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")


def test_one_line_says_where_the_server_is_and_only_a_signal_stops_it(serve):
    server = serve()
    assert server.first_line == f"Server starting at: http://127.0.0.1:{server.port}\n"
    server.create("CartPole-v1")
    # The end of standard input means nothing unless that was asked for.
    server.process.stdin.close()
    server.process.stdin = None
    time.sleep(0.3)
    assert server.get("/v1/health")[0] == 200
    # Much less than a request in progress may take.
    assert server.stop(timeout=8)[:2] == (0, "")


def test_the_end_of_standard_input_stops_it(serve):
    server = serve("--stop-on-stdin-eof")
    server.process.stdin.write("a line\n")
    server.process.stdin.flush()
    assert server.get("/v1/health")[0] == 200
    assert server.stop(how=None)[0] == 0


@needs_signals
def test_a_call_that_hangs_at_the_end_leaves_no_temporary_folder(serve, tmp_path):
    server = serve(limits=SHORT_GRACE, TMPDIR=str(tmp_path))
    how = {"num_envs": 1, "vectorization_mode": "async"}
    # The second one uses the processes that the first one left.
    urls = [server.create("faulty_envs:Hanging-v0", **how) for _ in range(2)]
    assert any(tmp_path.iterdir())
    for url in urls:
        server.post(f"{url}/reset/")
    with server.socket() as hanging:
        body = b'{"action": [0]}'
        head = f"POST {urls[0]}/step/ HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: {len(body)}"
        hanging.sendall(head.encode() + b"\r\n\r\n" + body)
        server.get("/v1/health")
        assert server.stop()[0] == 0
    assert not list(tmp_path.glob("pymp-*"))


@needs_signals
def test_ctrl_c_stops_it_and_the_port_is_free_again_at_once(serve):
    server = serve()
    port = server.port
    server.get("/v1/health")
    assert server.stop(signal.SIGINT)[0] == 0
    again = serve("--port", str(port))
    assert again.port == port


@needs_signals
def test_a_server_that_was_paused_by_ctrl_z_goes_on(serve):
    server = serve("--max-call-seconds", "3")
    url = server.create("CartPole-v1")
    server.process.send_signal(signal.SIGTSTP)
    time.sleep(1)
    # Linux ignores the first one in a process that no terminal controls.
    server.process.send_signal(signal.SIGSTOP)
    time.sleep(5)
    server.process.send_signal(signal.SIGCONT)
    assert server.post(f"{url}/reset/")[0] == 200


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.7"])
def test_only_this_machine_is_served_unless_asked(host, capsys, monkeypatch):
    monkeypatch.delenv("GYM_SERVER_TOKEN", raising=False)
    assert main.main(["--host", host]) == 1
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1
    assert "--no-auth" in errors and "--token-file" in errors and "GYM_SERVER_TOKEN" in errors


def test_a_host_that_is_not_ours_is_one_line_and_status_1(capsys):
    assert main.main(["--host", "192.0.2.1", "--no-auth", "--port", "0"]) == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_a_monitor_directory_that_cannot_be_made_is_one_line_and_status_1(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main.main(["--port", "0", "--monitor-dir", str(tmp_path / "file" / "runs")]) == 1
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1
    assert str(tmp_path / "file") in errors


@pytest.mark.parametrize(
    "options",
    [
        ["--port", "65536"],
        ["--port", "x"],
        ["--max-processes", "0"],
    ],
)
def test_options_out_of_range_are_refused(options, capsys):
    with pytest.raises(SystemExit):
        main.main(options)
    assert "is not between" in capsys.readouterr().err


@needs_signals
def test_its_own_monitor_directory_is_there_only_for_what_was_written(serve, tmp_path):
    server = serve(TMPDIR=str(tmp_path))
    url = server.create("CartPole-v1")
    server.post(f"{url}/monitor/start/", {"directory": ".."})
    assert list(tmp_path.iterdir()) == []
    server.post(f"{url}/monitor/start/", {"directory": "a"})
    server.stop()
    assert len(list(tmp_path.iterdir())) == 1


def test_modules_are_allowed_by_the_operator_alone(shared):
    assert shared.create("faulty_envs:Counting-v0")
    status, answer = shared.post("/v1/envs/", {"env_id": "os:Counting-v0"})
    assert (status, answer["code"]) == (400, "module_not_allowed")


@needs_signals
def test_a_video_under_way_is_finished_at_the_stop_in_the_directory_that_was_named(serve, tmp_path):
    pytest.importorskip("moviepy")
    server = serve("--monitor-dir", str(tmp_path / "runs"))
    url = server.create("CartPole-v1")
    server.post(f"{url}/monitor/start/", {"directory": "a", "video_callable": True})
    server.post(f"{url}/reset/")
    server.post(f"{url}/step/", {"action": 0})
    assert server.stop()[0] == 0
    assert (tmp_path / "runs" / "a" / "rl-video-episode-0.mp4").stat().st_size > 1000
    assert (tmp_path / "runs" / "a" / "episodes.csv").read_text().startswith("episode,return")


@needs_signals
def test_what_never_returns_does_not_keep_it_alive(serve, tmp_path, gate, eventually):
    pytest.importorskip("moviepy")
    # Enough time for the other videos.
    limits = {**SHORT_GRACE, "gym_server.cli.main._LAST_SECONDS": 4}
    server = serve("--monitor-dir", str(tmp_path), limits=limits)
    stepping = server.create("faulty_envs:Gated-v0", kwargs=gate.kwargs)
    drawing = server.create("faulty_envs:Drawing-v0", kwargs={"frame": "hangs"})
    healthy = [server.create("CartPole-v1") for _ in range(2)]
    for url in healthy:
        fields = {"directory": url[-8:], "video_callable": True}
        server.post(f"{url}/monitor/start/", fields)
    for url in (stepping, drawing, *healthy):
        server.post(f"{url}/reset/")
    calls = [
        threading.Thread(target=_without_answer, args=(server.get, f"{drawing}/render/")),
        threading.Thread(target=_without_answer, args=(server.post, f"{stepping}/step/")),
    ]
    for call in calls:
        call.start()
    eventually(gate.is_reached)
    began = time.monotonic()
    status, _, errors = server.stop()
    assert status == 0
    assert time.monotonic() - began > 1
    assert "did not finish within 1 seconds" in errors
    for url in healthy:
        assert (tmp_path / url[-8:] / "rl-video-episode-0.mp4").stat().st_size > 1000
    for call in calls:
        call.join()


def _without_answer(call, url):
    with pytest.raises((OSError, http.client.HTTPException)):
        call(url, {"action": 0}) if url.endswith("step/") else call(url)


@pytest.mark.parametrize(
    ("option", "instead"),
    [
        ("--isolate", "--users"),
        ("--max-worker-mb", "--max-memory-mb"),
        ("--max-total-sub-envs", "--max-memory-mb"),
    ],
)
def test_an_option_that_is_gone_names_what_replaces_it(option, instead, capsys):
    for written in ([option, "all"], [f"{option}=all"]):
        with pytest.raises(SystemExit):
            main.main(written)
        said = capsys.readouterr().err
        assert f"{option} is gone" in said and instead in said


# The calls before the one that hangs take less, even on a busy machine.
HANGS = ("--max-call-seconds", "8")


def ended(server, url, status=1):
    """Take a step that ends the server; return its log."""
    server.post(f"{url}/reset/")
    with pytest.raises((OSError, http.client.HTTPException)):
        server.post(f"{url}/step/", {"action": 0})
    assert server.process.wait(30) == status
    return server.process.stderr.read()


def test_a_call_that_hangs_ends_the_server_which_says_why(serve, eventually):
    server = serve(*HANGS)
    workers = server.create("faulty_envs:Counting-v0", num_envs=2, num_workers=2)
    children = descendants(server.process.pid)
    url = server.create("faulty_envs:Hanging-v0", name="mine")
    log = ended(server, url)
    assert (
        f"step() of instance {url.rsplit('/', 1)[1]} of faulty_envs:Hanging-v0 (name 'mine') took "
        "more than 8 seconds, so the server ends; its option --max-call-seconds sets the limit\n"
    ) in log
    assert "hanging.py" in log
    assert workers and children
    eventually(lambda: not any(map(is_running, children)))


@needs_signals
def test_a_crash_of_c_code_is_in_the_log(serve):
    server = serve()
    url = server.create("faulty_envs:Rogue-v0", kwargs={"does": "crashes"})
    assert "Fatal Python error: Segmentation fault" in ended(server, url, -signal.SIGSEGV)


@needs_signals
def test_a_call_that_holds_pythons_lock_for_too_long_ends_the_server(serve):
    server = serve(*HANGS)
    url = server.create("faulty_envs:Rogue-v0", kwargs={"does": "never_returns"})
    assert "never_returns" in ended(server, url)


def test_a_server_without_a_limit_is_not_ended(serve):
    server = serve("--max-call-seconds", "0")
    url = server.create("faulty_envs:Counting-v0", kwargs={"seconds": 1.0})
    server.post(f"{url}/reset/")
    assert server.post(f"{url}/step/", {"action": 0})[0] == 200
