//! The `xfm` binary: the library's command line and nothing else.

use std::process::ExitCode;

fn main() -> ExitCode {
    xfm::memory::give_back_large_blocks();
    xfm::run(std::env::args_os())
}
