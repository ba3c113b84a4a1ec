//! Triangle meshes as pictures: parallel projection, a depth buffer, two-sided shading, samples averaged. The same input makes the same bytes.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::Picture;
use crate::mesh::vector::{Point, cross, dot, norm, sub};

/// Samples a pixel across and down.
const SAMPLES: usize = 3;
/// Where light comes from, in the camera's axes: right, up, towards the eye.
const LIGHT: Point = [0.35, 0.55, 0.76];
/// The ground that poses stand on.
const PAPER: [f64; 3] = [1.0, 1.0, 1.0];
/// Pixels left free around each pose.
const MARGIN: f64 = 6.0;

/// Unless said otherwise.
pub const PLAIN: [f64; 3] = [0.62, 0.68, 0.74];
/// For what the reader is to look at.
pub const MARKED: [f64; 3] = [0.86, 0.45, 0.22];

/// A mesh in a picture.
pub struct Pose<'a> {
    /// x0 y0 z0 x1 ..., 3V.
    pub positions: &'a [f64],
    pub faces: &'a [[u32; 3]],
    /// Red, green and blue from 0 to 1.
    pub colour: [f64; 3],
}

/// From where poses are seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// To the right in the picture.
    pub right: Point,
    /// Upwards in the picture; both of unit length and orthogonal.
    pub up: Point,
}

impl View {
    /// Along an axis turned by `azimuth` about y and raised by `elevation`, in degrees; y is up.
    pub fn around_y(azimuth: f64, elevation: f64) -> Self {
        let (a, e) = (azimuth.to_radians(), elevation.to_radians());
        Self {
            right: [a.cos(), 0.0, -a.sin()],
            up: [-a.sin() * e.sin(), e.cos(), -a.cos() * e.sin()],
        }
    }

    /// x to the right, y up.
    pub const FRONT: Self = Self {
        right: [1.0, 0.0, 0.0],
        up: [0.0, 1.0, 0.0],
    };

    fn project(&self, p: Point) -> Point {
        let towards = cross(self.right, self.up);
        [dot(p, self.right), dot(p, self.up), dot(p, towards)]
    }
}

/// Poses side by side in one row, all at the scale at which each fits into its cell of `cell` pixels, middles in the middle.
pub fn row(title: &str, poses: &[Pose], view: View, cell: [usize; 2]) -> Picture {
    let [width, height] = [cell[0] * poses.len().max(1), cell[1]];
    let projected: Vec<Vec<Point>> = poses
        .iter()
        .map(|pose| {
            let points = pose.positions.as_chunks::<3>().0;
            points.iter().map(|&p| view.project(p)).collect()
        })
        .collect();
    let boxes: Vec<[[f64; 2]; 2]> = projected.iter().map(|p| extent(p)).collect();
    let fit = |b: &[[f64; 2]; 2]| {
        let room = |a: usize| (cell[a] as f64 - 2.0 * MARGIN).max(1.0);
        let across = |a: usize| room(a) / (b[1][a] - b[0][a]).max(f64::MIN_POSITIVE);
        across(0).min(across(1))
    };
    let scale = boxes.iter().map(fit).fold(f64::INFINITY, f64::min);
    let mut canvas = Canvas::new(width, height);
    for (i, (pose, points)) in poses.iter().zip(&projected).enumerate() {
        let middle = |a: usize| 0.5 * (boxes[i][0][a] + boxes[i][1][a]);
        let centre = [(i as f64 + 0.5) * cell[0] as f64, 0.5 * cell[1] as f64];
        let place = |p: &Point| {
            let fine = SAMPLES as f64;
            [
                fine * (centre[0] + scale * (p[0] - middle(0))),
                fine * (centre[1] - scale * (p[1] - middle(1))),
                p[2],
            ]
        };
        let placed: Vec<Point> = points.iter().map(place).collect();
        for face in pose.faces {
            let corners = face.map(|v| points[v as usize]);
            let shade = shade(corners);
            canvas.triangle(
                face.map(|v| placed[v as usize]),
                pose.colour.map(|c| c * shade),
            );
        }
    }
    canvas.picture(title)
}

fn extent(points: &[Point]) -> [[f64; 2]; 2] {
    let mut found = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for p in points.iter().filter(|p| p.iter().all(|x| x.is_finite())) {
        for a in 0..2 {
            found[0][a] = found[0][a].min(p[a]);
            found[1][a] = found[1][a].max(p[a]);
        }
    }
    match found[0][0] <= found[1][0] {
        true => found,
        false => [[0.0; 2]; 2],
    }
}

/// Light on a triangle, either side.
fn shade(corners: [Point; 3]) -> f64 {
    let [a, b, c] = corners;
    let normal = cross(sub(b, a), sub(c, a));
    let length = norm(normal);
    match length > 0.0 {
        true => 0.35 + 0.65 * (dot(normal, LIGHT) / length / norm(LIGHT)).abs(),
        false => 1.0,
    }
}

