//! Every tolerance and its reason. A case may ask for another, with a reason of its own.
//!
//! Lengths are relative to the diagonal of the box around the first frame or the layout, sums of squares to themselves or, below that, to a
//! millionth of the data's.

/// What a quantity is held against.
#[derive(Clone, Debug, PartialEq)]
pub struct Tolerance {
    pub value: f64,
    pub reason: String,
}

struct Entry {
    stage: &'static str,
    quantity: &'static str,
    value: f64,
    reason: &'static str,
}

macro_rules! tolerances {
    ($($stage:literal { $($quantity:literal <= $value:literal, $reason:literal;)* })*) => {
        const TOLERANCES: &[Entry] = &[$($(Entry { stage: $stage, quantity: $quantity, value: $value, reason: $reason },)*)*];
    };
}

tolerances! {
    "sequence.read" {
        "impossible" <= 0.0, "an area is not negative and a box not inside out";
        "count_differences" <= 0.0, "counts are whole numbers";
        "area_difference" <= 1e-12, "the same sum in another order, over the squared diagonal";
        "volume_difference" <= 1e-12, "the same sum in another order, over the cubed diagonal";
        "bounds_difference" <= 1e-15, "the same decimal digits give the same double";
    }
    "sequence.distance" {
        "brute_force" <= 1e-12, "the same distances, triangle by triangle";
        "mean_above_greatest" <= 1e-15, "a mean is not above its greatest term";
        "hausdorff_difference" <= 1e-12, "exact distances up to rounding";
        "mean_difference" <= 1e-12, "exact distances up to rounding";
    }
    "mesh.quality" {
        "area" <= 1e-10, "Heron's formula in another's place, over the squared diagonal; slivers cancel in it";
        "volume" <= 1e-12, "the same sum of determinants, over the cubed diagonal";
        "pairs_miscounted" <= 0.0, "pairs surely apart do not count, pairs surely deep in one another do";
        "impossible" <= 0.0, "k triangles make at most k (k - 1) / 2 pairs";
        "area_difference" <= 1e-12, "the same sum in another order, over itself";
        "volume_difference" <= 1e-12, "the same sum in another order, over the cubed diagonal";
        "pairs_difference" <= 0.0, "decided exactly";
        "faces_difference" <= 0.0, "decided exactly";
    }
    "shape.gradient_encode" {
        "formula" <= 1e-12, "R S times the reference's edges are the frame's edges, over the diagonal";
        "stretch" <= 1e-12, "a stretch has no negative eigenvalue";
        "centres" <= 1e-13, "a mean of vertices, over the diagonal";
        "rotation_difference" <= 1e-10, "slivers: eps over the ratio of height to length, 1e-3 on real meshes, and more where two stretches nearly vanish";
        "number_difference" <= 1e-10, "as rotations";
    }
    "shape.gradient_decode" {
        "round_trip" <= 1e-11, "a consistent z gives its frame back, over the diagonal (DESIGN.md, 7)";
        "frame_difference" <= 1e-11, "the same Poisson equation by another factorisation, over the diagonal";
    }
    "shape.lric_encode" {
        "first_form" <= 1e-12, "U times the reference's edges have the frame's lengths, over the diagonal";
        "second_form" <= 1e-10, "radians; normals of slivers: eps over the ratio of height to length, 1e-3 on real meshes";
        "placement" <= 1e-12, "the root triangle is mapped onto the frame's, centres are means";
        "form_difference" <= 1e-10, "as gradients: slivers";
        "angle_difference" <= 1e-10, "as second_form";
        "placement_difference" <= 1e-10, "as gradients";
    }
    "shape.lric_decode" {
        "round_trip" <= 1e-11, "a consistent z gives its frame back, over the diagonal (DESIGN.md, 7)";
        "frame_difference" <= 1e-11, "the same two systems by other factorisations, over the diagonal";
    }
    "shape.lengths_encode" {
        "lengths" <= 1e-14, "a difference and a root, over the diagonal";
        "angles" <= 1e-10, "as second_form of lric";
        "placement" <= 1e-12, "as lric";
        "length_difference" <= 1e-13, "the same formula, over the mean edge length";
        "angle_difference" <= 1e-10, "as angles";
        "placement_difference" <= 1e-10, "as gradients: slivers";
    }
    "shape.lengths_decode" {
        "round_trip" <= 1e-8, "a consistent z gives its frame back, over the diagonal (issue 3)";
        "stationarity" <= 1e-6, "means of two frames lead to where the squared differences are stationary";
        "frame_difference" <= 1e-8, "the same stationary frame, over the diagonal";
    }
    "shape.poisson_factor" {
        "backward_error" <= 1e-14, "a factorisation is backward stable";
        "solution_difference" <= 1e-9, "the condition of a Poisson matrix with slivers, 1e5, times the backward errors";
    }
    "shape.poisson_solve" {
        "backward_error" <= 1e-14, "a factorisation is backward stable";
        "solution_difference" <= 1e-9, "the condition of a Poisson matrix with slivers, 1e5, times the backward errors";
    }
    "shape.halfway" {
        "share_of_means" <= 0.1, "a limb that bends keeps its length; the mean of positions cuts across";
        "length_difference" <= 0.02, "another energy: as-rigid-as-possible surfaces stretch a little where they bend";
    }
    "shape.patch_encode" {
        "formula" <= 1e-12, "R_p R S times the reference's edges are the frame's edges, over the diagonal, R_p along a chain of patches";
        "stretch" <= 1e-12, "a stretch has no negative eigenvalue";
        "mean" <= 1e-12, "R_p is the rotation nearest to the mean, so that of what is left is none";
        "joints" <= 1e-12, "the rotations of pairs of patches agree around every loop";
        "placement" <= 1e-13, "a mean of vertices, over the diagonal; a vertex by itself does not turn";
        "rotation_difference" <= 1e-10, "as gradients: slivers";
        "patch_difference" <= 1e-12, "means over areas, in which slivers hardly count";
        "number_difference" <= 1e-10, "as gradients: slivers";
    }
    "shape.patch_decode" {
        "round_trip" <= 1e-11, "a consistent z gives its frame back, over the diagonal (DESIGN.md, 7)";
        "frame_difference" <= 1e-11, "the same two systems by other factorisations, over the diagonal";
    }
    "signal.h" {
        "mean" <= 1e-14, "a mean of n frames";
        "orthonormality" <= 1e-9, "the Gram route is taken down to squared ratios of 1e-6, which costs eps / 1e-6";
        "projection" <= 1e-10, "coordinates are projections, up to the orthonormality lost";
        "sign" <= 0.0, "the entry of largest magnitude is positive (reading 9)";
        "too_many_dimensions" <= 0.0, "at most m";
        "too_few_dimensions" <= 1e-18, "fewer than m leave only what lies below the rank's bound, squared";
        "error_h_difference" <= 1e-10, "second order in the error of the subspace";
        "dimension_difference" <= 0.0, "m is cut to the rank by one rule (PROTOCOL.md)";
        "sigma_difference" <= 1e-10, "over the norm of the data";
        "coordinate_difference" <= 1e-9, "up to sign, and up to turns where singular values are equal to 1e-6";
    }
    "signal.mds" {
        "above_start" <= 1e-12, "majorisation never rises";
        "stress_difference" <= 1e-6, "SMACOF alone stops before the minimum";
        "position_difference" <= 1e-8, "after the best rigid motion, where both gradients vanish";
    }
    "signal.mds_fixed" {
        "above_start" <= 1e-12, "majorisation never rises";
        "pins_moved" <= 0.0, "pins stay where they are put";
        "stress_difference" <= 1e-9, "both end with a second-order method";
        "position_difference" <= 1e-8, "where both gradients vanish; pins leave no motion";
    }
    "signal.layout" {
        "delta" <= 1e-12, "sums of at most n steps, over the greatest dissimilarity";
        "above_point" <= 0.0, "a layout is better than none";
        "delta_difference" <= 1e-12, "sums of at most n steps, over the greatest dissimilarity";
        "stress_difference" <= 1e-6, "as signal.mds: majorisation alone stops before the minimum";
        "position_difference" <= 1e-8, "after the best rigid motion, where both gradients vanish";
    }
    "signal.rbf" {
        "side_conditions" <= 1e-10, "coefficients come from a null space";
        "formula" <= 1e-9, "values are those of the coefficients";
        "stationarity" <= 1e-10, "a least-squares residual is orthogonal to the space";
        "error_g_difference" <= 1e-9, "least squares by another factorisation";
        "value_difference" <= 1e-9, "least squares by another factorisation";
        "query_difference" <= 1e-8, "between frames the conditioning of the kernels shows";
    }
    "signal.sites" {
        "errors" <= 1e-10, "each error again from scratch, over the data";
        "greedy" <= 1e-6, "the next site is the worst frame, up to ties";
        "start" <= 1e-6, "the first four are the farthest from the best-fit plane, up to ties";
        "rising" <= 1e-13, "spaces are nested";
        "order_gap" <= 1e-6, "orders may part only at ties of the argmax";
        "errors_difference" <= 1e-9, "up to where the orders part, over the data";
        "count_difference" <= 0.0, "the same number of sites";
    }
    "signal.parameters" {
        "first" <= 0.0, "t_1 = 0 (reading 8)";
        "steps" <= 1e-12, "squared steps are distances";
        "t_difference" <= 1e-12, "a cumulative sum";
    }
    "signal.knots" {
        "ends" <= 0.0, "clamped ends are copies (reading 1)";
        "falling" <= 0.0, "knots do not decrease";
        "averages" <= 1e-12, "reading 2 as a piecewise linear function";
        "u_difference" <= 1e-12, "averages of neighbours";
    }
    "signal.spline" {
        "formula" <= 1e-12, "values are those of the control points";
        "stationarity" <= 1e-10, "a least-squares residual is orthogonal to the space";
        "error_f_difference" <= 1e-9, "least squares by another factorisation";
        "value_difference" <= 1e-9, "least squares by another factorisation";
        "query_difference" <= 1e-9, "least squares by another factorisation";
    }
    "signal.rho" {
        "formula" <= 1e-13, "the cubic Hermite formula";
        "slopes" <= 1e-12, "reading 7 written out";
        "falling" <= 1e-14, "monotone data give a monotone curve";
        "value_difference" <= 1e-12, "the same cubic";
        "slope_difference" <= 1e-12, "the same slopes";
    }
    "signal.psi" {
        "formula" <= 1e-9, "three formulas in a row; kernels and coefficients cancel";
        "frame_difference" <= 1e-9, "three formulas in a row; kernels and coefficients cancel";
    }
    "signal.insert_knots" {
        "knots" <= 0.0, "old and new knots, merged";
        "formula" <= 1e-13, "values are those of the new control points";
        "curve" <= 1e-13, "the curve stays: averages of control points, over their extent";
        "u_difference" <= 0.0, "old and new knots, merged";
        "control_difference" <= 1e-12, "one set of control points keeps the curve; other ways to find it round in another order";
        "value_difference" <= 1e-12, "the same curve";
    }
    "signal.transfer" {
        "stationarity" <= 1e-13, "a least-squares residual is orthogonal to the examples, over the norms of both";
        "formula" <= 1e-13, "frames are sums of examples, over their greatest number";
        "examples" <= 1e-9, "an example becomes its partner: eps times the condition of the examples, below 1e5 (issue 4)";
        "coordinate_difference" <= 1e-9, "least squares by another factorisation: eps times the condition of the examples, squared by the normal equations";
        "frame_difference" <= 1e-9, "as coordinates";
    }
    "signal.refine" {
        "claimed_error" <= 1e-10, "the error again by three formulas in a row; kernels and coefficients cancel (2e-13 measured)";
        "above_start" <= 0.0, "every step goes down";
        "above_least" <= 1e-10, "g and h are the best there are for their curve, up to what the formulas cancel";
        "sites_moved" <= 1e-14, "the sites are given; an engine may scale the plane and back";
        "slope" <= 1e-4, "it starts at 1e-2 or more and ends where the error is flat to rounding: 3e-8 to 8e-6 by either engine, most where coefficients cancel most";
        "side_conditions" <= 1e-10, "coefficients come from a null space";
        "orthonormality" <= 1e-12, "H comes of a singular value decomposition";
        "error_difference" <= 1e-9, "one minimum, found by two descents to a vanishing gradient (5e-12 measured)";
    }
    "signal" {
        "claimed_error_psi" <= 1e-9, "error (2) again from the frames";
        "claimed_error_h" <= 1e-10, "error (3) again from singular values";
        "claimed_error_g" <= 1e-7, "error (4) again from an SVD's coordinates, at the claimed positions and sites";
        "claimed_error_f" <= 1e-9, "error (7) again at the claimed positions";
        "error_h_difference" <= 1e-10, "as signal.h";
        "error_g_difference" <= 1e-7, "positions agree to 1e-8 (signal.mds)";
        "error_f_difference" <= 1e-6, "positions agree to 1e-8, and the square root of the parameters magnifies short steps";
        "error_psi_difference" <= 1e-6, "as error (7)";
        "frame_difference" <= 1e-6, "as error (7)";
        "position_difference" <= 1e-8, "as signal.mds";
    }
}

