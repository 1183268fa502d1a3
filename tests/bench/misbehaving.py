"""Contestants that fail in every way; known by name, so that they can be sent to another process."""

import ctypes
import math
import time


def right(question):
    return [question["truth"]]


def wrong(question):
    return [question["truth"] * 2.0]


def no_number(question):
    return [math.nan]


def hangs_on_the_second(question):
    if question["number"] == 1:
        time.sleep(60.0)
    return right(question)


def crashes_on_the_second(question):
    if question["number"] == 1:
        ctypes.string_at(0)
    return right(question)


def always_crashes(question):
    ctypes.string_at(0)


def refuses(question):
    raise ValueError("not this one")
