//! Numbers that are joined into groups in turn.

/// Groups of the numbers below some count (union-find with path halving); a group is called by its least number.
pub(crate) struct Groups(Vec<u32>);

impl Groups {
    /// Every number by itself.
    pub(crate) fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    /// The connected surfaces of triangles over so many vertices.
    pub(crate) fn of_triangles(vertices: usize, triangles: &[[u32; 3]]) -> Self {
        let mut groups = Self::new(vertices);
        for &[a, b, c] in triangles {
            groups.join(a as usize, b as usize);
            groups.join(b as usize, c as usize);
        }
        groups
    }

    /// The group of a number.
    pub(crate) fn of(&mut self, mut item: usize) -> u32 {
        while self.0[item] as usize != item {
            self.0[item] = self.0[self.0[item] as usize];
            item = self.0[item] as usize;
        }
        item as u32
    }

    /// Joins the groups of two numbers: whether they were apart.
    pub(crate) fn join(&mut self, a: usize, b: usize) -> bool {
        let (a, b) = (self.of(a), self.of(b));
        self.0[a.max(b) as usize] = a.min(b);
        a != b
    }

    /// The group of every number.
    pub(crate) fn all(&mut self) -> Vec<u32> {
        (0..self.0.len()).map(|item| self.of(item)).collect()
    }
}
