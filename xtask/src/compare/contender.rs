//! Who takes part.

use super::tools::Tools;

/// One way to decimate a mesh, or to build a hierarchy of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Contender {
    /// Its name in the table.
    pub name: String,
    /// How it is run.
    pub kind: Kind,
}

/// How a contender is run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Kind {
    /// `xfm` with these arguments besides input, output and ratio.
    Ours(Vec<String>),
    /// The peer of this name in `tests/compare/peer.py`.
    Peer(&'static str),
    /// Programs, where they are installed.
    Tools(Tools),
}

/// The peers, by their names in `tests/compare/peer.py`.
const PEERS: [&str; 6] = [
    "meshoptimizer",
    "fast-simplification",
    "fast-simplification-3",
    "pyfqmr",
    "pymeshlab",
    "trimesh",
];

/// `xfm` as it is by default: the others are compared with it.
pub fn reference() -> Contender {
    Contender { name: "xfm".into(), kind: Kind::Ours(Vec::new()) }
}

fn ours(name: &str, arguments: &[&str]) -> Contender {
    Contender {
        name: format!("xfm {name}"),
        kind: Kind::Ours(arguments.iter().map(|argument| (*argument).to_owned()).collect()),
    }
}

fn tools(tools: Tools) -> Contender {
    Contender { name: tools.name().to_owned(), kind: Kind::Tools(tools) }
}

/// All, or those whose name contains one of the words.
fn chosen(mut contenders: Vec<Contender>, words: &[String]) -> Vec<Contender> {
    let wanted = |name: &str| words.is_empty() || words.iter().any(|word| name.contains(word));
    contenders.retain(|contender| wanted(&contender.name));
    contenders
}

/// Those whose decimation of so many triangles is compared with the reference: all, or those whose name contains one
/// of the words.
pub fn decimating(triangles: u64, words: &[String]) -> Vec<Contender> {
    let buffer = |share: u64| {
        let size = (triangles / share).max(1).to_string();
        ours(&format!("buffer 1/{share}"), &["--buffer", &size])
    };
    let mut contenders = vec![
        buffer(8),
        buffer(40),
        ours("greedy", &["--method", "greedy"]),
        ours("cluster", &["--method", "cluster"]),
    ];
    contenders
        .extend(PEERS.map(|peer| Contender { name: peer.to_owned(), kind: Kind::Peer(peer) }));
    contenders.push(tools(Tools::OpenMeshDecimater));
    chosen(contenders, words)
}

/// Those whose hierarchies are compared with the reference's, chosen by words as above.
pub fn building(words: &[String]) -> Vec<Contender> {
    let contenders = vec![
        ours("64 MiB", &["--memory", "64MiB"]),
        ours("compact", &["--encoding", "compact"]),
        ours("compact 1e-5", &["--encoding", "compact", "--position-error", "1e-5"]),
        tools(Tools::OpenMeshVdpm),
        tools(Tools::Nexus),
        tools(Tools::NexusCompressed),
    ];
    chosen(contenders, words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_choose_by_name() {
        let words = |words: &[&str]| -> Vec<String> {
            words.iter().map(|word| (*word).to_owned()).collect()
        };
        let names = |contenders: Vec<Contender>| {
            contenders.into_iter().map(|contender| contender.name).collect::<Vec<_>>()
        };
        assert_eq!(names(decimating(8_000, &words(&["greedy", "pyf"]))), ["xfm greedy", "pyfqmr"]);
        assert_eq!(names(building(&words(&["VDPM"]))), ["OpenMesh VDPM"]);
        assert_eq!(decimating(8_000, &[]).len(), 4 + PEERS.len() + 1);
    }

    #[test]
    fn buffers_are_shares_of_the_input() {
        let of = |index: usize| decimating(8_000, &[])[index].kind.clone();
        assert_eq!(of(0), Kind::Ours(vec!["--buffer".into(), "1000".into()]));
        assert_eq!(of(1), Kind::Ours(vec!["--buffer".into(), "200".into()]));
    }
}
