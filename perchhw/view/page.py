"""The page of the web viewer, which may talk to this machine only.

Rerun's page asks several servers on the internet for a font, for the newest version, for examples, and tells
one that it is used. It is handed on here with a content security policy, so that the browser itself refuses
all of that: https://www.w3.org/TR/CSP3/.
"""

import threading
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

LOOPBACK = "127.0.0.1"
_PATIENCE_S = 60.0
_HANDED_ON = ("Content-Type", "rerun-final-length")


def policy(feed_port: int) -> str:
    """What the page may do: run its own code, and talk to its own server and to the feed."""
    return (
        "default-src 'none'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; "
        "style-src 'unsafe-inline'; img-src 'self' data: blob:; font-src data:; worker-src 'self' blob:; "
        f"connect-src 'self' data: blob: http://{LOOPBACK}:{feed_port}"
    )


@contextmanager
def guarded_page(port: int, original_port: int, feed: str, feed_port: int) -> Iterator[str]:
    """Serve the page at `port` on loopback during the block; gives its whole address.

    A browser that asks for the bare address is sent on to the whole one, which names the feed.

    Args:
        port: where a browser opens it.
        original_port: where Rerun serves it.
        feed: address of the recordings.
        feed_port: its port.
    """
    place = f"/?{urllib.parse.urlencode({'url': feed})}"

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            if self.path == "/":
                self.send_response(302)
                self.send_header("Location", place)
                self.send_header("Content-Length", "0")
                self.end_headers()
                return
            path = self.path.partition("?")[0]
            try:
                url = f"http://{LOOPBACK}:{original_port}{path}"
                with urllib.request.urlopen(url, None, _PATIENCE_S) as got:
                    content, headers = got.read(), got.headers
            except urllib.error.URLError as error:
                self.send_error(getattr(error, "code", 502))
                return
            self.send_response(200)
            for name in _HANDED_ON:
                if headers[name]:
                    self.send_header(name, headers[name])
            self.send_header("Content-Length", str(len(content)))
            self.send_header("Content-Security-Policy", policy(feed_port))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, format: str, *arguments: object) -> None:
            """Nobody wants to read of every request."""

    server = ThreadingHTTPServer((LOOPBACK, port), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, name="view-page", daemon=True)
    thread.start()
    try:
        yield f"http://{LOOPBACK}:{port}{place}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
