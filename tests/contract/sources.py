"""Where scans are fetched from: a server of files made by code, at the address in VISAGE_SOURCE."""

import http.server
import os
import threading
import urllib.parse

import surfaces

BASE = os.environ["VISAGE_SOURCE"]


class Source(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        content = surfaces.content(self.path.rsplit("/", 1)[-1])
        self.send_response(200)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_):
        """Nothing of it is logged."""


def address(name):
    """The address of a file."""
    return urllib.parse.urljoin(BASE, name)


_server = http.server.ThreadingHTTPServer(("127.0.0.1", urllib.parse.urlsplit(BASE).port), Source)
threading.Thread(target=_server.serve_forever, daemon=True).start()
