#!/usr/bin/env python3
"""Reads a sealed record (.svb) and prints its values as JSON: reader.py RECORD.

Written from schema/FORMAT.md alone, with nothing but the standard library. Exit code 1 if the record is refused.
"""
import calendar, hashlib, json, math, struct, sys

MAGIC = b"\x89SVB\r\n\x1a\n"
ORDER = ["HEAD", "SECS", "CLIP", "RAWF", "AUXS", "GNSS", "HLTH", "TRIG", "DONE", "SEAL"]

def table():
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (0x82F63B78 if byte & 1 else 0)
        yield byte

TABLE = list(table())

def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc = TABLE[(crc ^ byte) & 0xFF] ^ crc >> 8
    return crc ^ 0xFFFFFFFF

def need(true, what):
    if not true:
        raise ValueError(what)

class Bytes:
    """Takes values off a body: 'u16', '?u16', '3 f64', 'list X', 'str', 'sha', 'enum a b c', or [(field, type), ...]."""
    NUMBERS = {"u8": "B", "i8": "b", "u16": "<H", "i16": "<h", "u32": "<I", "u64": "<Q", "i64": "<q", "f64": "<d"}

    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, n):
        need(self.at + n <= len(self.data), "truncated")
        self.at += n
        return self.data[self.at - n:self.at]

    def get(self, kind):
        if isinstance(kind, list):
            return {field: self.get(each) for field, each in kind}
        if isinstance(kind, tuple):  # a list of structures
            return [self.get(kind[0]) for _ in range(self.get("u64"))]
        if kind in self.NUMBERS:
            return struct.unpack(self.NUMBERS[kind], self.take(struct.calcsize(self.NUMBERS[kind])))[0]
        if kind == "bool":
            return [False, True][self.get("u8")]
        if kind == "str":
            return self.take(self.get("u64")).decode()
        if kind == "short":  # the names of auxiliary signals
            return self.take(self.get("u16")).decode()
        if kind == "sha":
            return self.take(32).hex()
        if kind[0] == "?":
            return self.get(kind[1:]) if self.get("bool") else None
        if kind == "origin":
            return {"kind": "live"} if self.get("enum live replay") == "live" else {
                "kind": "replay", "logs": self.get(([("name", "str"), ("bytes", "u64"), ("sha256", "sha")],))}
        word, rest = kind.split(" ", 1)
        if word == "enum":
            return rest.split()[self.get("u32")]
        return [self.get(rest) for _ in range(self.get("u64") if word == "list" else int(word))]

    def whole(self, kind):
        value = self.get(kind)
        need(self.at == len(self.data), "trailing bytes")
        return value

def each(kind, *names):
    return [(name, kind) for name in names]

SCALE = [("fine_step", "f64"), ("fine_steps", "u16"), ("coarse_step", "f64"), ("coarse_steps", "u16"), ("carry_limit", "f64")]
HEAD = [("number", "u64"), ("previous_sha256", "sha"), ("parent_sha256", "?sha"), ("origin", "origin"), ("device_id", "str"),
    ("software", "str"), ("config_sha256", "sha"),
    ("vehicle", each("str", "vin", "name") + [("track_width_m", "f64"), ("imu_position_m", "?3 f64"), ("imu_position_sd_m", "3 f64"),
        ("cg_position_m", "?3 f64"), ("cg_position_sd_m", "3 f64")]),
    ("imu", each("?f64", "accel_range", "rate_range") + each("f64", "accel_density", "rate_density", "accel_bias", "rate_bias",
        "accel_bias_jump", "rate_bias_jump", "accel_scale", "rate_scale", "accel_vibration", "rate_vibration")
        + each("3 f64", "mounting", "mounting_sd")),
    ("wheels", [("present", "bool")] + each("f64", "latency_s", "latency_sd_s", "cutoff_mps", "scale_sd", "scale_difference_sd", "noise_mps")),
    ("wheel_scale", each("f64", "step")), ("accel_scale", SCALE), ("rate_scale", SCALE), ("layout", "enum full two-rate"),
    ("channel_frequency_class", "?u16"), ("periods", each("u64", "accel_ns", "rate_ns") + [("wheels_ns", "2 u64")]),
    ("interfaces", ([("name", "str"), ("offset_ns", "i64"), ("uncertainty_ns", "?u64")],)),
    ("clock", [("source", "enum log-stamps system-clock disciplined gnss"), ("offset_ns", "i64"), ("uncertainty_ns", "?u64"), ("leap_second", "bool")])]
