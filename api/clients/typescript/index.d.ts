import { Api } from "./api.js";
import { ServerEvent } from "./transport.js";
import { JobView, Output } from "./types.js";

export * from "./api.js";
export { ProblemError, ServerEvent, Transport, checkDigest } from "./transport.js";

/** Every operation, and the steps that take several. */
export class Client extends Api {
  /** Follows a job to its end and gives it. A job without a result is thrown as its `ProblemError`. */
  wait(jobId: string, listener?: (event: ServerEvent) => void): Promise<JobView>;
  /** Fetches an output of a job: resumed if it breaks, from the bytes `begun` if there are any, and held against its digest. */
  fetch(job: JobView, name: string, begun?: Uint8Array): Promise<Uint8Array>;
  /** An output of a job by its name. */
  output(job: JobView, name: string): Output;
}
