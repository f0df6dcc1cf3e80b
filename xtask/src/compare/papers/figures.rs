//! What the two papers print.

/// A model of the first paper's tables (DeCoro and Pajarola 2002, section 5).
#[derive(Debug, Clone, Copy)]
pub struct Model {
    /// Its name there.
    pub name: &'static str,
    /// The name of its file, where it is at hand.
    pub file: &'static str,
    /// Its triangles.
    pub faces: u64,
    /// Table 1: the file, in 10^6 bytes.
    pub file_mb: Option<f64>,
    /// Table 2: preprocessing with the file, in seconds.
    pub seconds: Option<f64>,
    /// Table 3.
    pub frame: Option<Frame>,
}

/// A row of Table 3: means per frame.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// Triangles shown.
    pub shown: f64,
    /// Splits and collapses.
    pub updates: f64,
    /// Milliseconds for updates, view tests, block loading and rendering.
    pub ms: [f64; 4],
}

const fn frame(shown: f64, updates: f64, ms: [f64; 4]) -> Option<Frame> {
    Some(Frame { shown, updates, ms })
}

/// The models of Tables 1, 2 and 3 that the paper gives a figure of its own for.
pub const MODELS: [Model; 7] = [
    Model {
        name: "bunny",
        file: "bunny.ply",
        faces: 69_451,
        file_mb: Some(2.0),
        seconds: Some(8.6),
        frame: frame(10e3, 1593.0, [4.0, 3.5, 11.0, 9.0]),
    },
    Model {
        name: "knee",
        file: "knee.ply",
        faces: 75_000,
        file_mb: Some(2.2),
        seconds: Some(9.4),
        frame: frame(10e3, 589.0, [4.0, 3.2, 8.0, 9.0]),
    },
    Model {
        name: "horse",
        file: "horse.ply",
        faces: 96_966,
        file_mb: Some(2.8),
        seconds: Some(12.3),
        frame: frame(9e3, 270.0, [15.0, 3.0, 7.0, 15.0]),
    },
    Model {
        name: "ball joint",
        file: "balljoint.ply",
        faces: 274_000,
        file_mb: Some(8.0),
        seconds: Some(40.2),
        frame: frame(14e3, 463.0, [6.0, 5.3, 5.0, 13.0]),
    },
    Model {
        name: "dragon",
        file: "dragon.ply",
        faces: 871_414,
        file_mb: Some(25.6),
        seconds: Some(122.0),
        frame: frame(39e3, 1700.0, [11.0, 9.1, 12.0, 25.0]),
    },
    Model {
        name: "buddha",
        file: "happy.ply",
        faces: 1_087_716,
        file_mb: Some(31.8),
        seconds: Some(154.0),
        frame: frame(38e3, 1110.0, [19.0, 15.0, 5.0, 35.0]),
    },
    Model {
        name: "david",
        file: "david.ply",
        faces: 8_254_150,
        file_mb: Some(241.4),
        seconds: Some(2994.0),
        frame: frame(17e3, 1148.0, [10.0, 7.5, 2.0, 17.0]),
    },
];

/// A row of the second paper's Table 1 (Wu and Kobbelt 2003).
#[derive(Debug, Clone, Copy)]
pub struct Stream {
    /// The model.
    pub name: &'static str,
    /// Its triangles.
    pub input: u64,
    /// The triangles that are left.
    pub output: u64,
    /// Seconds with reading and writing.
    pub seconds: f64,
    /// The process' memory, in 10^6 bytes.
    pub memory_mb: f64,
}

const fn stream(
    name: &'static str,
    input: u64,
    output: u64,
    seconds: f64,
    memory_mb: f64,
) -> Stream {
    Stream { name, input, output, seconds, memory_mb }
}

/// The second paper's Table 1.
pub const STREAMS: [Stream; 10] = [
    stream("Buddha", 1_087_470, 21_748, 32.0, 100.0),
    stream("Buddha", 1_087_470, 217_038, 29.0, 100.0),
    stream("David head", 4_000_885, 80_016, 124.0, 100.0),
    stream("David head", 4_000_885, 409_048, 129.0, 100.0),
    stream("David 2mm", 8_254_150, 82_541, 259.0, 100.0),
    stream("David 2mm", 8_254_150, 829_048, 270.0, 100.0),
    stream("David 1mm", 56_230_343, 562_219, 1960.0, 100.0),
    stream("David 1mm", 56_230_343, 2_815_413, 2001.0, 100.0),
    stream("St. Matthew", 372_767_445, 559_087, 14_046.0, 315.0),
    stream("St. Matthew", 372_767_445, 1_863_837, 14_487.0, 315.0),
];

/// A result of the second paper's Figure 4, of a Buddha of [`FIGURE_INPUT`] triangles.
#[derive(Debug, Clone, Copy)]
pub struct Result {
    /// What the paper calls it.
    pub name: &'static str,
    /// Ours: the word of `xfm decimate --method`, where there is one.
    pub method: Option<&'static str>,
    /// Its triangles.
    pub triangles: u64,
    /// The maximum error in percent of the diagonal.
    pub max_percent: f64,
}

/// Triangles of the Buddha of Figure 4.
pub const FIGURE_INPUT: u64 = 1_087_470;

/// Figure 4.
pub const FIGURE: [Result; 4] = [
    Result { name: "stream", method: Some("stream"), triangles: 18_486, max_percent: 0.89 },
    Result { name: "OEMM", method: None, triangles: 18_338, max_percent: 0.89 },
    Result { name: "QEM", method: Some("greedy"), triangles: 18_338, max_percent: 0.87 },
    Result { name: "OOCS", method: Some("cluster"), triangles: 20_950, max_percent: 1.12 },
];
