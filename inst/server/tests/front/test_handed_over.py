import errno
import socket

import pytest

from gym_server.front.handed_over import HandedOver

resource = pytest.importorskip("resource")


def test_a_server_that_may_open_no_more_files_loses_one_connection_and_goes_on():
    front, its_socket = socket.socketpair()
    client, other = socket.socketpair()
    stops = []
    handed_over = HandedOver(its_socket.detach(), lambda: stops.append(True))
    with front, client, other, handed_over:
        socket.send_fds(front, [b"x"], [client.fileno()])
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (0, hard))
        try:
            with pytest.raises(OSError, match="Too many open files") as refused:
                handed_over.accept()
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        assert refused.value.errno == errno.EMFILE
        assert not stops
        # The front closes its copy, too.
        assert front.recv(1) == b"x"
