//! Jobs that wait: first come, first served among those of one owner, and the owners by turns.

use std::collections::{HashMap, VecDeque};

use crate::digest::Digest;

/// A job that waits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Waiting {
    /// Its id.
    pub(super) id: String,
    /// Whose it is.
    pub(super) owner: String,
    /// Digest of its work.
    pub(super) work: Digest,
}

/// The queue. Who waits with one job waits for at most one job of everybody else, however many those have.
#[derive(Debug, Default)]
pub(super) struct Queue {
    /// Owners with jobs that wait; the first is next.
    turns: VecDeque<String>,
    /// Their jobs, none empty.
    of_owners: HashMap<String, VecDeque<Waiting>>,
    length: usize,
}

impl Queue {
    pub(super) fn len(&self) -> usize {
        self.length
    }

    /// Puts a job behind its owner's others.
    pub(super) fn add(&mut self, job: Waiting) {
        self.line(&job.owner).push_back(job);
    }

    /// Puts a job before its owner's others: it has waited already.
    pub(super) fn put_back(&mut self, job: Waiting) {
        self.line(&job.owner).push_front(job);
    }

    /// The line that grows by one.
    fn line(&mut self, owner: &str) -> &mut VecDeque<Waiting> {
        self.length += 1;
        if !self.of_owners.contains_key(owner) {
            self.turns.push_back(owner.to_owned());
        }
        self.of_owners.entry(owner.to_owned()).or_default()
    }

    /// Takes the next job that may begin; its owner is last then.
    ///
    /// Cost: the jobs that wait for work that somebody is at.
    pub(super) fn take(&mut self, may_begin: impl Fn(&Waiting) -> bool) -> Option<Waiting> {
        let found =
            self.turns.iter().enumerate().find_map(|(turn, owner)| Some((turn, self.of_owners.get(owner)?.iter().position(&may_begin)?)));
        let (turn, place) = found?;
        let owner = self.turns.remove(turn)?;
        let line = self.of_owners.get_mut(&owner)?;
        let job = line.remove(place);
        self.length -= 1;
        if line.is_empty() {
            self.of_owners.remove(&owner);
        } else {
            self.turns.push_back(owner);
        }
        job
    }

    /// Takes all jobs that are so, in the order of the owners' turns.
    pub(super) fn take_all(&mut self, so: impl Fn(&Waiting) -> bool) -> Vec<Waiting> {
        let mut taken = Vec::new();
        for owner in &self.turns {
            let Some(line) = self.of_owners.get_mut(owner) else { continue };
            let (those, others) = std::mem::take(line).into_iter().partition(&so);
            *line = others;
            taken.extend::<VecDeque<Waiting>>(those);
        }
        self.of_owners.retain(|_, line| !line.is_empty());
        self.turns.retain(|owner| self.of_owners.contains_key(owner));
        self.length -= taken.len();
        taken
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn job(owner: &str, number: u8) -> Waiting {
        Waiting { id: format!("{owner}{number}"), owner: owner.into(), work: Digest::of(&[number]) }
    }

    fn rest(queue: &mut Queue) -> Vec<String> {
        std::iter::from_fn(|| queue.take(|_| true)).map(|job| job.id).collect()
    }

    #[test]
    fn owners_are_served_by_turns() {
        let mut queue = Queue::default();
        for number in 0..4 {
            queue.add(job("a", number));
        }
        assert_eq!(queue.take(|_| true).unwrap().id, "a0");
        queue.add(job("b", 0));
        queue.add(job("b", 1));
        queue.add(job("c", 0));
        assert_eq!(queue.len(), 6);
        assert_eq!(rest(&mut queue), ["a1", "b0", "c0", "a2", "b1", "a3"]);
        assert_eq!((queue.len(), queue.turns.len(), queue.of_owners.len()), (0, 0, 0));
    }

    #[test]
    fn who_cannot_begin_is_passed_over_and_keeps_its_turn() {
        let mut queue = Queue::default();
        queue.add(job("a", 0));
        queue.add(job("b", 1));
        queue.add(job("b", 2));
        let at_work = Digest::of(&[0]);
        assert_eq!(queue.take(|job| job.work != at_work).unwrap().id, "b1");
        assert_eq!(queue.take(|job| job.work != at_work).unwrap().id, "b2");
        assert_eq!(queue.take(|job| job.work != at_work), None);
        assert_eq!(rest(&mut queue), ["a0"]);
    }

    #[test]
    fn those_that_are_taken_leave_the_others_in_order() {
        let mut queue = Queue::default();
        for (owner, number) in [("a", 0), ("a", 1), ("b", 1), ("b", 2), ("c", 1)] {
            queue.add(job(owner, number));
        }
        let equal = Digest::of(&[1]);
        let taken: Vec<String> = queue.take_all(|job| job.work == equal).into_iter().map(|job| job.id).collect();
        assert_eq!((taken, queue.len()), (vec!["a1".to_owned(), "b1".into(), "c1".into()], 2));
        queue.put_back(job("b", 9));
        assert_eq!(rest(&mut queue), ["a0", "b9", "b2"]);
    }
}
