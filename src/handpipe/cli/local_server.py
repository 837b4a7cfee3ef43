"""A server of one page: on this machine alone, for who has the address, until it is ended."""

from __future__ import annotations

import json
import logging
import secrets
import threading
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files

from handpipe.core import HandpipeError, plain

log = logging.getLogger(__name__)

HERE = "127.0.0.1"
PATIENCE = 60.0  # s without a byte after which a connection ends
PAUSE = 0.2  # s without a byte after which a refused request has been sent
UNREAD = 2**26  # bytes of a refused request that are read, at most
HTML, SCRIPT = "text/html; charset=utf-8", "text/javascript; charset=utf-8"
STYLE, PLAIN, JSON = "text/css; charset=utf-8", "text/plain; charset=utf-8", "application/json"
# Nothing from the network, and no page of another site around this one.
POLICY = (
    "default-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; "
    "frame-ancestors 'none'; form-action 'none'; base-uri 'none'"
)


class LocalServer(ThreadingHTTPServer):
    """Serves a page at `address`, which holds a secret.

    Parameters
    ----------
    handler : class
        What answers requests.
    command : str
        Command that printed the address, for messages.
    """

    daemon_threads = True

    def __init__(self, handler: type[LocalHandler], command: str) -> None:
        super().__init__((HERE, 0), handler)
        self.command = command
        self.secret = secrets.token_urlsafe(24)
        self.saving = threading.Lock()

    @property
    def hosts(self) -> tuple[str, str]:
        """Hosts of requests that are answered: a page of a foreign name that leads here is none."""
        return f"{HERE}:{self.server_port}", f"localhost:{self.server_port}"

    @property
    def address(self) -> str:
        """URL of the page."""
        return f"http://{HERE}:{self.server_port}/{self.secret}/"

    def serve(self, title: str, browser: bool) -> None:
        """Serve the page until the person ends it, by its button or by Ctrl-C.

        Parameters
        ----------
        title : str
            What the console says of it.
        browser : bool
            Whether to open it.
        """
        print(f"{title}\n{self.address}\nEnd it by its button or by Ctrl-C", flush=True)
        if browser:
            webbrowser.open(self.address)
        try:
            self.serve_forever()
        except KeyboardInterrupt:
            print()


class LocalHandler(BaseHTTPRequestHandler):
    """Answers requests that know the secret; `give` and `take` say which there are."""

    server: LocalServer
    timeout = PATIENCE
    package = ""  # whose folder `static` has the page's files
    static: dict[str, tuple[str, str]] = {}  # file and kind of content by name

    def give(self, name: str) -> bool:
        """Answer a request for what is asked for; False if there is no such thing."""
        raise NotImplementedError

    def take(self, name: str) -> bool:
        """Answer a request that sends something; False if there is no such request."""
        raise NotImplementedError

    def do_GET(self) -> None:
        """Give what is asked for."""
        name = self._asked()
        if name is None:
            return
        if name in self.static:
            file, kind = self.static[name]
            content = files(self.package).joinpath("static", file).read_bytes()
            self.answer(content, kind, {"Content-Encoding": "gzip"} if file.endswith(".gz") else {})
        elif not self.give(name):
            self.refuse(HTTPStatus.NOT_FOUND, "There is no such page")

    def do_POST(self) -> None:
        """Take what is sent."""
        name = self._asked()
        if name == "stop":
            self.say("ended")
            threading.Thread(target=self.server.shutdown).start()
        elif name is not None and not self.take(name):
            self.refuse(HTTPStatus.NOT_FOUND, "There is no such page")

    def _asked(self) -> str | None:
        """What is asked for, behind the secret; None after a refusal."""
        _, given, *rest = [*self.path.split("/", 2), ""]
        known = secrets.compare_digest(given.encode(), self.server.secret.encode())
        if known and self.headers.get("Host") in self.server.hosts:
            return rest[0]
        self.refuse(HTTPStatus.FORBIDDEN, f"Open the address that handpipe {self.server.command} printed")
        return None

    def received(self, most: int) -> bytes | None:
        """What was sent, of at most so many bytes; None after a refusal."""
        given = self.headers.get("Content-Length", "")
        if given.isdecimal() and len(given) <= len(str(most)) and int(given) <= most:
            return self.rfile.read(int(given))
        self.refuse(HTTPStatus.BAD_REQUEST, f"at most {most} bytes are taken, not {given or 'none'}")
        return None

    def work(self, act: Callable[[], None]) -> None:
        """Act, one request at a time; what is wrong is said."""
        try:
            with self.server.saving:
                act()
        except ConnectionError:
            raise
        except Exception as error:
            self.failed(error)

    def failed(self, error: Exception) -> None:
        """Answer that a request failed, in words."""
        wrong = isinstance(error, HandpipeError)
        status = HTTPStatus.BAD_REQUEST if wrong else HTTPStatus.INTERNAL_SERVER_ERROR
        self.refuse(status, plain(error))

    def say(self, text: str) -> None:
        """Answer with a sentence for the person."""
        self.answer(json.dumps({"said": text}).encode(), JSON)

    def refuse(self, status: HTTPStatus, text: str) -> None:
        """Answer with a sentence that says why not."""
        if self.command == "POST":
            self._drain()
        self.answer(json.dumps({"said": text}).encode(), JSON, status=status)

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
        """Answer with content of a kind."""
        self.send_response(status)
        common = {
            "Content-Type": kind,
            "Content-Length": str(len(content)),
            "Cache-Control": "no-store",
            "Content-Security-Policy": POLICY,
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
        }
        for key, value in {**common, **(headers or {})}.items():
            self.send_header(key, value)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: object) -> None:
        """Keep requests out of the console."""
        log.debug(format, *args)
