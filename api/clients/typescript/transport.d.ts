/** An event of a job: `state`, `progress`, `warning`, `output` or `done`. */
export interface ServerEvent {
  id: number;
  name: string;
  data: unknown;
}

/** What the service refused, or why a job has no result: an RFC 9457 problem. */
export class ProblemError extends Error {
  constructor(document: Record<string, unknown>, status: number);
  document: Record<string, unknown>;
  status: number;
  code: string;
  errors: Array<{ pointer: string; code: string; message: string }>;
  remedy?: Record<string, number>;
}

/** A service at an address. */
export class Transport {
  constructor(address?: string, options?: { key?: string; fetch?: typeof fetch });
  readonly address: string;
}

/** The bytes of an answer, if they are what its `Repr-Digest` says. */
export function checkDigest(response: Response): Promise<Uint8Array>;
