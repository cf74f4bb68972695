-- The ledger that several processes share. Every change of a job's record raises its revision and is told on the
-- channel `lacuna`, as the job's state and id; the clock that counts is the database's.

CREATE TABLE lacuna_jobs (
    id text PRIMARY KEY,
    -- The order of acceptance; ids are made by clocks that may disagree.
    number bigint GENERATED ALWAYS AS IDENTITY,
    owner text NOT NULL,
    kind text NOT NULL,
    state text NOT NULL,
    -- Digest of the work: equal for equal work.
    work text NOT NULL,
    document text NOT NULL,
    -- How often the job was started: whoever holds an older attempt may not write any more.
    attempt integer NOT NULL,
    revision bigint NOT NULL DEFAULT 1,
    record text NOT NULL,
    progress text,
    idempotency_key text,
    -- Digests of its results.
    results text[] NOT NULL DEFAULT '{}',
    -- When the worker that is at it counts as gone.
    lease_until timestamptz,
    -- When it ended, or expired.
    finished timestamptz
);

CREATE UNIQUE INDEX lacuna_jobs_key ON lacuna_jobs (owner, idempotency_key) WHERE idempotency_key IS NOT NULL;
CREATE INDEX lacuna_jobs_page ON lacuna_jobs (owner, id);
CREATE INDEX lacuna_jobs_queue ON lacuna_jobs (number) WHERE state = 'queued';
CREATE INDEX lacuna_jobs_unfinished ON lacuna_jobs (owner) WHERE state IN ('queued', 'running', 'cancelling');
-- Equal work is never done by two workers at once.
CREATE UNIQUE INDEX lacuna_jobs_at_work ON lacuna_jobs (work) WHERE state IN ('running', 'cancelling');
CREATE INDEX lacuna_jobs_equal ON lacuna_jobs (work);
CREATE INDEX lacuna_jobs_finished ON lacuna_jobs (finished) WHERE finished IS NOT NULL;
CREATE INDEX lacuna_jobs_results ON lacuna_jobs USING gin (results);

-- What finished work left.
CREATE TABLE lacuna_answers (
    work text PRIMARY KEY,
    answer text NOT NULL,
    made timestamptz NOT NULL DEFAULT now()
);
