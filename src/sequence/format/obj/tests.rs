use super::parse::{MAX_LINE, parse};
use super::*;
use proptest::prelude::*;

mod frames;

fn mesh(text: impl AsRef<[u8]>) -> Mesh {
    let mut mesh = Mesh::default();
    let fault = parse(text.as_ref(), &mut mesh).err();
    assert_eq!(fault, None);
    mesh
}

fn fault(text: impl AsRef<[u8]>) -> (usize, usize, ObjProblem) {
    let fault = parse(text.as_ref(), &mut Mesh::default()).err();
    let fault = fault.unwrap_or_else(|| panic!("accepted: {}", text.as_ref().escape_ascii()));
    (fault.line, fault.column, fault.problem)
}

const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n";

#[test]
fn numbers_are_correctly_rounded() {
    // Half-way cases, a mantissa beyond 2^64, extremes, and what other programs write.
    for text in [
        "9007199254740993",
        "0.1",
        "5e-324",
        "2.2250738585072011e-308",
        "1.7976931348623157e308",
        "0.500000000000000166533453693773481063544750213623046875",
        "-0",
        "1E+2",
        ".5",
        "5.",
        "0.26256031800000001",
        "00012.50",
        "123456789012345678901234567890e-30",
    ] {
        let found = mesh(format!("v {text} {text} {text}\n")).positions;
        let expected: f64 = text.parse().unwrap();
        assert_eq!(bits(&found), [expected.to_bits(); 3], "{text}");
    }
}

fn bits(numbers: &[f64]) -> Vec<u64> {
    numbers.iter().map(|x| x.to_bits()).collect()
}

#[test]
fn what_is_understood() {
    let plain = mesh(format!("{CORNERS}f 1 2 3\nf 2 4 3\n"));
    assert_eq!(plain.triangles, [[0, 1, 2], [1, 3, 2]]);
    for faces in [
        "f 1/9 2/8 3/7\nf 2//9 4//8 3//7",
        "f 1/1/1 2/2/2 3/3/3\nf 2 4/1 3//2",
        "f -4 -3 -2\nf -3 -1 -2",
        "# no\n#f 1 2 3\nf 1 2 3 # yes\r\nf 2 4 3#",
        "\t f\t1  2\t 3  \r\nf 2 4 3\r",
        "f 1 \\\n2 \\\r\n 3\nf 2 4\\\n 3",
        "g a\nf 1 2 3\rusemtl b\rf 2 4 3\r",
        "f 1// 2/ 3/-1/-1\nfo\nvn 0 0 1\nf 2 4 3",
        "# \\\nf 1 2 3\n\n\\\nf 2 4 3",
        "# caf\u{e9} \u{1}\0\nf 1 2 3\nf 2 4 3\n  \t",
    ] {
        assert_eq!(
            mesh(format!("{CORNERS}{faces}")).triangles,
            plain.triangles,
            "{faces}"
        );
    }
    for vertices in [
        "\u{feff}v 0 0 0\nv 1 0 0 1.0\nv 0 1 0 .1 .2 .3\nv 1 1 0 1 .1 .2 .3 # four\n",
        "v 0 0 0\r\nv\t1 0\t0\r\n  v 0.0 1e0 -0e9\r\nv 1 \\\n 1 0",
        "vt 1 2\nv 0 0 0\nv 1 0 0\rv 0 1 0\rvp 1\rv 1 1 0",
    ] {
        assert_eq!(mesh(vertices).positions, plain.positions, "{vertices}");
    }
    let latin1 = [b"# caf\xe9\no \xff\n", CORNERS.as_bytes()].concat();
    assert_eq!(mesh(latin1).positions, plain.positions);
}

#[test]
fn polygons_are_fans_and_faces_may_come_first() {
    let pentagon = mesh("f 5 1 2 3 4\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 2 2 0\n");
    assert_eq!(pentagon.triangles, [[4, 0, 1], [4, 1, 2], [4, 2, 3]]);
    // A relative index counts from the vertices so far.
    let relative = mesh(format!("{CORNERS}f -4 -3 -2\nv 5 5 5\nf -1 -2 -5\n"));
    assert_eq!(relative.triangles, [[0, 1, 2], [4, 3, 0]]);
}

