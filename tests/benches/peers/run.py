"""The whole comparison, from an empty folder: `python3 tests/benches/peers/run.py --work FOLDER`.

Makes a Python environment, builds lacuna's adapter and the C++ peer (Debian: g++ libopenvdb-dev libtbb-dev), tests the judge, finds
the true topology, runs every program on every shape, sweeps tolerances and sizes, and writes tables, plots and pictures to
FOLDER/results. About two hours on two cores that do nothing else; --quick compares koch5 alone in a few minutes.
"""
import argparse
import json
import os
import platform
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
STEPS = ("test", "truth", "compare", "sweep", "plots", "pictures", "tables")


def python_of(work):
    """The environment's interpreter; made where it is missing or the requirements changed."""
    python, stamp = work / "python" / "bin" / "python", work / "python" / "requirements.txt"
    wanted = (HERE / "requirements.txt").read_text()
    if not stamp.exists() or stamp.read_text() != wanted:
        subprocess.run([sys.executable, "-m", "venv", work / "python"], check=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "-r", HERE / "requirements.txt"], check=True)
        stamp.write_text(wanted)
    return python


def adapter():
    """Builds the kernel's example and gives its path."""
    words = ["cargo", "build", "--release", "--package", "lacuna-kernel", "--example", "peer", "--message-format", "json"]
    done = subprocess.run(words, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True)
    built = [json.loads(line) for line in done.stdout.splitlines()]
    return next(m["executable"] for m in built if m.get("target", {}).get("name") == "peer" and m.get("executable"))


def openvdb(work):
    """Builds the C++ peer; without the library it is left out and its rows say so."""
    words = ["g++", "-O3", "-march=native", "-o", work / "openvdb_offset", HERE / "openvdb_offset.cpp", "-lopenvdb", "-ltbb"]
    if subprocess.run(words, check=False).returncode != 0:
        print("OpenVDB is left out: it needs libopenvdb-dev and libtbb-dev", flush=True)


def machine():
    """What the figures were measured on."""
    with open("/proc/cpuinfo") as info:
        model = next((line.split(":")[1].strip() for line in info if line.startswith("model name")), platform.machine())
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False).stdout.strip()
    return {"processor": model, "cores": os.cpu_count(), "system": platform.platform(terse=True), "commit": commit, "load_at_start": os.getloadavg()[0]}


def main():
    """All steps, or those that are named."""
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--work", type=Path, required=True)
    words.add_argument("--lacuna", help="a built adapter; built here if left out")
    words.add_argument("--steps", default=",".join(STEPS))
    words.add_argument("--shapes", default="all")
    words.add_argument("--divisors", default="10,40")
    words.add_argument("--quick", action="store_true")
    options = words.parse_args()
    work = options.work.resolve()
    results = work / "results"
    results.mkdir(parents=True, exist_ok=True)
    python, lacuna = python_of(work), Path(options.lacuna or adapter()).resolve()
    openvdb(work)
    (results / "machine.json").write_text(json.dumps(machine(), indent=1) + "\n")
    shapes, divisors = ("koch5", "10") if options.quick else (options.shapes, options.divisors)
    both = ["--work", work, "--lacuna", lacuna]
    steps = {
        "test": ["-m", "unittest", "test_judge"],
        "truth": ["truth.py", results] + ([] if shapes == "all" else shapes.split(",")),
        "compare": ["compare.py", *both, "--results", results / "results.json", "--shapes", shapes, "--divisors", divisors],
        "sweep": ["sweep.py", *both, "--results", results / "sweep.json"] + (["--shapes", "koch5"] if options.quick else []),
        "plots": ["plots.py", results],
        "pictures": ["pictures.py", *both, "--results", results] + (["--views", "koch5,koch5-openvdb"] if options.quick else []),
        "tables": ["tables.py", results],
    }
    for step in options.steps.split(","):
        print(f"== {step}", flush=True)
        subprocess.run([python, *steps[step]], cwd=HERE, check=True)


if __name__ == "__main__":
    main()
