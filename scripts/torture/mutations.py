"""Mutations of files: of their bytes, and of their structure as JSON, tables, lines, glTF, arrays and C3D."""

import io
import json
import re
import struct
import zipfile
from collections.abc import Callable
from random import Random
from typing import Any

Mutation = Callable[[bytes, Random], bytes]

_NUMBERS = (0, -1, 1, 2, 3, 7, 255, 256, 65535, 65536, 2**31 - 1, 2**31, -(2**31), 2**32, 2**53 + 1, 2**63, 10**30)
_REALS = (0.0, -0.0, 0.5, 1e-320, 1e-30, 1e12, 1e30, 3.5e38, 1e300, float("nan"), float("inf"), float("-inf"))
_TEXTS = (
    *(
        "",
        " ",
        "a",
        "A" * 300,
        "n" * 70_000,
        "é",
        "\u202eabc",
        "a\x1b[31mb",
        "a\nb",
        "a\0b",
        "\ud800",
        "🙂",
        "~nobodyx/x.npz",
    ),
    *(
        "../x",
        "/dev/zero",
        "/etc/passwd",
        "C:\\x",
        "http://x/y",
        "data:,x",
        "%00",
        "jawOpen",
        "eyeBlinkLeft",
        "low",
        ":" * 2000,
    ),
)
_TOKENS = (
    *(b"", b"0", b"-1", b"1", b"nan", b"inf", b"-inf", b"1e999", b"1e39", b"1e-320", b"1e300", b"1_0", b"0x1", b"1,5"),
    *(
        b"9" * 400,
        b"99999999999",
        b"-99999999999",
        b"1/1/1",
        b"1//1",
        b"/",
        b"//",
        b"\xff\xfe",
        b"\0",
        b"#",
        b"\\",
        b'"',
    ),
    *(b"\xef\xbb\xbf", b"a" * 5000, b":" * 3000, b"\xd9\xa1", b"\r", b"\x85", b"f", b"v", b"vt", b"g", b"usemtl"),
)
_NASTY_BYTES = (
    b"\0",
    b"\xff",
    b"\x80",
    b"\x7f",
    b"\n",
    b"\r",
    b'"',
    b",",
    b"{",
    b"}",
    b"[",
    b"]",
    b"\xff\xff\xff\xff",
    b"\0\0\0\0",
)


