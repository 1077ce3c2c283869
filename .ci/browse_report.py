"""Opens reports in a browser, without a network, and looks at what it shows.

    python browse_report.py PAGE.html [PAGE.html ...] [--pictures DIR]

The browser is Chromium, spoken to through its driver in W3C WebDriver (JSON over HTTP, so nothing but Python is needed). Of each page:
it loads without errors and asks the network for nothing; its view is not empty; the time slider moves the grains, as numbers and as
pixels; a box hides its electrode. One line per check; the last says "N passed, M failed", and the exit status is 0 only if none
failed. --pictures keeps what was seen, light and dark, as PNG.
"""

import argparse
import base64
import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

# WebGL by software, as root in a container, with no host that can be reached.
ARGUMENTS = [
    "--headless=new",
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--host-resolver-rules=MAP * ~NOTFOUND",
    "--disable-background-networking",
    "--disable-component-update",
    "--hide-scrollbars",
    "--window-size=1400,1000",
]
BROWSERS = ["chromium", "google-chrome", "chromium-browser"]
# A view of one colour, or of a line of text, has fewer.
COLOURS = 200
# Pixels that must change when grains of a few pixels move or go.
CHANGED = 20


class Browser:
    """A browser with one page."""

    def __init__(self, dark=False, webgl=True):
        driver = shutil.which("chromedriver") or "/usr/lib/chromium/chromedriver"
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.base = f"http://127.0.0.1:{port}"
        self.profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self.driver = subprocess.Popen([driver, f"--port={port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        # No proxy of the environment stands between us and the driver.
        self.opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        for _ in range(100):
            try:
                if self.ask("GET", "/status")["ready"]:
                    break
            except OSError:
                time.sleep(0.1)
        more = [f"--user-data-dir={self.profile.name}"] + (["--blink-settings=preferredColorScheme=0"] if dark else [])
        more += [] if webgl else ["--disable-gpu", "--disable-3d-apis"]
        options = {
            "args": [a for a in ARGUMENTS if webgl or "gl" not in a and "swiftshader" not in a] + more,
            "binary": next(filter(None, map(shutil.which, BROWSERS)), "chromium"),
        }
        wanted = {
            "goog:chromeOptions": options,
            "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"},
        }
        # The page that a browser begins with asks for much of its own.
        self.session = "/session/" + self.ask("POST", "/session", {"capabilities": {"alwaysMatch": wanted}})["sessionId"]
        self.ask("POST", self.session + "/url", {"url": "about:blank"})

    def ask(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.base + path, data, {"Content-Type": "application/json"}, method=method)
        try:
            with self.opener.open(request, timeout=120) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise RuntimeError(json.load(error)["value"]["message"]) from None

    def open(self, page):
        self.ask("POST", self.session + "/url", {"url": "file://" + os.path.abspath(page)})

    def run(self, script, *arguments):
        return self.ask("POST", self.session + "/execute/sync", {"script": script, "args": list(arguments)})

    def log(self, kind):
        return self.ask("POST", self.session + "/se/log", {"type": kind})

    def whole(self):
        """The whole page as PNG."""
        self.ask("POST", self.session + "/window/rect", {"width": 1400, "height": 1000})
        height = self.run("return Math.min(8000, document.documentElement.scrollHeight)")
        self.ask("POST", self.session + "/window/rect", {"width": 1400, "height": height + 100})
        time.sleep(0.5)
        picture = base64.b64decode(self.ask("GET", self.session + "/screenshot"))
        self.ask("POST", self.session + "/window/rect", {"width": 1400, "height": 1000})
        return picture

    def seen(self):
        """How many colours the view has, and how many of its pixels are not as they were the last time."""
        return self.run(SEEN)

    def close(self):
        try:
            self.ask("DELETE", self.session)
        finally:
            self.driver.terminate()
            self.driver.wait(20)
            self.profile.cleanup()


class Checks:
    """What held and what did not."""

    def __init__(self):
        self.passed = self.failed = 0

    def that(self, page, what, holds, more=""):
        self.passed, self.failed = self.passed + bool(holds), self.failed + (not holds)
        print(f"{'ok  ' if holds else 'FAIL'} {page}: {what}{f' ({more})' if more != '' else ''}")


# The canvas alone, without the words that stand over it.
SEEN = """
const canvas = document.getElementById("canvas"), copy = document.createElement("canvas");
[copy.width, copy.height] = [canvas.width, canvas.height];
const flat = copy.getContext("2d");
flat.drawImage(canvas, 0, 0);
const pixels = new Uint32Array(flat.getImageData(0, 0, copy.width, copy.height).data.buffer);
const before = window.seenBefore ?? pixels;
window.seenBefore = pixels;
return [new Set(pixels).size, pixels.reduce((n, pixel, k) => n + (pixel !== before[k]), 0)];
"""
MOVE = """
const slider = document.getElementById("time");
slider.value = arguments[0];
slider.dispatchEvent(new Event("input", { bubbles: true }));
window.graintrap.render();
return [window.graintrap.part, window.graintrap.places(), document.getElementById("now").textContent];
"""


def look(browser, page, checks, pictures):
    name = os.path.basename(os.path.dirname(os.path.abspath(page)))
    browser.log("performance")
    browser.log("browser")
    start = time.time()
    browser.open(page)
    checks.that(name, "loads", browser.run("return document.readyState") == "complete", f"{time.time() - start:.1f} s")
    checks.that(name, "has a title", browser.run("return document.title.length") > 0)
    if browser.run("return document.getElementById('scene') !== null"):
        checks.that(name, "draws with WebGL", browser.run("return window.graintrap !== undefined"))
        colours, _ = browser.seen()
        checks.that(name, "the view is not empty", colours > COLOURS, f"{colours} colours")
        if browser.run("return document.getElementById('player').hidden === false"):
            part, here, said = browser.run(MOVE, 300)
            browser.seen()
            later, there, then = browser.run(MOVE, 450)
            moved = max((abs(a - b) for a, b in zip(here, there)), default=0)
            checks.that(name, "the slider sets the time", (part, later) == (0.3, 0.45) and said != then, f"{said}, {then}")
            checks.that(name, "the slider moves the grains", moved > 0, f"by {moved:.3g} m")
            _, changed = browser.seen()
            checks.that(name, "and it shows", changed > CHANGED, f"{changed} pixels")
            browser.run(MOVE, 1000)
        if browser.run("return document.querySelectorAll('#electrodes input').length > 0"):
            browser.seen()
            browser.run("document.querySelector('#electrodes input').click(); window.graintrap.render()")
            _, changed = browser.seen()
            checks.that(name, "a box hides its electrode", changed > CHANGED, f"{changed} pixels")
            browser.run("document.querySelector('#electrodes input').click(); window.graintrap.render()")
    broken = browser.run("return [...document.images].filter((i) => !i.complete || i.naturalWidth === 0).map((i) => i.alt)")
    checks.that(name, "all plots are shown", broken == [], ", ".join(broken))
    if pictures:
        with open(os.path.join(pictures, name + ".png"), "wb") as out:
            out.write(browser.whole())
    errors = [entry["message"] for entry in browser.log("browser") if entry["level"] == "SEVERE"]
    checks.that(name, "no errors", errors == [], "; ".join(errors))
    sent = [json.loads(entry["message"])["message"] for entry in browser.log("performance")]
    asked = [m["params"]["request"]["url"] for m in sent if m["method"] == "Network.requestWillBeSent"]
    outside = [url[:100] for url in asked if not url.startswith(("file:", "data:", "blob:", "chrome:"))]
    checks.that(name, "asks the network for nothing", outside == [], "; ".join(outside))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("pages", nargs="+")
    parser.add_argument("--pictures")
    parser.add_argument("--dark", action="store_true")
    arguments = parser.parse_args()
    if arguments.pictures:
        os.makedirs(arguments.pictures, exist_ok=True)
    checks = Checks()
    browser = Browser(dark=arguments.dark)
    try:
        for page in arguments.pages:
            look(browser, page, checks, arguments.pictures)
    finally:
        browser.close()
    # Without WebGL the page says so, and the rest of it is there.
    browser = Browser(webgl=False)
    try:
        browser.open(arguments.pages[0])
        name = os.path.basename(os.path.dirname(os.path.abspath(arguments.pages[0])))
        if browser.run("return document.getElementById('scene') !== null"):
            said = browser.run("return !document.getElementById('absent').hidden && window.graintrap === undefined")
            checks.that(name, "says that there is no WebGL", said)
        shown = browser.run("return document.images.length === 0 || document.images[0].naturalWidth > 0")
        checks.that(name, "shows plots without WebGL", shown)
    finally:
        browser.close()
    print(f"{checks.passed} passed, {checks.failed} failed")
    return 1 if checks.failed or not checks.passed else 0


if __name__ == "__main__":
    sys.exit(main())
