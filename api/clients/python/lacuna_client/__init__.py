"""A client of lacuna's HTTP service, with nothing but the standard library.

    from lacuna_client import Client

    client = Client("http://127.0.0.1:7878")
    job = client.submit_job({"lacuna": 1, "kind": "solidify", ...})
    job = client.wait(job["id"])
    client.fetch(job, "3mf", "part.3mf")

`api` has one method for each operation of the contract, `types` its types: both are generated, the rest is written by hand.
"""
from __future__ import annotations

import os
from collections.abc import Callable

from .api import Api
from .transport import Answer, Event, Problem, check_digest
from .types import JobView, ModelView, Output

__all__ = ["Answer", "Client", "Event", "Problem", "check_digest"]


class Client(Api):
    """Every operation, and the steps that take several."""

    def wait(self, job_id: str, listener: Callable[[Event], None] | None = None) -> JobView:
        """Follows a job to its end and gives it. A job without a result is raised as its `Problem`."""
        job = None
        for event in self.job_events(job_id):
            if listener is not None:
                listener(event)
            if event.name == "done":
                job = event.data
        job = job if job is not None else self.show_job(job_id)
        if "problem" in job:
            raise Problem(job["problem"], job["problem"].get("status", 422))
        return job

    def fetch(self, job: JobView, name: str, path: str | os.PathLike) -> Output:
        """Fetches an output of a job into a file, resumed if it breaks and held against its digest."""
        for output in job["outputs"]:
            if output["name"] == name:
                self._download(output["digest"], output["bytes"], path)
                return output
        raise KeyError(f"the job has no output {name!r}; it has {[output['name'] for output in job['outputs']]}")

    def upload(self, path: str | os.PathLike, name: str | None = None) -> ModelView:
        """Uploads a mesh file (STL, 3MF, OBJ, PLY, OFF, VRML); its `id` is a `model_ref` for jobs."""
        stem = os.path.splitext(os.path.basename(path))[0]
        with open(path, "rb") as file:
            return self.store_model(file, name=name or stem)
