"""Which failures are alike: what their messages say without what belongs to one scenario: paths, numbers, names.

A message is taken word by word. A word of letters alone is part of what is said. Any other one (a number, a path,
a name with digits), what stands in quotes, and what has a value are particulars. Names of letters alone that stand
without quotes cannot be told from words, but for the scenario's own.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence

_LONGEST = 200
"""Characters of a message that a name has room for."""
_PARTICULAR = "..."
_UNFORESEEN = re.compile(r"(?:^|: )(\w+)(?:: .*)? \((replay/[\w/]+\.py:\d+)\)$")
"""An error that nobody has foreseen, and the place that raised it (`batch.raised`): one cause, whatever it says."""
_PARTICULARS = (
    re.compile(r"^(?:(?!: ).)+\.[A-Za-z]\w{0,5}(?::\d+){0,2}:(?= )"),  # the file, line and column that is spoken of
    re.compile(r"""(?<!\w)(?:'[^']*'|"[^"]*"|`[^`]*`)(?!\w)"""),
    re.compile(r"\S+ = (?:\[[^\]]*\]|\([^)]*\)|\S+)"),
)
_PUNCTUATION = ".,:;()[]{}!?"
_SINGULAR = {"are": "is", "were": "was", "have": "has", "do": "does"}


def kinds(messages: Mapping[str, str]) -> dict[str, str]:
    """Return the kind of each failure, the same for those that are alike.

    Args:
        messages: why scenarios failed, by their names; the first line counts.
    """
    plain = {name: _kind(_first_line(message)) for name, message in messages.items()}
    often = Counter(plain.values())
    return {
        name: kind if often[kind] > 1 else _kind(_without(name, _first_line(messages[name])))
        for name, kind in plain.items()
    }


def in_common(messages: Sequence[str]) -> str:
    """Return what the messages of failures of one kind have in common, as one line; that of a single one is itself."""
    lines = list(dict.fromkeys(_first_line(message) for message in messages))
    words = [line.split() for line in lines]
    if len({len(line) for line in words}) == 1:
        told = [same[0] if len(set(same)) == 1 else _PARTICULAR for same in zip(*words, strict=True)]
    else:
        told = _kind(lines[0]).split()
    return " ".join(_once(told))[:_LONGEST]


def _first_line(message: str) -> str:
    return (message.splitlines() or [""])[0]


def _without(name: str, line: str) -> str:
    """Return a line without the scenario's name, which no other scenario's message has."""
    return re.sub(rf"(?<!\w){re.escape(name)}(?!\w)", _PARTICULAR, line)


def _kind(line: str) -> str:
    if unforeseen := _UNFORESEEN.search(line):
        return " ".join(unforeseen.groups())
    for pattern in _PARTICULARS:
        line = pattern.sub(f" {_PARTICULAR} ", line)
    words: list[str] = []
    for word in line.split():
        bare = word.strip(_PUNCTUATION)
        if not re.fullmatch(r"[^\W\d_]+(?:['’-][^\W\d_]+)*", bare) or bare in ("nan", "inf"):
            words.append(_PARTICULAR)
            continue
        bare = _SINGULAR.get(bare, bare)
        words.append(bare.removesuffix("s") if words and words[-1] == _PARTICULAR else bare)  # 1 frame, 2 frames
    return " ".join(_once(words))


def _once(words: Sequence[str]) -> list[str]:
    """Return words with particulars that follow each other as one."""
    return [word for k, word in enumerate(words) if word != _PARTICULAR or k == 0 or words[k - 1] != _PARTICULAR]
