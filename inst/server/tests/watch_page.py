"""The watch page in a headless browser, and what it shows. For tests."""

import shutil
import time

from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By

_MINUS, _DASH = "\u2212", "\u2013"

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


def start_chromium():
    """Start a headless browser; return None if there is none."""
    binary = next(filter(None, map(shutil.which, _BROWSERS)), None)
    driver = shutil.which("chromedriver")
    if binary is None or driver is None:
        return None
    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(options=options, service=Service(driver))
    browser.set_window_size(1100, 700)
    return browser


def text(browser, name):
    return browser.find_element(By.ID, name).text


def number(browser, name):
    words = text(browser, name).replace(",", "").replace(_MINUS, "-")
    return float(words) if words.strip(_DASH) else 0.0


def picture(browser):
    return browser.execute_script("return document.getElementById('picture').toDataURL()")


def pictures(browser, seconds=0.7):
    """Return the different pictures that are shown within a time."""
    seen, end = set(), time.monotonic() + seconds
    while time.monotonic() < end:
        seen.add(picture(browser))
    return seen


def moves(browser, seconds=20):
    """Return as soon as the pictures have changed several times; fail after some seconds."""
    seen, end = set(), time.monotonic() + seconds
    while len(seen) <= 5 and time.monotonic() < end:
        seen.add(picture(browser))
    return len(seen) > 5


def complaints(browser):
    return [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]


def pace(server, url, seconds=1):
    """Return how many steps a second an environment takes; a watched one takes 50."""
    began, before = time.monotonic(), server.get(url)[1]["steps"]
    time.sleep(seconds)
    return (server.get(url)[1]["steps"] - before) / (time.monotonic() - began)
