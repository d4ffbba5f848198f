"""A malicious server, for tests of the client.

    python bad_server.py flood HOW    answers each request endlessly; HOW is "chunks", "length" or
                                      "headers"
    python bad_server.py packed       answers with 256 MB, compressed, although not requested
    python bad_server.py canned FILE  answers as FILE says at that moment: a JSON object with an
                                      answer for each path, {"status", "type", "text" or "hex"}

Prints its port, and ends when its standard input closes. A flood ends after ten seconds.
"""

import contextlib
import gzip
import http.server
import json
import sys
import threading
import time

BLANKS = b" " * 2**20


class Bad(http.server.BaseHTTPRequestHandler):
    """Answers as the arguments say."""

    protocol_version = "HTTP/1.1"

    def do_GET(self):
        """Answer."""
        body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        with contextlib.suppress(OSError):
            if sys.argv[1] == "flood":
                self.flood(sys.argv[2])
            elif sys.argv[1] == "packed":
                self.packed()
            else:
                self.answer(body)

    do_POST = do_GET  # noqa: N815

    def flood(self, how):
        """Send endlessly."""
        self.close_connection = True
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        end = time.monotonic() + 10
        if how == "headers":
            while time.monotonic() < end:
                self.send_header("X-More", "x" * 1000)
                self.flush_headers()
            return
        if how == "length":
            self.send_header("Content-Length", str(2**50))
        else:
            self.send_header("Transfer-Encoding", "chunked")
        self.end_headers()
        piece = BLANKS if how == "length" else b"%x\r\n%b\r\n" % (len(BLANKS), BLANKS)
        while time.monotonic() < end:
            self.wfile.write(piece)

    def packed(self):
        """Send a small body that decompresses to a large one."""
        content = gzip.compress(b'{"all_envs":{}' + 256 * BLANKS + b"}")
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Encoding", "gzip")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

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
        """Log nothing."""


server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Bad)
server.daemon_threads = True
print(server.server_port, flush=True)
threading.Thread(target=server.serve_forever, daemon=True).start()
sys.stdin.read()
