"""What is wrong with sensors that are computed by electrostatics, and what a reader should know of them, as written."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from replay.errors import count
from replay.sensing.capacitive.part import VACUUM_PERMITTIVITY

_FITTED = 1e-6
"""Relative deviation from the vacuum's permittivity beyond which one was fitted."""


def faults(
    parts: Mapping[str, Any], felt: Mapping[str, Sequence[str]], method: str
) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield why sensors of a link cannot be one unit; arguments as of `notes`."""
    for link in sorted({part.link for part in parts.values()}):
        first, *others = (name for name, part in parts.items() if part.link == link)
        unit = f"with method {method} the sensors of link {link!r} are one unit"
        for other in others:
            apart = sorted(set(felt[first]) ^ set(felt[other]))
            if apart:
                shown = f"{', '.join(apart[:5])}{', ...' if len(apart) > 5 else ''}"
                yield (other, "ignore"), f"must leave out the same links as of {first!r}, unlike {shown}: {unit}"
            if parts[other].driven != parts[first].driven:
                yield (other, "driven"), f"must be as of {first!r}: {unit}, and what is behind it one conductor"
        if parts[first].driven and not any(part.back for part in parts.values() if part.link == link):
            yield (first, "driven"), f"drives nothing: {unit}, and none has anything in `back`"


def notes(
    parts: Mapping[str, Any], felt: Mapping[str, Sequence[str]], earth: Mapping[str, float], method: str
) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield what units there are, what they feel and how that is earthed, and what of sensors has no effect.

    Args:
        parts: capacitive sensors as they are written, by name.
        felt: the links that each senses.
        earth: [F] of each link; inf: grounded, 0: floating.
        method: by which they are computed.
    """
    links = sorted({part.link for part in parts.values()})
    for link in links:
        own = {name: part for name, part in parts.items() if part.link == link}
        first = next(iter(own))
        behind = sorted({name for part in own.values() for name in part.back})
        backed = f"with {', '.join(behind)} behind its plates" if behind else "with nothing behind its plates"
        bodies = ", ".join(f"{body} ({_earth(earth[body])})" for body in felt[first]) or "nothing"
        names = ", ".join(own) if len(own) <= 6 else f"{', '.join(list(own)[:5])} and {len(own) - 5} more"
        are = "is" if len(own) == 1 else "are"
        yield (first,), f"with method {method}, {names} on {link} {are} one unit {backed}; it feels {bodies}"
    if len(links) > 1:
        units = count(len(links), "unit")
        yield (
            (next(iter(parts)),),
            f"with method {method}, {units} on {', '.join(links)}: each reads by itself, to it the links of the others "
            "are bodies as any, and their plates are not there",
        )
    for name, part in parts.items():
        for key, default in (("side", "front"), ("faces", "all")):
            if getattr(part, key) != default:
                yield (name, key), f"has no effect with method {method}: charge gathers on all sides"
        if part.stray_capacitance > 0.0:
            rule = (
                f"is to method {method} what it does not model, such as cables; a value fitted for tree, which "
                "does not know the sensor by itself, is too large: calibrate again"
            )
            yield (name, "stray_capacitance"), rule
        if abs(part.permittivity / VACUUM_PERMITTIVITY - 1.0) > _FITTED:
            factor = part.permittivity / VACUUM_PERMITTIVITY
            rule = (
                f"is the vacuum's times {factor:.4g}, and so is what method {method} reads; a value fitted for "
                "tree is no such factor: leave it out, or calibrate again"
            )
            yield (name, "permittivity"), rule


def _earth(capacitance: float) -> str:
    if math.isinf(capacitance):
        return "grounded"
    return "floating" if capacitance == 0.0 else f"{capacitance * 1e12:.6g} pF to earth"
