"""Damaged copies of a file: by bytes, by words of its text, by values of its JSON, inside its container.

A mutator takes a generator and the seeds of one reader, and gives the bytes of one case.  Containers are written again
with sizes and checksums that are right, so that damage reaches what lies behind them.
"""

from __future__ import annotations

import io
import json
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

Mutator = Callable[[np.random.Generator, Sequence[bytes]], bytes]

NUMBERS = (0, 1, -1, 2, 3, 4, 7, 127, 128, 255, 256, 32767, 65535, 65536, 2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**40)
NUMBERS += (-(2**31), 2**63 - 1, 2**63, -(2**63), 10**9, 60_000_000, 16384)
WORDS = ("nan", "inf", "-inf", "1e400", "-1e308", "1e-320", "0x10", "1_0", "٣", "", "9" * 400, "-0", "\0", "\ud7ff")
VALUES: tuple[Any, ...] = (None, True, False, "", "a", "../outside/secret.bin", "/etc/passwd", "/dev/zero", [], {}, 0.5)
VALUES += (1e308, -1e308, 1e-320, [0], [[]], {"a": 0}, [1e308] * 16, "http://127.0.0.1/a", "file:///etc/passwd")
VALUES += ("data:;base64,AAAA", "data:image/png;base64,", "data:,x", *NUMBERS)
DEEP = 3000
"""Brackets of a value that is nested beyond what any file needs."""
LONG = 1 << 16
"""The most bytes that are put into a file at once."""
MANY = 1000
"""Entries that a list of a JSON tree may grow to."""


def pick(rng: np.random.Generator, choices: Sequence[Any]) -> Any:
    """One of several, as it is."""
    return choices[int(rng.integers(len(choices)))]


def by_bytes(rng: np.random.Generator, seeds: Sequence[bytes]) -> bytes:
    """One to eight blows: bits, bytes, integers of a header, cut, doubled, joined with another seed."""
    data = bytearray(pick(rng, seeds))
    for _ in range(1 << int(rng.integers(4))):
        place = int(rng.integers(max(len(data), 1)))
        place = min(place, int(rng.integers(256))) if rng.random() < 0.5 else place  # headers decide the most
        kind = int(rng.integers(8))
        if kind == 0 and data:
            data[place] ^= 1 << int(rng.integers(8))
        elif kind == 1 and data:
            data[place] = int(rng.integers(256))
        elif kind in (2, 3):
            width, order = pick(rng, (1, 2, 4, 8)), pick(rng, ("little", "big"))
            data[place : place + width] = (pick(rng, NUMBERS) % (1 << 8 * width)).to_bytes(width, order)
        elif kind == 4:
            del data[place : place + int(rng.integers(1, 64))]
        elif kind == 5:
            data = data[:place] if rng.random() < 0.3 or len(data) > LONG else data + data[place : place + LONG]
        elif kind == 6:
            data[place:place] = rng.bytes(int(rng.integers(1, 32)))
        else:
            other = pick(rng, seeds)
            data[place:] = other[int(rng.integers(max(len(other), 1))) :]
    return bytes(data)


