// Generated from api/openapi.json by api/clients/generate.py: do not edit.
import { Transport } from "./transport.js";

/** One method for each operation. What the service refuses is thrown as a `ProblemError`. */
export class Api extends Transport {
  docs(options = {}) {
    return this._bytes("GET", "/docs", { accept: "text/html, application/problem+json", signal: options.signal });
  }

  livez(options = {}) {
    return this._json("GET", "/livez", { accept: "application/json, application/problem+json", signal: options.signal });
  }

  metrics(options = {}) {
    return this._bytes("GET", "/metrics", { accept: "text/plain, application/problem+json", signal: options.signal });
  }

  showProblem(code, options = {}) {
    return this._json("GET", `/problems/${encodeURIComponent(code)}`, { accept: "application/json, application/problem+json", signal: options.signal });
  }

  readyz(options = {}) {
    return this._json("GET", "/readyz", { accept: "application/json, application/problem+json", signal: options.signal });
  }

  locate(body, options = {}) {
    return this._json("POST", "/v1/address", { body, accept: "application/json, application/problem+json", signal: options.signal });
  }

  automaton(body, options = {}) {
    return this._bytes("POST", "/v1/automaton", { body, accept: "image/svg+xml, text/vnd.graphviz, application/problem+json", signal: options.signal });
  }

  submitBatch(body, options = {}) {
    return this._json("POST", "/v1/batches", { header: { "Prefer": options.prefer, "Idempotency-Key": options.idempotencyKey }, body, accept: "application/json, application/problem+json", signal: options.signal });
  }

  forgetBatch(id, options = {}) {
    return this._nothing("DELETE", `/v1/batches/${encodeURIComponent(id)}`, { accept: "application/problem+json", signal: options.signal });
  }

  showBatch(id, options = {}) {
    return this._json("GET", `/v1/batches/${encodeURIComponent(id)}`, { accept: "application/json, application/problem+json", signal: options.signal });
  }

  cancelBatch(id, options = {}) {
    return this._json("POST", `/v1/batches/${encodeURIComponent(id)}/cancel`, { accept: "application/json, application/problem+json", signal: options.signal });
  }

  batchCertificate(id, options = {}) {
    return this._json("GET", `/v1/batches/${encodeURIComponent(id)}/certificate`, { accept: "application/json, application/problem+json", signal: options.signal });
  }

  batchEvents(id, options = {}) {
    return this._events("GET", `/v1/batches/${encodeURIComponent(id)}/events`, { accept: "application/x-ndjson, text/event-stream, application/problem+json", signal: options.signal });
  }

  capabilities(options = {}) {
    return this._json("GET", "/v1/capabilities", { accept: "application/json, application/problem+json", signal: options.signal });
  }

  evaluate(body, options = {}) {
    return this._json("POST", "/v1/evaluate", { header: { "Prefer": options.prefer, "Idempotency-Key": options.idempotencyKey }, body, accept: "application/json, application/problem+json", signal: options.signal });
  }

  listJobs(options = {}) {
    return this._json("GET", "/v1/jobs", { query: { "state": options.state, "kind": options.kind, "limit": options.limit, "cursor": options.cursor }, accept: "application/json, application/problem+json", signal: options.signal });
  }

  submitJob(body, options = {}) {
    return this._json("POST", "/v1/jobs", { header: { "Prefer": options.prefer, "Idempotency-Key": options.idempotencyKey }, body, accept: "application/json, application/problem+json", signal: options.signal });
  }

  forgetJob(id, options = {}) {
    return this._nothing("DELETE", `/v1/jobs/${encodeURIComponent(id)}`, { accept: "application/problem+json", signal: options.signal });
  }

  showJob(id, options = {}) {
    return this._json("GET", `/v1/jobs/${encodeURIComponent(id)}`, { accept: "application/json, application/problem+json", signal: options.signal });
  }

  cancelJob(id, options = {}) {
    return this._json("POST", `/v1/jobs/${encodeURIComponent(id)}/cancel`, { accept: "application/json, application/problem+json", signal: options.signal });
  }

  jobEvents(id, options = {}) {
    return this._events("GET", `/v1/jobs/${encodeURIComponent(id)}/events`, { header: { "Last-Event-ID": options.lastEventId }, accept: "text/event-stream, application/problem+json", signal: options.signal });
  }

  jobOutput(id, name, options = {}) {
    return this._bytes("GET", `/v1/jobs/${encodeURIComponent(id)}/outputs/${encodeURIComponent(name)}`, { query: { "redirect": options.redirect, "format": options.format }, accept: "application/octet-stream, application/problem+json", signal: options.signal });
  }

  listClassics(options = {}) {
    return this._json("GET", "/v1/library", { accept: "application/json, application/problem+json", signal: options.signal });
  }

  fetchClassic(name, options = {}) {
    return this._json("GET", `/v1/library/${encodeURIComponent(name)}`, { accept: "application/vnd.lacuna.model+json;v=1, application/problem+json", signal: options.signal });
  }

  listMaterials(options = {}) {
    return this._json("GET", "/v1/materials", { accept: "application/json, application/problem+json", signal: options.signal });
  }

  measure(body, options = {}) {
    return this._json("POST", "/v1/measure", { header: { "Prefer": options.prefer, "Idempotency-Key": options.idempotencyKey }, body, accept: "application/json, application/problem+json", signal: options.signal });
  }

  listModels(options = {}) {
    return this._json("GET", "/v1/models", { query: { "limit": options.limit, "cursor": options.cursor }, accept: "application/json, application/problem+json", signal: options.signal });
  }

  storeModel(body, options = {}) {
    return this._json("POST", "/v1/models", { query: { "format": options.format, "name": options.name }, body, contentType: options.contentType, accept: "application/json, application/problem+json", signal: options.signal });
  }

  forgetModel(id, options = {}) {
    return this._nothing("DELETE", `/v1/models/${encodeURIComponent(id)}`, { accept: "application/problem+json", signal: options.signal });
  }

  fetchModel(id, options = {}) {
    return this._bytes("GET", `/v1/models/${encodeURIComponent(id)}`, { accept: "application/octet-stream, application/problem+json", signal: options.signal });
  }

  openapi(options = {}) {
    return this._json("GET", "/v1/openapi.json", { accept: "application/json, application/problem+json", signal: options.signal });
  }

  plan(body, options = {}) {
    return this._json("POST", "/v1/plan", { body, accept: "application/json, application/problem+json", signal: options.signal });
  }

  listProfiles(options = {}) {
    return this._json("GET", "/v1/profiles", { accept: "application/json, application/problem+json", signal: options.signal });
  }

  showProfile(process, options = {}) {
    return this._json("GET", `/v1/profiles/${encodeURIComponent(process)}`, { accept: "application/json, application/problem+json", signal: options.signal });
  }

  fetchResult(digest, options = {}) {
    return this._bytes("GET", `/v1/results/${encodeURIComponent(digest)}`, { header: { "Range": options.range }, accept: "application/octet-stream, application/problem+json", signal: options.signal });
  }

  solve(body, options = {}) {
    return this._json("POST", "/v1/solve", { body, accept: "application/json, application/problem+json", signal: options.signal });
  }

  validate(body, options = {}) {
    return this._json("POST", "/v1/validate", { body, accept: "application/json, application/problem+json", signal: options.signal });
  }

  version(options = {}) {
    return this._json("GET", "/version", { accept: "application/json, application/problem+json", signal: options.signal });
  }
}
