"""Speak HTTP on a socket. For tests."""

from contextlib import suppress


def request(method, path, body=b"", *headers):
    lines = [f"{method} {path} HTTP/1.1", "Host: 127.0.0.1", *headers]
    if not any(header.startswith("Transfer-Encoding") for header in headers):
        lines.append(f"Content-Length: {len(body)}")
    return "\r\n".join([*lines, "", ""]).encode() + body


def read_answer(connection):
    """Return status, headers and body of a response, and its number of packets."""
    data, packets = b"", 0
    while b"\r\n\r\n" not in data:
        data, packets = data + _receive(connection), packets + 1
    head, _, body = data.partition(b"\r\n\r\n")
    lines = head.decode().split("\r\n")
    headers = dict(line.lower().split(": ", 1) for line in lines[1:])
    body = bytearray(body)
    while len(body) < int(headers.get("content-length", 0)):
        body += _receive(connection)
        packets += 1
    return int(lines[0].split()[1]), headers, bytes(body), packets


def _receive(connection):
    data = connection.recv(65536)
    if not data:
        raise ConnectionError("closed without an answer")
    return data


def answered(connection, sent):
    connection.sendall(sent)
    return read_answer(connection)


def read_all(connection):
    """Return what comes until the connection ends."""
    data = b""
    with suppress(ConnectionError):
        while more := connection.recv(65536):
            data += more
    return data
