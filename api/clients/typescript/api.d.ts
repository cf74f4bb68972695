// Generated from api/openapi.json by api/clients/generate.py: do not edit.
import { ServerEvent, Transport } from "./transport.js";
import { AddressAnswer, AddressQuestion, Batch, BatchCertificate, BatchView, Capabilities, Health, Job, JobKind, JobPage, JobState, JobView, LibraryPage, MaterialPage, Model, ModelPage, ModelView, Plan, ProblemPage, Profile, ProfilePage, ShortOrder, SolveReport, SolveRequest, ValidationReport, Version } from "./types.js";

export * from "./types.js";

/** One method for each operation. What the service refuses is thrown as a `ProblemError`. */
export class Api extends Transport {
  /** The description as a page that needs nothing from elsewhere. */
  docs(options?: { signal?: AbortSignal }): Promise<Response>;
  /** Whether the process answers. */
  livez(options?: { signal?: AbortSignal }): Promise<Health>;
  /** Counters in the text format of Prometheus. */
  metrics(options?: { signal?: AbortSignal }): Promise<Response>;
  /** Tells a kind of problem. */
  showProblem(code: string, options?: { signal?: AbortSignal }): Promise<ProblemPage>;
  /**
   * Whether the service takes work: not while it goes down, nor while its data folder, or the database and the
   * object store that it shares with others, cannot be used.
   */
  readyz(options?: { signal?: AbortSignal }): Promise<Health>;
  /** Tells where an address leads, or which addresses lead near a point. */
  locate(body: AddressQuestion, options?: { signal?: AbortSignal }): Promise<AddressAnswer>;
  /**
   * Draws the automaton of a model: states as nodes, transitions and boundaries as two kinds of arrows. An SVG
   * picture, or DOT text when `Accept` prefers `text/vnd.graphviz`; 406 when it refuses both. A model that is a
   * legal document is drawn even if it cannot be evaluated, with what is wrong in red.
   */
  automaton(body: Model, options?: { signal?: AbortSignal }): Promise<Response>;
  /**
   * Submits up to 100 jobs at once. All are accepted, or none: faults of any of the documents refuse the batch,
   * with their places. Then every job ends for itself, well or not. They count as so many submissions and so many
   * unfinished jobs; those whose work was done before are answered at once and count as submissions alone. What
   * only computing shows, a limit that is passed too, is the problem of that job. With `Prefer: wait=n` (30 at
   * most) the answer waits up to n seconds for the end of all.
   */
  submitBatch(body: Batch, options?: { prefer?: string | null; idempotencyKey?: string | null; signal?: AbortSignal }): Promise<BatchView>;
  /** Stops a batch if needed and forgets it with all of its jobs. */
  forgetBatch(id: string, options?: { signal?: AbortSignal }): Promise<void>;
  /** A batch, in every state with 200: how many of its jobs stand where, and a row for each. */
  showBatch(id: string, options?: { signal?: AbortSignal }): Promise<BatchView>;
  /** Stops all jobs of a batch that have not ended. 200 if all have ended, 202 while some are stopping. */
  cancelBatch(id: string, options?: { signal?: AbortSignal }): Promise<BatchView>;
  /**
   * What is proven of all results of a batch: for every job how it ended, the digests of its files, and its key
   * figures or its problem. 409 until all of its jobs have ended; 410 once they have expired. Until then its bytes
   * stay the same.
   */
  batchCertificate(id: string, options?: { signal?: AbortSignal }): Promise<BatchCertificate>;
  /**
   * The rows of a batch's jobs as they end. Server-Sent Events: `row` for every job that has ended or ends, then
   * `done` with the batch; or with `Accept: application/x-ndjson` the rows alone, one a line. A stream that is
   * opened again begins again; how far a single job has come is told by its own events.
   */
  batchEvents(id: string, options?: { signal?: AbortSignal }): AsyncGenerator<ServerEvent>;
  /** Kinds of jobs, formats and limits of this service. */
  capabilities(options?: { signal?: AbortSignal }): Promise<Capabilities>;
  /**
   * Evaluates: a job of the kind `evaluate`, waited for 10 s. 200 if it has ended by then, else 202 with its
   * `Location`: nothing is lost, and `Prefer: wait=n` chooses another time.
   */
  evaluate(body: ShortOrder, options?: { prefer?: string | null; idempotencyKey?: string | null; signal?: AbortSignal }): Promise<JobView>;
  /** Lists the caller's jobs. */
  listJobs(options?: { state?: JobState; kind?: JobKind; limit?: number; cursor?: string; signal?: AbortSignal }): Promise<JobPage>;
  /**
   * Submits a job. With `Prefer: wait=n` (30 at most) the answer waits up to n seconds for the end: 200 if it
   * came, else 202. The job's own failure is in its `problem`, never in the status. An `Idempotency-Key` makes a
   * repeated submission give the first one's job. Equal work that was finished before is not done again.
   */
  submitJob(body: Job, options?: { prefer?: string | null; idempotencyKey?: string | null; signal?: AbortSignal }): Promise<JobView>;
  /** Stops a job if needed and forgets it. 409 for a job of a batch, which is forgotten with its batch. */
  forgetJob(id: string, options?: { signal?: AbortSignal }): Promise<void>;
  /** A job, in every state with 200. */
  showJob(id: string, options?: { signal?: AbortSignal }): Promise<JobView>;
  /** Stops a job. 200 if it has ended, 202 while it is stopping. */
  cancelJob(id: string, options?: { signal?: AbortSignal }): Promise<JobView>;
  /**
   * A job's events: `state`, `progress`, `warning`, `output`, `done`; the last ends the stream. A client that lost
   * the stream sends `Last-Event-ID` and gets what it missed; all there is, if the service was started again in
   * between.
   */
  jobEvents(id: string, options?: { lastEventId?: number | null; signal?: AbortSignal }): AsyncGenerator<ServerEvent>;
  /**
   * A job's output: 303 to its bytes, or the bytes with `?redirect=0`. `HEAD` gives the headers. A file name
   * without its ending stands for all files of that name: `format`, or else `Accept`, says which of them.
   * `application/octet-stream` accepts every file. 406 where none is acceptable: nothing is converted here.
   */
  jobOutput(id: string, name: string, options?: { redirect?: number; format?: string; signal?: AbortSignal }): Promise<Response>;
  /** Lists the library of classics. */
  listClassics(options?: { signal?: AbortSignal }): Promise<LibraryPage>;
  /** The model document of a classic. `HEAD` gives its headers. */
  fetchClassic(name: string, options?: { signal?: AbortSignal }): Promise<Model>;
  /** Lists materials with their densities. */
  listMaterials(options?: { signal?: AbortSignal }): Promise<MaterialPage>;
  /**
   * Measures: a job of the kind `measure`, waited for 10 s. 200 if it has ended by then, else 202 with its
   * `Location`: nothing is lost, and `Prefer: wait=n` chooses another time.
   */
  measure(body: ShortOrder, options?: { prefer?: string | null; idempotencyKey?: string | null; signal?: AbortSignal }): Promise<JobView>;
  /** Lists the caller's models. */
  listModels(options?: { limit?: number; cursor?: string; signal?: AbortSignal }): Promise<ModelPage>;
  /**
   * Stores a model document in its canonical form, or a mesh file as it is. The same shape and name, or the same
   * file, give the same id. A mesh file is received piece by piece, read within limits and examined: `mesh` tells
   * what it holds, and nothing of it is repaired. `model_ref` in a job names either.
   */
  storeModel(body: Model | BodyInit, options?: { format?: string; name?: string; contentType?: string; signal?: AbortSignal }): Promise<ModelView>;
  /** Forgets a model, with `If-Match` only if it has that tag. Jobs that used it keep what they made. */
  forgetModel(id: string, options?: { signal?: AbortSignal }): Promise<void>;
  /** The canonical document of a model, or a mesh file as it was uploaded. `HEAD` gives the headers. */
  fetchModel(id: string, options?: { signal?: AbortSignal }): Promise<Response>;
  /** The OpenAPI description. */
  openapi(options?: { signal?: AbortSignal }): Promise<unknown>;
  /**
   * Predicts what a job costs, without doing it. A job that would pass a limit is refused with the limit and a
   * value that passes.
   */
  plan(body: Job, options?: { signal?: AbortSignal }): Promise<Plan>;
  /** Lists the profiles of processes. */
  listProfiles(options?: { signal?: AbortSignal }): Promise<ProfilePage>;
  /** The numbers of a process: default, range, unit and source of each. */
  showProfile(process: string, options?: { signal?: AbortSignal }): Promise<Profile>;
  /** The bytes with a digest, if one of the caller's jobs made them. They never change. `HEAD` gives the headers. */
  fetchResult(digest: string, options?: { range?: string | null; signal?: AbortSignal }): Promise<Response>;
  /**
   * Solves the unknown entries of a model. 200 with all solutions, and the model for the chosen values in `model`.
   * Constraints that contradict each other are refused with 422: `errors` are the fewest of them that already do.
   */
  solve(body: SolveRequest, options?: { signal?: AbortSignal }): Promise<SolveReport>;
  /** Says what is wrong with a model. 200 for every JSON text: `valid` and `diagnostics` tell. */
  validate(body: Model, options?: { signal?: AbortSignal }): Promise<ValidationReport>;
  /** The program's version. */
  version(options?: { signal?: AbortSignal }): Promise<Version>;
}
