//! Patch-based rotation-invariant coordinates (Baran et al. 2009): d = 9F + 3A + 6C, A the number of adjacent patches, where adjacency joins all patches of
//! a component.
//!
//! A patch turns by R_p, the rotation nearest to the sum over its triangles of A_f R_f (areas of the reference; R_f, S_f as in [`super::gradient`]). A triangle's nine
//! numbers: the rotation vector of R_p^T R_f, then S_f as in the gradient space. Then the rotation vector of R_p^T R_q for every adjacent pair p < q, in ascending order;
//! then six numbers of each component: the rotation vector of R_p of its lowest patch and its centre over the diagonal (zeros and the centre for a vertex by itself);
//! then three of each further part of patches ([`super::placement`]), of which [`super::patches::choose`] makes none.
//! Decoding finds the R_p from the pairs ([`super::frames`]), then T_f = R_p exp(.) S_f and the positions as in the gradient space. Degenerate triangles: as there.

use std::f64::consts::SQRT_2;
use std::ops::Range;
use std::sync::Arc;

use super::deformation::{Deformation, LANES, Lanes};
use super::frames::Frames;
use super::gradient::{NUMBERS, STILL, decode_triangles, unwrap_triangles};
use super::partition::Partition;
use super::placement::Placement;
use super::poisson::{Gradient, Poisson};
use super::pool::Pool;
use super::reference::{Reference, check, check_len};
use super::{ShapeError, Space, SpaceKind};
use crate::linalg::kernels::vectorised;
use crate::linalg::rotation::{
    IDENTITY, Matrix, apply, exp, log, nearest_branch, nearest_rotation, transposed_times,
};
use crate::mesh::Connectivity;
use crate::mesh::topology::Topology;

/// Numbers of an adjacent pair.
const PAIR: usize = 3;

/// R^(9F + 3A + 6C).
#[derive(Debug)]
pub struct PatchSpace {
    reference: Reference,
    deformation: Deformation,
    poisson: Poisson,
    partition: Partition,
    /// Areas in the reference, F; 0 for degenerate triangles.
    areas: Vec<f64>,
    frames: Frames,
    placement: Placement,
    work: Pool<Work>,
}

#[derive(Debug, Default)]
struct Work {
    /// R_f, in blocks of lanes.
    turns: Vec<Lanes<9>>,
    /// R_p, and one more for degenerate triangles.
    patches: Vec<Matrix>,
    /// R_p^T R_q.
    relative: Vec<Matrix>,
}

impl PatchSpace {
    /// Over a reference frame of 3V positions and labels, one a triangle. Costs a sparse factorisation.
    pub fn new(
        connectivity: Arc<Connectivity>,
        reference: &[f64],
        labels: &[i64],
    ) -> Result<Self, ShapeError> {
        let reference = Reference::new(connectivity, reference)?;
        let topology = Topology::new(reference.faces());
        let partition = Partition::new(&reference, &topology, labels)?;
        let mut lowest = vec![None; reference.components.len()];
        for (patch, &component) in partition.components.iter().enumerate() {
            lowest[component as usize].get_or_insert(patch as u32);
        }
        let frames = Frames::new(partition.patches(), partition.pairs.clone())?;
        let component_of = |p: u32| Some(partition.components[p as usize]);
        Ok(Self {
            placement: Placement::new(lowest, frames.roots(), component_of),
            deformation: Deformation::new(&reference),
            poisson: Poisson::new(&reference)?,
            areas: reference.area_shares(),
            frames,
            partition,
            reference,
            work: Pool::default(),
        })
    }

    /// P.
    pub fn patches(&self) -> usize {
        self.partition.patches()
    }

    fn triangle_numbers(&self) -> usize {
        NUMBERS * self.reference.faces().len()
    }

    /// Where the numbers of pairs are.
    fn pair_numbers(&self) -> Range<usize> {
        let start = self.triangle_numbers();
        start..start + PAIR * self.partition.pairs.len()
    }

    /// R_p of every patch from the R_f.
    fn turn_patches(&self, work: &mut Work) {
        work.patches.clear();
        work.patches.resize(self.patches() + 1, [[0.0; 3]; 3]);
        let blocks = self
            .partition
            .labels
            .chunks(LANES)
            .zip(self.areas.chunks(LANES));
        for ((labels, areas), turns) in blocks.zip(&work.turns) {
            for (lane, (&label, area)) in labels.iter().zip(areas).enumerate() {
                let sum = work.patches[label as usize].as_flattened_mut();
                let turn = turns.get(lane);
                sum.iter_mut()
                    .zip(turn)
                    .for_each(|(sum, x)| *sum += area * x);
            }
        }
        let (patches, degenerate) = work.patches.split_at_mut(self.patches());
        patches
            .iter_mut()
            .for_each(|sum| *sum = nearest_rotation(sum));
        degenerate.fill(IDENTITY);
    }

