// Connections, problems and events: what does not follow from the contract. For browsers, and Node 20 or newer.

/** How often in a row a stream may break without anything new. */
export const TRIES = 6;

/** What the service refused, or why a job has no result: an RFC 9457 problem. */
export class ProblemError extends Error {
  constructor(document, status) {
    super(`${document.detail ?? document.title ?? "refused"} [${document.code ?? status}]`);
    this.name = "ProblemError";
    this.document = document;
    this.status = status;
    this.code = document.code ?? "";
    this.errors = document.errors ?? [];
    this.remedy = document.remedy;
  }
}

export const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));

const isBytes = (body) =>
  typeof body === "string" || body instanceof ArrayBuffer || ArrayBuffer.isView(body) || body instanceof Blob || body instanceof ReadableStream;

export class Transport {
  constructor(address = "http://127.0.0.1:7878", { key, fetch: ask } = {}) {
    this.address = address.replace(/\/+$/, "");
    this.key = key;
    this.ask = ask ?? ((...request) => globalThis.fetch(...request));
  }

  async _open(method, path, { query = {}, header = {}, body, contentType, accept = "*/*", signal } = {}) {
    const address = new URL(this.address + path);
    for (const [name, value] of Object.entries(query)) if (value !== undefined && value !== null) address.searchParams.set(name, value);
    const headers = new Headers({ accept });
    for (const [name, value] of Object.entries(header)) if (value !== undefined && value !== null) headers.set(name, String(value));
    if (this.key) headers.set("authorization", `Bearer ${this.key}`);
    const request = { method, headers, signal };
    if (body !== undefined) {
      const bytes = isBytes(body);
      request.body = bytes ? body : JSON.stringify(body);
      headers.set("content-type", contentType ?? (bytes ? "application/octet-stream" : "application/json"));
      if (body instanceof ReadableStream) request.duplex = "half";
    }
    const answer = await this.ask(address, request);
    if (answer.ok) return answer;
    let document = {};
    try {
      document = await answer.json();
    } catch {
      document = { detail: `${address} answers ${answer.status} without a problem document` };
    }
    throw new ProblemError(document, answer.status);
  }

  _bytes(method, path, options) {
    return this._open(method, path, options);
  }

  async _json(method, path, options) {
    return (await this._open(method, path, options)).json();
  }

  async _nothing(method, path, options) {
    await (await this._open(method, path, options)).arrayBuffer();
  }

  /** Events until `done`; a stream that breaks is taken up after the last event that arrived. */
  async *_events(method, path, options = {}) {
    let last = Number(options.header?.["Last-Event-ID"] ?? 0);
    let failures = 0;
    for (;;) {
      try {
        const answer = await this._open(method, path, { ...options, header: { "Last-Event-ID": last } });
        for await (const event of parse(answer.body)) {
          last = event.id;
          failures = 0;
          yield event;
          if (event.name === "done") return;
        }
        // The job had ended before the stream was taken up, and everything was heard.
        if (last && failures) return;
      } catch (error) {
        const passing = !(error instanceof ProblemError) || [429, 503, 504].includes(error.status);
        if (!passing || failures >= TRIES || options.signal?.aborted) throw error;
      }
      failures += 1;
      await pause(Math.min(200 * 2 ** failures, 5000));
    }
  }
}

async function* parse(stream) {
  const decoder = new TextDecoder();
  let waiting = "";
  let event = { id: 0, name: "", data: "" };
  for await (const chunk of stream) {
    waiting += decoder.decode(chunk, { stream: true });
    const lines = waiting.split("\n");
    waiting = lines.pop();
    for (const raw of lines) {
      const line = raw.replace(/\r$/, "");
      const [, field, value] = /^([^:]*):? ?(.*)$/.exec(line);
      if (line === "") {
        if (event.data) yield { ...event, data: JSON.parse(event.data) };
        event = { id: 0, name: "", data: "" };
      } else if (field === "id") event.id = Number(value);
      else if (field === "event") event.name = value;
      else if (field === "data") event.data += value;
    }
  }
}

/** The bytes of an answer, if they are what its `Repr-Digest` says. */
export async function checkDigest(response) {
  const bytes = new Uint8Array(await response.arrayBuffer());
  const found = btoa(String.fromCharCode(...new Uint8Array(await crypto.subtle.digest("SHA-256", bytes))));
  const stated = response.headers.get("repr-digest");
  if (stated !== `sha-256=:${found}:`) throw new Error(`the bytes arrived damaged: ${found} is not ${stated}`);
  return bytes;
}
