"""The operations of lacuna's contract 0.1.0: one method for each.

Generated from api/openapi.json by api/clients/generate.py: do not edit.
"""
from __future__ import annotations

from collections.abc import Iterator
from typing import Any, BinaryIO, Literal
from urllib.parse import quote

from .transport import Answer, Event, Transport
from .types import AddressAnswer, AddressQuestion, Batch, BatchCertificate, BatchView, Capabilities, Health, Job, JobKind, JobPage, JobState, JobView, LibraryPage, MaterialPage, Model, ModelPage, ModelView, Plan, ProblemPage, Profile, ProfilePage, ShortOrder, SolveReport, SolveRequest, ValidationReport, Version


class Api(Transport):
    """One method for each operation. What the service refuses is raised as a `Problem`."""

    def docs(self) -> Answer:
        """The description as a page that needs nothing from elsewhere."""
        return self._bytes('GET', '/docs', accept='text/html, application/problem+json')

    def livez(self) -> Health:
        """Whether the process answers."""
        return self._json('GET', '/livez', accept='application/json, application/problem+json')

    def metrics(self) -> Answer:
        """Counters in the text format of Prometheus."""
        return self._bytes('GET', '/metrics', accept='text/plain, application/problem+json')

    def show_problem(self, code: str) -> ProblemPage:
        """Tells a kind of problem."""
        return self._json('GET', f"/problems/{quote(code, safe='')}", accept='application/json, application/problem+json')

    def readyz(self) -> Health:
        """Whether the service takes work: not while it goes down, nor while its data folder, or the database and the object store that it shares with others, cannot be used."""
        return self._json('GET', '/readyz', accept='application/json, application/problem+json')

    def locate(self, body: AddressQuestion) -> AddressAnswer:
        """Tells where an address leads, or which addresses lead near a point."""
        return self._json('POST', '/v1/address', body=body, accept='application/json, application/problem+json')

    def automaton(self, body: Model) -> Answer:
        """Draws the automaton of a model: states as nodes, transitions and boundaries as two kinds of arrows.

        An SVG picture, or DOT text when `Accept` prefers `text/vnd.graphviz`; 406 when it refuses both. A model
        that is a legal document is drawn even if it cannot be evaluated, with what is wrong in red.
        """
        return self._bytes('POST', '/v1/automaton', body=body, accept='image/svg+xml, text/vnd.graphviz, application/problem+json')

    def submit_batch(self, body: Batch, *, prefer: str | None | None = None, idempotency_key: str | None | None = None) -> BatchView:
        """Submits up to 100 jobs at once.

        All are accepted, or none: faults of any of the documents refuse the batch, with their places. Then
        every job ends for itself, well or not. They count as so many submissions and so many unfinished jobs;
        those whose work was done before are answered at once and count as submissions alone. What only
        computing shows, a limit that is passed too, is the problem of that job. With `Prefer: wait=n` (30 at
        most) the answer waits up to n seconds for the end of all.
        """
        return self._json('POST', '/v1/batches', header={'Prefer': prefer, 'Idempotency-Key': idempotency_key}, body=body, accept='application/json, application/problem+json')

    def forget_batch(self, id: str) -> None:
        """Stops a batch if needed and forgets it with all of its jobs."""
        self._nothing('DELETE', f"/v1/batches/{quote(id, safe='')}", accept='application/problem+json')

    def show_batch(self, id: str) -> BatchView:
        """A batch, in every state with 200: how many of its jobs stand where, and a row for each."""
        return self._json('GET', f"/v1/batches/{quote(id, safe='')}", accept='application/json, application/problem+json')

    def cancel_batch(self, id: str) -> BatchView:
        """Stops all jobs of a batch that have not ended. 200 if all have ended, 202 while some are stopping."""
        return self._json('POST', f"/v1/batches/{quote(id, safe='')}/cancel", accept='application/json, application/problem+json')

    def batch_certificate(self, id: str) -> BatchCertificate:
        """What is proven of all results of a batch: for every job how it ended, the digests of its files, and its key figures or its problem.

        409 until all of its jobs have ended; 410 once they have expired. Until then its bytes stay the same.
        """
        return self._json('GET', f"/v1/batches/{quote(id, safe='')}/certificate", accept='application/json, application/problem+json')

    def batch_events(self, id: str) -> Iterator[Event]:
        """The rows of a batch's jobs as they end.

        Server-Sent Events: `row` for every job that has ended or ends, then `done` with the batch; or with
        `Accept: application/x-ndjson` the rows alone, one a line. A stream that is opened again begins again;
        how far a single job has come is told by its own events.
        """
        return self._events('GET', f"/v1/batches/{quote(id, safe='')}/events", accept='application/x-ndjson, text/event-stream, application/problem+json')

    def capabilities(self) -> Capabilities:
        """Kinds of jobs, formats and limits of this service."""
        return self._json('GET', '/v1/capabilities', accept='application/json, application/problem+json')

    def evaluate(self, body: ShortOrder, *, prefer: str | None | None = None, idempotency_key: str | None | None = None) -> JobView:
        """Evaluates: a job of the kind `evaluate`, waited for 10 s.

        200 if it has ended by then, else 202 with its `Location`: nothing is lost, and `Prefer: wait=n` chooses
        another time.
        """
        return self._json('POST', '/v1/evaluate', header={'Prefer': prefer, 'Idempotency-Key': idempotency_key}, body=body, accept='application/json, application/problem+json')

    def list_jobs(self, *, state: JobState | None = None, kind: JobKind | None = None, limit: int | None = None, cursor: str | None = None) -> JobPage:
        """Lists the caller's jobs."""
        return self._json('GET', '/v1/jobs', query={'state': state, 'kind': kind, 'limit': limit, 'cursor': cursor}, accept='application/json, application/problem+json')

    def submit_job(self, body: Job, *, prefer: str | None | None = None, idempotency_key: str | None | None = None) -> JobView:
        """Submits a job.

        With `Prefer: wait=n` (30 at most) the answer waits up to n seconds for the end: 200 if it came, else
        202. The job's own failure is in its `problem`, never in the status. An `Idempotency-Key` makes a
        repeated submission give the first one's job. Equal work that was finished before is not done again.
        """
        return self._json('POST', '/v1/jobs', header={'Prefer': prefer, 'Idempotency-Key': idempotency_key}, body=body, accept='application/json, application/problem+json')

    def forget_job(self, id: str) -> None:
        """Stops a job if needed and forgets it. 409 for a job of a batch, which is forgotten with its batch."""
        self._nothing('DELETE', f"/v1/jobs/{quote(id, safe='')}", accept='application/problem+json')

    def show_job(self, id: str) -> JobView:
        """A job, in every state with 200."""
        return self._json('GET', f"/v1/jobs/{quote(id, safe='')}", accept='application/json, application/problem+json')

    def cancel_job(self, id: str) -> JobView:
        """Stops a job. 200 if it has ended, 202 while it is stopping."""
        return self._json('POST', f"/v1/jobs/{quote(id, safe='')}/cancel", accept='application/json, application/problem+json')

    def job_events(self, id: str, *, last_event_id: int | None | None = None) -> Iterator[Event]:
        """A job's events: `state`, `progress`, `warning`, `output`, `done`; the last ends the stream.

        A client that lost the stream sends `Last-Event-ID` and gets what it missed; all there is, if the
        service was started again in between.
        """
        return self._events('GET', f"/v1/jobs/{quote(id, safe='')}/events", header={'Last-Event-ID': last_event_id}, accept='text/event-stream, application/problem+json')

    def job_output(self, id: str, name: str, *, redirect: int | None = None, format: str | None = None) -> Answer:
        """A job's output: 303 to its bytes, or the bytes with `?redirect=0`. `HEAD` gives the headers.

        A file name without its ending stands for all files of that name: `format`, or else `Accept`, says which
        of them. `application/octet-stream` accepts every file. 406 where none is acceptable: nothing is
        converted here.
        """
        return self._bytes('GET', f"/v1/jobs/{quote(id, safe='')}/outputs/{quote(name, safe='')}", query={'redirect': redirect, 'format': format}, accept='application/octet-stream, application/problem+json')

    def list_classics(self) -> LibraryPage:
        """Lists the library of classics."""
        return self._json('GET', '/v1/library', accept='application/json, application/problem+json')

    def fetch_classic(self, name: str) -> Model:
        """The model document of a classic. `HEAD` gives its headers."""
        return self._json('GET', f"/v1/library/{quote(name, safe='')}", accept='application/vnd.lacuna.model+json;v=1, application/problem+json')

    def list_materials(self) -> MaterialPage:
        """Lists materials with their densities."""
        return self._json('GET', '/v1/materials', accept='application/json, application/problem+json')

    def measure(self, body: ShortOrder, *, prefer: str | None | None = None, idempotency_key: str | None | None = None) -> JobView:
        """Measures: a job of the kind `measure`, waited for 10 s.

        200 if it has ended by then, else 202 with its `Location`: nothing is lost, and `Prefer: wait=n` chooses
        another time.
        """
        return self._json('POST', '/v1/measure', header={'Prefer': prefer, 'Idempotency-Key': idempotency_key}, body=body, accept='application/json, application/problem+json')

    def list_models(self, *, limit: int | None = None, cursor: str | None = None) -> ModelPage:
        """Lists the caller's models."""
        return self._json('GET', '/v1/models', query={'limit': limit, 'cursor': cursor}, accept='application/json, application/problem+json')

    def store_model(self, body: Model | bytes | BinaryIO, *, format: str | None = None, name: str | None = None, content_type: str | None = None) -> ModelView:
        """Stores a model document in its canonical form, or a mesh file as it is.

        The same shape and name, or the same file, give the same id. A mesh file is received piece by piece,
        read within limits and examined: `mesh` tells what it holds, and nothing of it is repaired. `model_ref`
        in a job names either.
        """
        return self._json('POST', '/v1/models', query={'format': format, 'name': name}, body=body, content_type=content_type, accept='application/json, application/problem+json')

    def forget_model(self, id: str) -> None:
        """Forgets a model, with `If-Match` only if it has that tag. Jobs that used it keep what they made."""
        self._nothing('DELETE', f"/v1/models/{quote(id, safe='')}", accept='application/problem+json')

    def fetch_model(self, id: str) -> Answer:
        """The canonical document of a model, or a mesh file as it was uploaded. `HEAD` gives the headers."""
        return self._bytes('GET', f"/v1/models/{quote(id, safe='')}", accept='application/octet-stream, application/problem+json')

    def openapi(self) -> Any:
        """The OpenAPI description."""
        return self._json('GET', '/v1/openapi.json', accept='application/json, application/problem+json')

    def plan(self, body: Job) -> Plan:
        """Predicts what a job costs, without doing it.

        A job that would pass a limit is refused with the limit and a value that passes.
        """
        return self._json('POST', '/v1/plan', body=body, accept='application/json, application/problem+json')

    def list_profiles(self) -> ProfilePage:
        """Lists the profiles of processes."""
        return self._json('GET', '/v1/profiles', accept='application/json, application/problem+json')

    def show_profile(self, process: str) -> Profile:
        """The numbers of a process: default, range, unit and source of each."""
        return self._json('GET', f"/v1/profiles/{quote(process, safe='')}", accept='application/json, application/problem+json')

    def fetch_result(self, digest: str, *, range: str | None | None = None) -> Answer:
        """The bytes with a digest, if one of the caller's jobs made them. They never change. `HEAD` gives the headers."""
        return self._bytes('GET', f"/v1/results/{quote(digest, safe='')}", header={'Range': range}, accept='application/octet-stream, application/problem+json')

    def solve(self, body: SolveRequest) -> SolveReport:
        """Solves the unknown entries of a model.

        200 with all solutions, and the model for the chosen values in `model`. Constraints that contradict each
        other are refused with 422: `errors` are the fewest of them that already do.
        """
        return self._json('POST', '/v1/solve', body=body, accept='application/json, application/problem+json')

    def validate(self, body: Model) -> ValidationReport:
        """Says what is wrong with a model.

        200 for every JSON text: `valid` and `diagnostics` tell.
        """
        return self._json('POST', '/v1/validate', body=body, accept='application/json, application/problem+json')

    def version(self) -> Version:
        """The program's version."""
        return self._json('GET', '/version', accept='application/json, application/problem+json')
