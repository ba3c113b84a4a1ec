"""What the tests of this folder have in common: checks that are counted, and an oracle asked through the wire."""

import subprocess
import sys
from pathlib import Path

import numpy as np

from wire import read_message, write_message

FOLDER = Path(__file__).parent
failures = []


def check(name, passed, detail=""):
    print(f"{'ok  ' if passed else 'FAIL'} {name} {detail}".rstrip(), flush=True)
    if not passed:
        failures.append(name)


def close(name, found, expected, tolerance=1e-11):
    found, expected = np.asarray(found, float), np.asarray(expected, float)
    error = np.abs(found - expected).max(initial=0.0) if found.shape == expected.shape else np.inf
    check(name, error <= tolerance, f"{error:.1e}")


class Oracle:
    """A running oracle (its program, then its arguments) and its stage. In a `with`: leaving checks that it ends well."""

    def __init__(self, program, stage):
        self.program, self.stage = program, stage

    def __enter__(self):
        name, *arguments = self.program.split()
        self.process = subprocess.Popen(
            [sys.executable, f"{name}.py", *arguments],
            cwd=FOLDER,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        version = self.ask(op="version")
        check(f"{self.program}: version", version["status"] == "ok" and "Python" in version["version"], version["version"])
        check(f"{self.program}: another stage", self.status(stage="no.such") == "unsupported")
        check(f"{self.program}: missing input", self.status(stage=self.stage) == "error")
        return self

    def __exit__(self, kind, *_):
        self.process.stdin.close()
        if kind is None:
            check(f"{self.program}: silent exit", self.process.stdout.read() == b"" and self.process.wait(60) == 0)
        self.process.kill()

    def ask(self, **message):
        write_message(self.process.stdin, message)
        return read_message(self.process.stdout)

    def request(self, stage=None, samples=1, batch=1, **inputs):
        named = {f"in.{name}": value for name, value in inputs.items()}
        return self.ask(op="run", stage=stage or self.stage, samples=samples, batch=batch, **named)

    def status(self, **request):
        return self.request(**request)["status"]

    def run(self, **inputs):
        reply = self.request(samples=3, batch=1 if self.stage == "sequence.read" else 2, **inputs)
        if reply["status"] != "ok":
            raise RuntimeError(f"{self.program}: {reply['status']}: {reply['message']}")
        outputs = {name[4:]: value for name, value in reply.items() if name.startswith("out.")}
        if reply["seconds"].shape != (3,) or not np.all(reply["seconds"] > 0):
            check(f"{self.program}: seconds", False, reply["seconds"])
        if not all(np.all(np.isfinite(value)) for value in outputs.values()):
            check(f"{self.program}: finite", False)
        return outputs
