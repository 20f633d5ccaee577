# SPDX-License-Identifier: BSD-3-Clause
"""Tasks for tests of clusters: quick ones, and those that do what none should."""

import os
import re
import time

from airlight.errors import InputError


def square(number, seconds=0.0):
    time.sleep(seconds)
    return number * number


def add(first, number, seconds=0.0):
    time.sleep(seconds)
    return first + number


def process(seconds):
    time.sleep(seconds)
    return os.getpid()


def large(number):
    return bytes(1_000_000) + bytes([number])


def refuse():
    raise InputError("it is too dark")


def fail():
    raise ValueError("a fault")


def abort():
    os.abort()


def sleep_for_ever():
    while True:
        time.sleep(1)


def hold_the_interpreter():
    """Run for ever in C, without letting other threads of Python run."""
    re.match(r"(a+)+$", "a" * 60 + "b")
