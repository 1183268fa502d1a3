"""Damage to bytes, texts, JSON and MCAP records; what has checksums gets right ones again."""

from __future__ import annotations

import copy
import json
import random
import re
import struct
import zlib
from typing import Any
from xml.sax import saxutils

import zstandard

from replay.logs.mcap_records import MAGIC, Op

NUMBERS = (0, 1, 2, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 1 << 40, (1 << 63) - 1, (1 << 64) - 1)
STRAY: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 46, 255, 1.5, -0.5, 1e300, 1e-300, 10**18, 10**400, float("inf"), float("nan")),
    *("", "x", "-", "a" * 300, "../../etc/passwd", "\x1b[31mred", "\u2028", "\ud800", "30 deg", "5 cm", "NaN", "true"),
    *([], {}, [None], [[]], {"a": 1}, [1, 2, 3], ["x"], {"": {"": {}}}),
)
WORDS = (
    "0 1 -1 46 1e999 -1e-999 nan inf .nan .inf 1e309 99999999999999999999 1_000 0x1F 0b1 1,5 1/0 1/3 30deg deg cm",
    "null true ~ [] {} [ ] { } : - ? * & ! | > % @ ` # , ; << &a *a *b !!str !!int !x 'x \"x --- ... %YAML %TAG",
    "v f o l p vn solid facet vertex endsolid element property list end_header ply format",
)
WORDS = (*(word for words in WORDS for word in words.split(" ")), "\t", "\r", "\0", "\ufeff", "\u2028", "\x85")


def of_bytes(data: bytes, rng: random.Random) -> bytes:
    """Return bytes with one to four wounds."""
    wound = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = rng.randrange(len(wound) + 1)
        size = rng.choice((1, 1, 2, 4, 8, 32))
        match rng.randrange(8):
            case 0:
                wound[at : at + 1] = bytes([rng.randrange(256)])
            case 1 if at < len(wound):
                wound[at] ^= 1 << rng.randrange(8)
            case 2:
                number = rng.choice(NUMBERS)
                width = rng.choice((1, 2, 4, 8))
                wound[at : at + width] = (number & ((1 << 8 * width) - 1)).to_bytes(
                    width, rng.choice(("little", "big"))
                )
            case 3:
                del wound[at : at + size]
            case 4:
                wound[at:at] = wound[at : at + size]
            case 5:
                wound[at:at] = bytes(rng.randrange(256) for _ in range(size))
            case 6:
                other = rng.randrange(len(wound) + 1)
                wound[at : at + size] = wound[other : other + size]
            case 7 if rng.random() < 0.3:
                del wound[at:]
    return bytes(wound)


def of_text(data: bytes, rng: random.Random) -> bytes:
    """Return a text with words and lines removed, doubled, moved or replaced, or with wounds as bytes."""
    if rng.random() < 0.2:
        return of_bytes(data, rng)
    separator = rng.choice((b"\n", b"\n", b" ", b",", b":"))
    parts = data.split(separator)
    for _ in range(rng.choice((1, 1, 2, 3))):
        at, other = rng.randrange(len(parts)), rng.randrange(len(parts))
        match rng.randrange(6):
            case 0 if len(parts) > 1:
                del parts[at]
            case 1:
                parts.insert(at, parts[other])
            case 2:
                parts[at], parts[other] = parts[other], parts[at]
            case 3:
                parts[at] = rng.choice(WORDS).encode()
            case 4:
                parts.insert(at, rng.choice(WORDS).encode())
            case 5:
                parts[at : at + 1] = [parts[at]] * rng.choice((2, 5, 50))
        if not parts:
            parts = [b""]
    return separator.join(parts)


