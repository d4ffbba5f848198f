"""A program that is not a Gym server: refuses everything, under the name in its argument.

Prints its port, and ends when its standard input closes.
"""

import http.server
import sys
import threading


class Stranger(http.server.BaseHTTPRequestHandler):
    """Answers 403 without a body, as AirPlay does."""

    protocol_version = "HTTP/1.1"

    def version_string(self):
        """Return the name."""
        return sys.argv[1]

    def do_GET(self):
        """Refuse."""
        self.rfile.read(int(self.headers.get("Content-Length", 0)))
        self.send_response(403)
        self.send_header("Content-Length", "0")
        self.end_headers()

    do_POST = do_GET  # noqa: N815

    def log_message(self, *args):
        """Log nothing."""


server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Stranger)
print(server.server_port, flush=True)
threading.Thread(target=server.serve_forever, daemon=True).start()
sys.stdin.read()
