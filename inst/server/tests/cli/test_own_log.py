import os

from gym_server.cli import own_log


def test_the_end_of_a_long_log_is_kept_and_written_on(tmp_path, monkeypatch):
    monkeypatch.setattr(own_log, "_MOST_BYTES", 1000)
    monkeypatch.setattr(own_log, "_KEPT_BYTES", 50)
    file = tmp_path / "own.log"
    lines = [b"line %d\n" % number for number in range(200)]
    with open(file, "wb", buffering=0) as log:
        log.write(b"".join(lines[:100]))
        own_log.shorten(file, log.fileno())
        assert file.read_bytes() == b"".join(lines[:100])
        log.write(b"".join(lines[100:]))
        # Like the descriptor of another process of the server.
        other = os.dup(log.fileno())
        own_log.shorten(file, log.fileno())
        os.write(other, b"more\n")
        os.close(other)
    assert file.read_bytes() == b"".join(lines[-5:]) + b"more\n"


def test_the_log_of_a_server_stays_short(serve, tmp_path, eventually):
    file = tmp_path / "own.log"
    limits = {"_MOST_BYTES": 2000, "_KEPT_BYTES": 500, "_TICK_SECONDS": 0.01}
    with open(file, "w") as log:
        server = serve(
            *("--log-level", "info", "--own-log", str(file)),
            stderr=log,
            limits={f"gym_server.cli.own_log.{name}": value for name, value in limits.items()},
        )
    for _ in range(50):
        server.post(server.create("CartPole-v1") + "/close/")

    def is_short_and_whole():
        # While it is shortened, the file is empty for a moment.
        lines = file.read_text().splitlines() or [""]
        is_short = file.stat().st_size < 2000
        return is_short and lines[-1].partition(": ")[2].startswith("Closed instance ")

    eventually(is_short_and_whole)