#[test]
fn nothing_is_repaired() {
    let mesh = mesh("v 1 1 1\nv 1 1 1\nv 9 9 9\nf 1 1 2\nf 2 2 2\nf 1 1 2\n");
    assert_eq!(mesh.positions.len(), 9);
    assert_eq!(mesh.triangles, [[0, 0, 1], [1, 1, 1], [0, 0, 1]]);
}

#[test]
fn faults_name_their_place() {
    use ObjProblem::*;
    let text = |s: &str| s.to_string();
    let after_corners = |s: &str| format!("{CORNERS}{s}");
    for (input, line, column, problem) in [
        (text("v 1 2\n"), 1, 6, TooFewCoordinates { found: 2 }),
        (text("v 1 2"), 1, 6, TooFewCoordinates { found: 2 }),
        (text("v"), 1, 1, TooFewCoordinates { found: 0 }),
        (text("#\r\n\r\n v \n"), 3, 4, TooFewCoordinates { found: 0 }),
        (text("v 1 2 # 3\n"), 1, 7, TooFewCoordinates { found: 2 }),
        (
            text("v 1 2 3\nv 1 2,5 3\n"),
            2,
            5,
            BadNumber { text: text("2,5") },
        ),
        (
            text("v 1 2 3v 4 5 6\n"),
            1,
            7,
            BadNumber { text: text("3v") },
        ),
        (
            text("v 1 2 3 v 4 5 6\n"),
            1,
            9,
            BadNumber { text: text("v") },
        ),
        (
            text("v 1 2 3 4 5 6 7 8\n"),
            1,
            17,
            TooManyCoordinates { text: text("8") },
        ),
        (text("v 1 - 3\n"), 1, 5, BadNumber { text: text("-") }),
        (text("v 1 2 3e\n"), 1, 7, BadNumber { text: text("3e") }),
        (text("v 1 0x2 3\n"), 1, 5, BadNumber { text: text("0x2") }),
        (
            text("v 0 0 0\nv 1 nan 3\n"),
            2,
            5,
            NotFinite {
                vertex: 1,
                axis: 'y',
                text: text("nan"),
            },
        ),
        (
            text("v 1 2 -inf\n"),
            1,
            7,
            NotFinite {
                vertex: 0,
                axis: 'z',
                text: text("-inf"),
            },
        ),
        (
            text("v 1e999 2 3\n"),
            1,
            3,
            NotFinite {
                vertex: 0,
                axis: 'x',
                text: text("1e999"),
            },
        ),
        (text("v 1 2 3 \\"), 1, 9, BadNumber { text: text("\\\\") }),
        (text("v 1 2 \\\n"), 1, 7, CutOff),
        (after_corners("f 1 2\n"), 5, 6, TooFewCorners { found: 2 }),
        (after_corners("f"), 5, 1, TooFewCorners { found: 0 }),
        (after_corners("f 1 2 0\n"), 5, 7, IndexZero),
        (
            after_corners("f 1 2 5\nf 1 2 3\n"),
            5,
            7,
            IndexOutOfRange {
                text: text("5"),
                vertices: 4,
            },
        ),
        (
            after_corners("f 1 -5 3\n"),
            5,
            5,
            IndexOutOfRange {
                text: text("-5"),
                vertices: 4,
            },
        ),
        (
            after_corners("f 1 2 99999999999999999999\n"),
            5,
            7,
            IndexOutOfRange {
                text: text("99999999999999999999"),
                vertices: 4,
            },
        ),
        (
            after_corners("f 1 2 4294967297\n"),
            5,
            7,
            IndexOutOfRange {
                text: text("4294967297"),
                vertices: 4,
            },
        ),
        (
            after_corners("f 1 2 3.5\n"),
            5,
            7,
            BadCorner { text: text("3.5") },
        ),
        (
            after_corners("f 1 2 /3\n"),
            5,
            7,
            BadCorner { text: text("/3") },
        ),
        (
            after_corners("f 1 2 3/4/5/6\n"),
            5,
            7,
            BadCorner {
                text: text("3/4/5/6"),
            },
        ),
        (
            after_corners("f 1 2 x\n"),
            5,
            7,
            BadCorner { text: text("x") },
        ),
        (
            after_corners("f 1 \\\n 2 \\\n x\n"),
            7,
            2,
            BadCorner { text: text("x") },
        ),
        (
            text("f -1 1 2\nv 0 0 0\nv 0 0 0\n"),
            1,
            3,
            IndexOutOfRange {
                text: text("-1"),
                vertices: 0,
            },
        ),
    ] {
        assert_eq!(fault(&input), (line, column, problem), "{input}");
    }
}

