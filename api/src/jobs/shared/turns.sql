-- Whose turn it is: the smaller, the longer ago a job of that owner was begun. Who is not here has had no turn.

CREATE SEQUENCE lacuna_turn;

CREATE TABLE lacuna_turns (
    owner text PRIMARY KEY,
    turn bigint NOT NULL
);
