//! Doors and machine room.
