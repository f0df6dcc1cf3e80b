//! Compiles the WGSL shaders to SPIR-V, so that no shader compiler has to be installed and no binary lies in the tree.

use naga::back::spv;
use naga::front::wgsl;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use std::path::{Path, PathBuf};
use std::{env, fs};

/// Every module is `common.wgsl` followed by files of its own.
const MODULES: [(&str, &[&str]); 6] = [
    ("background", &["background"]),
    ("mesh", &["whole", "mesh"]),
    ("mesh_cut", &["cut", "mesh"]),
    ("lines", &["lines"]),
    ("overlay", &["overlay"]),
    ("ui", &["ui"]),
];

fn main() -> Result<(), String> {
    println!("cargo::rerun-if-changed=shaders");
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?);
    let common = read("common")?;
    for (name, files) in MODULES {
        let mut source = common.clone();
        for file in files {
            source = format!("{source}\n{}", read(file)?);
        }
        let words = compile(name, &source)?;
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let path = out.join(format!("{name}.spv"));
        fs::write(&path, bytes).map_err(|error| format!("{}: {error}", path.display()))?;
    }
    Ok(())
}

fn read(name: &str) -> Result<String, String> {
    let path = Path::new("shaders").join(format!("{name}.wgsl"));
    fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))
}

fn compile(name: &str, source: &str) -> Result<Vec<u32>, String> {
    let module = wgsl::parse_str(source)
        .map_err(|error| error.emit_to_string_with_path(source, &format!("{name}.wgsl")))?;
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .map_err(|error| error.emit_to_string_with_path(source, &format!("{name}.wgsl")))?;
    // No flag: the projection already yields Vulkan's clip space, so nothing is flipped behind our back.
    let options = spv::Options {
        lang_version: (1, 3),
        flags: spv::WriterFlags::empty(),
        // The map is empty: groups and bindings mean what the shaders say.
        fake_missing_bindings: true,
        binding_map: spv::BindingMap::default(),
        ..spv::Options::default()
    };
    spv::write_vec(&module, &info, &options, None).map_err(|error| format!("{name}: {error}"))
}
