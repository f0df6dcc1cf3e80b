//! Dependencies between the crates point one way.

use std::process::Command;

/// Who may use whom: a crate uses only those named before it; `may` narrows that down further.
const ORDER: [&str; 14] = [
    "halfedge",
    "qem",
    "mesh-io",
    "scratch",
    "stream-decimate",
    "mergetree",
    "xfm-format",
    "xfm-build",
    "xfm-pager",
    "vk-render",
    "xfm",
    "xtask",
    "tests",
    "fuzz",
];

/// What a crate of the workspace may use at run time at most.
fn may(name: &str) -> Option<&'static [&'static str]> {
    Some(match name {
        "halfedge" | "qem" | "mesh-io" | "scratch" => &[],
        "stream-decimate" => &["halfedge", "qem", "mesh-io", "scratch"],
        "mergetree" => &["halfedge", "qem"],
        "xfm-format" => &["halfedge", "mergetree"],
        "xfm-build" => {
            &["halfedge", "mesh-io", "scratch", "stream-decimate", "mergetree", "xfm-format"]
        }
        "xfm-pager" => &["halfedge", "mergetree", "xfm-format"],
        _ => return None,
    })
}

#[test]
fn dependencies_point_up_the_list_only() {
    let packages = tests::packages();
    assert_eq!(packages.len(), ORDER.len());
    for package in &packages {
        let name = package["name"].as_str().unwrap();
        let place = ORDER.iter().position(|&n| n == name).unwrap();
        for dependency in package["dependencies"].as_array().unwrap() {
            let used = dependency["name"].as_str().unwrap();
            let Some(of) = ORDER.iter().position(|&n| n == used) else { continue };
            assert!(of < place, "{name} uses {used}, which is further down");
            if dependency["kind"].is_null()
                && let Some(allowed) = may(name)
            {
                assert!(allowed.contains(&used), "{name} uses {used}");
            }
        }
    }
}

#[test]
fn the_renderer_as_a_library_knows_no_files_and_no_trees() {
    let output = Command::new(env!("CARGO"))
        .args(["tree", "-p", "vk-render", "--no-default-features", "-e", "normal", "--offline"])
        .args(["--prefix", "none"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let tree = String::from_utf8(output.stdout).unwrap();
    assert!(tree.starts_with("vk-render"), "{tree}");
    for other in ORDER.iter().filter(|&&n| n != "vk-render") {
        assert!(!tree.lines().any(|line| line.starts_with(&format!("{other} "))), "{other}");
    }
}