def by_words(rng: np.random.Generator, seeds: Sequence[bytes]) -> bytes:
    """A text with other words, and with lines doubled, left out, moved or grown."""
    lines = pick(rng, seeds).decode("latin-1").split("\n")
    for _ in range(1 << int(rng.integers(4))):
        lines = lines or [""]
        place = int(rng.integers(len(lines)))
        kind = int(rng.integers(6))
        if kind < 3:
            words = re.split(r"([ ,/]+)", lines[place])
            words[int(rng.integers(len(words)))] = str(pick(rng, (*WORDS, *NUMBERS)))
            lines[place] = "".join(words)
        elif kind == 3:
            lines[place : place + 1] = [lines[place]] * int(rng.integers(0, 4))
        elif kind == 4:
            other = int(rng.integers(len(lines)))
            lines[place], lines[other] = lines[other], lines[place]
        else:
            grown = f"{lines[place]} "
            lines[place] = grown * int(rng.integers(2, max(3, LONG // len(grown))))
    text = "\n".join(lines)
    return text.encode(pick(rng, ("utf-8", "utf-8", "utf-16", "utf-8-sig")), errors="replace")


def in_turn(*mutators: Mutator) -> Mutator:
    """Any of several, as the generator will have it."""
    return lambda rng, seeds: pick(rng, mutators)(rng, seeds)


def other_value(rng: np.random.Generator, tree: Any) -> Any:
    """The tree with one to four of its values replaced, left out, doubled or taken from elsewhere in it."""
    tree = copied(tree)
    for _ in range(1 << int(rng.integers(3))):
        places = list(_places(tree))
        if not places:
            return copied(pick(rng, VALUES))
        holder, key = pick(rng, places)
        kind = int(rng.integers(6))
        if kind < 3:
            holder[key] = copied(pick(rng, VALUES))
        elif kind == 3:
            del holder[key]
        elif kind == 4:
            other, name = pick(rng, places)
            named = isinstance(other, dict) and name in other
            holder[key] = copied(other[name]) if named else 0
        elif isinstance(holder[key], list):
            holder[key] = holder[key] * int(rng.integers(2, max(3, MANY // (len(holder[key]) + 1))))
        else:
            holder[key] = [holder[key]] * int(rng.integers(1, 20))
    return tree


def copied(tree: Any) -> Any:
    """The same values anew: one that stood in two places would change in both, or come to hold itself."""
    return json.loads(json.dumps(tree))


def _places(tree: Any) -> Any:
    """(holder, key) of every value of a tree."""
    entries = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in list(entries):
        yield tree, key
        yield from _places(value)


def json_text(rng: np.random.Generator, tree: Any) -> bytes:
    """A tree with other values as text; now and then nested deeper than any reader goes."""
    text = json.dumps(other_value(rng, tree))
    text = text if len(text) < 16 * LONG else json.dumps(tree)
    if rng.random() < 0.03:
        text = text.replace("0", "[" * DEEP + "]" * DEEP, 1)
    return text.encode()


def by_json(rng: np.random.Generator, seeds: Sequence[bytes]) -> bytes:
    """A JSON file with other values."""
    return json_text(rng, json.loads(pick(rng, seeds)))


def by_lines(rng: np.random.Generator, seeds: Sequence[bytes]) -> bytes:
    """A file of JSON lines, one of which has other values, or is left out, doubled or cut."""
    lines = pick(rng, seeds).splitlines()
    place = int(rng.integers(len(lines)))
    if rng.random() < 0.8:
        lines[place] = json_text(rng, json.loads(lines[place]))
    else:
        lines[place : place + 1] = [lines[place]] * int(rng.integers(0, 4))
    return b"\n".join(lines) + (b"\n" if rng.random() < 0.8 else b"")


def by_glb(rng: np.random.Generator, seeds: Sequence[bytes]) -> bytes:
    """A GLB file whose JSON has other values, or whose binary chunk is damaged; its lengths are right."""
    data = pick(rng, seeds)
    size = struct.unpack_from("<I", data, 12)[0]
    text, body = data[20 : 20 + size], data[28 + size :]
    if rng.random() < 0.75:
        text = json_text(rng, json.loads(text))
    else:
        body = by_bytes(rng, [body])
    return glb(text, body)


def glb(text: bytes, body: bytes) -> bytes:
    """A GLB file of a JSON text and a binary chunk."""
    text, body = text + b" " * (-len(text) % 4), body + b"\0" * (-len(body) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(body), 0x004E4942) + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def by_zip(rng: np.random.Generator, seeds: Sequence[bytes]) -> bytes:
    """An archive with one damaged member; its checksums are right."""
    found: dict[str, bytes] = {}
    with zipfile.ZipFile(io.BytesIO(pick(rng, seeds))) as archive:
        found = {name: archive.read(name) for name in archive.namelist()}
    name = pick(rng, list(found))
    mutate = by_words if found[name].lstrip()[:1] == b"<" and rng.random() < 0.7 else by_bytes
    found[name] = mutate(rng, [found[name]])
    stream = io.BytesIO()
    with zipfile.ZipFile(
        stream, "w", pick(rng, (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_LZMA))
    ) as archive:
        for member, content in found.items():
            archive.writestr(member, content)
    return stream.getvalue()


def by_png(rng: np.random.Generator, seeds: Sequence[bytes]) -> bytes:
    """A PNG file with damaged chunks; their checksums are right."""
    data, place, parts = pick(rng, seeds), 8, []
    if not data.startswith(b"\x89PNG"):
        return by_bytes(rng, [data])
    while place + 8 <= len(data):
        size = struct.unpack_from(">I", data, place)[0]
        parts.append((data[place + 4 : place + 8], data[place + 8 : place + 8 + size]))
        place += 12 + size
    chosen = int(rng.integers(len(parts)))
    parts[chosen] = (parts[chosen][0], by_bytes(rng, [parts[chosen][1]]))
    if rng.random() < 0.2:
        parts.insert(chosen, pick(rng, parts))
    packed = (
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body)) for kind, body in parts
    )
    return data[:8] + b"".join(packed)


def by_header(rng: np.random.Generator, seeds: Sequence[bytes]) -> bytes:
    """A safetensors file whose header has other values."""
    data = pick(rng, seeds)
    size = int.from_bytes(data[:8], "little")
    text = json_text(rng, json.loads(data[8 : 8 + size]))
    return len(text).to_bytes(8, "little") + text + data[8 + size :]


def by_safetensors(rng: np.random.Generator, seeds: Sequence[bytes]) -> bytes:
    """A safetensors file whose header, or the JSON in it, has other values, or whose numbers are damaged."""
    data = pick(rng, seeds)
    size = int.from_bytes(data[:8], "little")
    tree, body = json.loads(data[8 : 8 + size]), data[8 + size :]
    kind = int(rng.integers(3))
    if kind == 0:
        tree["__metadata__"]["flexpara"] = json_text(rng, json.loads(tree["__metadata__"]["flexpara"])).decode()
    elif kind == 1:
        tree = other_value(rng, tree)
    else:
        numbers = bytearray(body)
        for _ in range(1 << int(rng.integers(4))):
            place = int(rng.integers(len(body) // 8)) * 8
            numbers[place : place + 8] = (pick(rng, NUMBERS) % 2**64).to_bytes(8, "little")
        body = bytes(numbers)
    text = json.dumps(tree).encode()
    return len(text).to_bytes(8, "little") + text + body
