"""Open pages in headless Chromium, and return what they show and log."""

import base64
import contextlib
import itertools
import json
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from urllib.request import urlopen

import cv2
import numpy as np
from websockets.sync.client import connect

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), ""
)
"""Path of the browser; empty if there is none."""

_FLAGS = "--headless=new --no-sandbox --disable-gpu --enable-unsafe-swiftshader --mute-audio"
_FLAGS += " --remote-debugging-port=0 --remote-allow-origins=* --window-size=800,450"
_FLAGS += " --no-first-run --disable-extensions --disable-background-networking"


class Page:
    """A page of a browser that is controlled through the DevTools protocol."""

    def __init__(self, socket):
        self._socket, self._ids = socket, itertools.count(1)
        self.errors = []
        """Errors and exceptions that the page logged."""

        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method, **parameters):
        """Call a method of the protocol, and return its result."""
        number = next(self._ids)
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(timeout=60))
            self._record(message)
            if message.get("id") == number:
                return message["result"]

    def _record(self, message):
        parameters = message.get("params", {})
        if message.get("method") == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(parameters["exceptionDetails"]))
        elif message.get("method") == "Runtime.consoleAPICalled" and parameters["type"] == "error":
            self.errors.append(json.dumps(parameters["args"]))
        elif message.get("method") == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.errors.append(json.dumps(parameters["entry"]))

    def evaluate(self, expression):
        """Return the value of a JavaScript expression."""
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        return result["result"].get("value")

    def wait_for(self, expression, seconds=60):
        """Wait until a JavaScript expression is true; fail if it takes too long."""
        end = time.monotonic() + seconds
        while not self.evaluate(expression):
            assert time.monotonic() < end, (expression, self.errors)
            time.sleep(0.1)

    def screenshot(self):
        """Return a picture of the page, shape (height, width, 3)."""
        data = self.call("Page.captureScreenshot", format="png")["data"]
        return cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_COLOR)


@contextlib.contextmanager
def open_page(address):
    """Open a page in a new browser."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        command = [CHROMIUM, *_FLAGS.split(), f"--user-data-dir={profile}", "about:blank"]
        browser = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            file = Path(profile) / "DevToolsActivePort"
            end = time.monotonic() + 60
            while not (file.exists() and file.read_text().count("\n")):
                assert time.monotonic() < end, "the browser does not start"
                time.sleep(0.05)
            port = file.read_text().split("\n")[0]
            with urlopen(f"http://localhost:{port}/json") as response:
                pages = [each for each in json.load(response) if each["type"] == "page"]
            with connect(pages[0]["webSocketDebuggerUrl"], max_size=None) as socket:
                page = Page(socket)
                page.call("Page.navigate", url=address)
                yield page
        finally:
            browser.terminate()
            browser.wait(timeout=30)
