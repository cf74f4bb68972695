"""Connections, problems, events and downloads: what does not follow from the contract."""
from __future__ import annotations

import base64
import hashlib
import http.client
import json
import os
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

#: How often in a row a stream or a download may break without anything new.
TRIES = 6
CHUNK = 1 << 16
BROKEN = (urllib.error.URLError, http.client.HTTPException, OSError)


class Problem(Exception):
    """What the service refused, or why a job has no result: an RFC 9457 problem."""

    def __init__(self, document: dict[str, Any], status: int):
        super().__init__(f"{document.get('detail', document.get('title', 'refused'))} [{document.get('code', status)}]")
        self.document, self.status = document, status
        self.code: str = document.get("code", "")
        self.errors: list[dict[str, Any]] = document.get("errors", [])
        self.remedy: dict[str, float] | None = document.get("remedy")
        self.retry_after: int | None = document.get("retry_after")


@dataclass(frozen=True)
class Event:
    """An event of a job: `state`, `progress`, `warning`, `output` or `done`."""

    id: int
    name: str
    data: Any


@dataclass(frozen=True)
class Answer:
    """Bytes, with their headers by names in lower case."""

    status: int
    headers: dict[str, str]
    body: bytes


class _KeyStaysHere(urllib.request.HTTPRedirectHandler):
    """Follows redirects within the service only: its key is nobody else's business."""

    def redirect_request(self, request, file, code, message, headers, address):
        old, new = urllib.parse.urlsplit(request.full_url), urllib.parse.urlsplit(address)
        if (old.scheme, old.netloc) != (new.scheme, new.netloc):
            return None
        return super().redirect_request(request, file, code, message, headers, address)


class Transport:
    """A service at an address; `key` is that of the environment's `LACUNA_API_KEY` unless it is given."""

    def __init__(self, address: str = "http://127.0.0.1:7878", key: str | None = None, timeout: float = 60.0):
        self.address = address.rstrip("/")
        self.key = key if key is not None else os.environ.get("LACUNA_API_KEY")
        self.timeout = timeout
        self._opener = urllib.request.build_opener(_KeyStaysHere())

    def _open(self, verb, path, *, query=None, header=None, body=None, content_type=None, accept="*/*"):
        """The open answer; the caller closes it."""
        chosen = {name: value for name, value in (query or {}).items() if value is not None}
        address = f"{self.address}{path}" + (f"?{urllib.parse.urlencode(chosen)}" if chosen else "")
        headers = {"Accept": accept, **{name: str(value) for name, value in (header or {}).items() if value is not None}}
        if self.key:
            headers["Authorization"] = f"Bearer {self.key}"
        data = body
        if body is not None and not isinstance(body, (bytes, bytearray)) and not hasattr(body, "read"):
            data, content_type = json.dumps(body).encode(), content_type or "application/json"
        if data is not None:
            headers["Content-Type"] = content_type or "application/octet-stream"
        if hasattr(data, "read") and hasattr(data, "fileno"):
            headers["Content-Length"] = str(os.fstat(data.fileno()).st_size - data.tell())
        request = urllib.request.Request(address, data=data, headers=headers, method=verb)
        try:
            return self._opener.open(request, timeout=self.timeout)
        except urllib.error.HTTPError as refusal:
            with refusal:
                content = refusal.read()
            try:
                document = json.loads(content)
            except ValueError:
                document = {}
            if not isinstance(document, dict):
                document = {}
            raise Problem(document or {"detail": f"{address} answers {refusal.code} without a problem document"}, refusal.code) from None

    def _bytes(self, verb, path, **options) -> Answer:
        with self._open(verb, path, **options) as answer:
            return Answer(answer.status, {name.lower(): value for name, value in answer.headers.items()}, answer.read())

    def _json(self, verb, path, **options):
        return json.loads(self._bytes(verb, path, **options).body)

    def _nothing(self, verb, path, **options) -> None:
        self._bytes(verb, path, **options)

    def _events(self, verb, path, *, header=None, **options) -> Iterator[Event]:
        """Events until `done`; a stream that breaks is taken up after the last event that arrived."""
        last, failures = int((header or {}).get("Last-Event-ID") or 0), 0
        while True:
            try:
                with self._open(verb, path, header={"Last-Event-ID": last}, **options) as answer:
                    for event in _parse(answer):
                        last, failures = event.id, 0
                        yield event
                        if event.name == "done":
                            return
                if last and failures:
                    # The job had ended before the stream was taken up, and everything was heard.
                    return
            except Problem as problem:
                if problem.status not in (429, 503, 504) or failures >= TRIES:
                    raise
            except BROKEN:
                if failures >= TRIES:
                    raise
            failures += 1
            time.sleep(min(0.2 * 2**failures, 5))

    def _download(self, digest: str, length: int, path: str | os.PathLike) -> None:
        """Fetches a result into a file: resumed where it broke, also an earlier call, and held against its digest."""
        part = f"{os.fspath(path)}.{digest.rpartition(':')[2][:16]}.part"
        failures = 0
        while (have := os.path.getsize(part) if os.path.exists(part) else 0) < length:
            header = {"Range": f"bytes={have}-", "If-Range": f'"{digest}"'} if have else None
            try:
                with self._open("GET", f"/v1/results/{digest}", header=header) as answer, open(part, "ab") as file:
                    if answer.status != 206:
                        file.truncate(0)
                    while chunk := answer.read(CHUNK):
                        file.write(chunk)
            except BROKEN:
                pass
            failures = 0 if os.path.exists(part) and os.path.getsize(part) > have else failures + 1
            if failures > TRIES:
                raise ConnectionError(f"the download of {digest} does not get beyond {have} of {length} bytes")
            if failures:
                time.sleep(min(0.2 * 2**failures, 5))
        if length == 0:
            open(part, "ab").close()
        with open(part, "rb") as file:
            found = f"sha256:{hashlib.file_digest(file, 'sha256').hexdigest()}"
        if found != digest:
            os.remove(part)
            raise ValueError(f"{path} arrived damaged: its digest is {found}, not {digest}; fetch it again")
        os.replace(part, path)


def check_digest(answer: Answer) -> bytes:
    """The bytes of an answer, if they are what its `Repr-Digest` says."""
    stated = answer.headers.get("repr-digest", "")
    found = base64.b64encode(hashlib.sha256(answer.body).digest()).decode()
    if stated != f"sha-256=:{found}:":
        raise ValueError(f"the bytes arrived damaged: {found} is not {stated}")
    return answer.body


def _parse(lines) -> Iterator[Event]:
    number, name, data = 0, "", []
    for raw in lines:
        line = raw.decode().rstrip("\r\n")
        field, _, value = line.partition(":")
        value = value.removeprefix(" ")
        if not line and data:
            yield Event(number, name, json.loads("\n".join(data)))
            number, name, data = 0, "", []
        elif field == "id" and value.isdigit():
            number = int(value)
        elif field == "event":
            name = value
        elif field == "data":
            data.append(value)
