//! Branches of rotation vectors chosen over the surface: for poses that no motion joins, where a limb may be turned by more than half a turn.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::PI;

use crate::linalg::rotation::nearest_branch;
use crate::mesh::vector::sub;

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

    /// Moves every rotation vector to its branch nearest to that of the neighbour from which it is reached, from the member of each part that is turned
    /// least (the lowest of equals), whose angle stays in [0, pi].
    ///
    /// Where a member is folded over against its neighbours its branch means little, and whatever were reached through it would be torn from the rest. So
    /// the next member reached is the one that is surest, by each of `SUREST` in turn, and the answer is kept that tears the fewest pairs apart.
    /// O((count + pairs) log pairs).
    pub fn unwrap(&self, vectors: &mut [&mut [f64; 3]]) {
        let given: Vec<Vector> = vectors.iter().map(|v| **v).collect();
        let mut best: Option<(Torn, Vec<Vector>)> = None;
        for surest in SUREST {
            let grown = self.grown(&given, surest);
            let torn = self.torn(&grown);
            if best.as_ref().is_none_or(|(least, _)| torn < *least) {
                best = Some((torn, grown));
            }
        }
        if let Some((_, chosen)) = best {
            vectors.iter_mut().zip(chosen).for_each(|(v, to)| **v = to);
        }
    }

    /// The vectors on branches that spread over the surface, the least of `doubt` first (Prim 1957).
    fn grown(&self, given: &[Vector], doubt: Doubt) -> Vec<Vector> {
        let mut vectors = given.to_vec();
        let mut roots: Vec<u32> = (0..given.len() as u32).collect();
        roots.sort_by(|&a, &b| {
            let [a, b] = [a, b].map(|m| squared(given[m as usize]));
            a.total_cmp(&b)
        });
        let mut reached = vec![false; given.len()];
        let mut heap = BinaryHeap::new();
        for root in roots {
            let vector = vectors[root as usize];
            heap.push(Next {
                doubt: 0.0,
                member: root,
                vector,
            });
            while let Some(Next { member, vector, .. }) = heap.pop() {
                if std::mem::replace(&mut reached[member as usize], true) {
                    continue;
                }
                vectors[member as usize] = vector;
                for &next in self.of(member).iter().filter(|&&m| !reached[m as usize]) {
                    let to = nearest_branch(given[next as usize], vector);
                    heap.push(Next {
                        doubt: doubt(vector, to),
                        member: next,
                        vector: to,
                    });
                }
            }
        }
        vectors
    }

    /// How many pairs lie more than half a turn apart, and the sum of the squared distances of all.
    fn torn(&self, vectors: &[Vector]) -> Torn {
        let (mut pairs, mut sum) = (0, 0.0);
        for (member, &vector) in vectors.iter().enumerate() {
            for &other in self.of(member as u32) {
                let apart = squared(sub(vectors[other as usize], vector));
                pairs += usize::from(apart > PI * PI);
                sum += apart;
            }
        }
        (pairs, sum)
    }
}

type Vector = [f64; 3];
/// Compared pairs first.
type Torn = (usize, f64);
/// How doubtful the branch of a vector, the second, is that was reached from a neighbour, the first.
type Doubt = fn(Vector, Vector) -> f64;

/// By the turn from one to the other, by the distance of their vectors, and by how far the vector is from no turn.
const SUREST: [Doubt; 3] = [
    |from, to| 1.0 - dot(quaternion(from), quaternion(to)).abs(),
    |from, to| squared(sub(to, from)),
    |_, to| squared(to),
];

fn squared(v: Vector) -> f64 {
    v.iter().map(|x| x * x).sum()
}

/// Of a rotation vector; its negative is the same rotation.
fn quaternion(v: Vector) -> [f64; 4] {
    let half = 0.5 * squared(v).sqrt();
    let share = if half > 0.0 {
        0.5 * half.sin() / half
    } else {
        0.5
    };
    [half.cos(), share * v[0], share * v[1], share * v[2]]
}

fn dot(a: [f64; 4], b: [f64; 4]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A member that can be reached, on the branch it would have; the least doubtful is the greatest, of equals the lowest.
struct Next {
    doubt: f64,
    member: u32,
    vector: Vector,
}

impl Ord for Next {
    fn cmp(&self, other: &Self) -> Ordering {
        let doubt = other.doubt.total_cmp(&self.doubt);
        doubt.then(other.member.cmp(&self.member))
    }
}

impl PartialOrd for Next {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Next {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Next {}

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

    /// A strip of two rows that is turned by up to 4 radians; one member is folded over, and behind it, in the order of pairs, lie the others.
    #[test]
    fn a_folded_member_tears_nothing_from_the_rest() {
        let length = 60u32;
        let count = 2 * length as usize;
        let rows = (1..length).flat_map(|i| [[2 * i - 2, 2 * i], [2 * i - 1, 2 * i + 1]]);
        let across = (0..length).map(|i| [2 * i, 2 * i + 1]);
        let turned = |i: usize| [0.0, 0.0, 4.0 * (i / 2) as f64 / length as f64];
        let folded = 2 * 40;
        let mut vectors: Vec<_> = (0..count).map(|i| log(&exp(turned(i)))).collect();
        vectors[folded] = [0.0, 2.9, 0.0];
        let mut places: Vec<_> = vectors.iter_mut().collect();
        Neighbours::new(count, rows.chain(across)).unwrap(&mut places);
        for (i, v) in vectors.iter().enumerate().filter(|(i, _)| *i != folded) {
            assert!(squared(sub(*v, turned(i))) < 1e-20, "{i}: {v:?}");
        }
    }
}