def bytewise(data: bytes, rng: Random) -> bytes:
    """Return ``data`` with a few bytes changed, inserted, removed, repeated or cut off."""
    result = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        at = rng.randrange(len(result) + 1)
        # The beginnings of files have their counts and sizes.
        at = min(at, rng.randrange(256)) if rng.random() < 0.4 else at
        size = rng.choice((1, 1, 2, 4, 16, 256))
        kind = rng.randrange(8)
        if kind == 0 and at < len(result):
            result[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            result[at : at + size] = rng.randbytes(size)
        elif kind == 2:
            result[at:at] = rng.choice(_NASTY_BYTES) * rng.choice((1, 1, 4, 64))
        elif kind == 3:
            del result[at : at + size]
        elif kind == 4:
            result[at:at] = result[at : at + size] * rng.choice((1, 2, 50))
        elif kind == 5 and rng.random() < 0.3:
            del result[at:]
        elif kind == 6:
            code = rng.choice(("<B", "<h", ">h", "<i", ">i", "<f", "<d", "<q"))
            pool: tuple[Any, ...] = _REALS if code in ("<f", "<d") else _NUMBERS
            result[at : at + struct.calcsize(code)] = _packed(code, rng.choice(pool))
        else:
            begin = rng.randrange(len(result) + 1)
            result[at : at + size] = result[begin : begin + size]
    return bytes(result)


def _packed(code: str, value: Any) -> bytes:
    if code in ("<f", "<d"):
        return struct.pack(
            code, value if code == "<d" or not abs(value) < float("inf") else max(min(value, 3e38), -3e38)
        )
    return (int(value) % 256 ** struct.calcsize(code)).to_bytes(struct.calcsize(code), "little")


def json_structure(data: bytes, rng: Random) -> bytes:
    """Return the JSON text ``data`` with some of its values, keys and items changed."""
    return _json_bytes(changed(json.loads(data.decode("utf-8-sig")), rng), rng)


def _json_bytes(value: Any, rng: Random) -> bytes:
    text = json.dumps(value, ensure_ascii=rng.random() < 0.9)
    kind = rng.randrange(40)
    if kind == 0:
        text = re.sub(r"(\d)([,\]}])", lambda found: f"{found[1]}{'0' * 400}{found[2]}", text, count=1)
    elif kind == 1:
        text = text.replace("0.0", rng.choice(("1e999", "-1e400", "NaN", "0" * 6000, "1e-999")), 1)
    elif kind == 2:
        text = text.replace("{", '{"' + rng.choice(("a", "version", "format")) + '": 1, ', 1)
    content = text.encode("utf-8", "surrogatepass")
    return (
        b"\xef\xbb\xbf" + content
        if kind == 3
        else content.decode("utf-8", "replace").encode("utf-16")
        if kind == 4
        else content
    )


def changed(root: Any, rng: Random) -> Any:
    """Return the JSON value ``root``, which is changed in place, with one to four of its parts changed."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        places: list[tuple[Any, Any]] = []
        _collect(root, places, 4000)
        if not places:
            return strange_value(rng)
        holder, key = rng.choice(places)
        if isinstance(holder, dict) and key in holder:
            _change_key(holder, key, rng)
        elif isinstance(holder, list) and key < len(holder):
            _change_item(holder, key, rng)
    return root


def _change_key(holder: dict[str, Any], key: str, rng: Random) -> None:
    kind = rng.randrange(5)
    if kind == 0:
        del holder[key]
    elif kind == 1:
        holder[rng.choice(_TEXTS)] = holder.pop(key)
    elif kind == 2:
        holder[rng.choice(_TEXTS)] = strange_value(rng)
    else:
        holder[key] = _like(holder[key], rng)


def _change_item(holder: list[Any], at: int, rng: Random) -> None:
    kind = rng.randrange(6)
    if kind == 0:
        del holder[at]
    elif kind == 1:
        holder[at:at] = [holder[at]] * rng.choice((1, 2, 100))
    elif kind == 2:
        holder.append(strange_value(rng))
    elif kind == 3:
        rng.shuffle(holder)
    else:
        holder[at] = _like(holder[at], rng)


def _collect(value: Any, places: list[tuple[Any, Any]], most: int) -> None:
    keys = value.keys() if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    for key in list(keys):
        if len(places) >= most:
            return
        places.append((value, key))
        _collect(value[key], places, most)


def _like(value: Any, rng: Random) -> Any:
    """Return a value of the kind of ``value``, usually, which may or may not be valid in its place."""
    if rng.random() < 0.25:
        return strange_value(rng)
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return rng.choice((*_NUMBERS, value + 1, value - 1, -value, value * 1000))
    if isinstance(value, float):
        return rng.choice((*_REALS, -value, value * 1e3, value * 1e-3, value * 1e6, value + 0.5, value * 1e30))
    if isinstance(value, str):
        return rng.choice((*_TEXTS, value + "x", value.upper(), value * 3))
    if isinstance(value, list):
        return rng.choice(([], value * 2, value[:1], [*value, *value[:1]], value[1:], [value], value * 40))
    if isinstance(value, dict):
        return rng.choice(({}, [value], {**value, "x": 1}, dict(list(value.items())[:1])))
    return strange_value(rng)


def strange_value(rng: Random) -> Any:
    """Return a value of any kind."""
    deep: Any = []
    if rng.random() < 0.1:
        for _ in range(rng.choice((10, 70, 400))):
            deep = [deep] if rng.random() < 0.5 else {"a": deep}
    return rng.choice((None, True, False, [], {}, deep, rng.choice(_NUMBERS), rng.choice(_REALS), rng.choice(_TEXTS)))


def lines(data: bytes, rng: Random) -> bytes:
    """Return the text ``data`` with some of its words and lines changed."""
    rows = data.split(b"\n")
    for _ in range(rng.choice((1, 1, 2, 4, 10))):
        at = rng.randrange(len(rows))
        at = min(at, rng.randrange(20)) if rng.random() < 0.4 else at
        kind = rng.randrange(10)
        words = rows[at].split(b" ")
        if kind <= 4:
            words[rng.randrange(len(words))] = rng.choice(_TOKENS)
            rows[at] = b" ".join(words)
        elif kind == 5:
            rows[at:at] = [rows[at]] * rng.choice((1, 3, 200))
        elif kind == 6 and len(rows) > 1:
            del rows[at]
        elif kind == 7:
            other = rng.randrange(len(rows))
            rows[at], rows[other] = rows[other], rows[at]
        elif kind == 8:
            rows[at] += rng.choice((b" \\", b"\r", b" 1 2 3", b" " + rng.choice(_TOKENS)))
        else:
            rng.shuffle(words)
            rows[at] = b" ".join(words)
    return b"\n".join(rows)


def table(data: bytes, rng: Random) -> bytes:
    """Return the table of comma-separated values ``data`` with some of its cells, rows and columns changed."""
    rows = [row.split(b",") for row in data.split(b"\n")]
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = 0 if rng.random() < 0.3 else rng.randrange(len(rows))
        row = rows[at]
        column = 0 if rng.random() < 0.2 else rng.randrange(len(row))
        kind = rng.randrange(9)
        if kind <= 2:
            row[column] = rng.choice((*_TOKENS, *(text.encode("utf-8", "replace") for text in _TEXTS)))
        elif kind == 3:
            rows[at:at] = [list(row)] * rng.choice((1, 3, 50))
        elif kind == 4 and len(rows) > 1:
            del rows[at]
        elif kind == 5:
            for other in rows:
                other[column : column + 1] = [] if rng.random() < 0.98 else [b"0", b"0"]
        elif kind == 6:
            row[column:column] = [rng.choice(_TOKENS)] * rng.choice((1, 2, 300))
        elif kind == 7:
            row[column] = b'"' + row[column] + rng.choice((b"", b'"', b'\n"', b',"'))
        else:
            row[column] = row[rng.randrange(len(row))]
        for other in rows:
            other.extend([b""] if not other else [])
    separator = rng.choice((b",", b",", b",", b",", b";", b"\t"))
    text = b"\n".join(separator.join(row) for row in rows)
    kind = rng.randrange(20)
    return (
        b"\xef\xbb\xbf" + text if kind == 0 else text.decode("utf-8", "replace").encode("utf-16") if kind == 1 else text
    )


def gltf(data: bytes, rng: Random) -> bytes:
    """Return the binary glTF ``data`` with its JSON, its numbers or its chunks changed."""
    size = struct.unpack_from("<I", data, 12)[0]
    text, binary = data[20 : 20 + size], bytearray(data[20 + size + 8 :])
    if rng.random() < 0.7:
        text = _json_bytes(changed(json.loads(text), rng), rng)
    if rng.random() < 0.4 and binary:
        for _ in range(rng.choice((1, 4, 40))):
            at = rng.randrange(len(binary)) & ~3
            code = rng.choice(("<f", "<i"))
            binary[at : at + 4] = _packed(code, rng.choice(_REALS if code == "<f" else _NUMBERS))
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary))
    whole = head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return bytewise(whole, rng) if rng.random() < 0.1 else whole


def archive(data: bytes, rng: Random) -> bytes:
    """Return the archive of arrays ``data`` with members changed, missing, renamed, or with other headers."""
    with zipfile.ZipFile(io.BytesIO(data)) as read:
        members = {name: read.read(name) for name in read.namelist()}
    for _ in range(rng.choice((1, 1, 2))):
        name = rng.choice(list(members))
        kind = rng.randrange(8)
        content = members[name]
        if kind == 0:
            del members[name]
        elif kind == 1:
            members[rng.choice(("x.npy", "meta.npy", "shapes.npy", "vertices.npy", "faces.npy", "texture.x.npy"))] = (
                content
            )
        elif kind <= 4:
            members[name] = _other_header(content, rng)
        elif b'"format"' in content[:400]:
            _, _, text = content.partition(b"{\n")
            if kind == 5 or not text:
                members[name] = bytewise(content, rng)
            else:
                members[name] = _array_of(json_structure(b"{\n" + text, rng))
        else:
            members[name] = bytewise(content, rng)
        if not members:
            break
    result = io.BytesIO()
    with zipfile.ZipFile(result, "w", rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))) as written:
        for name, content in members.items():
            written.writestr(name, content)
    whole = bytearray(result.getvalue())
    if rng.random() < 0.1:
        # Flags, method and sizes of a member in the central directory.
        at = whole.find(b"PK\1\2")
        place = at + rng.choice((8, 10, 20, 24, 42))
        whole[place : place + 2] = rng.choice((b"\1\0", b"\x0c\0", b"\xff\xff", b"\0\0", b"\x08\0"))
    return bytes(whole)


def _array_of(text: bytes) -> bytes:
    import numpy as np

    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.frombuffer(text, dtype=np.uint8))
    return stream.getvalue()


def _other_header(content: bytes, rng: Random) -> bytes:
    """Return an array in NumPy's format with a changed header."""
    end = content.find(b"\n") + 1
    header = content[10:end].decode("latin-1").rstrip("\n ")
    kind = rng.randrange(7)
    if kind == 0:
        header = re.sub(
            r"'descr': '[^']*'",
            f"'descr': '{rng.choice(('|O', '<f2', '<f8', '<i8', '|S5', '<c8', '|u1', '>f4', '|V9', '<M8[s]'))}'",
            header,
        )
    elif kind == 1:
        shape = rng.choice(
            (
                "()",
                "(0,)",
                "(1,)",
                "(-1, 3)",
                "(2, 3)",
                "(10**20,)",
                "(99999999999, 3)",
                "(True, 3)",
                "(3, 3, 3)",
                "(1.5,)",
            )
        )
        header = re.sub(r"\([^)]*\)", shape, header)
    elif kind == 2:
        header = re.sub(r"\d+", str(rng.choice(_NUMBERS)), header, count=1)
    elif kind == 3:
        header = header.replace("False", "True")
    elif kind == 4:
        header = rng.choice(
            ("", "{", "{}", "[" * 500, "(" * 200 + ")" * 200, "'" * 3, "{'descr': '<f4'}", header + "(")
        )
    elif kind == 5:
        return content[:end] + content[end : end + rng.randrange(len(content) - end + 1)]
    else:
        values = bytearray(content[end:])
        for _ in range(rng.choice((1, 5))):
            if len(values) >= 4:
                at = rng.randrange(len(values)) & ~3
                values[at : at + 4] = _packed("<f", rng.choice((*_REALS[:-3], float("nan"), 1.0, 7.0)))
        return content[:end] + bytes(values)
    encoded = header.encode("latin-1") + b"\n"
    return content[:6] + b"\1\0" + struct.pack("<H", len(encoded)) + encoded + content[end:]


def words_of_16_bits(data: bytes, rng: Random) -> bytes:
    """Return ``data``, whose first blocks are tables of 16-bit numbers as in C3D, with some of them changed."""
    result = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = 2 * rng.randrange(min(len(result), rng.choice((24, 512, 1024, 4096))) // 2)
        result[at : at + 2] = struct.pack("<H", int(rng.choice(_NUMBERS)) % 65536)
    return bytes(result)
