//! Things joined into groups (union–find); a group is known by its least member.

/// The groups of things numbered from 0.
pub struct Groups(Vec<u32>);

impl Groups {
    /// Every one of `count` things alone.
    pub fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    /// Joins the groups of two things.
    pub fn join(&mut self, [a, b]: [u32; 2]) {
        let (a, b) = (self.first_of(a), self.first_of(b));
        self.0[a.max(b) as usize] = a.min(b);
    }

    /// The least member of the group of `v`.
    pub fn first_of(&mut self, mut v: u32) -> u32 {
        while self.0[v as usize] != v {
            let up = self.0[self.0[v as usize] as usize];
            self.0[v as usize] = up;
            v = up;
        }
        v
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joining_is_transitive_and_the_least_member_names_the_group() {
        let mut groups = Groups::new(6);
        for pair in [[5, 3], [1, 2], [3, 2]] {
            groups.join(pair);
        }
        let names: Vec<u32> = (0..6).map(|v| groups.first_of(v)).collect();
        assert_eq!(names, [0, 1, 1, 1, 4, 1]);
    }
}
