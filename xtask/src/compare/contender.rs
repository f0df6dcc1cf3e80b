//! Who takes part.

/// One way to decimate a mesh.
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
    /// `xfm decimate` with these arguments besides input, output and ratio.
    Ours(Vec<String>),
    /// The peer of this name in `tests/compare/peer.py`.
    Peer(&'static str),
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

/// Those that are compared with the reference, on a mesh of so many triangles: all, or those whose name
/// contains one of the words.
pub fn all(triangles: u64, words: &[String]) -> Vec<Contender> {
    let ours = |name: &str, arguments: &[&str]| Contender {
        name: format!("xfm {name}"),
        kind: Kind::Ours(arguments.iter().map(|argument| (*argument).to_owned()).collect()),
    };
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
    let wanted = |name: &str| words.is_empty() || words.iter().any(|word| name.contains(word));
    contenders.retain(|contender| wanted(&contender.name));
    contenders
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_choose_by_name() {
        let names = |words: &[&str]| {
            let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
            all(8_000, &words).into_iter().map(|contender| contender.name).collect::<Vec<_>>()
        };
        assert_eq!(names(&["greedy", "pyf"]), ["xfm greedy", "pyfqmr"]);
        assert_eq!(names(&[]).len(), 4 + PEERS.len());
    }

    #[test]
    fn buffers_are_shares_of_the_input() {
        let of = |index: usize| all(8_000, &[])[index].kind.clone();
        assert_eq!(of(0), Kind::Ours(vec!["--buffer".into(), "1000".into()]));
        assert_eq!(of(1), Kind::Ours(vec!["--buffer".into(), "200".into()]));
    }
}
