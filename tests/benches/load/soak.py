"""Mixed work on one process over its folder for half an hour; prints its memory every minute. Needs nothing but Python.

    cargo build --release --package lacuna-api --bin lacuna
    python3 tests/benches/load/soak.py target/release/lacuna [MINUTES]

Six clients work without a pause: small measures, solids, results of some megabytes that are downloaded, uploads that are converted, long jobs that
are stopped, documents that are refused. Each forgets its jobs when it has what it wanted, since what is kept is meant to be there: a service remembers
jobs for `LACUNA_RETENTION_HOURS`. The exit status is 1 when the service's own memory in the last third is more than a quarter above that of the
second third, or when anything is answered that should not be.
"""
import collections
import http.client
import json
import os
import random
import re
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

FIXTURES = Path(__file__).resolve().parents[3] / "fixtures"
BUSY = {"LACUNA_SUBMISSIONS_PER_MINUTE": "10000000", "LACUNA_QUEUED": "10000", "LACUNA_JOBS_PER_KEY": "10000", "LACUNA_LOG": "warn"}


def model(name):
    """A model of the fixtures."""
    return json.loads((FIXTURES / name / "model.json").read_text())


class Client:
    """A client with a connection of its own and numbers that no other has used."""

    def __init__(self, port, number, counts):
        self.port, self.random, self.counts = port, random.Random(number), counts

    def ask(self, method, path, body=None, headers=None):
        """Status and body of an answer; every answer has a status that was foreseen, or the soak has failed."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=120)
        try:
            connection.request(method, path, body, headers or {})
            answer = connection.getresponse()
            return answer.status, answer.read()
        finally:
            connection.close()

    def count(self, what, status, expected):
        """Counts an answer."""
        self.counts[what if status in expected else f"{what}: {status}!"] += 1

    def job(self, what, order, stop_after=None):
        """Submits a job, waits for it or stops it, fetches its files and forgets it."""
        status, body = self.ask("POST", "/v1/jobs", json.dumps(order), {"content-type": "application/json"})
        if status not in (200, 202):
            return self.count(what, status, ())
        view = json.loads(body)
        place = f"/v1/jobs/{view['id']}"
        if stop_after is not None:
            time.sleep(stop_after)
            self.ask("POST", f"{place}/cancel", b"")
        while view["state"] not in ("succeeded", "failed", "cancelled"):
            time.sleep(0.02)
            view = json.loads(self.ask("GET", place)[1])
        expected = "succeeded" if stop_after is None else "cancelled"
        for output in view["outputs"]:
            status, body = self.ask("GET", f"/v1/results/{output['digest']}")
            if status != 200 or len(body) != output["bytes"]:
                self.count(f"{what}, download", status, ())
        self.counts[what if view["state"] == expected else f"{what}: {view['state']}!"] += 1
        return self.ask("DELETE", place)

    def measure(self):
        """A small measure."""
        self.job("measures", {"lacuna": 1, "kind": "measure", "model": model("meshes/segment"), "params": {"tolerance_mm": self.random.uniform(0.1, 0.2)}})

    def solid(self):
        """A small solid in two formats."""
        params = {"tolerance_mm": self.random.uniform(0.05, 0.06), "radius_mm": 1}
        self.job("solids", {"lacuna": 1, "kind": "solidify", "model": model("meshes/segment"), "params": params, "outputs": ["stl", "3mf"]})

    def large(self):
        """A result of some ten megabytes."""
        params = {"tolerance_mm": self.random.uniform(0.2, 0.3)}
        self.job("large results", {"lacuna": 1, "kind": "evaluate", "model": model("ifs/sierpinski_tetrahedron"), "params": params, "outputs": ["obj"]})

    def stopped(self):
        """A long job that is stopped."""
        inputs = [{"name": name, "model": model(f"ifs/{name}")} for name in ("sierpinski_tetrahedron", "menger_sponge")]
        params = {"tolerance_mm": self.random.uniform(1e-7, 2e-7)}
        self.job("stopped", {"lacuna": 1, "kind": "measure", "inputs": inputs, "params": params}, self.random.uniform(0, 0.5))

    def converted(self):
        """A mesh file that is uploaded, converted and forgotten."""
        corner = self.random.uniform(1, 9)
        off = f"OFF\n4 4 0\n0 0 0\n{corner} 0 0\n0 {corner} 0\n0 0 {corner}\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
        status, body = self.ask("POST", "/v1/models", off, {"content-type": "application/octet-stream"})
        if status not in (200, 201):
            return self.count("uploads", status, ())
        id = json.loads(body)["id"]
        self.job("conversions", {"lacuna": 1, "kind": "convert", "model_ref": id, "params": {"tolerance_mm": 0.01}, "outputs": ["stl"]})
        return self.ask("DELETE", f"/v1/models/{id}")

    def refused(self):
        """A document that is refused."""
        status, _ = self.ask("POST", "/v1/jobs", json.dumps({"lacuna": 1, "kind": "solidify", "x" * self.random.randrange(1, 1000): -1}), {"content-type": "application/json"})
        self.count("refusals", status, (422,))
        time.sleep(0.05)


def resident(process):
    """Resident memory of a process and of its children in MB."""
    own, children = 0.0, 0.0
    for entry in Path("/proc").iterdir():
        try:
            status = (entry / "status").read_text() if entry.name.isdigit() else ""
        except OSError:
            continue
        size = re.search(r"^VmRSS:\s+(\d+)", status, re.MULTILINE)
        if size is None:
            continue
        if int(entry.name) == process:
            own = int(size.group(1)) / 1024
        elif re.search(rf"^PPid:\t{process}$", status, re.MULTILINE):
            children += int(size.group(1)) / 1024
    return own, children


def main():
    """Soaks, and prints a line of a table every minute."""
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    minutes = float(sys.argv[2]) if len(sys.argv) == 3 else 30.0
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.argv[1], "serve", "--bind", "127.0.0.1:0", "--data", f"{folder}/data"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, env=os.environ | BUSY) as service:
            try:
                sys.exit(soak(service, minutes))
            finally:
                service.terminate()


def soak(service, minutes):
    """Works for so many minutes; the exit status."""
    port = int(re.search(rb":(\d+)\s*$", service.stdout.readline()).group(1))
    counts, ended = collections.Counter(), threading.Event()

    def work(number, name):
        client = Client(port, number, counts)
        while not ended.is_set():
            try:
                getattr(client, name)()
            except OSError as error:
                counts[f"{name}: {error}!"] += 1

    kinds = ("measure", "solid", "large", "stopped", "converted", "refused")
    threads = [threading.Thread(target=work, args=(number, name), daemon=True) for number, name in enumerate(kinds)]
    print("| minute | the service, MB | its processes, MB | done so far |\n|---|---|---|---|", flush=True)
    for thread in threads:
        thread.start()
    sizes, begun = [], time.monotonic()
    while (passed := (time.monotonic() - begun) / 60) < minutes and service.poll() is None:
        time.sleep(min(5.0, max(0.1, (minutes - passed) * 60)))
        own, children = resident(service.pid)
        sizes.append(own)
        if int((time.monotonic() - begun) / 60) > int(passed):
            done = ", ".join(f"{count} {what}" for what, count in sorted(counts.items()))
            print(f"| {int(passed) + 1} | {own:.1f} | {children:.1f} | {done} |", flush=True)
    alive = service.poll() is None
    ended.set()
    for thread in threads:
        thread.join(timeout=120)
    third = max(len(sizes) // 3, 1)
    second, last = (sum(part) / len(part) for part in (sizes[third : 2 * third] or sizes, sizes[-third:]))
    wrong = {what: count for what, count in counts.items() if what.endswith("!")}
    print(f"\nthe service's own memory: {second:.1f} MB in the second third, {last:.1f} MB in the last, {max(sizes):.1f} MB at most; wrong: {wrong or 'nothing'}")
    return 0 if alive and last <= 1.25 * second and not wrong else 1


if __name__ == "__main__":
    main()
