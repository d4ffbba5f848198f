"""A server that gets stuck, for tests of the client.

    python stalling_server.py HOW

HOW "silent" accepts requests and never answers, "half" sends the first half of the answer and then
nothing, "cut" sends the first half and closes the connection, "full" accepts no connections, like a
machine behind a broken line. Prints its port.
"""

import socket
import sys
import threading

ANSWER = b'HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: 20\r\n\r\n{"all_envs"'


def serve(client, how):
    client.recv(65536)
    if how in ("half", "cut"):
        client.sendall(ANSWER)
    if how == "cut":
        client.close()


def main():
    how = sys.argv[1]
    listener = socket.socket()
    listener.bind(("127.0.0.1", 0))
    listener.listen(0 if how == "full" else 64)
    port = listener.getsockname()[1]
    kept = []
    if how == "full":
        # Connections that are not accepted fill the queue; later ones get no answer at all.
        for _ in range(4):
            one = socket.socket()
            one.setblocking(False)
            one.connect_ex(("127.0.0.1", port))
            kept.append(one)
    print(port, flush=True)
    while how != "full":
        client, _ = listener.accept()
        kept.append(client)
        threading.Thread(target=serve, args=(client, how), daemon=True).start()
    sys.stdin.read()


main()
