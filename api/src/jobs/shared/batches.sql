-- Batches: which jobs were accepted together. A batch never changes; where it stands follows from its jobs.

CREATE TABLE lacuna_batches (
    id text PRIMARY KEY,
    owner text NOT NULL,
    record text NOT NULL,
    idempotency_key text
);

CREATE INDEX lacuna_batches_key ON lacuna_batches (owner, idempotency_key) WHERE idempotency_key IS NOT NULL;

ALTER TABLE lacuna_jobs ADD COLUMN batch text;

CREATE INDEX lacuna_jobs_batch ON lacuna_jobs (batch) WHERE batch IS NOT NULL;