#[test]
fn a_line_without_end_is_refused_wherever_it_is() {
    let endless = |start: &str, part: &str| {
        format!("v 0 0 0\n{start}{}", part.repeat((3 << 20) / part.len()))
    };
    for (start, part) in [
        ("# ", "x"),
        ("v ", "1"),
        ("v 1 2 3", " "),
        ("v 1 2 ", "0"),
        ("f ", "1 "),
        ("f 1 1 1", " "),
        ("  ", " "),
        ("", "\0"),
    ] {
        let (line, _, problem) = fault(endless(start, part));
        assert_eq!(
            (line, problem),
            (2, ObjProblem::LineTooLong),
            "{start}{part}"
        );
    }
    let longest = format!("# {}\nv 1 2 3\n", "x".repeat(MAX_LINE - 3));
    assert_eq!(mesh(&longest).positions, [1.0, 2.0, 3.0]);
    assert_eq!(fault(format!("#x{longest}")).2, ObjProblem::LineTooLong);
}

/// Text made of the pieces of OBJ files, so that odd combinations are common.
fn odd_text() -> impl Strategy<Value = Vec<u8>> {
    let pieces = [
        "v",
        "f",
        " ",
        "\n",
        "\r",
        "\r\n",
        "\\",
        "\\\n",
        "#",
        "/",
        "-",
        "1",
        "2",
        "0",
        ".5",
        "e9",
        "nan",
        "vn",
        "\t",
        "\u{feff}",
        "\0",
        "x",
        "v 1 2 3\n",
        "f 1 2 3\n",
        "f 1 1 1 1",
        "99999999999999999999",
    ];
    let piece = prop::sample::select(pieces.to_vec()).prop_map(|p| p.as_bytes().to_vec());
    let any = prop_oneof![9 => piece, 1 => prop::collection::vec(any::<u8>(), 1..4)];
    prop::collection::vec(any, 0..60).prop_map(|parts| parts.concat())
}

proptest! {
    #[test]
    fn no_text_makes_it_panic_and_indices_are_in_range(text in odd_text()) {
        let mut mesh = Mesh::default();
        if let Ok(summary) = parse(&text, &mut mesh) {
            prop_assert_eq!(summary.vertices as usize * 3, mesh.positions.len());
            prop_assert!(mesh.triangles.as_flattened().iter().all(|&v| u64::from(v) < summary.vertices));
            prop_assert!(mesh.positions.iter().all(|x| x.is_finite()));
        }
    }

    /// A trailing blank sends a line the careful way; a plain line goes the fast one. Both must see the same.
    #[test]
    fn the_plain_way_is_the_careful_way(numbers in prop::array::uniform3("[-+]?[0-9]{0,20}[.]?[0-9]{0,20}(e[-+]?[0-9]{1,3})?|nan|inf")) {
        let line = format!("v {}", numbers.join(" "));
        let read = |end| {
            let mut mesh = Mesh::default();
            parse(format!("{line}{end}").as_bytes(), &mut mesh).map(|_| bits(&mesh.positions))
        };
        prop_assert_eq!(read("\n"), read(" \n"));
        prop_assert_eq!(read("\r\n"), read(" 1\n"));
    }
}