struct Canvas {
    width: usize,
    height: usize,
    /// Of every sample: depth towards the eye, and colour.
    depth: Vec<f64>,
    colour: Vec<[f32; 3]>,
}

impl Canvas {
    fn new(width: usize, height: usize) -> Self {
        let samples = width * height * SAMPLES * SAMPLES;
        Self {
            width,
            height,
            depth: vec![f64::NEG_INFINITY; samples],
            colour: vec![PAPER.map(|c| c as f32); samples],
        }
    }

    fn triangle(&mut self, [a, b, c]: [Point; 3], colour: [f64; 3]) {
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if !area.is_finite() || area == 0.0 {
            return;
        }
        let range = |axis: usize, end: usize| {
            let values = [a[axis], b[axis], c[axis]];
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            (low - 0.5).ceil().max(0.0) as usize..((high + 0.5).floor().max(0.0) as usize).min(end)
        };
        let across = self.width * SAMPLES;
        let colour = colour.map(|c| c.clamp(0.0, 1.0) as f32);
        for y in range(1, self.height * SAMPLES) {
            for x in range(0, across) {
                let p = [x as f64 + 0.5, y as f64 + 0.5];
                let part = |u: Point, v: Point| {
                    ((v[0] - u[0]) * (p[1] - u[1]) - (v[1] - u[1]) * (p[0] - u[0])) / area
                };
                let (of_c, of_a, of_b) = (part(a, b), part(b, c), part(c, a));
                let depth = of_a * a[2] + of_b * b[2] + of_c * c[2];
                let at = y * across + x;
                if of_a >= 0.0 && of_b >= 0.0 && of_c >= 0.0 && depth > self.depth[at] {
                    (self.depth[at], self.colour[at]) = (depth, colour);
                }
            }
        }
    }

    /// Each pixel the mean of its samples.
    fn pixels(&self) -> Vec<u8> {
        let across = self.width * SAMPLES;
        let mut pixels = Vec::with_capacity(3 * self.width * self.height);
        for y in 0..self.height {
            for x in 0..self.width {
                let mut sum = [0.0f32; 3];
                for row in 0..SAMPLES {
                    let at = (y * SAMPLES + row) * across + x * SAMPLES;
                    for sample in &self.colour[at..at + SAMPLES] {
                        (0..3).for_each(|i| sum[i] += sample[i]);
                    }
                }
                let count = (SAMPLES * SAMPLES) as f32;
                pixels.extend(sum.map(|s| (s / count * 255.0).round() as u8));
            }
        }
        pixels
    }

    fn picture(&self, title: &str) -> Picture {
        let (width, height) = (self.width as u32, self.height as u32);
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_compression(png::Compression::High);
        // Into memory nothing fails but a size of zero, which leaves no bytes and so no picture.
        let written = encoder.write_header();
        let written = written.and_then(|mut writer| writer.write_image_data(&self.pixels()));
        if written.is_err() {
            bytes.clear();
        }
        Picture {
            title: title.into(),
            png: STANDARD.encode(bytes),
            width,
            height,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(picture: &Picture) -> Vec<u8> {
        let bytes = STANDARD.decode(&picture.png).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
            .read_info()
            .unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        pixels
    }

    #[test]
    fn the_nearer_of_two_squares_hides_the_other() {
        let square = |size: f64, z: f64| {
            [
                [-size, -size, z],
                [size, -size, z],
                [size, size, z],
                [-size, size, z],
            ]
            .concat()
        };
        let faces = [[0, 1, 2], [0, 2, 3]];
        let (far, near) = (square(1.0, 0.0), square(0.5, 1.0));
        let both = [far, near].concat();
        let all = [faces, faces.map(|f| f.map(|v| v + 4))].concat();
        for order in [all.clone(), all.iter().rev().copied().collect()] {
            let pose = |faces: &[[u32; 3]]| {
                row(
                    "two",
                    &[Pose {
                        positions: &both,
                        faces,
                        colour: PLAIN,
                    }],
                    View::FRONT,
                    [60, 60],
                )
            };
            let pixels = decoded(&pose(&order));
            let at = |x: usize, y: usize| &pixels[3 * (60 * y + x)..][..3];
            assert_eq!(at(0, 0), [255; 3]);
            assert_eq!(at(30, 30), at(10, 30));
            assert_ne!(at(30, 30), [255; 3]);
            assert_eq!(pose(&order), pose(&order));
        }
    }

    #[test]
    fn nothing_and_nonsense_are_drawn_as_paper() {
        let nonsense = [f64::NAN, 0.0, 0.0, f64::INFINITY, 1.0, 0.0, 0.0, 1.0, 0.0];
        for positions in [&[][..], &nonsense] {
            let faces: &[[u32; 3]] = if positions.is_empty() {
                &[]
            } else {
                &[[0, 1, 2]]
            };
            let poses = [Pose {
                positions,
                faces,
                colour: PLAIN,
            }];
            let pixels = decoded(&row("none", &poses, View::around_y(30.0, 10.0), [8, 8]));
            assert!(pixels.iter().all(|&p| p == 255));
        }
    }
}
