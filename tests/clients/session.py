"""A session with the Python client against a real service: prints one JSON object of what it saw.

    python3 session.py SERVICE CUTTING_PROXY FOLDER
"""
import json
import sys
from pathlib import Path

from lacuna_client import Client, Problem, check_digest

SEGMENT = {"lacuna": 1, "name": "bar", "shape": {"family": "mesh", "vertices": [[0, 0, 0], [10, 0, 0]], "faces": [[0, 1]]}}


def order(tolerance, **changes):
    """A small solid."""
    params = {"tolerance_mm": tolerance, "radius_mm": 1}
    return {"lacuna": 1, "kind": "solidify", "model": SEGMENT, "params": params, "outputs": ["stl", "3mf"], **changes}


def refused(call, *arguments, **options):
    """The problem that a call raises."""
    try:
        call(*arguments, **options)
    except Problem as problem:
        return {"status": problem.status, "code": problem.code, "pointers": [finding["pointer"] for finding in problem.errors]}
    raise SystemExit(f"{call} was not refused")


def main():
    """The session."""
    service, proxy, folder = sys.argv[1], sys.argv[2], Path(sys.argv[3])
    client, seen = Client(service), {}
    seen["version"] = client.version()["name"]
    job = client.submit_job(order(0.01), idempotency_key="python 1")
    seen["same"] = client.submit_job(order(0.01), idempotency_key="python 1")["id"] == job["id"]
    heard = []
    job = client.wait(job["id"], heard.append)
    seen["state"], seen["events"] = job["state"], sorted({event.name for event in heard})
    seen["last"] = [event.id for event in heard] == sorted(event.id for event in heard) and heard[-1].name

    # Bytes as they are, by the job and by their digest, whole and in part.
    stl = next(output for output in job["outputs"] if output["name"] == "stl")
    bytes_of_job = check_digest(client.job_output(job["id"], "stl"))
    part = client.fetch_result(stl["digest"], range="bytes=80-83")
    seen["binary"] = [len(bytes_of_job) == stl["bytes"], part.status, part.body == bytes_of_job[80:84], part.headers["content-type"]]
    # Every connection to the proxy breaks off after some kilobytes: the file comes in pieces.
    client.address = proxy
    client.fetch(job, "stl", folder / "python.stl")
    client.address = service
    seen["resumed"] = (folder / "python.stl").read_bytes() == bytes_of_job

    seen["invalid"] = refused(client.submit_job, order(-1, colour="red"))
    seen["absent"] = refused(client.show_job, "job_none")
    mesh = folder / "triangle.off"
    mesh.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    view = client.upload(mesh)
    seen["upload"] = [view["name"], view["mesh"]["boundary_edges"]]
    conversion = {"lacuna": 1, "kind": "convert", "model_ref": view["id"], "params": {"tolerance_mm": 0.1}, "outputs": ["3mf"]}
    seen["failed"] = refused(client.wait, client.submit_job(conversion)["id"])
    client.forget_model(view["id"])
    seen["forgotten"] = refused(client.fetch_model, view["id"])["status"]
    seen["page"] = len(client.list_jobs(limit=1)["items"])
    print(json.dumps(seen))


if __name__ == "__main__":
    main()