/// Our own second-order method must reach a vanishing gradient.
const RUST_GRADIENT: f64 = 1e-12;
/// Engines that hold f32 somewhere, and what that allows: some units of its rounding, 1.2e-7.
const SINGLE: [(&str, f64, &str); 3] = [
    ("openmesh", 1e-6, "OpenMesh parses OBJ coordinates as f32"),
    ("tobj", 1e-6, "tobj holds f32"),
    (
        "pymeshlab",
        4e-6,
        "MeshLab measures distances, and sums them, in f32",
    ),
];

const ARCCOSINE: &str =
    "the arccosine of a dot product next to 1 is good to the root of its rounding";
/// What else a library allows: stage, quantity, engine, value, reason.
const OTHERS: [(&str, &str, &str, f64, &str); 7] = [
    ("shape.lengths_encode", "angles", "trimesh", 5e-8, ARCCOSINE),
    (
        "shape.lengths_encode",
        "angle_difference",
        "trimesh",
        5e-8,
        ARCCOSINE,
    ),
    (
        "shape.lengths_encode",
        "angles",
        "openmesh",
        5e-8,
        ARCCOSINE,
    ),
    (
        "shape.lengths_encode",
        "angle_difference",
        "openmesh",
        5e-8,
        ARCCOSINE,
    ),
    (
        "mesh.quality",
        "area",
        "pymeshlab",
        1e-6,
        "MeshLab sums areas in f32",
    ),
    (
        "mesh.quality",
        "area_difference",
        "pymeshlab",
        1e-6,
        "MeshLab sums areas in f32",
    ),
    (
        "mesh.quality",
        "faces_difference",
        "pymeshlab",
        0.1,
        "MeshLab tests triangles in floating point with thresholds of its own, and is off exact counts by 2% (cow) to 7% (samba)",
    ),
];

