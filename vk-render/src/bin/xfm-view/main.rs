//! `xfm-view`: looks at a `.xfm` file, or at any mesh, in a window or offscreen.

mod action;
mod args;
mod camera;
mod clipboard;
mod error;
mod frame_log;
mod input;
mod model;
mod offscreen;
mod output;
mod overlay;
mod panels;
mod pick;
mod picture;
mod screen;
mod state;
mod viewer;
mod window;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let args = args::Args::parse();
    let done = match &args.offscreen {
        Some(out) => offscreen::run(&args, out),
        None => window::run(&args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", error::one_line(&error));
            ExitCode::FAILURE
        }
    }
}
