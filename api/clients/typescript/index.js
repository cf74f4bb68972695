// A client of lacuna's HTTP service, with nothing but `fetch`. `api.js` has one method for each operation of the contract
// and is generated; the rest is written by hand.
import { Api } from "./api.js";
import { ProblemError, TRIES, pause } from "./transport.js";

export * from "./api.js";
export { ProblemError, Transport, checkDigest } from "./transport.js";

export class Client extends Api {
  async wait(jobId, listener) {
    let job;
    for await (const event of this.jobEvents(jobId)) {
      listener?.(event);
      if (event.name === "done") job = event.data;
    }
    job ??= await this.showJob(jobId);
    if (job.problem) throw new ProblemError(job.problem, job.problem.status ?? 422);
    return job;
  }

  output(job, name) {
    const output = job.outputs.find((each) => each.name === name);
    if (!output) throw new Error(`the job has no output ${name}; it has ${job.outputs.map((each) => each.name).join(", ")}`);
    return output;
  }

  async fetch(job, name, begun = new Uint8Array()) {
    const { digest, bytes } = this.output(job, name);
    const whole = new Uint8Array(bytes);
    let have = begun.length <= bytes ? begun.length : 0;
    whole.set(begun.subarray(0, have));
    for (let failures = 0; have < bytes; ) {
      const before = have;
      try {
        const header = have ? { Range: `bytes=${have}-`, "If-Range": `"${digest}"` } : {};
        const answer = await this._open("GET", `/v1/results/${digest}`, { header });
        if (answer.status !== 206) have = 0;
        for await (const chunk of answer.body) {
          whole.set(chunk, have);
          have += chunk.length;
        }
      } catch (error) {
        if (error instanceof ProblemError || failures >= TRIES) throw error;
      }
      failures = have > before ? 0 : failures + 1;
      if (failures > TRIES) throw new Error(`the download of ${digest} does not get beyond ${have} of ${bytes} bytes`);
      if (failures) await pause(Math.min(200 * 2 ** failures, 5000));
    }
    const hash = new Uint8Array(await crypto.subtle.digest("SHA-256", whole));
    const found = `sha256:${[...hash].map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
    if (found !== digest) throw new Error(`${name} arrived damaged: its digest is ${found}, not ${digest}; fetch it again`);
    return whole;
  }
}
