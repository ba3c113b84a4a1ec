//! The `meshseq` command line; see `meshseq --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    meshseq::cmd::main()
}
