"""Servers of pages: on this machine alone, for who has the address, until they are ended."""

from __future__ import annotations

import json
import logging
import secrets
import threading
import webbrowser
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

log = logging.getLogger(__name__)

HERE = "127.0.0.1"
PATIENCE = 60.0  # s without a byte after which a connection ends
PAUSE = 0.2  # s without a byte after which a refused request has been sent
UNREAD = 2**26  # bytes of a refused request that are read, at most
# Nothing from the network, and no page of another site around this one.
POLICY = (
    "default-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; "
    "frame-ancestors 'none'; form-action 'none'; base-uri 'none'"
)


class PageServer(ThreadingHTTPServer):
    """Serves a page at `address`, which holds a secret."""

    daemon_threads = True

    def __init__(self, handler: type[PageHandler]) -> None:
        super().__init__((HERE, 0), handler)
        self.secret = secrets.token_urlsafe(24)

    @property
    def hosts(self) -> tuple[str, str]:
        """Hosts of requests that are answered: a page of a foreign name that leads here is none."""
        return f"{HERE}:{self.server_port}", f"localhost:{self.server_port}"

    @property
    def address(self) -> str:
        """URL of the page."""
        return f"http://{HERE}:{self.server_port}/{self.secret}/"


def serve_page(server: PageServer, title: str, browser: bool) -> None:
    """Serve a page until the person ends it, by its button or by Ctrl-C; open it if `browser` is set."""
    with server:
        print(f"{title}\n{server.address}\nEnd it by its button or by Ctrl-C", flush=True)
        if browser:
            webbrowser.open(server.address)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            print()


class PageHandler(BaseHTTPRequestHandler):
    """Answers requests that know the secret."""

    server: PageServer
    timeout = PATIENCE
    policy = POLICY

    def asked(self) -> str | None:
        """What is asked for, behind the secret; None after a refusal."""
        _, given, *rest = [*self.path.split("/", 2), ""]
        known = secrets.compare_digest(given.encode(), self.server.secret.encode())
        if known and self.headers.get("Host") in self.server.hosts:
            return rest[0]
        self.refuse(HTTPStatus.FORBIDDEN, "Open the address that the command printed")
        return None

    def stop(self) -> None:
        """End the server, after an answer."""
        self.say("ended")
        threading.Thread(target=self.server.shutdown).start()

    def say(self, text: str) -> None:
        """Answer with one sentence."""
        self.answer(json.dumps({"said": text}).encode(), "application/json")

    def refuse(self, status: HTTPStatus, text: str) -> None:
        """Answer that the request is wrong, and why."""
        if self.command == "POST":
            self._drain()
        self.answer(json.dumps({"said": text}).encode(), "application/json", status=status)

    def refuse_unknown(self) -> None:
        """Answer that nothing has the name that is asked for."""
        self.refuse(HTTPStatus.NOT_FOUND, "There is no such page")

    def _drain(self) -> None:
        """Read what was sent, within limits: a connection with unread bytes is reset, and the answer lost."""
        self.connection.settimeout(PAUSE)
        left = UNREAD
        with suppress(OSError):
            while left > 0 and (read := self.rfile.read1(min(left, 2**16))):
                left -= len(read)

    def answer(
        self,
        content: bytes,
        kind: str,
        headers: dict[str, str] | None = None,
        status: HTTPStatus = HTTPStatus.OK,
    ) -> None:
        """Send content of a kind of media."""
        self.send_response(status)
        common = {
            "Content-Type": kind,
            "Content-Length": str(len(content)),
            "Cache-Control": "no-store",
            "Content-Security-Policy": self.policy,
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
        }
        for key, value in {**common, **(headers or {})}.items():
            self.send_header(key, value)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: object) -> None:
        """Requests go to the debug log, not to the terminal."""
        log.debug(format, *args)
