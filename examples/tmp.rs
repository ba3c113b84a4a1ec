use faer::MatRef;
use meshseq::signal::{fidelity::*, fit::*, knots::KnotRule};
use std::time::Instant;
fn load(name: &str) -> Vec<f64> {
    std::fs::read(format!("/tmp/{name}.f64"))
        .unwrap()
        .chunks(8)
        .map(|c| f64::from_le_bytes(c.try_into().unwrap()))
        .collect()
}
fn run(
    label: &str,
    z: &[f64],
    d: usize,
    sel: &[usize],
    k: usize,
    l: usize,
    m: usize,
    knots: KnotRule,
) {
    let v: Vec<f64> = sel
        .iter()
        .flat_map(|&i| z[i * d..(i + 1) * d].to_vec())
        .collect();
    let n = sel.len();
    let frames = MatRef::from_column_major_slice(&v, d, n);
    let t = Instant::now();
    let f = fit(
        frames,
        &FitOptions {
            k,
            l,
            m,
            knots,
            pins: vec![],
        },
    )
    .unwrap();
    let el = t.elapsed();
    let (mut lo, mut hi) = ([f64::MAX; 3], [f64::MIN; 3]);
    for p in v[..d].chunks(3) {
        for a in 0..3 {
            lo[a] = lo[a].min(p[a]);
            hi[a] = hi[a].max(p[a]);
        }
    }
    let diag = (0..3).map(|a| (hi[a] - lo[a]).powi(2)).sum::<f64>().sqrt();
    println!(
        "{label} klm={:?} {:?} sep={:.6} rms={:.4}% {:?} total {:?}",
        f.klm(),
        f.errors,
        f.same_pose,
        100.0 * (f.errors.psi / (n * d / 3) as f64).sqrt() / diag,
        f.timings,
        el
    );
}
fn main() {
    let horse = load("horse-gallop");
    let cow = load("cow");
    let samba = load("samba");
    let r = |n: usize| (0..n).collect::<Vec<_>>();
    for rule in [KnotRule::Literal, KnotRule::Symmetric] {
        run("horse24", &horse, 25293, &r(24), 16, 12, 7, rule);
        run("cow", &cow, 8712, &r(204), 155, 144, 42, rule);
        run("samba", &samba, 29913, &r(175), 140, 80, 40, rule);
        run("horse48", &horse, 25293, &r(48), 32, 12, 7, rule);
        run(
            "horse odd",
            &horse,
            25293,
            &(0..48).step_by(2).collect::<Vec<_>>(),
            16,
            12,
            7,
            rule,
        );
        run("horse interp", &horse, 25293, &r(24), 26, 24, 23, rule);
        run("horse48 interp", &horse, 25293, &r(48), 50, 48, 47, rule);
        run("horse min", &horse, 25293, &r(24), 4, 3, 0, rule);
    }
    let frames = MatRef::from_column_major_slice(&cow, 8712, 204);
    let t = Instant::now();
    let f = fit_to_error(frames, 100.0, KnotRule::Symmetric, &[]).unwrap();
    println!(
        "{:?} {:?} {:?} {}",
        f.klm(),
        f.errors,
        t.elapsed(),
        f.representation.stored_numbers()
    );
}
