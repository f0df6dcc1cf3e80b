//! What was found once: every file in `cases/TARGET/` did something that it must not, and does so no more.

use std::path::Path;

use fuzz::engine::{TIME_LIMIT, run_case, saved_cases};
use fuzz::memory::Counting;
use fuzz::targets;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

// One test: memory is counted for the whole process.
#[test]
fn saved_cases_do_no_harm() {
    // A case that hangs cannot be broken off.
    std::thread::spawn(|| {
        std::thread::sleep(4 * TIME_LIMIT);
        eprintln!(
            "a case takes too long; run the cases one by one with `cargo xtask fuzz TARGET --case FILE`"
        );
        std::process::exit(1);
    });
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("cases");
    for entry in folder.read_dir().expect("the folder of cases") {
        let name = entry.expect("an entry").file_name();
        assert!(targets::ALL.iter().any(|t| t.name == name), "{name:?} is no target");
    }
    for target in &targets::ALL {
        for seed in (target.seeds)() {
            run_case(target, &seed)
                .unwrap_or_else(|what| panic!("{}, a seed: {what}", target.name));
        }
        for (path, case) in saved_cases(&folder.join(target.name)).expect("readable cases") {
            assert!(case.len() <= 4096, "{}: make it smaller", path.display());
            run_case(target, &case).unwrap_or_else(|what| panic!("{}: {what}", path.display()));
        }
    }
}