/// The tolerance of a quantity, none where it is only reported.
pub fn find(stage: &str, quantity: &str, engine: &str) -> Option<Tolerance> {
    if quantity == "gradient" && engine == "rust" {
        return Some(Tolerance {
            value: RUST_GRADIENT,
            reason: "Newton's method ends at a vanishing gradient (reading 6)".into(),
        });
    }
    let entry = TOLERANCES
        .iter()
        .find(|e| e.stage == stage && e.quantity == quantity)?;
    let other = OTHERS
        .iter()
        .find(|other| (other.0, other.1, other.2) == (stage, quantity, engine));
    if let Some((.., value, reason)) = other {
        return Some(Tolerance {
            value: *value,
            reason: (*reason).into(),
        });
    }
    let single = SINGLE.iter().find(|(name, ..)| *name == engine);
    let measured = quantity.ends_with("_difference") || quantity == "brute_force";
    let touched = stage.starts_with("sequence.") && measured;
    match single {
        Some((_, value, reason)) if touched && entry.value > 0.0 => Some(Tolerance {
            value: *value,
            reason: (*reason).into(),
        }),
        _ => Some(Tolerance {
            value: entry.value,
            reason: entry.reason.into(),
        }),
    }
}

/// Whether a case may name this quantity of this stage.
pub fn is_checked(stage: &str, quantity: &str) -> bool {
    find(stage, quantity, "rust").is_some()
}
