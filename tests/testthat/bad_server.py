"""A server that means ill, for tests of what the client bears.

    python bad_server.py flood HOW    answers each request without an end; HOW is "gzip" (8 GB of
                                      zeros, packed), "chunks", "length" or "headers"
    python bad_server.py canned FILE  answers what FILE says at that moment: a JSON object of the
                                      answers by path, {"status", "type", "text" or "hex"} each

Prints its port, ends when its standard input closes. A flood ends by itself after ten seconds.
"""

import contextlib
import http.server
import json
import sys
import threading
import time
import zlib

MEGABYTE = bytes(2**20)


def packed():
    """Yield a gzip file of zeros, piece by piece."""
    packer = zlib.compressobj(9, zlib.DEFLATED, 31)
    for _ in range(8192):
        yield packer.compress(MEGABYTE)
    yield packer.flush()


class Bad(http.server.BaseHTTPRequestHandler):
    """Answers as the arguments say."""

    protocol_version = "HTTP/1.1"

    def do_GET(self):
        """Answer."""
        body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        with contextlib.suppress(OSError):
            if sys.argv[1] == "flood":
                self.flood(sys.argv[2])
            else:
                self.answer(body)

    do_POST = do_GET  # noqa: N815

    def flood(self, how):
        """Send and send."""
        self.close_connection = True
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        end = time.monotonic() + 10
        if how == "headers":
            while time.monotonic() < end:
                self.send_header("X-More", "x" * 1000)
                self.flush_headers()
            return
        if how == "gzip":
            self.send_header("Content-Encoding", "gzip")
        if how == "length":
            self.send_header("Content-Length", str(2**50))
        else:
            self.send_header("Transfer-Encoding", "chunked")
        self.end_headers()
        pieces = packed() if how == "gzip" else iter(lambda: b" " * 2**20, None)
        for piece in pieces:
            if time.monotonic() > end:
                return
            if how == "length":
                self.wfile.write(piece)
            elif piece:
                self.wfile.write(b"%x\r\n%b\r\n" % (len(piece), piece))
        self.wfile.write(b"0\r\n\r\n")

    def answer(self, body):
        """Send what the file says."""
        with open(sys.argv[2], encoding="utf-8") as file:
            said = json.load(file).get(self.path.partition("?")[0], {"status": 404, "text": "{}"})
        content = bytes.fromhex(said["hex"]) if "hex" in said else said["text"].encode()
        self.send_response(said.get("status", 200))
        self.send_header("Content-Type", said.get("type", "application/json"))
        self.send_header("Content-Length", str(len(content)))
        for name in ("server", "date"):
            self._headers_buffer = [
                line for line in self._headers_buffer if not line.lower().startswith(name.encode())
            ]
        if "server" in said:
            self.send_header("Server", said["server"])
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *args):
        """Say nothing."""


server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Bad)
server.daemon_threads = True
print(server.server_port, flush=True)
threading.Thread(target=server.serve_forever, daemon=True).start()
sys.stdin.read()
