"""An oracle for signal.parameters that misbehaves as its first argument says; the second is a file that tells it what it has done before.

Needs nothing but Python. Without misbehaviour it answers correctly.
"""

import os
import signal
import struct
import sys
import time

MODE, MEMORY = sys.argv[1], sys.argv[2]
OUT = os.fdopen(os.dup(1), "wb")


def say(text):
    os.write(2, text.encode())


def first_time():
    """True once for each mode, however often this program is started."""
    if os.path.exists(MEMORY):
        return False
    open(MEMORY, "w").close()
    return True


def read_exactly(count):
    data = sys.stdin.buffer.read(count)
    if len(data) != count:
        sys.exit(0)
    return data


def read_request():
    count = struct.unpack("<4sI", read_exactly(8))[1]
    request = {}
    for _ in range(count):
        name = read_exactly(struct.unpack("<H", read_exactly(2))[0]).decode()
        dtype, rank = read_exactly(2)
        elements = 1
        for extent in struct.unpack(f"<{rank}Q", read_exactly(8 * rank)):
            elements *= extent
        payload = read_exactly(elements * (1 if dtype == 3 else 8))
        request[name] = payload.decode() if dtype == 3 else struct.unpack(f"<{elements}{'xdq'[dtype]}", payload)
    return request


def record(name, value):
    head = struct.pack("<H", len(name)) + name.encode()
    if isinstance(value, str):
        return head + struct.pack("<BBQ", 3, 1, len(value.encode())) + value.encode()
    return head + struct.pack("<BBQ", 1, 1, len(value)) + struct.pack(f"<{len(value)}d", *value)


def message(**records):
    body = b"".join(record(name.replace("_", "."), value) for name, value in records.items())
    return b"MSEQ" + struct.pack("<I", len(records)) + body


def reply(data):
    OUT.write(data)
    OUT.flush()


def parameters(request):
    flat = request["in.P"]
    points = list(zip(flat[::2], flat[1::2]))
    t = [0.0]
    for (a, b), (c, d) in zip(points, points[1:]):
        t.append(t[-1] + ((a - c) ** 2 + (b - d) ** 2) ** 0.25)
    return t


def flood(megabytes):
    for _ in range(megabytes):
        os.write(2, b"x" * (1 << 20))


def hang():
    time.sleep(600)


def answer(t):
    """One reply to `run`, or something else."""
    good = message(status="ok", seconds=[1e-6], out_t=t)
    if MODE == "hangs" and first_time():
        say("thinking hard\n")
        hang()
    if MODE == "floods-and-hangs" and first_time():
        say("a line\n")
        flood(5)
        hang()
    if MODE == "half-a-reply" and first_time():
        reply(good[: len(good) // 2])
        hang()
    if MODE == "breaks-off":
        reply(good[: len(good) // 2])
        say("out of ink\n")
        sys.exit(4)
    if MODE == "crashes" and first_time():
        say("stack overflow\nsecond line\n")
        os.kill(os.getpid(), signal.SIGSEGV)
    if MODE == "ends" and first_time():
        say("\x1b[31mhad enough\x1b[0m\n")
        sys.exit(7)
    if MODE == "closes-its-output" and first_time():
        OUT.close()
        os.close(1)
        hang()
    replies = {
        "garbage": os.urandom(8) + b"\0" * 5000,
        "chats": b"Loading model...\n" + good,
        "trillion-numbers": b"MSEQ" + struct.pack("<I", 1) + b"\x05\0out.t" + struct.pack("<BBQ", 1, 1, 10**12),
        "million-records": b"MSEQ" + struct.pack("<I", 10**6),
        "rank-200": b"MSEQ" + struct.pack("<I", 1) + b"\x05\0out.t" + struct.pack("<BB", 1, 200) + b"\1" * 1600,
        "same-name-twice": b"MSEQ" + struct.pack("<I", 2) + 2 * record("out.t", t),
        "nan": message(status="ok", seconds=[1e-6], out_t=t[:3] + [float("nan")] + t[4:]),
        "infinity": message(status="ok", seconds=[1e-6], out_t=t[:-1] + [float("inf")]),
        "huge": message(status="ok", seconds=[1e-6], out_t=t[:-1] + [1e300]),
        "wrong-shape": message(status="ok", seconds=[1e-6], out_t=t[:-1]),
        "empty": message(status="ok", seconds=[1e-6], out_t=[]),
        "text-for-numbers": message(status="ok", seconds=[1e-6], out_t="0, 1, 2"),
        "lacks-an-array": message(status="ok", seconds=[1e-6], out_s=t),
        "no-status": message(seconds=[1e-6], out_t=t),
        "odd-status": message(status="fine", seconds=[1e-6], out_t=t),
        "no-time": message(status="ok", out_t=t),
        "time-travels": message(status="ok", seconds=[-1.0], out_t=t),
        "endless-time": message(status="ok", seconds=[float("inf")], out_t=t),
        "unsupported": message(status="unsupported", message="only for even n"),
        "fails": message(status="error", message="singular matrix"),
        "differs": message(status="ok", seconds=[1e-6], out_t=[1.001 * x for x in t]),
        "answers-twice": good + good,
    }
    reply(replies.get(MODE, good))


def main():
    if MODE == "crashes-at-start":
        say("ModuleNotFoundError: No module named 'scipy'\n")
        sys.exit(1)
    if MODE == "hangs-at-version":
        say("downloading weather data\n")
        hang()
    while True:
        request = read_request()
        if request["op"] == "version":
            if MODE == "floods":
                flood(100)
            if MODE == "garbage-at-version":
                reply(b"hostile 1.0\n")
            if MODE == "no-version":
                reply(message(status="ok"))
            reply(message(status="ok", version="hostile 1.0"))
        else:
            answer(parameters(request))


main()