HEALTH = each("u64", "frames_seen", "frames_dropped", "error_frames", "malformed", "late_frames", "out_of_range") + [
    ("gaps", ([("signal", "str"), ("from_ns", "i64"), ("to_ns", "i64")],)), ("clock_steps", (each("i64", "monotonic_ns", "step_ns"),)),
    ("signals", ([("signal", "str"), ("frames", "u64"), ("lost_by_counter", "?u64"), ("period_ns", "u64"), ("jitter_ns", "u64")],)),
    ("notes", "list str")]
TRIGGERS = ([("kind", "enum peak delta-v manual can power-loss"), ("monotonic_ns", "i64"), ("index", "u64"), ("value", "f64"), ("threshold", "f64"), ("source", "str")],)
DONE = [("complete", "bool"), ("reasons", "list str"), ("ends_at_rest", "bool")]
CLIP = [("index", "u64"), ("axis", "u8"), ("sign", "i8"), ("clipped", "u16"), ("frames", "u16")]

def fields(data, widths):
    bits, left = int.from_bytes(data, "big"), 8 * len(data)
    for width in widths:
        left -= width
        yield bits >> left & (1 << width) - 1

def physical(code, scale):
    if code == 1023:
        return None
    if "step" in scale:
        return code * scale["step"]
    n, fine = abs(code - 511), scale["fine_steps"]
    size = n * scale["fine_step"] if n <= fine else fine * scale["fine_step"] + (n - fine) * scale["coarse_step"]
    return -size if code < 511 else size

def block(body, header):
    taken = Bytes(body)
    out = taken.get([("first_index", "u64"), ("monotonic_ns", "i64"), ("count", "u16"), ("rate_hz", "u8"), ("remainder", "6 i16")])
    start, *stamp = fields(taken.take(6), [9, 13, 4, 5, 5, 6, 6])
    year, month, day, hour, minute, second = stamp
    need(start == 0b101110000 and 1 <= month <= 12 and 1 <= day <= calendar.monthrange(year or 400, month)[1], "no stamp")
    need(hour < 24 and minute < 60 and second < 61, "no time")
    scales = [header["wheel_scale"]] * 2 + [header["accel_scale"]] * 3 + [header["rate_scale"]] * 3
    out["stamp"] = stamp
    out["codes"] = [list(fields(taken.take(10), [10] * 8)) for _ in range(out.pop("count"))]
    out["values"] = [[physical(code, scale) for code, scale in zip(codes, scales)] for codes in out["codes"]]
    for field, part in enumerate(out["remainder"], start=2):
        present = [values for values in out["values"] if values[field] is not None]
        need(present or part == 0, "remainder of an axis without values")
        if present:
            present[-1][field] += part * scales[field]["fine_step"] / 256
    need(taken.at == len(body) and 1 <= len(out["codes"]) <= out["rate_hz"] and out["rate_hz"] in (20, 100), "bad block")
    return out

def raw_frame(body):
    out = body.get([("monotonic_ns", "i64"), ("id", "u32"), ("interface", "u8"), ("flags", "u8")])
    return out | {"data": body.take(body.get("u8")).hex()}

def channel(body):
    out = body.get(each("short", "name", "signal", "unit") + [("first_index", "u64")])
    values = [body.get("f64") for _ in range(body.get("u32"))]
    return out | {"values": [None if math.isnan(value) else value for value in values]}

QUALITIES = "none autonomous differential precise rtk-fixed rtk-float estimated manual simulated unstated".split()

def number(body):
    value = body.get("f64")
    return None if math.isnan(value) else value

def together(numbers):
    need(len({each is None for each in numbers}) == 1, "some numbers missing")
    return None if numbers[0] is None else numbers

