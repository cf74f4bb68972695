//! The order of entries of a queue.

/// Orders a type by a comparison of two references alone, equality included: what a binary heap needs of its entries. The greatest comes first.
macro_rules! ordered_by {
    ($entry:ty, $compare:expr) => {
        impl PartialEq for $entry {
            fn eq(&self, other: &Self) -> bool {
                self.cmp(other).is_eq()
            }
        }
        impl Eq for $entry {}
        impl PartialOrd for $entry {
            fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
                Some(self.cmp(other))
            }
        }
        impl Ord for $entry {
            fn cmp(&self, other: &Self) -> std::cmp::Ordering {
                let compare: fn(&Self, &Self) -> std::cmp::Ordering = $compare;
                compare(self, other)
            }
        }
    };
}
pub(crate) use ordered_by;