    /// R_p of every patch from the pairs, the components and the further parts.
    fn solve_patches(&self, z: &[f64], work: &mut Work) -> Result<(), ShapeError> {
        work.patches.clear();
        work.patches.resize(self.patches() + 1, IDENTITY);
        for (root, turn) in self.placement.turns(&z[self.pair_numbers().end..]) {
            work.patches[root as usize] = turn;
        }
        let vectors = z[self.pair_numbers()].as_chunks::<PAIR>().0;
        work.relative.clear();
        work.relative.extend(vectors.iter().map(|&v| exp(v)));
        self.frames
            .solve(&work.relative, &mut work.patches[..self.patches()])
    }

    /// The gradients of these triangles.
    fn gradients(&self, patches: &[Matrix], range: Range<usize>, z: &[f64], out: &mut [Gradient]) {
        let triangles = z[..self.triangle_numbers()].as_chunks::<NUMBERS>().0;
        decode_triangles(
            &self.deformation,
            range.start,
            &triangles[range.clone()],
            out,
        );
        for (out, &label) in out.iter_mut().zip(&self.partition.labels[range]) {
            *out = out.map(|image| apply(&patches[label as usize], image));
        }
    }
}

impl Space for PatchSpace {
    fn kind(&self) -> SpaceKind {
        SpaceKind::Patch
    }

    fn dimension(&self) -> usize {
        self.pair_numbers().end + self.placement.numbers()
    }

    fn frame_len(&self) -> usize {
        self.reference.frame_len()
    }

    fn encode(&self, positions: &[f64], z: &mut [f64]) -> Result<(), ShapeError> {
        check("frame", positions, self.frame_len())?;
        check_len("z", z, self.dimension())?;
        let (triangles, rest) = z.split_at_mut(self.triangle_numbers());
        let (pairs, placed) = rest.split_at_mut(self.pair_numbers().len());
        self.work.lend(|work| {
            let faces = self.reference.faces();
            work.turns.resize(faces.len().div_ceil(LANES), Lanes::ZERO);
            measure_triangles(
                &self.deformation,
                faces,
                positions,
                &mut work.turns,
                triangles,
            );
            self.turn_patches(work);
            let labels = &self.partition.labels;
            relate_triangles(
                &self.deformation,
                labels,
                &work.patches,
                &work.turns,
                triangles,
            );
            let patch = |p: u32| &work.patches[p as usize];
            for (z, &[p, q]) in pairs
                .as_chunks_mut::<PAIR>()
                .0
                .iter_mut()
                .zip(&self.partition.pairs)
            {
                *z = log(&transposed_times(patch(p), patch(q)));
            }
            self.placement
                .encode(&self.reference, positions, |p| *patch(p), placed);
        });
        Ok(())
    }

    fn decode(&self, z: &[f64], positions: &mut [f64]) -> Result<(), ShapeError> {
        check("z", z, self.dimension())?;
        check_len("frame", positions, self.frame_len())?;
        self.work.lend(|work| {
            self.solve_patches(z, work)?;
            let fill = |range: Range<usize>, out: &mut [Gradient]| {
                self.gradients(&work.patches, range, z, out)
            };
            self.poisson.solve(fill, positions);
            let placed = &z[self.pair_numbers().end..];
            self.placement.place(&self.reference, placed, positions);
            check("decoded frame", positions, self.frame_len())
        })
    }

    fn unwrap(&self, previous: &[f64], z: &mut [f64]) {
        if previous.len() != self.dimension() || z.len() != self.dimension() {
            return;
        }
        let Range { start, end } = self.pair_numbers();
        unwrap_triangles(&previous[..start], &mut z[..start]);
        let before = previous[start..end].as_chunks::<PAIR>().0;
        for (z, &before) in z[start..end]
            .as_chunks_mut::<PAIR>()
            .0
            .iter_mut()
            .zip(before)
        {
            *z = nearest_branch(*z, before);
        }
        self.placement.unwrap(&previous[end..], &mut z[end..]);
    }
}