def fix(body):
    out = {"monotonic_ns": body.get("i64"), "utc_ns": body.get("i64"), "quality": QUALITIES[body.get("u8")], "satellites": body.get("u8")}
    out["utc_ns"] = None if out["utc_ns"] == -2**63 else out["utc_ns"]
    out["satellites"] = None if out["satellites"] == 255 else out["satellites"]
    out["position"] = together([number(body) for _ in range(2)])
    out |= {name: number(body) for name in ["height_m", "speed_mps", "course", "climb_mps"]}
    out["horizontal_m2"] = together([number(body) for _ in range(3)])
    return out | {name: number(body) for name in ["height_sd_m", "speed_sd_mps", "course_sd", "hdop"]}

def sentence(body):
    return {"monotonic_ns": body.get("i64"), "text": body.take(body.get("u8")).decode("ascii")}

def gnss(data):
    body = Bytes(data)
    sheet = {"source": ["can", "nmea"][body.get("u8")], "receiver": body.get("short")}
    sheet["antenna_position_m"] = together([number(body) for _ in range(3)])
    sheet |= body.get([("antenna_position_sd_m", "3 f64")] + each("f64", "latency_s", "latency_sd_s", "horizontal_sd_m", "height_sd_m", "speed_sd_mps"))
    out = {"sheet": sheet, "fixes": [fix(body) for _ in range(body.get("u32"))], "sentences": [sentence(body) for _ in range(body.get("u32"))]}
    need(body.at == len(data), "trailing bytes")
    return out

def counted(data, one):
    body = Bytes(data)
    out = [one(body) for _ in range(body.get("u32"))]
    need(body.at == len(data), "trailing bytes")
    return out

def read(data):
    need(data.startswith(MAGIC), "not a record")
    at, record, last, minor = len(MAGIC), {"blocks": []}, "", 0
    while last != "SEAL":
        need(at + 16 <= len(data), "truncated")
        tag, length, check = struct.unpack_from("<4sII", data, at)
        end = at + 12 + length
        need(crc32c(data[at:at + 8]) == check and end + 4 <= len(data), f"head at {at}")
        need(struct.unpack_from("<I", data, end)[0] == crc32c(data[at:end]), f"checksum at {at}")
        body, tag, start, at = data[at + 12:end], tag.decode("latin-1"), at, end + 4
        need(last or tag == "HEAD", "no header")
        if tag not in ORDER:
            continue
        order = ORDER if minor == 1 else [each for each in ORDER if each != "GNSS" or each == tag]
        need(not last or order.index(tag) - order.index(last) == 1 or tag == last == "SECS", f"order at {start}")
        last = tag
        if tag == "HEAD":
            need(body[:2] == b"\x01\x00", "version")
            minor, record["header"], record["gnss"] = body[2] + 256 * body[3], Bytes(body[4:]).whole(HEAD), None
        elif tag == "SECS":
            record["blocks"].append(block(body, record["header"]))
        elif tag == "SEAL":
            need(body[1:33] == hashlib.sha256(data[:start + 13]).digest(), "digest")
            need(len(body) == {0: 33, 1: 97}.get(body[0]) and at == len(data), "seal")
            record["sha256"], record["signature"] = body[1:33].hex(), body[33:].hex() or None
        else:
            name, decode = {"CLIP": ("clipping", lambda b: counted(b, lambda c: c.get(CLIP))), "RAWF": ("raw", lambda b: counted(b, raw_frame)),
                "AUXS": ("aux", lambda b: counted(b, channel)), "GNSS": ("gnss", gnss), "HLTH": ("health", lambda b: Bytes(b).whole(HEALTH)),
                "TRIG": ("triggers", lambda b: Bytes(b).whole(TRIGGERS)), "DONE": ("completion", lambda b: Bytes(b).whole(DONE))}[tag]
            record[name] = decode(body)
    return record

if __name__ == "__main__":
    try:
        with open(sys.argv[1], "rb") as file:
            print(json.dumps(read(file.read()), ensure_ascii=False, allow_nan=False))
    except (ValueError, IndexError, OSError) as error:
        sys.exit(f"{sys.argv[1:]}: {error}")