def paths(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the path of every value in JSON."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *(found for key, below in items for found in paths(below, (*path, key)))]


def stray(rng: random.Random) -> Any:
    """Return a value that belongs nowhere, as one of its own: what it is put into may be damaged once more."""
    return copy.deepcopy(rng.choice(STRAY))


def of_values(value: Any, rng: random.Random) -> Any:
    """Return JSON values of which one or two are removed, replaced or moved."""
    value = json.loads(json.dumps(value))
    for _ in range(rng.choice((1, 1, 2))):
        places = [path for path in paths(value) if path]
        if not places:
            return stray(rng)
        path = rng.choice(places)
        owner = value
        for step in path[:-1]:
            owner = owner[step]
        match rng.randrange(5):
            case 0:
                del owner[path[-1]]
            case 1:
                other = value
                for step in rng.choice(places):
                    other = other[step]
                owner[path[-1]] = json.loads(json.dumps(other))
            case 2 if isinstance(owner, dict):
                owner[rng.choice(("x", "", "a" * 300, "\x1b[2J"))] = stray(rng)
            case _:
                owner[path[-1]] = stray(rng)
    return value


def of_xml(data: bytes, rng: random.Random) -> bytes:
    """Return XML of which elements or attributes are removed, doubled, moved or replaced, or damaged as a text."""
    if rng.random() < 0.2:
        return of_text(data, rng)
    parts = re.split(rb"(<[^>]*>)", data)
    for _ in range(rng.choice((1, 1, 2, 3))):
        at, other = rng.randrange(len(parts)), rng.randrange(len(parts))
        values = [*re.finditer(rb'"[^"]*"', parts[at])]
        match rng.randrange(6):
            case 0:
                parts[at] = b""
            case 1:
                parts[at : at + 1] = [parts[at]] * rng.choice((2, 5, 200))
            case 2:
                parts[at], parts[other] = parts[other], parts[at]
            case _ if values:
                one = rng.choice(values)
                word = str(rng.choice((*WORDS, *STRAY, "a.stl", "b.dae", "base", "turn", "1 2 3", "1e-320 1 1")))
                value = saxutils.quoteattr(word).encode(errors="replace")
                parts[at] = parts[at][: one.start()] + value + parts[at][one.end() :]
            case _:
                parts[at] = of_text(parts[at], rng)
    return b"".join(parts)


def of_json(data: bytes, rng: random.Random) -> bytes:
    """Return a JSON text with other values, too deep, or damaged as a text."""
    kind = rng.random()
    if kind < 0.2:
        return of_text(data, rng)
    if kind < 0.23:
        return rng.choice((b"[", b'{"a":')) * rng.choice((50, 900, 100_000))
    if kind < 0.26:
        return data.replace(b"1", b"1" * rng.choice((30, 5000)), 1)
    return json.dumps(of_values(json.loads(data), rng)).encode()


Records = list[tuple[int, Any]]
"""Opcodes and contents; of a chunk its compression and its records."""


def parse(data: bytes) -> tuple[Records, Records]:
    """Return the records of the data section and of the summary of a whole MCAP file."""
    found: Records = []
    summary: Records = []
    at, into = len(MAGIC), found
    while at < len(data) - len(MAGIC):
        op, size = struct.unpack_from("<BQ", data, at)
        content = data[at + 9 : at + 9 + size]
        at += 9 + size
        if op == Op.DATA_END:
            into = summary
        elif op == Op.CHUNK:
            into.append((op, _unpacked(content)))
        elif op != Op.FOOTER:
            into.append((op, content))
    return found, summary


def _unpacked(content: bytes) -> tuple[str, Records]:
    (size,) = struct.unpack_from("<I", content, 28)
    compression = content[32 : 32 + size].decode()
    packed = content[40 + size :]
    data = zstandard.ZstdDecompressor().decompress(packed) if compression == "zstd" else packed
    records: Records = []
    at = 0
    while at < len(data):
        op, size = struct.unpack_from("<BQ", data, at)
        records.append((op, data[at + 9 : at + 9 + size]))
        at += 9 + size
    return compression, records


def record(op: int, content: bytes) -> bytes:
    """Return a record as it stands in a file."""
    return struct.pack("<BQ", op & 0xFF, len(content)) + content


def build(records: Records, summary: Records, claimed: int | None = None) -> bytes:
    """Return a file of records with right checksums; `claimed` is the size that chunks say they unpack to."""
    out = bytearray(MAGIC)
    for op, content in records:
        if isinstance(content, tuple):
            compression, inside = content
            data = b"".join(record(*entry) for entry in inside)
            packed = zstandard.compress(data, 1) if compression == "zstd" else data
            head = struct.pack("<QQQI", 0, 0, len(data) if claimed is None else claimed, zlib.crc32(data))
            name = compression.encode(errors="replace")
            content = head + struct.pack("<I", len(name)) + name + struct.pack("<Q", len(packed)) + packed
        elif op == Op.ATTACHMENT and len(content) > 4:
            content = content[:-4] + struct.pack("<I", zlib.crc32(content[:-4]))
        elif op == Op.METADATA and content[4:12] == b"preamble":
            content = metadata("preamble", {"crc32": str(zlib.crc32(out))})
        out += record(op, content)
    out += record(Op.DATA_END, struct.pack("<I", zlib.crc32(out)))
    start = len(out)
    tail = b"".join(record(op, content) for op, content in summary)
    tail += struct.pack("<BQQQ", Op.FOOTER, 20, start if summary else 0, 0)
    return bytes(out + tail + struct.pack("<I", zlib.crc32(tail)) + MAGIC)


def text(value: str) -> bytes:
    """Return a text as it stands in a record."""
    data = value.encode(errors="replace")
    return struct.pack("<I", len(data)) + data


def metadata(name: str, values: dict[str, str]) -> bytes:
    """Return the content of a metadata record."""
    pairs = b"".join(text(key) + text(value) for key, value in values.items())
    return text(name) + struct.pack("<I", len(pairs)) + pairs


def values_of(content: bytes) -> tuple[str, dict[str, str]]:
    """Return the name and the values of a metadata record."""
    texts, at = [], 0
    while at < len(content):
        (size,) = struct.unpack_from("<I", content, at)
        if len(texts) == 1 and at + 4 + size == len(content):
            at += 4
            continue
        texts.append(content[at + 4 : at + 4 + size].decode())
        at += 4 + size
    return texts[0], dict(zip(texts[1::2], texts[2::2], strict=True))


def of_mcap(whole: tuple[Records, Records], rng: random.Random) -> bytes:
    """Return a recording with damaged records and right checksums."""
    records, summary = ([*part] for part in whole)
    claimed: int | None = None
    for _ in range(rng.choice((1, 1, 2))):
        where = summary if summary and rng.random() < 0.15 else records
        at = rng.randrange(len(where))
        op, content = where[at]
        match rng.randrange(10):
            case 0:
                del where[at]
                where = where or [(Op.HEADER, b"")]
            case 1:
                where.insert(rng.randrange(len(where)), where[at])
            case 2:
                where[at] = (rng.choice((*range(16), 0x80, 0xFF)), content if isinstance(content, bytes) else b"x" * 40)
            case 3:
                other = rng.randrange(len(where))
                where[at], where[other] = where[other], where[at]
            case 4:
                claimed = rng.choice((0, 1, 1 << 28, (1 << 28) + 1, 1 << 31, 1 << 40, (1 << 64) - 1))
            case _ if isinstance(content, tuple):
                where[at] = (op, _in_chunk(content, rng))
            case 5 | 6 if op == Op.METADATA and b"layout" in content:
                name, values = values_of(content)
                key = rng.choice([*values])
                values[key] = of_json(values[key].encode(), rng).decode(errors="replace")
                where[at] = (op, metadata(name, values))
            case _:
                where[at] = (op, of_bytes(content, rng))
    if not records:
        records = [(Op.HEADER, text("") + text("x"))]
    return build(records, summary, claimed)


def _in_chunk(content: tuple[str, Records], rng: random.Random) -> tuple[str, Records]:
    compression, inside = content
    inside = [*inside]
    if not inside or rng.random() < 0.05:
        return rng.choice(("zstd", "", "lz4", "rar")), inside
    at = rng.randrange(len(inside))
    op, message = inside[at]
    match rng.randrange(5):
        case 0:
            del inside[at]
        case 1:
            inside.insert(at, inside[rng.randrange(len(inside))])
        case 2:
            inside = [(kind, of_head(data, message, rng)) for kind, data in inside]
        case _:
            inside[at] = (op, of_bytes(message, rng))
    return compression, inside


def of_head(data: bytes, example: bytes, rng: random.Random) -> bytes:
    """Return a message with one byte of its data as in no other: the same place in all, so that the layout stays."""
    place = random.Random(len(example)).randrange(22, max(23, len(data)))
    return data[:place] + bytes([rng.randrange(256)]) + data[place + 1 :]