vectorised! {
    /// The rotations of all triangles, in blocks, and the stretches among their nine numbers.
    fn measure_triangles(deformation: &Deformation, faces: &[[u32; 3]], positions: &[f64], turns: &mut [Lanes<9>], z: &mut [f64]) {
        let blocks = faces.chunks(LANES).zip(z.as_chunks_mut::<NUMBERS>().0.chunks_mut(LANES));
        for (block, ((faces, z), turns)) in blocks.zip(turns).enumerate() {
            let (rotation, stretch) = deformation.block(block, faces, positions);
            *turns = rotation;
            for (lane, z) in z.iter_mut().enumerate() {
                let [xx, yy, zz, yz, xz, xy] = stretch.get(lane);
                z[3..].copy_from_slice(&[xx, yy, zz, SQRT_2 * yz, SQRT_2 * xz, SQRT_2 * xy]);
            }
        }
    }
}

vectorised! {
    /// The rotation vectors among the nine numbers of all triangles, and what stands for degenerate ones.
    fn relate_triangles(deformation: &Deformation, labels: &[u32], patches: &[Matrix], turns: &[Lanes<9>], z: &mut [f64]) {
        let blocks = labels.chunks(LANES).zip(z.as_chunks_mut::<NUMBERS>().0.chunks_mut(LANES));
        for (block, ((labels, z), turns)) in blocks.zip(turns).enumerate() {
            let mut patch = Lanes::<9>::ZERO;
            for (lane, &label) in labels.iter().enumerate() {
                let [[a, b, c], [d, e, f], [g, h, i]] = patches[label as usize];
                patch.set(lane, [a, b, c, d, e, f, g, h, i]);
            }
            let mut vectors = Lanes::<3>::ZERO;
            for lane in 0..LANES {
                vectors.set(lane, log(&transposed_times(&patch.matrix(lane), &turns.matrix(lane))));
            }
            for (lane, z) in z.iter_mut().enumerate() {
                z[..3].copy_from_slice(&vectors.get(lane));
            }
            for (face, z) in deformation.degenerate(block, labels.len()).zip(z) {
                if face {
                    *z = STILL;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use nalgebra::{Rotation3, Vector3};
    use proptest::prelude::*;

    use super::*;
    use crate::sequence::synthetic::embedded;
    use crate::shape::partition::PatchError;
    use crate::shape::patches::choose;
    use crate::shape::tests::worst;
    use crate::shape::{decode_all, encode_all};

    /// Two plates of 8 triangles that share an edge path, the second turned about it by an angle.
    fn plates(angle: f64) -> Vec<f64> {
        let turn = Rotation3::new(Vector3::y() * angle);
        let place = |column: usize, row: usize| {
            let (x, y) = (column as f64 - 2.0, row as f64);
            let p = Vector3::new(x, y, 0.0);
            let p = if column > 2 { turn * p } else { p };
            [p.x, p.y, p.z]
        };
        (0..5)
            .flat_map(|c| (0..3).flat_map(move |r| place(c, r)))
            .collect()
    }

    fn plate_faces() -> Vec<[u32; 3]> {
        let quad = |c: u32, r: u32| {
            let a = 3 * c + r;
            [[a, a + 3, a + 4], [a, a + 4, a + 1]]
        };
        (0..4)
            .flat_map(|c| (0..2).flat_map(move |r| quad(c, r)))
            .collect()
    }

    fn mesh(vertices: usize, faces: Vec<[u32; 3]>) -> Arc<Connectivity> {
        Arc::new(Connectivity::new(vertices, faces).unwrap())
    }

    #[test]
    fn what_turns_as_one_is_a_patch() {
        let connectivity = mesh(15, plate_faces());
        let rest = plates(0.0);
        let halves: Vec<i64> = (0..16).map(|f| i64::from(f >= 8)).collect();
        let bent = [rest.clone(), plates(1.0), plates(0.3)].concat();
        assert_eq!(choose(connectivity.clone(), &rest, &bent).unwrap(), halves);
        // 45 degrees are not yet too much.
        assert_eq!(
            choose(connectivity.clone(), &rest, &plates(0.78)).unwrap(),
            [0; 16]
        );
        assert_eq!(
            choose(connectivity.clone(), &rest, &plates(0.79)).unwrap(),
            halves
        );
        let turned = Rotation3::new(Vector3::new(1.0, 2.0, 2.5));
        let moved: Vec<f64> = bent
            .as_chunks::<3>()
            .0
            .iter()
            .flat_map(|&p| <[f64; 3]>::from(turned * Vector3::from(p)))
            .collect();
        assert_eq!(choose(connectivity.clone(), &rest, &moved).unwrap(), halves);
        assert_eq!(choose(connectivity, &rest, &[]).unwrap(), [0; 16]);
    }

    /// Of the quadruped: connected patches, none small, as many as it has limbs or more; the same in any number of threads.
    #[test]
    fn patches_of_an_animal() {
        let sequence = embedded("@gallop-small").unwrap();
        let connectivity = sequence.connectivity();
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| {
                choose(
                    connectivity.clone(),
                    sequence.frame(0),
                    sequence.positions(),
                )
                .unwrap()
            })
        };
        let labels = run(1);
        assert_eq!(labels, run(3));
        let reference = Reference::new(connectivity.clone(), sequence.frame(0)).unwrap();
        let topology = Topology::new(connectivity.faces());
        let partition = Partition::new(&reference, &topology, &labels).unwrap();
        let patches = partition.patches();
        assert!((5..100).contains(&patches), "{patches}");
        let inside = topology
            .pairs()
            .map(|p| [p.first.triangle, p.second.triangle]);
        let inside = inside.filter(|&[f, g]| labels[f as usize] == labels[g as usize]);
        let (_, parts) = crate::mesh::topology::linked(labels.len(), inside);
        assert_eq!(parts, patches);
        let areas = reference.area_shares();
        let mut sums = vec![0.0; patches];
        labels
            .iter()
            .zip(&areas)
            .for_each(|(&p, area)| sums[p as usize] += area);
        let least = sums.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(least > areas.iter().sum::<f64>() / 500.0);
    }

    /// Fans that touch at a vertex only: no edge leads from part to part, so a patch does.
    #[test]
    fn parts_that_touch_at_a_vertex_come_back() {
        let connectivity = mesh(5, vec![[0, 1, 2], [2, 3, 4]]);
        let rest = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [2.0, 1.0, 0.0],
            [2.0, 2.0, 0.0],
        ];
        let bent = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [1.0, 1.0, 1.0],
            [1.0, 2.0, 1.3],
        ];
        let [rest, bent] = [rest, bent].map(|x| x.as_flattened().to_vec());
        let labels = choose(connectivity.clone(), &rest, &bent).unwrap();
        assert_eq!(labels, [0, 0]);
        let back = |labels: &[i64]| {
            let space = PatchSpace::new(connectivity.clone(), &rest, labels).unwrap();
            let z = encode_all(&space, &bent).unwrap();
            decode_all(&space, z.as_ref()).unwrap()
        };
        assert!(worst(&bent, &back(&labels)) < 1e-14);
        // Labels of one's own that leave them apart.
        assert!(worst(&bent, &back(&[0, 1])) < 1e-14);
    }

    #[test]
    fn turns_are_counted() {
        let connectivity = mesh(15, plate_faces());
        let labels: Vec<i64> = (0..16).map(|f| i64::from(f >= 8)).collect();
        let space = PatchSpace::new(connectivity, &plates(0.0), &labels).unwrap();
        let frames: Vec<f64> = (0..36)
            .flat_map(|i| plates((20.0 * f64::from(i)).to_radians()))
            .collect();
        let z = encode_all(&space, &frames).unwrap();
        let pair = space.pair_numbers();
        for i in 0..36 {
            let v = &z.col_as_slice(i)[pair.clone()];
            assert!(
                worst(v, &[0.0, (20.0 * i as f64).to_radians(), 0.0]) < 1e-13,
                "{i}: {v:?}"
            );
        }
    }

    #[test]
    fn the_roll_keeps_well_away_from_half_turns() {
        let roll = embedded("@roll-small").unwrap();
        let labels = choose(roll.connectivity().clone(), roll.frame(0), roll.positions()).unwrap();
        let space = PatchSpace::new(roll.connectivity().clone(), roll.frame(0), &labels).unwrap();
        let z = encode_all(&space, roll.frame(roll.frame_count() - 1)).unwrap();
        let pair = space.pair_numbers();
        let angle = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let z = z.col_as_slice(0);
        let inside = z[..pair.start]
            .chunks(NUMBERS)
            .map(|n| angle(&n[..3]))
            .fold(0.0, f64::max);
        let across = z[pair].chunks(PAIR).map(angle).fold(0.0, f64::max);
        assert!(
            inside < 0.2 * TAU && across < 0.3 * TAU,
            "{inside} {across}"
        );
    }

    #[test]
    fn labels_are_checked() {
        // Two triangles apart, one without area.
        let points = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [5.0, 0.0, 0.0],
            [6.0, 0.0, 0.0],
            [5.0, 1.0, 0.0],
        ];
        let connectivity = mesh(6, vec![[0, 1, 2], [0, 1, 1], [3, 4, 5]]);
        let made = |labels: &[i64]| match PatchSpace::new(
            connectivity.clone(),
            points.as_flattened(),
            labels,
        ) {
            Ok(space) => Ok(space.patches()),
            Err(ShapeError::Patch(error)) => Err(error),
            Err(other) => panic!("{other}"),
        };
        assert_eq!(made(&[1, -1, 0]), Ok(2));
        assert_eq!(
            made(&[0, -1]),
            Err(PatchError::WrongCount {
                expected: 3,
                found: 2
            })
        );
        assert_eq!(
            made(&[0, 0, 1]),
            Err(PatchError::BadLabel {
                triangle: 1,
                found: 0
            })
        );
        assert_eq!(
            made(&[0, -1, -1]),
            Err(PatchError::BadLabel {
                triangle: 2,
                found: -1
            })
        );
        assert_eq!(
            made(&[0, -1, i64::MAX]),
            Err(PatchError::BadLabel {
                triangle: 2,
                found: i64::MAX
            })
        );
        assert_eq!(made(&[0, -1, 2]), Err(PatchError::Empty { patch: 1 }));
        assert_eq!(
            made(&[0, -1, 0]),
            Err(PatchError::Divided {
                patch: 0,
                first: 0,
                second: 2
            })
        );
    }

    #[test]
    fn a_crowd_at_one_edge_is_refused() {
        let pages = 6000u32;
        let faces = (0..pages).map(|i| [0, 1, i + 2]).collect();
        let mut points = vec![0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        points.extend((0..pages).flat_map(|i| [f64::from(i).cos(), f64::from(i).sin(), 0.5]));
        let labels: Vec<i64> = (0..i64::from(pages)).collect();
        let refused = PatchSpace::new(mesh(pages as usize + 2, faces), &points, &labels);
        assert_eq!(refused.err(), Some(ShapeError::Patch(PatchError::Crowded)));
    }

    #[test]
    fn nothing_at_all() {
        for (vertices, faces) in [(0, vec![]), (2, vec![]), (2, vec![[0, 1, 1]])] {
            let (connectivity, frame) = (mesh(vertices, faces), vec![0.25; 3 * vertices]);
            let labels = choose(connectivity.clone(), &frame, &frame).unwrap();
            let space = PatchSpace::new(connectivity, &frame, &labels).unwrap();
            let mut z = vec![0.0; space.dimension()];
            let mut back = vec![0.0; frame.len()];
            space.encode(&frame, &mut z).unwrap();
            space.decode(&z, &mut back).unwrap();
            assert!(worst(&frame, &back) < 1e-15);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// Patches of any shape, in pieces too, give frames back, and rigid motions touch nothing but the placement.
        #[test]
        fn any_patches_do(
            picks in prop::collection::vec(0i64..7, 4000), frame in 0usize..24, axis in prop::array::uniform3(-1.0f64..1.0),
        ) {
            let sequence = embedded("@gallop-small").unwrap();
            let faces = sequence.connectivity().faces().len();
            // All seven are there.
            let labels: Vec<i64> = (0..faces).map(|f| if f < 7 { f as i64 } else { picks[f % picks.len()] }).collect();
            let space = PatchSpace::new(sequence.connectivity().clone(), sequence.frame(0), &labels).unwrap();
            let frame = sequence.frame(frame);
            let turn = Rotation3::new(Vector3::from(axis) * 1.5);
            let moved: Vec<f64> = frame.as_chunks::<3>().0.iter()
                .flat_map(|&p| <[f64; 3]>::from(turn * Vector3::from(p) + Vector3::new(1.0, -2.0, 3.0))).collect();
            let z = [frame, &moved].map(|frame| encode_all(&space, frame).unwrap());
            for (z, frame) in z.iter().zip([frame, &moved]) {
                let found = worst(frame, &decode_all(&space, z.as_ref()).unwrap());
                prop_assert!(found < 1e-11, "{found}");
            }
            let shape = ..space.pair_numbers().end;
            let [a, b] = z.each_ref().map(|z| &z.col_as_slice(0)[shape]);
            prop_assert!(worst(a, b) < 1e-11, "{}", worst(a, b));
        }
    }
}
