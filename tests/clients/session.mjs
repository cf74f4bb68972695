// A session with the TypeScript client against a real service: prints one JSON object of what it saw.
//
//     node session.mjs CLIENT SERVICE CUTTING_PROXY
import { pathToFileURL } from "node:url";

const [, , index, service, proxy] = process.argv;
const { Client, ProblemError, checkDigest } = await import(pathToFileURL(index));

const segment = { lacuna: 1, name: "bar", shape: { family: "mesh", vertices: [[0, 0, 0], [10, 0, 0]], faces: [[0, 1]] } };
const order = (tolerance, changes = {}) => ({
  lacuna: 1, kind: "solidify", model: segment, params: { tolerance_mm: tolerance, radius_mm: 1 }, outputs: ["stl", "3mf"], ...changes,
});
const refused = async (promise) => {
  try {
    await promise;
  } catch (error) {
    if (!(error instanceof ProblemError)) throw error;
    return { status: error.status, code: error.code, pointers: error.errors.map((finding) => finding.pointer) };
  }
  throw new Error("it was not refused");
};
const equal = (a, b) => Buffer.compare(Buffer.from(a), Buffer.from(b)) === 0;

const client = new Client(service);
const seen = { version: (await client.version()).name };
let job = await client.submitJob(order(0.01), { idempotencyKey: "node 1" });
seen.same = (await client.submitJob(order(0.01), { idempotencyKey: "node 1" })).id === job.id;
const heard = [];
job = await client.wait(job.id, (event) => heard.push(event));
seen.state = job.state;
seen.events = [...new Set(heard.map((event) => event.name))].sort();
seen.last = heard.every((event, index) => index === 0 || heard[index - 1].id < event.id) && heard.at(-1).name;

// Bytes as they are, by the job and by their digest, whole and in part.
const stl = client.output(job, "stl");
const bytes = await checkDigest(await client.jobOutput(job.id, "stl"));
const part = await client.fetchResult(stl.digest, { range: "bytes=80-83" });
const type = part.headers.get("content-type");
seen.binary = [bytes.length === stl.bytes, part.status, equal(await part.arrayBuffer(), bytes.subarray(80, 84)), type];
// Every connection to the proxy breaks off after some kilobytes: the file comes in pieces.
seen.resumed = equal(await new Client(proxy).fetch(job, "stl"), bytes) && equal(await client.fetch(job, "stl", bytes.subarray(0, 999)), bytes);

seen.invalid = await refused(client.submitJob(order(-1, { colour: "red" })));
seen.absent = await refused(client.showJob("job_none"));
const view = await client.storeModel(new TextEncoder().encode("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), { name: "triangle" });
seen.upload = [view.name, view.mesh.boundary_edges];
const conversion = { lacuna: 1, kind: "convert", model_ref: view.id, params: { tolerance_mm: 0.1 }, outputs: ["3mf"] };
seen.failed = await refused(client.wait((await client.submitJob(conversion)).id));
await client.forgetModel(view.id);
seen.forgotten = (await refused(client.fetchModel(view.id))).status;
seen.page = (await client.listJobs({ limit: 1 })).items.length;
console.log(JSON.stringify(seen));
