"""A proxy that breaks connections, for tests of the client.

    python cutting_proxy.py SERVER_PORT WHEN PATTERN TIMES

Forwards HTTP requests to 127.0.0.1:SERVER_PORT, but breaks the first TIMES requests whose first
line contains PATTERN. With WHEN "answered" it forwards the request, waits for the whole response
and then resets the client's connection. With "unsent" it resets the connection without forwarding
anything. Prints its port.
"""

import socket
import struct
import sys
import threading


def read_message(connection, buffered):
    """Return one HTTP message with its body, and what was read beyond it."""
    while b"\r\n\r\n" not in buffered:
        chunk = connection.recv(65536)
        if not chunk:
            return None, b""
        buffered += chunk
    head, _, rest = buffered.partition(b"\r\n\r\n")
    length = 0
    for line in head.split(b"\r\n")[1:]:
        name, _, value = line.partition(b":")
        if name.lower() == b"content-length":
            length = int(value)
    while len(rest) < length:
        rest += connection.recv(65536)
    return head + b"\r\n\r\n" + rest[:length], rest[length:]


def serve(client, server_port, when, pattern, left):
    server = socket.create_connection(("127.0.0.1", server_port))
    from_client, from_server = b"", b""
    while True:
        request, from_client = read_message(client, from_client)
        if request is None:
            break
        # Like proxies that do not know it.
        request = request.replace(b"Upgrade: websocket\r\n", b"")
        cut = left[0] > 0 and pattern in request.split(b"\r\n")[0]
        if cut:
            left[0] -= 1
        if not (cut and when == "unsent"):
            server.sendall(request)
            answer, from_server = read_message(server, from_server)
        if cut:
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            break
        client.sendall(answer)
    client.close()
    server.close()


def main():
    server_port, when, pattern, times = sys.argv[1:]
    left = [int(times)]
    listener = socket.create_server(("127.0.0.1", 0))
    print(listener.getsockname()[1], flush=True)
    threading.Thread(target=lambda: (sys.stdin.read(), listener.close()), daemon=True).start()
    while True:
        try:
            client, _ = listener.accept()
        except OSError:
            return
        threading.Thread(
            target=serve,
            args=(client, int(server_port), when, pattern.encode(), left),
            daemon=True,
        ).start()


main()
