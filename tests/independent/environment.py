"""Makes the Python environment of the independent checks, once, and prints its interpreter's path.

    python3 tests/independent/environment.py FOLDER

The folder is complete when it holds a stamp with the digest of `requirements.txt`; until then a lock file keeps
other test processes waiting. Only the standard library is used here. A Debian without `python3-venv` has no
`ensurepip`: then the environment is made without pip, and pip is taken from its wheel on the package index.
"""
import fcntl
import hashlib
import os
import re
import subprocess
import sys
import tempfile
import urllib.parse
import urllib.request
import venv
from pathlib import Path

REQUIREMENTS = Path(__file__).resolve().parent / "requirements.txt"
INDEX = os.environ.get("PIP_INDEX_URL", "https://pypi.org/simple").rstrip("/") + "/pip/"


def run(*command, **options):
    """Runs a command quietly; its words are shown only if it fails."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))} failed:\n{done.stdout}")


def pip_from_its_wheel(folder):
    """Downloads pip's newest wheel, which can be run as it is, and checks its digest."""
    with urllib.request.urlopen(INDEX, timeout=60) as answer:
        links = re.findall(r'href="([^"#]+/(pip-([\d.]+)-py3-none-any\.whl))#sha256=(\w+)"', answer.read().decode())
    address, name, _, digest = max(links, key=lambda link: [int(part) for part in link[2].split(".")])
    with urllib.request.urlopen(urllib.parse.urljoin(INDEX, address), timeout=120) as answer:
        content = answer.read()
    if hashlib.sha256(content).hexdigest() != digest:
        sys.exit("pip's wheel arrived damaged")
    path = Path(folder) / name
    path.write_bytes(content)
    return f"{path}/pip"


def make(folder, stamp):
    """Creates the environment and installs the requirements."""
    python = folder / "bin" / "python"
    install = ["install", "--quiet", "--disable-pip-version-check", "--no-input", "--requirement", REQUIREMENTS]
    try:
        import ensurepip  # noqa: F401  (absent where Debian splits it off)

        venv.create(folder, clear=True, with_pip=True)
        run(python, "-m", "pip", *install)
    except ImportError:
        venv.create(folder, clear=True, with_pip=False)
        with tempfile.TemporaryDirectory() as scratch:
            run(python, pip_from_its_wheel(scratch), *install)
    (folder / "stamp").write_text(stamp)


def main():
    """Prints the interpreter."""
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    folder = Path(sys.argv[1]).absolute()
    stamp = hashlib.sha256(REQUIREMENTS.read_bytes() + sys.version.encode()).hexdigest()
    lock = folder.with_name(folder.name + ".lock")
    with open(lock, "w") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        current = folder / "stamp"
        if not current.is_file() or current.read_text() != stamp:
            make(folder, stamp)
    print(folder / "bin" / "python")


if __name__ == "__main__":
    # A failure must be one of this script, not of a site package that happens to be on the path.
    os.environ.pop("PYTHONPATH", None)
    main()
