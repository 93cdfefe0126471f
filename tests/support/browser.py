"""A headless browser without a network, spoken to through its own protocol."""

import base64
import json
import os
import subprocess
import time
from contextlib import contextmanager

from bubblefit.reports.html import BROWSERS, browser_command

from . import needs

PATIENCE = 60.0


class Browser:
    def __init__(self, into, out):
        self._into, self._out, self._number, self._rest = into, out, 0, b""
        self._session, self.complaints, self.requests = None, [], []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Runtime", "Log", "Network", "Page"):
            self.call(f"{domain}.enable")
        self.call("Network.emulateNetworkConditions", offline=True, latency=0,
                  downloadThroughput=0, uploadThroughput=0)  # fmt: skip

    def call(self, method, **parameters):
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._into, json.dumps(message).encode() + b"\0")
        for said in self._messages():
            if said.get("id") == self._number:
                assert "error" not in said, said
                return said["result"]
            self._note(said)
        raise AssertionError("the browser has gone")

    def open(self, page):
        self.call("Page.navigate", url=page.resolve().as_uri())
        end = time.monotonic() + PATIENCE
        while self.run("document.documentElement?.dataset.ready") != "yes":
            assert time.monotonic() < end, self.complaints or "the page is never ready"
            time.sleep(0.05)

    def run(self, script, **options):
        call = {"expression": script, "returnByValue": True, **options}
        answer = self.call("Runtime.evaluate", **call)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def wait(self, script):
        return self.run(script, awaitPromise=True)

    def box(self, selector):
        return self.run(
            "(({x, y, width, height}) => [x, y, width, height])"
            f"(document.querySelector({selector!r}).getBoundingClientRect())"
        )

    def press(self, selector, key):
        assert self.run(f"document.querySelector({selector!r}).focus(), 1") == 1
        assert self.run(f"document.activeElement.matches({selector!r})"), f"{selector}: no focus"
        code = {"Home": 36, "ArrowLeft": 37, "ArrowRight": 39}.get(key, 0)
        text = {} if code else {"text": key}
        named = {"key": key, "code": key, "windowsVirtualKeyCode": code, **text}
        self.call("Input.dispatchKeyEvent", type="keyDown", **named)
        self.call("Input.dispatchKeyEvent", type="keyUp", **named)
        # Two frames: what waits for the next one is drawn then.
        self.wait("new Promise(f => requestAnimationFrame(() => requestAnimationFrame(f)))")

    def look(self, selector):
        x, y, width, height = self.box(selector)
        x, y = x + self.run("scrollX"), y + self.run("scrollY")
        clip = {"x": x, "y": y, "width": width, "height": height, "scale": 1}
        shot = self.call("Page.captureScreenshot", clip=clip, captureBeyondViewport=True)
        return base64.b64decode(shot["data"])

    def _messages(self):
        while True:
            while b"\0" in self._rest:
                one, self._rest = self._rest.split(b"\0", 1)
                yield json.loads(one)
            more = os.read(self._out, 1 << 16)
            if not more:
                return
            self._rest += more

    def _note(self, said):
        method, parameters = said.get("method"), said.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.complaints.append(parameters["exceptionDetails"]["text"])
        if method == "Log.entryAdded" and parameters["entry"]["level"] in ("error", "warning"):
            self.complaints.append(parameters["entry"]["text"])
        if method == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "warning"):
            self.complaints.append(str(parameters["args"]))
        if method == "Network.requestWillBeSent":
            self.requests.append(parameters["request"]["url"])


@contextmanager
def browser(home):
    """A browser for a `with` block; left out, with the reason, where there is none."""
    program = needs.program(*BROWSERS, package="chromium")
    (theirs_in, ours_in), (ours_out, theirs_out) = os.pipe(), os.pipe()

    def as_three_and_four():
        read, write = os.dup(theirs_in), os.dup(theirs_out)
        os.dup2(read, 3)
        os.dup2(write, 4)

    every = browser_command(program, home)
    command = [word for word in every if not word.startswith("--virtual-time")]
    process = subprocess.Popen(
        [*command, "--remote-debugging-pipe"], pass_fds=(3, 4), preexec_fn=as_three_and_four,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    os.close(theirs_in)
    os.close(theirs_out)
    try:
        yield Browser(ours_in, ours_out)
    finally:
        process.terminate()
        process.wait(PATIENCE)
        os.close(ours_in)
        os.close(ours_out)
