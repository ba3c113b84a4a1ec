"""The wire protocol of oracles/PROTOCOL.md: the only file of ours that a Python oracle imports.

    from wire import serve, Unsupported

    def prepare(stage, inputs):        # inputs: dict of numpy arrays, scalars as int, text as str
        ...                            # conversions that are not the stage's own work
        return call                    # call() -> dict of output arrays, or a function that makes it; only call() is timed

    serve("numpy 2.1", prepare)
"""

import os
import struct
import sys
import time
import traceback

import numpy as np

DTYPES = {1: np.dtype("<f8"), 2: np.dtype("<i8"), 3: np.dtype("u1")}
CODES = {"f": 1, "i": 2, "u": 2, "b": 2}


class Unsupported(Exception):
    """Raised by prepare() or call() where the library has not got the stage for these inputs."""


def check_faces(F, vertices):
    """An error unless F is (F,3) and names vertices that are there."""
    if F.ndim != 2 or F.shape[1] != 3 or F.dtype.kind != "i":
        raise ValueError("F is (F,3), of whole numbers")
    if F.size and (F.min() < 0 or F.max() >= vertices):
        raise ValueError("a face names a vertex that is not there")


def _read_exactly(stream, count):
    data = stream.read(count)
    if len(data) != count:
        raise EOFError(f"expected {count} bytes, found {len(data)}")
    return data


def read_message(stream):
    """The next message as a dict, or None at the end of the stream."""
    head = stream.read(8)
    if not head:
        return None
    if len(head) != 8 or head[:4] != b"MSEQ":
        raise ValueError(f"not a message: starts with {head!r}")
    message = {}
    for _ in range(struct.unpack("<I", head[4:])[0]):
        (length,) = struct.unpack("<H", _read_exactly(stream, 2))
        name = _read_exactly(stream, length).decode()
        code, rank = struct.unpack("<BB", _read_exactly(stream, 2))
        shape = struct.unpack(f"<{rank}Q", _read_exactly(stream, 8 * rank))
        dtype = DTYPES[code]
        count = int(np.prod(shape, dtype=np.int64))
        array = np.frombuffer(_read_exactly(stream, count * dtype.itemsize), dtype)
        if code == 3:
            message[name] = array.tobytes().decode()
        elif rank == 0:
            message[name] = array[0].item()
        else:
            message[name] = array.reshape(shape).copy()
    return message


def write_message(stream, message):
    """message: dict of str, int, float or array."""
    stream.write(b"MSEQ" + struct.pack("<I", len(message)))
    for name, value in message.items():
        if isinstance(value, str):
            value = np.frombuffer(value.encode(), np.uint8)
        value = np.asarray(value)
        code = 3 if value.dtype == np.uint8 else CODES[value.dtype.kind]
        encoded = name.encode()
        stream.write(struct.pack("<H", len(encoded)) + encoded)
        stream.write(struct.pack(f"<BB{value.ndim}Q", code, value.ndim, *value.shape))
        stream.write(np.ascontiguousarray(value, DTYPES[code]).tobytes())
    stream.flush()


def _run(prepare, request):
    inputs = {name[3:]: value for name, value in request.items() if name.startswith("in.")}
    call = prepare(request["stage"], inputs)
    seconds = []
    for _ in range(request["samples"]):
        start = time.perf_counter()
        for _ in range(request["batch"]):
            outputs = call()
        seconds.append((time.perf_counter() - start) / request["batch"])
    if callable(outputs):
        outputs = outputs()
    reply = {"status": "ok", "seconds": np.array(seconds)}
    reply.update({"out." + name: value for name, value in outputs.items()})
    return reply


def _answer(version, prepare, request):
    try:
        if request["op"] == "version":
            return {"status": "ok", "version": version}
        return _run(prepare, request)
    except Unsupported as reason:
        return {"status": "unsupported", "message": str(reason)}
    except Exception as error:  # the run goes on: the harness turns this into one verdict
        traceback.print_exc(file=sys.stderr)
        return {"status": "error", "message": f"{type(error).__name__}: {error}"}


def serve(version, prepare):
    """Answers requests until standard input closes. What a library prints, even from C, goes to standard error."""
    stream_in, stream_out = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    while (request := read_message(stream_in)) is not None:
        write_message(stream_out, _answer(version, prepare, request))
