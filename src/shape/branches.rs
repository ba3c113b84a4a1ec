//! Branches of rotation vectors chosen over the surface: for poses that no motion joins, where a limb may be turned by more than half a turn.

use std::collections::VecDeque;

use crate::linalg::rotation::nearest_branch;

/// Which members (triangles, patches) lie next to which.
#[derive(Debug)]
pub struct Neighbours {
    /// Where the neighbours of each member begin in `others`, and one more.
    starts: Vec<u32>,
    others: Vec<u32>,
}

impl Neighbours {
    /// From pairs of members, numbered from 0 and below `count`; the neighbours of a member keep the order of its pairs. O(count + pairs).
    pub fn new(count: usize, pairs: impl Iterator<Item = [u32; 2]> + Clone) -> Self {
        let mut starts = vec![0u32; count + 1];
        for member in pairs.clone().flatten() {
            starts[member as usize + 1] += 1;
        }
        for i in 0..count {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut others = vec![0; starts[count] as usize];
        for [a, b] in pairs {
            for (from, to) in [(a, b), (b, a)] {
                others[next[from as usize] as usize] = to;
                next[from as usize] += 1;
            }
        }
        Self { starts, others }
    }

    fn of(&self, member: u32) -> &[u32] {
        let [from, to] = [member, member + 1].map(|m| self.starts[m as usize] as usize);
        &self.others[from..to]
    }

    /// Moves every rotation vector to its branch nearest to that of the neighbour from which it is reached, breadth first from the member of each part that
    /// is turned least (the lowest of equals), whose angle stays in [0, pi]. O(count log count + pairs).
    pub fn unwrap(&self, vectors: &mut [&mut [f64; 3]]) {
        let angle = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>();
        let mut least_first: Vec<u32> = (0..vectors.len() as u32).collect();
        least_first.sort_by(|&a, &b| {
            let [a, b] = [a, b].map(|m| angle(vectors[m as usize]));
            a.total_cmp(&b)
        });
        let mut reached = vec![false; vectors.len()];
        let mut queue = VecDeque::new();
        for root in least_first {
            if std::mem::replace(&mut reached[root as usize], true) {
                continue;
            }
            queue.push_back(root);
            while let Some(member) = queue.pop_front() {
                let from = *vectors[member as usize];
                for &next in self.of(member) {
                    if !std::mem::replace(&mut reached[next as usize], true) {
                        let vector = &mut *vectors[next as usize];
                        *vector = nearest_branch(*vector, from);
                        queue.push_back(next);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::rotation::{exp, log};

    /// A chain of members turned about one axis, each by a tenth of a radian more than the one before, and an odd one that touches nothing.
    #[test]
    fn a_chain_that_winds_up_is_followed() {
        let axis = [0.6, 0.0, 0.8];
        let count = 200;
        let pairs = (1..count - 1).map(|i| [i as u32 - 1, i as u32]);
        let turned = |i: usize| axis.map(|x| x * 0.1 * (i as f64 - 70.0));
        let mut vectors: Vec<_> = (0..count).map(|i| log(&exp(turned(i)))).collect();
        vectors[count - 1] = [0.0, 3.0, 0.0];
        let mut places: Vec<_> = vectors.iter_mut().collect();
        Neighbours::new(count, pairs).unwrap(&mut places);
        for (i, v) in vectors[..count - 1].iter().enumerate() {
            let gap = (0..3)
                .map(|a| (v[a] - turned(i)[a]).abs())
                .fold(0.0, f64::max);
            assert!(gap < 1e-12, "{i}: {gap}");
        }
        assert_eq!(vectors[count - 1], [0.0, 3.0, 0.0]);
    }
}
